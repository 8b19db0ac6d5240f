"""Every decision is made twice: a second monitor gets the same events a little later, and must say the same.

What it is for: memory that flips a bit and code that depends on more than its input are found within an epoch, and the station ends. What
it does besides: it runs shortly before the next epoch is due, and a processor that has just done the same work does it in half the time.
"""

from collections.abc import Sequence

from integrity.config import SiteConfig
from integrity.events import Event
from integrity.outputs import HealthReport, Output
from integrity.station_monitor import StationMonitor


class SecondLook:
    """Notes what was decided, and decides it again when there is time."""

    def __init__(self, site: SiteConfig) -> None:
        self._monitor = StationMonitor(site)
        self._noted: list[tuple[Event, list[HealthReport]]] = []

    def note(self, event: Event, outputs: Sequence[Output]) -> None:
        """What came of an event."""
        self._noted.append((event, _health(outputs)))

    def take(self) -> None:
        """Decide again what was noted. RuntimeError where it comes out differently: nothing may be published after that."""
        for event, health in self._noted:
            again = _health(self._monitor.feed((event,)))
            if again != health:
                raise RuntimeError(
                    f"decided twice, differently: {health}, then {again}: this machine's memory, or this program, is at fault"
                )
        self._noted.clear()


def _health(outputs: Sequence[Output]) -> list[HealthReport]:
    return [output for output in outputs if isinstance(output, HealthReport)]
