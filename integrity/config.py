"""What a site has decided about itself: the part of the site file that the verdict depends on. Units are in the names."""

from collections.abc import Mapping
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
    frequencies: int = 1  # 1: of every satellite one signal; 2: pairs of signals that the ionosphere does not delay, nothing else
    elevation_mask_deg: float = 5.0
    recover_after_s: float = 30.0


# Error models of pairs, m, where a site with `frequencies = 2` states none of its own. Noise and multipath of a pair are 2.98 times those
# of GPS L1 and L2 (2.6 times of E1 and E5a, 3.5 times of B1I and B3I): weights of IS-GPS-200, 20.3.3.3.3.3, of two errors that are alike
# and independent. So what receivers do not share (`differential`) is three times that of one signal. What they share stays as it is: the
# ionosphere is gone, but the code biases that no message tells (C1C to C1W, some 0.3 m) come 2.5-fold. A range has both:
# sqrt(0.9^2 - 0.25^2 + (3 * 0.25)^2) = 1.15, and sqrt(0.4^2 - 0.2^2 + (3 * 0.2)^2) = 0.7.
SIGMAS_OF_PAIRS_M: Mapping[str, float] = {
    "sigma_common_m": IntegrityConfig.sigma_common_m,
    "sigma_differential_m": 1.5,
    "sigma_range_m": 1.15,
    "sigma_range_low_m": 0.7,
    "sigma_range_differential_m": 0.75,
    "sigma_range_differential_low_m": 0.6,
}
SIGMAS_OF_SIGNALS_M: Mapping[str, float] = {name: getattr(IntegrityConfig, name) for name in SIGMAS_OF_PAIRS_M}


@dataclass(frozen=True)
class SiteConfig:
    """A site: its receivers in the order of their names, its frame, its epoch interval, its promises.

    `map_sha256`: the editions of the track map on which it vouches; empty: whichever. It is said, and nothing is decided by it.
    """

    site_id: str
    frame: str
    frame_epoch: float | None
    epoch_interval_ns: int
    host_clock: HostClock
    receivers: tuple[ReceiverConfig, ...]
    integrity: IntegrityConfig
    valid_for_ms: int
    config_sha256: str
    map_sha256: tuple[str, ...] = ()

    @property
    def receiver_names(self) -> tuple[str, ...]:
        """Names in the order of every receiver axis."""
        return tuple(r.name for r in self.receivers)

    @property
    def protocols(self) -> dict[str, Protocol]:
        """Of the receivers' bytes, by receiver."""
        return {r.name: r.protocol for r in self.receivers}
