"""What a site has decided about itself: the part of the site file that the verdict depends on. Units are in the names."""

from dataclasses import dataclass
from typing import Literal

from integrity.gnss.signals import MONITORED_SYSTEMS

Rule = Literal["full", "triangle"]
SatelliteFaultPolicy = Literal["stop", "exclude"]
Protocol = Literal["ubx", "rtcm3"]  # of a receiver's bytes
HostClock = Literal["none", "ntp", "ptp", "gnss"]


@dataclass(frozen=True)
class ReceiverConfig:
    """A receiver at its surveyed point; `protocol` of its bytes; `model`, `supply`, `mast`, `switch` name what it may share with others."""

    name: str
    position_ecef_m: tuple[float, float, float]
    model: str | None = None
    supply: str | None = None
    mast: str | None = None
    switch: str | None = None
    protocol: Protocol = "ubx"


@dataclass(frozen=True)
class IntegrityConfig:
    """Promises and error models, as in the `[integrity]` table; every threshold follows from these (`limits.derive`)."""

    rule: Rule = "full"
    on_satellite_fault: SatelliteFaultPolicy = "stop"
    false_stops_per_year: float = 1.0
    false_exclusions_per_year: float = 1.0
    missed_detection: float = 1e-5
    tolerance_m: float | None = None
    sigma_common_m: float = 1.2
    sigma_differential_m: float = 0.5
    sigma_common_up_m: float = 2.4
    sigma_differential_up_m: float = 1.0
    sigma_range_m: float = 0.9
    sigma_range_low_m: float = 0.4
    sigma_range_differential_m: float = 0.25
    sigma_range_differential_low_m: float = 0.2
    correlation_common_s: float = 3000.0
    correlation_differential_s: float = 30.0
    systems: tuple[str, ...] = MONITORED_SYSTEMS  # by name, see `gnss.signals.SYSTEM_NAMES`
    elevation_mask_deg: float = 5.0
    recover_after_s: float = 30.0


@dataclass(frozen=True)
class SiteConfig:
    """A site: its receivers in the order of their names, its frame, its epoch interval, its promises."""

    site_id: str
    frame: str
    frame_epoch: float | None
    epoch_interval_ns: int
    host_clock: HostClock
    receivers: tuple[ReceiverConfig, ...]
    integrity: IntegrityConfig
    valid_for_ms: int
    config_sha256: str

    @property
    def receiver_names(self) -> tuple[str, ...]:
        """Names in the order of every receiver axis."""
        return tuple(r.name for r in self.receivers)

    @property
    def protocols(self) -> dict[str, Protocol]:
        """Of the receivers' bytes, by receiver."""
        return {r.name: r.protocol for r in self.receivers}
