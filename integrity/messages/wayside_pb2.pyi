from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

AMBIGUOUS: Cause
CAUSE_UNSPECIFIED: Cause
CLOCK: Cause
CONSTELLATION: Cause
D1: NavigationMessage
D2: NavigationMessage
DATA: Cause
DESCRIPTOR: _descriptor.FileDescriptor
DIVERGED: Unsolved
FAIL: Outcome
FNAV: NavigationMessage
INAV: NavigationMessage
JAMMING: Cause
LNAV: NavigationMessage
MAINTENANCE: Cause
NAVIGATION_MESSAGE_UNSPECIFIED: NavigationMessage
NORMAL: State
NOT_CONFIRMABLE: State
NOT_MONITORED: Outcome
NOT_READY: Cause
OUTCOME_UNSPECIFIED: Outcome
PASS: Outcome
POOR_GEOMETRY: Unsolved
POSITION_PROVISIONAL: PositionStatus
POSITION_UNKNOWN: PositionStatus
POSITION_VALID: PositionStatus
RECEIVER: Cause
SATELLITE: Cause
SATELLITE_ANOMALY: State
SELF_TEST: Cause
SOLVED: Unsolved
SPOOFING: Cause
STATE_UNSPECIFIED: State
STOP_LATCHED: StopState
STOP_NONE: StopState
STOP_REQUESTED: StopState
STOP_UNSPECIFIED: StopState
TOO_FEW_SATELLITES: Unsolved
TRUST_CONFLICT: TrustState
TRUST_NORMAL: TrustState
TRUST_NOT_CONFIRMABLE: TrustState
TRUST_NO_COMMS: TrustState
TRUST_SATELLITE_ANOMALY: TrustState
TRUST_STALE: TrustState
TRUST_UNSPECIFIED: TrustState
UNKNOWN: Outcome

class Alert(_message.Message):
    __slots__ = ["before", "cause", "gps_time_ns", "mono_ns", "reasons", "state", "subjects"]
    BEFORE_FIELD_NUMBER: _ClassVar[int]
    CAUSE_FIELD_NUMBER: _ClassVar[int]
    GPS_TIME_NS_FIELD_NUMBER: _ClassVar[int]
    MONO_NS_FIELD_NUMBER: _ClassVar[int]
    REASONS_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    SUBJECTS_FIELD_NUMBER: _ClassVar[int]
    before: State
    cause: Cause
    gps_time_ns: int
    mono_ns: int
    reasons: _containers.RepeatedScalarFieldContainer[str]
    state: State
    subjects: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, gps_time_ns: _Optional[int] = ..., mono_ns: _Optional[int] = ..., before: _Optional[_Union[State, str]] = ..., state: _Optional[_Union[State, str]] = ..., cause: _Optional[_Union[Cause, str]] = ..., subjects: _Optional[_Iterable[str]] = ..., reasons: _Optional[_Iterable[str]] = ...) -> None: ...

class AntennaFix(_message.Message):
    __slots__ = ["antenna", "place", "residual", "residual_threshold", "satellites", "sigma_m", "tpdop", "why"]
    ANTENNA_FIELD_NUMBER: _ClassVar[int]
    PLACE_FIELD_NUMBER: _ClassVar[int]
    RESIDUAL_FIELD_NUMBER: _ClassVar[int]
    RESIDUAL_THRESHOLD_FIELD_NUMBER: _ClassVar[int]
    SATELLITES_FIELD_NUMBER: _ClassVar[int]
    SIGMA_M_FIELD_NUMBER: _ClassVar[int]
    TPDOP_FIELD_NUMBER: _ClassVar[int]
    WHY_FIELD_NUMBER: _ClassVar[int]
    antenna: str
    place: TrackPlace
    residual: float
    residual_threshold: float
    satellites: int
    sigma_m: float
    tpdop: float
    why: str
    def __init__(self, antenna: _Optional[str] = ..., place: _Optional[_Union[TrackPlace, _Mapping]] = ..., sigma_m: _Optional[float] = ..., tpdop: _Optional[float] = ..., satellites: _Optional[int] = ..., residual: _Optional[float] = ..., residual_threshold: _Optional[float] = ..., why: _Optional[str] = ...) -> None: ...

class AuditLedger(_message.Message):
    __slots__ = ["exceeded", "log_wealth", "look_ns", "looks", "most", "since_ns", "value"]
    EXCEEDED_FIELD_NUMBER: _ClassVar[int]
    LOG_WEALTH_FIELD_NUMBER: _ClassVar[int]
    LOOKS_FIELD_NUMBER: _ClassVar[int]
    LOOK_NS_FIELD_NUMBER: _ClassVar[int]
    MOST_FIELD_NUMBER: _ClassVar[int]
    SINCE_NS_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    exceeded: int
    log_wealth: _containers.RepeatedScalarFieldContainer[float]
    look_ns: int
    looks: int
    most: float
    since_ns: int
    value: float
    def __init__(self, since_ns: _Optional[int] = ..., look_ns: _Optional[int] = ..., value: _Optional[float] = ..., looks: _Optional[int] = ..., exceeded: _Optional[int] = ..., log_wealth: _Optional[_Iterable[float]] = ..., most: _Optional[float] = ...) -> None: ...

class AuditMemory(_message.Message):
    __slots__ = ["due_ns", "ledgers"]
    DUE_NS_FIELD_NUMBER: _ClassVar[int]
    LEDGERS_FIELD_NUMBER: _ClassVar[int]
    due_ns: int
    ledgers: _containers.RepeatedCompositeFieldContainer[AuditLedger]
    def __init__(self, ledgers: _Optional[_Iterable[_Union[AuditLedger, _Mapping]]] = ..., due_ns: _Optional[int] = ...) -> None: ...

class CarrierMemory(_message.Message):
    __slots__ = ["age", "code_minus_carrier_m", "epoch_ns", "half_cycle", "half_m", "innovation_m", "lock_s", "motion_age", "rate_mps", "receive_time_ns", "residual_m", "served_by", "serving", "signal", "since_ns"]
    AGE_FIELD_NUMBER: _ClassVar[int]
    CODE_MINUS_CARRIER_M_FIELD_NUMBER: _ClassVar[int]
    EPOCH_NS_FIELD_NUMBER: _ClassVar[int]
    HALF_CYCLE_FIELD_NUMBER: _ClassVar[int]
    HALF_M_FIELD_NUMBER: _ClassVar[int]
    INNOVATION_M_FIELD_NUMBER: _ClassVar[int]
    LOCK_S_FIELD_NUMBER: _ClassVar[int]
    MOTION_AGE_FIELD_NUMBER: _ClassVar[int]
    RATE_MPS_FIELD_NUMBER: _ClassVar[int]
    RECEIVE_TIME_NS_FIELD_NUMBER: _ClassVar[int]
    RESIDUAL_M_FIELD_NUMBER: _ClassVar[int]
    SERVED_BY_FIELD_NUMBER: _ClassVar[int]
    SERVING_FIELD_NUMBER: _ClassVar[int]
    SIGNAL_FIELD_NUMBER: _ClassVar[int]
    SINCE_NS_FIELD_NUMBER: _ClassVar[int]
    age: _containers.RepeatedScalarFieldContainer[int]
    code_minus_carrier_m: _containers.RepeatedScalarFieldContainer[float]
    epoch_ns: _containers.RepeatedScalarFieldContainer[int]
    half_cycle: _containers.RepeatedScalarFieldContainer[bool]
    half_m: _containers.RepeatedScalarFieldContainer[float]
    innovation_m: _containers.RepeatedScalarFieldContainer[float]
    lock_s: _containers.RepeatedScalarFieldContainer[float]
    motion_age: _containers.RepeatedScalarFieldContainer[int]
    rate_mps: _containers.RepeatedScalarFieldContainer[float]
    receive_time_ns: _containers.RepeatedScalarFieldContainer[int]
    residual_m: _containers.RepeatedScalarFieldContainer[float]
    served_by: _containers.RepeatedScalarFieldContainer[int]
    serving: _containers.RepeatedCompositeFieldContainer[Ephemeris]
    signal: _containers.RepeatedScalarFieldContainer[str]
    since_ns: _containers.RepeatedScalarFieldContainer[int]
    def __init__(self, signal: _Optional[_Iterable[str]] = ..., serving: _Optional[_Iterable[_Union[Ephemeris, _Mapping]]] = ..., served_by: _Optional[_Iterable[int]] = ..., receive_time_ns: _Optional[_Iterable[int]] = ..., lock_s: _Optional[_Iterable[float]] = ..., half_cycle: _Optional[_Iterable[bool]] = ..., epoch_ns: _Optional[_Iterable[int]] = ..., residual_m: _Optional[_Iterable[float]] = ..., half_m: _Optional[_Iterable[float]] = ..., motion_age: _Optional[_Iterable[int]] = ..., code_minus_carrier_m: _Optional[_Iterable[float]] = ..., innovation_m: _Optional[_Iterable[float]] = ..., rate_mps: _Optional[_Iterable[float]] = ..., age: _Optional[_Iterable[int]] = ..., since_ns: _Optional[_Iterable[int]] = ...) -> None: ...

class ChallengeAnswered(_message.Message):
    __slots__ = ["data", "error", "mono_ns", "nonce", "site"]
    DATA_FIELD_NUMBER: _ClassVar[int]
    ERROR_FIELD_NUMBER: _ClassVar[int]
    MONO_NS_FIELD_NUMBER: _ClassVar[int]
    NONCE_FIELD_NUMBER: _ClassVar[int]
    SITE_FIELD_NUMBER: _ClassVar[int]
    data: bytes
    error: str
    mono_ns: int
    nonce: bytes
    site: str
    def __init__(self, mono_ns: _Optional[int] = ..., site: _Optional[str] = ..., nonce: _Optional[bytes] = ..., data: _Optional[bytes] = ..., error: _Optional[str] = ...) -> None: ...

class ChallengeReply(_message.Message):
    __slots__ = ["boot_id", "issued_mono_ns", "nonce", "sequence"]
    BOOT_ID_FIELD_NUMBER: _ClassVar[int]
    ISSUED_MONO_NS_FIELD_NUMBER: _ClassVar[int]
    NONCE_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    boot_id: bytes
    issued_mono_ns: int
    nonce: bytes
    sequence: int
    def __init__(self, nonce: _Optional[bytes] = ..., boot_id: _Optional[bytes] = ..., issued_mono_ns: _Optional[int] = ..., sequence: _Optional[int] = ...) -> None: ...

class ChallengeSent(_message.Message):
    __slots__ = ["mono_ns", "nonce", "site"]
    MONO_NS_FIELD_NUMBER: _ClassVar[int]
    NONCE_FIELD_NUMBER: _ClassVar[int]
    SITE_FIELD_NUMBER: _ClassVar[int]
    mono_ns: int
    nonce: bytes
    site: str
    def __init__(self, mono_ns: _Optional[int] = ..., site: _Optional[str] = ..., nonce: _Optional[bytes] = ...) -> None: ...

class Channel(_message.Message):
    __slots__ = ["receiver", "satellite", "statistic", "threshold"]
    RECEIVER_FIELD_NUMBER: _ClassVar[int]
    SATELLITE_FIELD_NUMBER: _ClassVar[int]
    STATISTIC_FIELD_NUMBER: _ClassVar[int]
    THRESHOLD_FIELD_NUMBER: _ClassVar[int]
    receiver: str
    satellite: str
    statistic: float
    threshold: float
    def __init__(self, receiver: _Optional[str] = ..., satellite: _Optional[str] = ..., statistic: _Optional[float] = ..., threshold: _Optional[float] = ...) -> None: ...

class Check(_message.Message):
    __slots__ = ["name", "outcome", "statistic", "threshold"]
    NAME_FIELD_NUMBER: _ClassVar[int]
    OUTCOME_FIELD_NUMBER: _ClassVar[int]
    STATISTIC_FIELD_NUMBER: _ClassVar[int]
    THRESHOLD_FIELD_NUMBER: _ClassVar[int]
    name: str
    outcome: Outcome
    statistic: float
    threshold: float
    def __init__(self, name: _Optional[str] = ..., statistic: _Optional[float] = ..., threshold: _Optional[float] = ..., outcome: _Optional[_Union[Outcome, str]] = ...) -> None: ...

class ClockMemory(_message.Message):
    __slots__ = ["clock_m", "epoch_ns", "sigma_m"]
    CLOCK_M_FIELD_NUMBER: _ClassVar[int]
    EPOCH_NS_FIELD_NUMBER: _ClassVar[int]
    SIGMA_M_FIELD_NUMBER: _ClassVar[int]
    clock_m: _containers.RepeatedScalarFieldContainer[float]
    epoch_ns: _containers.RepeatedScalarFieldContainer[int]
    sigma_m: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, epoch_ns: _Optional[_Iterable[int]] = ..., clock_m: _Optional[_Iterable[float]] = ..., sigma_m: _Optional[_Iterable[float]] = ...) -> None: ...

class ClockTie(_message.Message):
    __slots__ = ["boot_id", "issued_mono_ns", "received_mono_ns", "sent_mono_ns"]
    BOOT_ID_FIELD_NUMBER: _ClassVar[int]
    ISSUED_MONO_NS_FIELD_NUMBER: _ClassVar[int]
    RECEIVED_MONO_NS_FIELD_NUMBER: _ClassVar[int]
    SENT_MONO_NS_FIELD_NUMBER: _ClassVar[int]
    boot_id: bytes
    issued_mono_ns: int
    received_mono_ns: int
    sent_mono_ns: int
    def __init__(self, boot_id: _Optional[bytes] = ..., sent_mono_ns: _Optional[int] = ..., received_mono_ns: _Optional[int] = ..., issued_mono_ns: _Optional[int] = ...) -> None: ...

class Ephemeris(_message.Message):
    __slots__ = ["accuracy_m", "af0", "af1", "af2", "cic", "cis", "crc", "crs", "cuc", "cus", "delta_n", "e", "fit_half_s", "geo", "glonass", "group_delay_2_s", "group_delay_s", "healthy", "i0", "i_dot", "issue", "m0", "message", "mono_ns", "omega", "omega0", "omega_dot", "satellite", "sqrt_a", "toc_ns", "toe_ns", "transmission_ns"]
    ACCURACY_M_FIELD_NUMBER: _ClassVar[int]
    AF0_FIELD_NUMBER: _ClassVar[int]
    AF1_FIELD_NUMBER: _ClassVar[int]
    AF2_FIELD_NUMBER: _ClassVar[int]
    CIC_FIELD_NUMBER: _ClassVar[int]
    CIS_FIELD_NUMBER: _ClassVar[int]
    CRC_FIELD_NUMBER: _ClassVar[int]
    CRS_FIELD_NUMBER: _ClassVar[int]
    CUC_FIELD_NUMBER: _ClassVar[int]
    CUS_FIELD_NUMBER: _ClassVar[int]
    DELTA_N_FIELD_NUMBER: _ClassVar[int]
    E_FIELD_NUMBER: _ClassVar[int]
    FIT_HALF_S_FIELD_NUMBER: _ClassVar[int]
    GEO_FIELD_NUMBER: _ClassVar[int]
    GLONASS_FIELD_NUMBER: _ClassVar[int]
    GROUP_DELAY_2_S_FIELD_NUMBER: _ClassVar[int]
    GROUP_DELAY_S_FIELD_NUMBER: _ClassVar[int]
    HEALTHY_FIELD_NUMBER: _ClassVar[int]
    I0_FIELD_NUMBER: _ClassVar[int]
    ISSUE_FIELD_NUMBER: _ClassVar[int]
    I_DOT_FIELD_NUMBER: _ClassVar[int]
    M0_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    MONO_NS_FIELD_NUMBER: _ClassVar[int]
    OMEGA0_FIELD_NUMBER: _ClassVar[int]
    OMEGA_DOT_FIELD_NUMBER: _ClassVar[int]
    OMEGA_FIELD_NUMBER: _ClassVar[int]
    SATELLITE_FIELD_NUMBER: _ClassVar[int]
    SQRT_A_FIELD_NUMBER: _ClassVar[int]
    TOC_NS_FIELD_NUMBER: _ClassVar[int]
    TOE_NS_FIELD_NUMBER: _ClassVar[int]
    TRANSMISSION_NS_FIELD_NUMBER: _ClassVar[int]
    accuracy_m: float
    af0: float
    af1: float
    af2: float
    cic: float
    cis: float
    crc: float
    crs: float
    cuc: float
    cus: float
    delta_n: float
    e: float
    fit_half_s: float
    geo: GeoOrbit
    glonass: GlonassOrbit
    group_delay_2_s: float
    group_delay_s: float
    healthy: bool
    i0: float
    i_dot: float
    issue: int
    m0: float
    message: NavigationMessage
    mono_ns: int
    omega: float
    omega0: float
    omega_dot: float
    satellite: str
    sqrt_a: float
    toc_ns: int
    toe_ns: int
    transmission_ns: int
    def __init__(self, mono_ns: _Optional[int] = ..., satellite: _Optional[str] = ..., issue: _Optional[int] = ..., healthy: bool = ..., accuracy_m: _Optional[float] = ..., transmission_ns: _Optional[int] = ..., toe_ns: _Optional[int] = ..., toc_ns: _Optional[int] = ..., fit_half_s: _Optional[float] = ..., sqrt_a: _Optional[float] = ..., e: _Optional[float] = ..., i0: _Optional[float] = ..., omega0: _Optional[float] = ..., omega: _Optional[float] = ..., m0: _Optional[float] = ..., delta_n: _Optional[float] = ..., i_dot: _Optional[float] = ..., omega_dot: _Optional[float] = ..., cuc: _Optional[float] = ..., cus: _Optional[float] = ..., crc: _Optional[float] = ..., crs: _Optional[float] = ..., cic: _Optional[float] = ..., cis: _Optional[float] = ..., af0: _Optional[float] = ..., af1: _Optional[float] = ..., af2: _Optional[float] = ..., group_delay_s: _Optional[float] = ..., message: _Optional[_Union[NavigationMessage, str]] = ..., group_delay_2_s: _Optional[float] = ..., glonass: _Optional[_Union[GlonassOrbit, _Mapping]] = ..., geo: _Optional[_Union[GeoOrbit, _Mapping]] = ...) -> None: ...

class EpochReport(_message.Message):
    __slots__ = ["cause", "channels", "check", "checks", "exclusions", "gps_time_ns", "mono_ns", "reasons", "residuals", "state", "statistic", "subjects", "threshold", "triangle", "triangle_alone", "verdict_cause", "verdict_state", "verdict_subjects"]
    CAUSE_FIELD_NUMBER: _ClassVar[int]
    CHANNELS_FIELD_NUMBER: _ClassVar[int]
    CHECKS_FIELD_NUMBER: _ClassVar[int]
    CHECK_FIELD_NUMBER: _ClassVar[int]
    EXCLUSIONS_FIELD_NUMBER: _ClassVar[int]
    GPS_TIME_NS_FIELD_NUMBER: _ClassVar[int]
    MONO_NS_FIELD_NUMBER: _ClassVar[int]
    REASONS_FIELD_NUMBER: _ClassVar[int]
    RESIDUALS_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    STATISTIC_FIELD_NUMBER: _ClassVar[int]
    SUBJECTS_FIELD_NUMBER: _ClassVar[int]
    THRESHOLD_FIELD_NUMBER: _ClassVar[int]
    TRIANGLE_ALONE_FIELD_NUMBER: _ClassVar[int]
    TRIANGLE_FIELD_NUMBER: _ClassVar[int]
    VERDICT_CAUSE_FIELD_NUMBER: _ClassVar[int]
    VERDICT_STATE_FIELD_NUMBER: _ClassVar[int]
    VERDICT_SUBJECTS_FIELD_NUMBER: _ClassVar[int]
    cause: Cause
    channels: _containers.RepeatedCompositeFieldContainer[Channel]
    check: str
    checks: _containers.RepeatedCompositeFieldContainer[Check]
    exclusions: _containers.RepeatedCompositeFieldContainer[Exclusion]
    gps_time_ns: int
    mono_ns: int
    reasons: _containers.RepeatedScalarFieldContainer[str]
    residuals: _containers.RepeatedCompositeFieldContainer[Residual]
    state: State
    statistic: float
    subjects: _containers.RepeatedScalarFieldContainer[str]
    threshold: float
    triangle: _containers.RepeatedCompositeFieldContainer[Vertex]
    triangle_alone: State
    verdict_cause: Cause
    verdict_state: State
    verdict_subjects: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, gps_time_ns: _Optional[int] = ..., mono_ns: _Optional[int] = ..., state: _Optional[_Union[State, str]] = ..., cause: _Optional[_Union[Cause, str]] = ..., subjects: _Optional[_Iterable[str]] = ..., verdict_state: _Optional[_Union[State, str]] = ..., verdict_cause: _Optional[_Union[Cause, str]] = ..., verdict_subjects: _Optional[_Iterable[str]] = ..., check: _Optional[str] = ..., statistic: _Optional[float] = ..., threshold: _Optional[float] = ..., reasons: _Optional[_Iterable[str]] = ..., triangle_alone: _Optional[_Union[State, str]] = ..., triangle: _Optional[_Iterable[_Union[Vertex, _Mapping]]] = ..., checks: _Optional[_Iterable[_Union[Check, _Mapping]]] = ..., residuals: _Optional[_Iterable[_Union[Residual, _Mapping]]] = ..., exclusions: _Optional[_Iterable[_Union[Exclusion, _Mapping]]] = ..., channels: _Optional[_Iterable[_Union[Channel, _Mapping]]] = ...) -> None: ...

class Exclusion(_message.Message):
    __slots__ = ["check", "clean_epochs", "clean_since_ns", "satellite", "since_ns", "statistic", "threshold"]
    CHECK_FIELD_NUMBER: _ClassVar[int]
    CLEAN_EPOCHS_FIELD_NUMBER: _ClassVar[int]
    CLEAN_SINCE_NS_FIELD_NUMBER: _ClassVar[int]
    SATELLITE_FIELD_NUMBER: _ClassVar[int]
    SINCE_NS_FIELD_NUMBER: _ClassVar[int]
    STATISTIC_FIELD_NUMBER: _ClassVar[int]
    THRESHOLD_FIELD_NUMBER: _ClassVar[int]
    check: str
    clean_epochs: int
    clean_since_ns: int
    satellite: str
    since_ns: int
    statistic: float
    threshold: float
    def __init__(self, satellite: _Optional[str] = ..., since_ns: _Optional[int] = ..., check: _Optional[str] = ..., statistic: _Optional[float] = ..., threshold: _Optional[float] = ..., clean_since_ns: _Optional[int] = ..., clean_epochs: _Optional[int] = ...) -> None: ...

class Fastest(_message.Message):
    __slots__ = ["offset_before_ns", "offset_ns", "since_gps_ns"]
    OFFSET_BEFORE_NS_FIELD_NUMBER: _ClassVar[int]
    OFFSET_NS_FIELD_NUMBER: _ClassVar[int]
    SINCE_GPS_NS_FIELD_NUMBER: _ClassVar[int]
    offset_before_ns: int
    offset_ns: int
    since_gps_ns: int
    def __init__(self, since_gps_ns: _Optional[int] = ..., offset_ns: _Optional[int] = ..., offset_before_ns: _Optional[int] = ...) -> None: ...

class GainMemory(_message.Message):
    __slots__ = ["epoch_ns", "usual"]
    EPOCH_NS_FIELD_NUMBER: _ClassVar[int]
    USUAL_FIELD_NUMBER: _ClassVar[int]
    epoch_ns: int
    usual: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, epoch_ns: _Optional[int] = ..., usual: _Optional[_Iterable[float]] = ...) -> None: ...

class GeoOrbit(_message.Message):
    __slots__ = ["af0", "af1", "ax_mps2", "ay_mps2", "az_mps2", "vx_mps", "vy_mps", "vz_mps", "x_m", "y_m", "z_m"]
    AF0_FIELD_NUMBER: _ClassVar[int]
    AF1_FIELD_NUMBER: _ClassVar[int]
    AX_MPS2_FIELD_NUMBER: _ClassVar[int]
    AY_MPS2_FIELD_NUMBER: _ClassVar[int]
    AZ_MPS2_FIELD_NUMBER: _ClassVar[int]
    VX_MPS_FIELD_NUMBER: _ClassVar[int]
    VY_MPS_FIELD_NUMBER: _ClassVar[int]
    VZ_MPS_FIELD_NUMBER: _ClassVar[int]
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    Z_M_FIELD_NUMBER: _ClassVar[int]
    af0: float
    af1: float
    ax_mps2: float
    ay_mps2: float
    az_mps2: float
    vx_mps: float
    vy_mps: float
    vz_mps: float
    x_m: float
    y_m: float
    z_m: float
    def __init__(self, x_m: _Optional[float] = ..., y_m: _Optional[float] = ..., z_m: _Optional[float] = ..., vx_mps: _Optional[float] = ..., vy_mps: _Optional[float] = ..., vz_mps: _Optional[float] = ..., ax_mps2: _Optional[float] = ..., ay_mps2: _Optional[float] = ..., az_mps2: _Optional[float] = ..., af0: _Optional[float] = ..., af1: _Optional[float] = ...) -> None: ...

class GlonassOrbit(_message.Message):
    __slots__ = ["ax_mps2", "ay_mps2", "az_mps2", "channel", "delta_tau_n_s", "gamma_n", "tau_n_s", "vx_mps", "vy_mps", "vz_mps", "x_m", "y_m", "z_m"]
    AX_MPS2_FIELD_NUMBER: _ClassVar[int]
    AY_MPS2_FIELD_NUMBER: _ClassVar[int]
    AZ_MPS2_FIELD_NUMBER: _ClassVar[int]
    CHANNEL_FIELD_NUMBER: _ClassVar[int]
    DELTA_TAU_N_S_FIELD_NUMBER: _ClassVar[int]
    GAMMA_N_FIELD_NUMBER: _ClassVar[int]
    TAU_N_S_FIELD_NUMBER: _ClassVar[int]
    VX_MPS_FIELD_NUMBER: _ClassVar[int]
    VY_MPS_FIELD_NUMBER: _ClassVar[int]
    VZ_MPS_FIELD_NUMBER: _ClassVar[int]
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    Z_M_FIELD_NUMBER: _ClassVar[int]
    ax_mps2: float
    ay_mps2: float
    az_mps2: float
    channel: int
    delta_tau_n_s: float
    gamma_n: float
    tau_n_s: float
    vx_mps: float
    vy_mps: float
    vz_mps: float
    x_m: float
    y_m: float
    z_m: float
    def __init__(self, channel: _Optional[int] = ..., x_m: _Optional[float] = ..., y_m: _Optional[float] = ..., z_m: _Optional[float] = ..., vx_mps: _Optional[float] = ..., vy_mps: _Optional[float] = ..., vz_mps: _Optional[float] = ..., ax_mps2: _Optional[float] = ..., ay_mps2: _Optional[float] = ..., az_mps2: _Optional[float] = ..., tau_n_s: _Optional[float] = ..., gamma_n: _Optional[float] = ..., delta_tau_n_s: _Optional[float] = ...) -> None: ...

class Health(_message.Message):
    __slots__ = ["boot_id", "cause", "config_sha256", "covers_from_gps_ns", "covers_to_gps_ns", "excluded_satellites", "gps_time_ns", "issued_mono_ns", "map_sha256", "monitored", "monitored_signals", "not_monitored", "reasons", "sequence", "site", "software", "state", "subjects", "utc_ns", "valid_for_ms"]
    BOOT_ID_FIELD_NUMBER: _ClassVar[int]
    CAUSE_FIELD_NUMBER: _ClassVar[int]
    CONFIG_SHA256_FIELD_NUMBER: _ClassVar[int]
    COVERS_FROM_GPS_NS_FIELD_NUMBER: _ClassVar[int]
    COVERS_TO_GPS_NS_FIELD_NUMBER: _ClassVar[int]
    EXCLUDED_SATELLITES_FIELD_NUMBER: _ClassVar[int]
    GPS_TIME_NS_FIELD_NUMBER: _ClassVar[int]
    ISSUED_MONO_NS_FIELD_NUMBER: _ClassVar[int]
    MAP_SHA256_FIELD_NUMBER: _ClassVar[int]
    MONITORED_FIELD_NUMBER: _ClassVar[int]
    MONITORED_SIGNALS_FIELD_NUMBER: _ClassVar[int]
    NOT_MONITORED_FIELD_NUMBER: _ClassVar[int]
    REASONS_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    SITE_FIELD_NUMBER: _ClassVar[int]
    SOFTWARE_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    SUBJECTS_FIELD_NUMBER: _ClassVar[int]
    UTC_NS_FIELD_NUMBER: _ClassVar[int]
    VALID_FOR_MS_FIELD_NUMBER: _ClassVar[int]
    boot_id: bytes
    cause: Cause
    config_sha256: str
    covers_from_gps_ns: int
    covers_to_gps_ns: int
    excluded_satellites: _containers.RepeatedScalarFieldContainer[str]
    gps_time_ns: int
    issued_mono_ns: int
    map_sha256: _containers.RepeatedScalarFieldContainer[str]
    monitored: _containers.RepeatedScalarFieldContainer[str]
    monitored_signals: _containers.RepeatedCompositeFieldContainer[MonitoredSignal]
    not_monitored: _containers.RepeatedScalarFieldContainer[str]
    reasons: _containers.RepeatedScalarFieldContainer[str]
    sequence: int
    site: str
    software: str
    state: State
    subjects: _containers.RepeatedScalarFieldContainer[str]
    utc_ns: int
    valid_for_ms: int
    def __init__(self, site: _Optional[str] = ..., boot_id: _Optional[bytes] = ..., sequence: _Optional[int] = ..., gps_time_ns: _Optional[int] = ..., utc_ns: _Optional[int] = ..., issued_mono_ns: _Optional[int] = ..., valid_for_ms: _Optional[int] = ..., state: _Optional[_Union[State, str]] = ..., cause: _Optional[_Union[Cause, str]] = ..., subjects: _Optional[_Iterable[str]] = ..., reasons: _Optional[_Iterable[str]] = ..., not_monitored: _Optional[_Iterable[str]] = ..., monitored: _Optional[_Iterable[str]] = ..., excluded_satellites: _Optional[_Iterable[str]] = ..., covers_from_gps_ns: _Optional[int] = ..., covers_to_gps_ns: _Optional[int] = ..., config_sha256: _Optional[str] = ..., software: _Optional[str] = ..., monitored_signals: _Optional[_Iterable[_Union[MonitoredSignal, _Mapping]]] = ..., map_sha256: _Optional[_Iterable[str]] = ...) -> None: ...

class HealthReceived(_message.Message):
    __slots__ = ["data", "key_expr", "mono_ns"]
    DATA_FIELD_NUMBER: _ClassVar[int]
    KEY_EXPR_FIELD_NUMBER: _ClassVar[int]
    MONO_NS_FIELD_NUMBER: _ClassVar[int]
    data: bytes
    key_expr: str
    mono_ns: int
    def __init__(self, mono_ns: _Optional[int] = ..., key_expr: _Optional[str] = ..., data: _Optional[bytes] = ...) -> None: ...

class InputLost(_message.Message):
    __slots__ = ["chunks", "mono_ns", "receiver"]
    CHUNKS_FIELD_NUMBER: _ClassVar[int]
    MONO_NS_FIELD_NUMBER: _ClassVar[int]
    RECEIVER_FIELD_NUMBER: _ClassVar[int]
    chunks: int
    mono_ns: int
    receiver: str
    def __init__(self, mono_ns: _Optional[int] = ..., receiver: _Optional[str] = ..., chunks: _Optional[int] = ...) -> None: ...

class Ionosphere(_message.Message):
    __slots__ = ["alpha", "beta", "mono_ns"]
    ALPHA_FIELD_NUMBER: _ClassVar[int]
    BETA_FIELD_NUMBER: _ClassVar[int]
    MONO_NS_FIELD_NUMBER: _ClassVar[int]
    alpha: _containers.RepeatedScalarFieldContainer[float]
    beta: _containers.RepeatedScalarFieldContainer[float]
    mono_ns: int
    def __init__(self, mono_ns: _Optional[int] = ..., alpha: _Optional[_Iterable[float]] = ..., beta: _Optional[_Iterable[float]] = ...) -> None: ...

class LastClean(_message.Message):
    __slots__ = ["e_enu_m", "gps_ns"]
    E_ENU_M_FIELD_NUMBER: _ClassVar[int]
    GPS_NS_FIELD_NUMBER: _ClassVar[int]
    e_enu_m: _containers.RepeatedScalarFieldContainer[float]
    gps_ns: int
    def __init__(self, gps_ns: _Optional[int] = ..., e_enu_m: _Optional[_Iterable[float]] = ...) -> None: ...

class LastHealth(_message.Message):
    __slots__ = ["boot_id", "data", "gps_time_ns", "sequence", "told"]
    BOOT_ID_FIELD_NUMBER: _ClassVar[int]
    DATA_FIELD_NUMBER: _ClassVar[int]
    GPS_TIME_NS_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    TOLD_FIELD_NUMBER: _ClassVar[int]
    boot_id: bytes
    data: bytes
    gps_time_ns: int
    sequence: int
    told: int
    def __init__(self, boot_id: _Optional[bytes] = ..., sequence: _Optional[int] = ..., data: _Optional[bytes] = ..., gps_time_ns: _Optional[int] = ..., told: _Optional[int] = ...) -> None: ...

class MonitorMemory(_message.Message):
    __slots__ = ["audit", "carriers", "clocks", "gains", "navigation", "slow"]
    AUDIT_FIELD_NUMBER: _ClassVar[int]
    CARRIERS_FIELD_NUMBER: _ClassVar[int]
    CLOCKS_FIELD_NUMBER: _ClassVar[int]
    GAINS_FIELD_NUMBER: _ClassVar[int]
    NAVIGATION_FIELD_NUMBER: _ClassVar[int]
    SLOW_FIELD_NUMBER: _ClassVar[int]
    audit: AuditMemory
    carriers: CarrierMemory
    clocks: ClockMemory
    gains: GainMemory
    navigation: _containers.RepeatedCompositeFieldContainer[ServedSet]
    slow: SlowMemory
    def __init__(self, navigation: _Optional[_Iterable[_Union[ServedSet, _Mapping]]] = ..., clocks: _Optional[_Union[ClockMemory, _Mapping]] = ..., slow: _Optional[_Union[SlowMemory, _Mapping]] = ..., gains: _Optional[_Union[GainMemory, _Mapping]] = ..., audit: _Optional[_Union[AuditMemory, _Mapping]] = ..., carriers: _Optional[_Union[CarrierMemory, _Mapping]] = ...) -> None: ...

class MonitoredSignal(_message.Message):
    __slots__ = ["b_m", "correction_m", "correction_sigma_m", "ephemeris_crc32", "issue", "signal", "undetected_range_m"]
    B_M_FIELD_NUMBER: _ClassVar[int]
    CORRECTION_M_FIELD_NUMBER: _ClassVar[int]
    CORRECTION_SIGMA_M_FIELD_NUMBER: _ClassVar[int]
    EPHEMERIS_CRC32_FIELD_NUMBER: _ClassVar[int]
    ISSUE_FIELD_NUMBER: _ClassVar[int]
    SIGNAL_FIELD_NUMBER: _ClassVar[int]
    UNDETECTED_RANGE_M_FIELD_NUMBER: _ClassVar[int]
    b_m: _containers.RepeatedScalarFieldContainer[float]
    correction_m: float
    correction_sigma_m: float
    ephemeris_crc32: int
    issue: int
    signal: str
    undetected_range_m: float
    def __init__(self, signal: _Optional[str] = ..., issue: _Optional[int] = ..., ephemeris_crc32: _Optional[int] = ..., undetected_range_m: _Optional[float] = ..., correction_m: _Optional[float] = ..., correction_sigma_m: _Optional[float] = ..., b_m: _Optional[_Iterable[float]] = ...) -> None: ...

class NavigationPage(_message.Message):
    __slots__ = ["data", "number", "satellite"]
    DATA_FIELD_NUMBER: _ClassVar[int]
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    SATELLITE_FIELD_NUMBER: _ClassVar[int]
    data: bytes
    number: int
    satellite: str
    def __init__(self, satellite: _Optional[str] = ..., number: _Optional[int] = ..., data: _Optional[bytes] = ...) -> None: ...

class Observations(_message.Message):
    __slots__ = ["carrier_cycles", "cn0_dbhz", "doppler_hz", "half_cycle", "lock_s", "mono_ns", "pseudorange_m", "receive_time_ns", "receiver", "signal", "slip"]
    CARRIER_CYCLES_FIELD_NUMBER: _ClassVar[int]
    CN0_DBHZ_FIELD_NUMBER: _ClassVar[int]
    DOPPLER_HZ_FIELD_NUMBER: _ClassVar[int]
    HALF_CYCLE_FIELD_NUMBER: _ClassVar[int]
    LOCK_S_FIELD_NUMBER: _ClassVar[int]
    MONO_NS_FIELD_NUMBER: _ClassVar[int]
    PSEUDORANGE_M_FIELD_NUMBER: _ClassVar[int]
    RECEIVER_FIELD_NUMBER: _ClassVar[int]
    RECEIVE_TIME_NS_FIELD_NUMBER: _ClassVar[int]
    SIGNAL_FIELD_NUMBER: _ClassVar[int]
    SLIP_FIELD_NUMBER: _ClassVar[int]
    carrier_cycles: _containers.RepeatedScalarFieldContainer[float]
    cn0_dbhz: _containers.RepeatedScalarFieldContainer[float]
    doppler_hz: _containers.RepeatedScalarFieldContainer[float]
    half_cycle: _containers.RepeatedScalarFieldContainer[bool]
    lock_s: _containers.RepeatedScalarFieldContainer[float]
    mono_ns: int
    pseudorange_m: _containers.RepeatedScalarFieldContainer[float]
    receive_time_ns: int
    receiver: str
    signal: _containers.RepeatedScalarFieldContainer[str]
    slip: _containers.RepeatedScalarFieldContainer[bool]
    def __init__(self, receiver: _Optional[str] = ..., mono_ns: _Optional[int] = ..., receive_time_ns: _Optional[int] = ..., signal: _Optional[_Iterable[str]] = ..., pseudorange_m: _Optional[_Iterable[float]] = ..., carrier_cycles: _Optional[_Iterable[float]] = ..., doppler_hz: _Optional[_Iterable[float]] = ..., cn0_dbhz: _Optional[_Iterable[float]] = ..., lock_s: _Optional[_Iterable[float]] = ..., slip: _Optional[_Iterable[bool]] = ..., half_cycle: _Optional[_Iterable[bool]] = ...) -> None: ...

class PendingEpoch(_message.Message):
    __slots__ = ["epoch_ns", "rows"]
    EPOCH_NS_FIELD_NUMBER: _ClassVar[int]
    ROWS_FIELD_NUMBER: _ClassVar[int]
    epoch_ns: int
    rows: _containers.RepeatedCompositeFieldContainer[Observations]
    def __init__(self, epoch_ns: _Optional[int] = ..., rows: _Optional[_Iterable[_Union[Observations, _Mapping]]] = ...) -> None: ...

class Reached(_message.Message):
    __slots__ = ["facing", "gps_time_ns", "place", "sigma_m"]
    FACING_FIELD_NUMBER: _ClassVar[int]
    GPS_TIME_NS_FIELD_NUMBER: _ClassVar[int]
    PLACE_FIELD_NUMBER: _ClassVar[int]
    SIGMA_M_FIELD_NUMBER: _ClassVar[int]
    facing: int
    gps_time_ns: int
    place: TrackPlace
    sigma_m: float
    def __init__(self, place: _Optional[_Union[TrackPlace, _Mapping]] = ..., sigma_m: _Optional[float] = ..., facing: _Optional[int] = ..., gps_time_ns: _Optional[int] = ...) -> None: ...

class ReceiverStatus(_message.Message):
    __slots__ = ["agc", "antenna", "fix_ok", "height_m", "jamming", "lat_rad", "lon_rad", "model", "spoofing", "stated_ecef_m", "virtual"]
    AGC_FIELD_NUMBER: _ClassVar[int]
    ANTENNA_FIELD_NUMBER: _ClassVar[int]
    FIX_OK_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_M_FIELD_NUMBER: _ClassVar[int]
    JAMMING_FIELD_NUMBER: _ClassVar[int]
    LAT_RAD_FIELD_NUMBER: _ClassVar[int]
    LON_RAD_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    SPOOFING_FIELD_NUMBER: _ClassVar[int]
    STATED_ECEF_M_FIELD_NUMBER: _ClassVar[int]
    VIRTUAL_FIELD_NUMBER: _ClassVar[int]
    agc: float
    antenna: int
    fix_ok: bool
    height_m: float
    jamming: int
    lat_rad: float
    lon_rad: float
    model: str
    spoofing: int
    stated_ecef_m: _containers.RepeatedScalarFieldContainer[float]
    virtual: bool
    def __init__(self, model: _Optional[str] = ..., fix_ok: bool = ..., lat_rad: _Optional[float] = ..., lon_rad: _Optional[float] = ..., height_m: _Optional[float] = ..., jamming: _Optional[int] = ..., spoofing: _Optional[int] = ..., antenna: _Optional[int] = ..., agc: _Optional[float] = ..., stated_ecef_m: _Optional[_Iterable[float]] = ..., virtual: bool = ...) -> None: ...

class ReceptionMemory(_message.Message):
    __slots__ = ["bad_frames", "gps_ahead_ns", "last_row_ns", "pages", "pending", "receiver", "rtcm", "since_mono_ns", "skipped_bytes", "status_mono_ns", "told"]
    class StatusMonoNsEntry(_message.Message):
        __slots__ = ["key", "value"]
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: int
        value: int
        def __init__(self, key: _Optional[int] = ..., value: _Optional[int] = ...) -> None: ...
    BAD_FRAMES_FIELD_NUMBER: _ClassVar[int]
    GPS_AHEAD_NS_FIELD_NUMBER: _ClassVar[int]
    LAST_ROW_NS_FIELD_NUMBER: _ClassVar[int]
    PAGES_FIELD_NUMBER: _ClassVar[int]
    PENDING_FIELD_NUMBER: _ClassVar[int]
    RECEIVER_FIELD_NUMBER: _ClassVar[int]
    RTCM_FIELD_NUMBER: _ClassVar[int]
    SINCE_MONO_NS_FIELD_NUMBER: _ClassVar[int]
    SKIPPED_BYTES_FIELD_NUMBER: _ClassVar[int]
    STATUS_MONO_NS_FIELD_NUMBER: _ClassVar[int]
    TOLD_FIELD_NUMBER: _ClassVar[int]
    bad_frames: int
    gps_ahead_ns: int
    last_row_ns: int
    pages: _containers.RepeatedCompositeFieldContainer[NavigationPage]
    pending: bytes
    receiver: str
    rtcm: RtcmMemory
    since_mono_ns: int
    skipped_bytes: int
    status_mono_ns: _containers.ScalarMap[int, int]
    told: _containers.RepeatedCompositeFieldContainer[Ephemeris]
    def __init__(self, receiver: _Optional[str] = ..., pending: _Optional[bytes] = ..., pages: _Optional[_Iterable[_Union[NavigationPage, _Mapping]]] = ..., told: _Optional[_Iterable[_Union[Ephemeris, _Mapping]]] = ..., last_row_ns: _Optional[int] = ..., status_mono_ns: _Optional[_Mapping[int, int]] = ..., bad_frames: _Optional[int] = ..., skipped_bytes: _Optional[int] = ..., rtcm: _Optional[_Union[RtcmMemory, _Mapping]] = ..., gps_ahead_ns: _Optional[int] = ..., since_mono_ns: _Optional[int] = ...) -> None: ...

class Residual(_message.Message):
    __slots__ = ["b_m", "sigmas", "signal", "used"]
    B_M_FIELD_NUMBER: _ClassVar[int]
    SIGMAS_FIELD_NUMBER: _ClassVar[int]
    SIGNAL_FIELD_NUMBER: _ClassVar[int]
    USED_FIELD_NUMBER: _ClassVar[int]
    b_m: _containers.RepeatedScalarFieldContainer[float]
    sigmas: float
    signal: str
    used: bool
    def __init__(self, signal: _Optional[str] = ..., used: bool = ..., sigmas: _Optional[float] = ..., b_m: _Optional[_Iterable[float]] = ...) -> None: ...

class RtcmMemory(_message.Message):
    __slots__ = ["channels", "epoch_ns", "lock_s", "lock_signal", "lock_time_ns", "near_ns", "open_messages", "refused", "told", "undated"]
    class ChannelsEntry(_message.Message):
        __slots__ = ["key", "value"]
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: int
        value: int
        def __init__(self, key: _Optional[int] = ..., value: _Optional[int] = ...) -> None: ...
    CHANNELS_FIELD_NUMBER: _ClassVar[int]
    EPOCH_NS_FIELD_NUMBER: _ClassVar[int]
    LOCK_SIGNAL_FIELD_NUMBER: _ClassVar[int]
    LOCK_S_FIELD_NUMBER: _ClassVar[int]
    LOCK_TIME_NS_FIELD_NUMBER: _ClassVar[int]
    NEAR_NS_FIELD_NUMBER: _ClassVar[int]
    OPEN_MESSAGES_FIELD_NUMBER: _ClassVar[int]
    REFUSED_FIELD_NUMBER: _ClassVar[int]
    TOLD_FIELD_NUMBER: _ClassVar[int]
    UNDATED_FIELD_NUMBER: _ClassVar[int]
    channels: _containers.ScalarMap[int, int]
    epoch_ns: int
    lock_s: _containers.RepeatedScalarFieldContainer[float]
    lock_signal: _containers.RepeatedScalarFieldContainer[str]
    lock_time_ns: _containers.RepeatedScalarFieldContainer[int]
    near_ns: int
    open_messages: _containers.RepeatedScalarFieldContainer[bytes]
    refused: int
    told: _containers.RepeatedCompositeFieldContainer[Ephemeris]
    undated: int
    def __init__(self, near_ns: _Optional[int] = ..., epoch_ns: _Optional[int] = ..., open_messages: _Optional[_Iterable[bytes]] = ..., channels: _Optional[_Mapping[int, int]] = ..., lock_signal: _Optional[_Iterable[str]] = ..., lock_time_ns: _Optional[_Iterable[int]] = ..., lock_s: _Optional[_Iterable[float]] = ..., told: _Optional[_Iterable[_Union[Ephemeris, _Mapping]]] = ..., refused: _Optional[int] = ..., undated: _Optional[int] = ...) -> None: ...

class SentNonce(_message.Message):
    __slots__ = ["mono_ns", "nonce"]
    MONO_NS_FIELD_NUMBER: _ClassVar[int]
    NONCE_FIELD_NUMBER: _ClassVar[int]
    mono_ns: int
    nonce: bytes
    def __init__(self, nonce: _Optional[bytes] = ..., mono_ns: _Optional[int] = ...) -> None: ...

class ServedSet(_message.Message):
    __slots__ = ["apart_m", "change", "orbit", "range_m", "reference", "reissued_m", "satellite", "serving"]
    APART_M_FIELD_NUMBER: _ClassVar[int]
    CHANGE_FIELD_NUMBER: _ClassVar[int]
    ORBIT_FIELD_NUMBER: _ClassVar[int]
    RANGE_M_FIELD_NUMBER: _ClassVar[int]
    REFERENCE_FIELD_NUMBER: _ClassVar[int]
    REISSUED_M_FIELD_NUMBER: _ClassVar[int]
    SATELLITE_FIELD_NUMBER: _ClassVar[int]
    SERVING_FIELD_NUMBER: _ClassVar[int]
    apart_m: float
    change: float
    orbit: float
    range_m: float
    reference: Ephemeris
    reissued_m: float
    satellite: str
    serving: Ephemeris
    def __init__(self, satellite: _Optional[str] = ..., serving: _Optional[_Union[Ephemeris, _Mapping]] = ..., reference: _Optional[_Union[Ephemeris, _Mapping]] = ..., change: _Optional[float] = ..., range_m: _Optional[float] = ..., apart_m: _Optional[float] = ..., reissued_m: _Optional[float] = ..., orbit: _Optional[float] = ...) -> None: ...

class SignedChallengeReply(_message.Message):
    __slots__ = ["key_id", "reply", "signature"]
    KEY_ID_FIELD_NUMBER: _ClassVar[int]
    REPLY_FIELD_NUMBER: _ClassVar[int]
    SIGNATURE_FIELD_NUMBER: _ClassVar[int]
    key_id: bytes
    reply: bytes
    signature: bytes
    def __init__(self, reply: _Optional[bytes] = ..., key_id: _Optional[bytes] = ..., signature: _Optional[bytes] = ...) -> None: ...

class SignedHealth(_message.Message):
    __slots__ = ["health", "key_id", "signature"]
    HEALTH_FIELD_NUMBER: _ClassVar[int]
    KEY_ID_FIELD_NUMBER: _ClassVar[int]
    SIGNATURE_FIELD_NUMBER: _ClassVar[int]
    health: bytes
    key_id: bytes
    signature: bytes
    def __init__(self, health: _Optional[bytes] = ..., key_id: _Optional[bytes] = ..., signature: _Optional[bytes] = ...) -> None: ...

class SiteInfo(_message.Message):
    __slots__ = ["boot_id", "config_sha256", "frame", "frame_epoch", "key_id", "radius_m", "site", "software", "triangle"]
    BOOT_ID_FIELD_NUMBER: _ClassVar[int]
    CONFIG_SHA256_FIELD_NUMBER: _ClassVar[int]
    FRAME_EPOCH_FIELD_NUMBER: _ClassVar[int]
    FRAME_FIELD_NUMBER: _ClassVar[int]
    KEY_ID_FIELD_NUMBER: _ClassVar[int]
    RADIUS_M_FIELD_NUMBER: _ClassVar[int]
    SITE_FIELD_NUMBER: _ClassVar[int]
    SOFTWARE_FIELD_NUMBER: _ClassVar[int]
    TRIANGLE_FIELD_NUMBER: _ClassVar[int]
    boot_id: bytes
    config_sha256: str
    frame: str
    frame_epoch: float
    key_id: bytes
    radius_m: float
    site: str
    software: str
    triangle: _containers.RepeatedCompositeFieldContainer[SurveyedPoint]
    def __init__(self, site: _Optional[str] = ..., frame: _Optional[str] = ..., frame_epoch: _Optional[float] = ..., triangle: _Optional[_Iterable[_Union[SurveyedPoint, _Mapping]]] = ..., radius_m: _Optional[float] = ..., key_id: _Optional[bytes] = ..., software: _Optional[str] = ..., config_sha256: _Optional[str] = ..., boot_id: _Optional[bytes] = ...) -> None: ...

class SlowMemory(_message.Message):
    __slots__ = ["cusum", "epoch_ns", "u"]
    CUSUM_FIELD_NUMBER: _ClassVar[int]
    EPOCH_NS_FIELD_NUMBER: _ClassVar[int]
    U_FIELD_NUMBER: _ClassVar[int]
    cusum: _containers.RepeatedScalarFieldContainer[float]
    epoch_ns: int
    u: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, epoch_ns: _Optional[int] = ..., u: _Optional[_Iterable[float]] = ..., cusum: _Optional[_Iterable[float]] = ...) -> None: ...

class Snapshot(_message.Message):
    __slots__ = ["aligned_ns", "cause", "clean_epochs", "clean_since_ns", "dropped", "ephemerides", "exclusions", "fastest", "heard_ns", "ionosphere", "last_clean", "last_epoch_ns", "last_rows", "monitors", "mono_ns", "pending", "receiver", "reception", "refused_ephemerides", "sequence", "signal", "silence_told", "silent", "started", "state", "status", "streams", "streams_epoch_ns", "subjects", "tick"]
    class DroppedEntry(_message.Message):
        __slots__ = ["key", "value"]
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: int
        def __init__(self, key: _Optional[str] = ..., value: _Optional[int] = ...) -> None: ...
    class HeardNsEntry(_message.Message):
        __slots__ = ["key", "value"]
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: int
        def __init__(self, key: _Optional[str] = ..., value: _Optional[int] = ...) -> None: ...
    class StatusEntry(_message.Message):
        __slots__ = ["key", "value"]
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: ReceiverStatus
        def __init__(self, key: _Optional[str] = ..., value: _Optional[_Union[ReceiverStatus, _Mapping]] = ...) -> None: ...
    ALIGNED_NS_FIELD_NUMBER: _ClassVar[int]
    CAUSE_FIELD_NUMBER: _ClassVar[int]
    CLEAN_EPOCHS_FIELD_NUMBER: _ClassVar[int]
    CLEAN_SINCE_NS_FIELD_NUMBER: _ClassVar[int]
    DROPPED_FIELD_NUMBER: _ClassVar[int]
    EPHEMERIDES_FIELD_NUMBER: _ClassVar[int]
    EXCLUSIONS_FIELD_NUMBER: _ClassVar[int]
    FASTEST_FIELD_NUMBER: _ClassVar[int]
    HEARD_NS_FIELD_NUMBER: _ClassVar[int]
    IONOSPHERE_FIELD_NUMBER: _ClassVar[int]
    LAST_CLEAN_FIELD_NUMBER: _ClassVar[int]
    LAST_EPOCH_NS_FIELD_NUMBER: _ClassVar[int]
    LAST_ROWS_FIELD_NUMBER: _ClassVar[int]
    MONITORS_FIELD_NUMBER: _ClassVar[int]
    MONO_NS_FIELD_NUMBER: _ClassVar[int]
    PENDING_FIELD_NUMBER: _ClassVar[int]
    RECEIVER_FIELD_NUMBER: _ClassVar[int]
    RECEPTION_FIELD_NUMBER: _ClassVar[int]
    REFUSED_EPHEMERIDES_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    SIGNAL_FIELD_NUMBER: _ClassVar[int]
    SILENCE_TOLD_FIELD_NUMBER: _ClassVar[int]
    SILENT_FIELD_NUMBER: _ClassVar[int]
    STARTED_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    STATUS_FIELD_NUMBER: _ClassVar[int]
    STREAMS_EPOCH_NS_FIELD_NUMBER: _ClassVar[int]
    STREAMS_FIELD_NUMBER: _ClassVar[int]
    SUBJECTS_FIELD_NUMBER: _ClassVar[int]
    TICK_FIELD_NUMBER: _ClassVar[int]
    aligned_ns: int
    cause: Cause
    clean_epochs: int
    clean_since_ns: int
    dropped: _containers.ScalarMap[str, int]
    ephemerides: _containers.RepeatedCompositeFieldContainer[Ephemeris]
    exclusions: _containers.RepeatedCompositeFieldContainer[Exclusion]
    fastest: Fastest
    heard_ns: _containers.ScalarMap[str, int]
    ionosphere: Ionosphere
    last_clean: LastClean
    last_epoch_ns: int
    last_rows: _containers.RepeatedCompositeFieldContainer[Observations]
    monitors: MonitorMemory
    mono_ns: int
    pending: _containers.RepeatedCompositeFieldContainer[PendingEpoch]
    receiver: _containers.RepeatedScalarFieldContainer[str]
    reception: _containers.RepeatedCompositeFieldContainer[ReceptionMemory]
    refused_ephemerides: int
    sequence: int
    signal: _containers.RepeatedScalarFieldContainer[str]
    silence_told: bool
    silent: _containers.RepeatedScalarFieldContainer[str]
    started: bool
    state: State
    status: _containers.MessageMap[str, ReceiverStatus]
    streams: _containers.RepeatedCompositeFieldContainer[StreamMemory]
    streams_epoch_ns: int
    subjects: _containers.RepeatedScalarFieldContainer[str]
    tick: Tick
    def __init__(self, mono_ns: _Optional[int] = ..., receiver: _Optional[_Iterable[str]] = ..., signal: _Optional[_Iterable[str]] = ..., streams_epoch_ns: _Optional[int] = ..., streams: _Optional[_Iterable[_Union[StreamMemory, _Mapping]]] = ..., pending: _Optional[_Iterable[_Union[PendingEpoch, _Mapping]]] = ..., last_epoch_ns: _Optional[int] = ..., heard_ns: _Optional[_Mapping[str, int]] = ..., aligned_ns: _Optional[int] = ..., dropped: _Optional[_Mapping[str, int]] = ..., refused_ephemerides: _Optional[int] = ..., ionosphere: _Optional[_Union[Ionosphere, _Mapping]] = ..., ephemerides: _Optional[_Iterable[_Union[Ephemeris, _Mapping]]] = ..., exclusions: _Optional[_Iterable[_Union[Exclusion, _Mapping]]] = ..., state: _Optional[_Union[State, str]] = ..., cause: _Optional[_Union[Cause, str]] = ..., subjects: _Optional[_Iterable[str]] = ..., clean_since_ns: _Optional[int] = ..., clean_epochs: _Optional[int] = ..., sequence: _Optional[int] = ..., last_clean: _Optional[_Union[LastClean, _Mapping]] = ..., silence_told: bool = ..., reception: _Optional[_Iterable[_Union[ReceptionMemory, _Mapping]]] = ..., status: _Optional[_Mapping[str, ReceiverStatus]] = ..., last_rows: _Optional[_Iterable[_Union[Observations, _Mapping]]] = ..., started: bool = ..., monitors: _Optional[_Union[MonitorMemory, _Mapping]] = ..., tick: _Optional[_Union[Tick, _Mapping]] = ..., silent: _Optional[_Iterable[str]] = ..., fastest: _Optional[_Union[Fastest, _Mapping]] = ...) -> None: ...

class Started(_message.Message):
    __slots__ = ["boot_id", "config_sha256", "gps_time_ns", "mono_ns", "site", "site_toml", "software"]
    BOOT_ID_FIELD_NUMBER: _ClassVar[int]
    CONFIG_SHA256_FIELD_NUMBER: _ClassVar[int]
    GPS_TIME_NS_FIELD_NUMBER: _ClassVar[int]
    MONO_NS_FIELD_NUMBER: _ClassVar[int]
    SITE_FIELD_NUMBER: _ClassVar[int]
    SITE_TOML_FIELD_NUMBER: _ClassVar[int]
    SOFTWARE_FIELD_NUMBER: _ClassVar[int]
    boot_id: bytes
    config_sha256: str
    gps_time_ns: int
    mono_ns: int
    site: str
    site_toml: str
    software: str
    def __init__(self, site: _Optional[str] = ..., software: _Optional[str] = ..., config_sha256: _Optional[str] = ..., site_toml: _Optional[str] = ..., gps_time_ns: _Optional[int] = ..., mono_ns: _Optional[int] = ..., boot_id: _Optional[bytes] = ...) -> None: ...

class StationMemory(_message.Message):
    __slots__ = ["alarming_mono_ns", "challenge_at_ns", "last_health", "missed_messages", "nonces", "normals", "refused_messages", "site", "superseded", "tie", "trust", "trust_sequence", "valid_until_ns", "vouched"]
    ALARMING_MONO_NS_FIELD_NUMBER: _ClassVar[int]
    CHALLENGE_AT_NS_FIELD_NUMBER: _ClassVar[int]
    LAST_HEALTH_FIELD_NUMBER: _ClassVar[int]
    MISSED_MESSAGES_FIELD_NUMBER: _ClassVar[int]
    NONCES_FIELD_NUMBER: _ClassVar[int]
    NORMALS_FIELD_NUMBER: _ClassVar[int]
    REFUSED_MESSAGES_FIELD_NUMBER: _ClassVar[int]
    SITE_FIELD_NUMBER: _ClassVar[int]
    SUPERSEDED_FIELD_NUMBER: _ClassVar[int]
    TIE_FIELD_NUMBER: _ClassVar[int]
    TRUST_FIELD_NUMBER: _ClassVar[int]
    TRUST_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    VALID_UNTIL_NS_FIELD_NUMBER: _ClassVar[int]
    VOUCHED_FIELD_NUMBER: _ClassVar[int]
    alarming_mono_ns: _containers.RepeatedScalarFieldContainer[int]
    challenge_at_ns: int
    last_health: LastHealth
    missed_messages: int
    nonces: _containers.RepeatedCompositeFieldContainer[SentNonce]
    normals: int
    refused_messages: int
    site: str
    superseded: _containers.RepeatedScalarFieldContainer[bytes]
    tie: ClockTie
    trust: TrustState
    trust_sequence: int
    valid_until_ns: int
    vouched: _containers.RepeatedCompositeFieldContainer[Vouched]
    def __init__(self, site: _Optional[str] = ..., vouched: _Optional[_Iterable[_Union[Vouched, _Mapping]]] = ..., tie: _Optional[_Union[ClockTie, _Mapping]] = ..., last_health: _Optional[_Union[LastHealth, _Mapping]] = ..., superseded: _Optional[_Iterable[bytes]] = ..., trust: _Optional[_Union[TrustState, str]] = ..., normals: _Optional[int] = ..., valid_until_ns: _Optional[int] = ..., trust_sequence: _Optional[int] = ..., nonces: _Optional[_Iterable[_Union[SentNonce, _Mapping]]] = ..., challenge_at_ns: _Optional[int] = ..., refused_messages: _Optional[int] = ..., alarming_mono_ns: _Optional[_Iterable[int]] = ..., missed_messages: _Optional[int] = ...) -> None: ...

class StationTrust(_message.Message):
    __slots__ = ["health_sequence", "missed_messages", "refused_messages", "security_alarm", "site", "trust", "valid_for_ms"]
    HEALTH_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    MISSED_MESSAGES_FIELD_NUMBER: _ClassVar[int]
    REFUSED_MESSAGES_FIELD_NUMBER: _ClassVar[int]
    SECURITY_ALARM_FIELD_NUMBER: _ClassVar[int]
    SITE_FIELD_NUMBER: _ClassVar[int]
    TRUST_FIELD_NUMBER: _ClassVar[int]
    VALID_FOR_MS_FIELD_NUMBER: _ClassVar[int]
    health_sequence: int
    missed_messages: int
    refused_messages: int
    security_alarm: bool
    site: str
    trust: TrustState
    valid_for_ms: int
    def __init__(self, site: _Optional[str] = ..., trust: _Optional[_Union[TrustState, str]] = ..., health_sequence: _Optional[int] = ..., valid_for_ms: _Optional[int] = ..., refused_messages: _Optional[int] = ..., security_alarm: bool = ..., missed_messages: _Optional[int] = ...) -> None: ...

class StopMemory(_message.Message):
    __slots__ = ["lost_ns", "reasons", "since_ns", "state", "valid_again"]
    LOST_NS_FIELD_NUMBER: _ClassVar[int]
    REASONS_FIELD_NUMBER: _ClassVar[int]
    SINCE_NS_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    VALID_AGAIN_FIELD_NUMBER: _ClassVar[int]
    lost_ns: int
    reasons: _containers.RepeatedScalarFieldContainer[str]
    since_ns: int
    state: StopState
    valid_again: bool
    def __init__(self, state: _Optional[_Union[StopState, str]] = ..., reasons: _Optional[_Iterable[str]] = ..., since_ns: _Optional[int] = ..., lost_ns: _Optional[int] = ..., valid_again: bool = ...) -> None: ...

class StopReleased(_message.Message):
    __slots__ = ["mono_ns"]
    MONO_NS_FIELD_NUMBER: _ClassVar[int]
    mono_ns: int
    def __init__(self, mono_ns: _Optional[int] = ...) -> None: ...

class StreamMemory(_message.Message):
    __slots__ = ["cn0_baseline_dbhz", "last_seen_ns", "pseudorange_m"]
    CN0_BASELINE_DBHZ_FIELD_NUMBER: _ClassVar[int]
    LAST_SEEN_NS_FIELD_NUMBER: _ClassVar[int]
    PSEUDORANGE_M_FIELD_NUMBER: _ClassVar[int]
    cn0_baseline_dbhz: _containers.RepeatedScalarFieldContainer[float]
    last_seen_ns: _containers.RepeatedScalarFieldContainer[int]
    pseudorange_m: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, last_seen_ns: _Optional[_Iterable[int]] = ..., pseudorange_m: _Optional[_Iterable[float]] = ..., cn0_baseline_dbhz: _Optional[_Iterable[float]] = ...) -> None: ...

class SurveyedPoint(_message.Message):
    __slots__ = ["receiver", "x_m", "y_m", "z_m"]
    RECEIVER_FIELD_NUMBER: _ClassVar[int]
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    Z_M_FIELD_NUMBER: _ClassVar[int]
    receiver: str
    x_m: float
    y_m: float
    z_m: float
    def __init__(self, receiver: _Optional[str] = ..., x_m: _Optional[float] = ..., y_m: _Optional[float] = ..., z_m: _Optional[float] = ...) -> None: ...

class Tick(_message.Message):
    __slots__ = ["mono_ns", "utc_ns", "utc_uncertainty_ns"]
    MONO_NS_FIELD_NUMBER: _ClassVar[int]
    UTC_NS_FIELD_NUMBER: _ClassVar[int]
    UTC_UNCERTAINTY_NS_FIELD_NUMBER: _ClassVar[int]
    mono_ns: int
    utc_ns: int
    utc_uncertainty_ns: int
    def __init__(self, mono_ns: _Optional[int] = ..., utc_ns: _Optional[int] = ..., utc_uncertainty_ns: _Optional[int] = ...) -> None: ...

class ToldEphemeris(_message.Message):
    __slots__ = ["antenna", "ephemeris"]
    ANTENNA_FIELD_NUMBER: _ClassVar[int]
    EPHEMERIS_FIELD_NUMBER: _ClassVar[int]
    antenna: str
    ephemeris: Ephemeris
    def __init__(self, antenna: _Optional[str] = ..., ephemeris: _Optional[_Union[Ephemeris, _Mapping]] = ...) -> None: ...

class TrackPlace(_message.Message):
    __slots__ = ["edge", "offset_m"]
    EDGE_FIELD_NUMBER: _ClassVar[int]
    OFFSET_M_FIELD_NUMBER: _ClassVar[int]
    edge: str
    offset_m: float
    def __init__(self, edge: _Optional[str] = ..., offset_m: _Optional[float] = ...) -> None: ...

class TrainPosition(_message.Message):
    __slots__ = ["antennas", "config_sha256", "distance_expected_m", "distance_m", "facing", "front", "gps_time_ns", "health_sequence", "last_confirmed", "last_confirmed_gps_ns", "map_id", "map_sha256", "map_version", "mono_ns", "rear", "reasons", "refused_messages", "sequence", "sigma_m", "site", "software", "stations", "status", "stop", "stop_reasons", "stop_since_mono_ns", "train", "trust", "unused", "valid_for_ms", "vouching"]
    ANTENNAS_FIELD_NUMBER: _ClassVar[int]
    CONFIG_SHA256_FIELD_NUMBER: _ClassVar[int]
    DISTANCE_EXPECTED_M_FIELD_NUMBER: _ClassVar[int]
    DISTANCE_M_FIELD_NUMBER: _ClassVar[int]
    FACING_FIELD_NUMBER: _ClassVar[int]
    FRONT_FIELD_NUMBER: _ClassVar[int]
    GPS_TIME_NS_FIELD_NUMBER: _ClassVar[int]
    HEALTH_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    LAST_CONFIRMED_FIELD_NUMBER: _ClassVar[int]
    LAST_CONFIRMED_GPS_NS_FIELD_NUMBER: _ClassVar[int]
    MAP_ID_FIELD_NUMBER: _ClassVar[int]
    MAP_SHA256_FIELD_NUMBER: _ClassVar[int]
    MAP_VERSION_FIELD_NUMBER: _ClassVar[int]
    MONO_NS_FIELD_NUMBER: _ClassVar[int]
    REAR_FIELD_NUMBER: _ClassVar[int]
    REASONS_FIELD_NUMBER: _ClassVar[int]
    REFUSED_MESSAGES_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    SIGMA_M_FIELD_NUMBER: _ClassVar[int]
    SITE_FIELD_NUMBER: _ClassVar[int]
    SOFTWARE_FIELD_NUMBER: _ClassVar[int]
    STATIONS_FIELD_NUMBER: _ClassVar[int]
    STATUS_FIELD_NUMBER: _ClassVar[int]
    STOP_FIELD_NUMBER: _ClassVar[int]
    STOP_REASONS_FIELD_NUMBER: _ClassVar[int]
    STOP_SINCE_MONO_NS_FIELD_NUMBER: _ClassVar[int]
    TRAIN_FIELD_NUMBER: _ClassVar[int]
    TRUST_FIELD_NUMBER: _ClassVar[int]
    UNUSED_FIELD_NUMBER: _ClassVar[int]
    VALID_FOR_MS_FIELD_NUMBER: _ClassVar[int]
    VOUCHING_FIELD_NUMBER: _ClassVar[int]
    antennas: _containers.RepeatedCompositeFieldContainer[AntennaFix]
    config_sha256: str
    distance_expected_m: float
    distance_m: float
    facing: int
    front: TrackPlace
    gps_time_ns: int
    health_sequence: int
    last_confirmed: TrackPlace
    last_confirmed_gps_ns: int
    map_id: str
    map_sha256: str
    map_version: str
    mono_ns: int
    rear: TrackPlace
    reasons: _containers.RepeatedScalarFieldContainer[str]
    refused_messages: int
    sequence: int
    sigma_m: float
    site: str
    software: str
    stations: _containers.RepeatedCompositeFieldContainer[StationTrust]
    status: PositionStatus
    stop: StopState
    stop_reasons: _containers.RepeatedScalarFieldContainer[str]
    stop_since_mono_ns: int
    train: str
    trust: TrustState
    unused: _containers.RepeatedCompositeFieldContainer[UnusedSatellite]
    valid_for_ms: int
    vouching: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, train: _Optional[str] = ..., sequence: _Optional[int] = ..., mono_ns: _Optional[int] = ..., gps_time_ns: _Optional[int] = ..., status: _Optional[_Union[PositionStatus, str]] = ..., reasons: _Optional[_Iterable[str]] = ..., front: _Optional[_Union[TrackPlace, _Mapping]] = ..., rear: _Optional[_Union[TrackPlace, _Mapping]] = ..., sigma_m: _Optional[float] = ..., facing: _Optional[int] = ..., trust: _Optional[_Union[TrustState, str]] = ..., site: _Optional[str] = ..., health_sequence: _Optional[int] = ..., valid_for_ms: _Optional[int] = ..., antennas: _Optional[_Iterable[_Union[AntennaFix, _Mapping]]] = ..., distance_m: _Optional[float] = ..., distance_expected_m: _Optional[float] = ..., unused: _Optional[_Iterable[_Union[UnusedSatellite, _Mapping]]] = ..., last_confirmed: _Optional[_Union[TrackPlace, _Mapping]] = ..., last_confirmed_gps_ns: _Optional[int] = ..., refused_messages: _Optional[int] = ..., map_id: _Optional[str] = ..., map_version: _Optional[str] = ..., map_sha256: _Optional[str] = ..., config_sha256: _Optional[str] = ..., software: _Optional[str] = ..., stations: _Optional[_Iterable[_Union[StationTrust, _Mapping]]] = ..., vouching: _Optional[_Iterable[str]] = ..., stop: _Optional[_Union[StopState, str]] = ..., stop_reasons: _Optional[_Iterable[str]] = ..., stop_since_mono_ns: _Optional[int] = ...) -> None: ...

class TrainSnapshot(_message.Message):
    __slots__ = ["behind_m", "challenge_at_ns", "facing", "first_antenna", "last_confirmed", "last_confirmed_gps_ns", "last_health", "last_mono_ns", "mono_ns", "nonces", "normals", "placed", "reached", "receivers", "refused_messages", "segment", "sequence", "stations", "stop", "superseded", "tie", "told", "trust", "trust_sequence", "unsolved", "valid_until_ns", "vouched", "vouching", "vouching_confirmed"]
    BEHIND_M_FIELD_NUMBER: _ClassVar[int]
    CHALLENGE_AT_NS_FIELD_NUMBER: _ClassVar[int]
    FACING_FIELD_NUMBER: _ClassVar[int]
    FIRST_ANTENNA_FIELD_NUMBER: _ClassVar[int]
    LAST_CONFIRMED_FIELD_NUMBER: _ClassVar[int]
    LAST_CONFIRMED_GPS_NS_FIELD_NUMBER: _ClassVar[int]
    LAST_HEALTH_FIELD_NUMBER: _ClassVar[int]
    LAST_MONO_NS_FIELD_NUMBER: _ClassVar[int]
    MONO_NS_FIELD_NUMBER: _ClassVar[int]
    NONCES_FIELD_NUMBER: _ClassVar[int]
    NORMALS_FIELD_NUMBER: _ClassVar[int]
    PLACED_FIELD_NUMBER: _ClassVar[int]
    REACHED_FIELD_NUMBER: _ClassVar[int]
    RECEIVERS_FIELD_NUMBER: _ClassVar[int]
    REFUSED_MESSAGES_FIELD_NUMBER: _ClassVar[int]
    SEGMENT_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    STATIONS_FIELD_NUMBER: _ClassVar[int]
    STOP_FIELD_NUMBER: _ClassVar[int]
    SUPERSEDED_FIELD_NUMBER: _ClassVar[int]
    TIE_FIELD_NUMBER: _ClassVar[int]
    TOLD_FIELD_NUMBER: _ClassVar[int]
    TRUST_FIELD_NUMBER: _ClassVar[int]
    TRUST_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    UNSOLVED_FIELD_NUMBER: _ClassVar[int]
    VALID_UNTIL_NS_FIELD_NUMBER: _ClassVar[int]
    VOUCHED_FIELD_NUMBER: _ClassVar[int]
    VOUCHING_CONFIRMED_FIELD_NUMBER: _ClassVar[int]
    VOUCHING_FIELD_NUMBER: _ClassVar[int]
    behind_m: float
    challenge_at_ns: int
    facing: int
    first_antenna: TrackPlace
    last_confirmed: TrackPlace
    last_confirmed_gps_ns: int
    last_health: LastHealth
    last_mono_ns: int
    mono_ns: int
    nonces: _containers.RepeatedCompositeFieldContainer[SentNonce]
    normals: int
    placed: bool
    reached: Reached
    receivers: Snapshot
    refused_messages: int
    segment: _containers.RepeatedScalarFieldContainer[int]
    sequence: int
    stations: _containers.RepeatedCompositeFieldContainer[StationMemory]
    stop: StopMemory
    superseded: _containers.RepeatedScalarFieldContainer[bytes]
    tie: ClockTie
    told: _containers.RepeatedCompositeFieldContainer[ToldEphemeris]
    trust: TrustState
    trust_sequence: int
    unsolved: int
    valid_until_ns: int
    vouched: _containers.RepeatedCompositeFieldContainer[Vouched]
    vouching: _containers.RepeatedScalarFieldContainer[str]
    vouching_confirmed: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, mono_ns: _Optional[int] = ..., receivers: _Optional[_Union[Snapshot, _Mapping]] = ..., told: _Optional[_Iterable[_Union[ToldEphemeris, _Mapping]]] = ..., segment: _Optional[_Iterable[int]] = ..., first_antenna: _Optional[_Union[TrackPlace, _Mapping]] = ..., facing: _Optional[int] = ..., unsolved: _Optional[int] = ..., reached: _Optional[_Union[Reached, _Mapping]] = ..., behind_m: _Optional[float] = ..., vouched: _Optional[_Iterable[_Union[Vouched, _Mapping]]] = ..., tie: _Optional[_Union[ClockTie, _Mapping]] = ..., last_health: _Optional[_Union[LastHealth, _Mapping]] = ..., superseded: _Optional[_Iterable[bytes]] = ..., trust: _Optional[_Union[TrustState, str]] = ..., normals: _Optional[int] = ..., valid_until_ns: _Optional[int] = ..., trust_sequence: _Optional[int] = ..., nonces: _Optional[_Iterable[_Union[SentNonce, _Mapping]]] = ..., challenge_at_ns: _Optional[int] = ..., last_mono_ns: _Optional[int] = ..., sequence: _Optional[int] = ..., refused_messages: _Optional[int] = ..., last_confirmed: _Optional[_Union[TrackPlace, _Mapping]] = ..., last_confirmed_gps_ns: _Optional[int] = ..., stations: _Optional[_Iterable[_Union[StationMemory, _Mapping]]] = ..., stop: _Optional[_Union[StopMemory, _Mapping]] = ..., vouching: _Optional[_Iterable[str]] = ..., vouching_confirmed: _Optional[_Iterable[str]] = ..., placed: bool = ...) -> None: ...

class TrainStarted(_message.Message):
    __slots__ = ["config_sha256", "gps_time_ns", "map_json", "mono_ns", "software", "train", "train_toml", "trusted_keys"]
    CONFIG_SHA256_FIELD_NUMBER: _ClassVar[int]
    GPS_TIME_NS_FIELD_NUMBER: _ClassVar[int]
    MAP_JSON_FIELD_NUMBER: _ClassVar[int]
    MONO_NS_FIELD_NUMBER: _ClassVar[int]
    SOFTWARE_FIELD_NUMBER: _ClassVar[int]
    TRAIN_FIELD_NUMBER: _ClassVar[int]
    TRAIN_TOML_FIELD_NUMBER: _ClassVar[int]
    TRUSTED_KEYS_FIELD_NUMBER: _ClassVar[int]
    config_sha256: str
    gps_time_ns: int
    map_json: str
    mono_ns: int
    software: str
    train: str
    train_toml: str
    trusted_keys: _containers.RepeatedCompositeFieldContainer[TrustedKey]
    def __init__(self, train: _Optional[str] = ..., software: _Optional[str] = ..., config_sha256: _Optional[str] = ..., train_toml: _Optional[str] = ..., map_json: _Optional[str] = ..., trusted_keys: _Optional[_Iterable[_Union[TrustedKey, _Mapping]]] = ..., gps_time_ns: _Optional[int] = ..., mono_ns: _Optional[int] = ...) -> None: ...

class TrustedKey(_message.Message):
    __slots__ = ["public_key", "site"]
    PUBLIC_KEY_FIELD_NUMBER: _ClassVar[int]
    SITE_FIELD_NUMBER: _ClassVar[int]
    public_key: bytes
    site: str
    def __init__(self, site: _Optional[str] = ..., public_key: _Optional[bytes] = ...) -> None: ...

class UnusedSatellite(_message.Message):
    __slots__ = ["signal", "why"]
    SIGNAL_FIELD_NUMBER: _ClassVar[int]
    WHY_FIELD_NUMBER: _ClassVar[int]
    signal: str
    why: str
    def __init__(self, signal: _Optional[str] = ..., why: _Optional[str] = ...) -> None: ...

class Vertex(_message.Message):
    __slots__ = ["east_m", "north_m", "receiver", "satellites", "unsolved", "up_m"]
    EAST_M_FIELD_NUMBER: _ClassVar[int]
    NORTH_M_FIELD_NUMBER: _ClassVar[int]
    RECEIVER_FIELD_NUMBER: _ClassVar[int]
    SATELLITES_FIELD_NUMBER: _ClassVar[int]
    UNSOLVED_FIELD_NUMBER: _ClassVar[int]
    UP_M_FIELD_NUMBER: _ClassVar[int]
    east_m: float
    north_m: float
    receiver: str
    satellites: int
    unsolved: Unsolved
    up_m: float
    def __init__(self, receiver: _Optional[str] = ..., east_m: _Optional[float] = ..., north_m: _Optional[float] = ..., up_m: _Optional[float] = ..., satellites: _Optional[int] = ..., unsolved: _Optional[_Union[Unsolved, str]] = ...) -> None: ...

class Vouched(_message.Message):
    __slots__ = ["ephemeris_crc32", "from_gps_ns", "signals", "to_gps_ns"]
    EPHEMERIS_CRC32_FIELD_NUMBER: _ClassVar[int]
    FROM_GPS_NS_FIELD_NUMBER: _ClassVar[int]
    SIGNALS_FIELD_NUMBER: _ClassVar[int]
    TO_GPS_NS_FIELD_NUMBER: _ClassVar[int]
    ephemeris_crc32: _containers.RepeatedScalarFieldContainer[int]
    from_gps_ns: int
    signals: _containers.RepeatedScalarFieldContainer[str]
    to_gps_ns: int
    def __init__(self, from_gps_ns: _Optional[int] = ..., to_gps_ns: _Optional[int] = ..., signals: _Optional[_Iterable[str]] = ..., ephemeris_crc32: _Optional[_Iterable[int]] = ...) -> None: ...

class State(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []

class Cause(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []

class Outcome(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []

class NavigationMessage(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []

class Unsolved(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []

class TrustState(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []

class StopState(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []

class PositionStatus(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []
