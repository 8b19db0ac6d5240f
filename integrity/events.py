"""What goes into a `StationMonitor`. Every event carries `mono_ns`, the host's monotonic clock when it arrived."""

from dataclasses import dataclass

from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris import Ephemeris
from integrity.gnss.observations import ObservationRow


@dataclass(frozen=True)
class ObservationsReceived:
    """One receiver's measurements at one time."""

    mono_ns: int
    row: ObservationRow


@dataclass(frozen=True)
class EphemerisReceived:
    """A broadcast ephemeris, usable from here on."""

    mono_ns: int
    ephemeris: Ephemeris


@dataclass(frozen=True)
class IonosphereReceived:
    """Broadcast ionospheric coefficients, used from the next epoch on."""

    mono_ns: int
    klobuchar: Klobuchar


@dataclass(frozen=True)
class Tick:
    """Time passes: the only clock that the monitor has. `utc_uncertainty_ns` is None where nobody vouches for `utc_ns`."""

    mono_ns: int
    utc_ns: int
    utc_uncertainty_ns: int | None


Event = ObservationsReceived | EphemerisReceived | IonosphereReceived | Tick
