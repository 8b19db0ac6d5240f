"""Every decision is made twice: a second monitor gets the same events a little later, and must say the same.

What it is for: memory that flips a bit and code that depends on more than its input are found within an epoch, and the station ends. It
runs between epochs, when there is time.
"""

from collections.abc import Callable, Sequence

from integrity.config import SiteConfig
from integrity.events import Event
from integrity.outputs import HealthReport, Output
from integrity.station_monitor import StationMonitor

MOST_NOTED = 2000  # events, a minute of three receivers at 10 Hz: there has been no time for so long


class SecondLook:
    """Notes what was decided, and decides it again when there is time. Gives up, and says so, where there never is."""

    def __init__(self, site: SiteConfig, say: Callable[[str], None]) -> None:
        self._monitor = StationMonitor(site)
        self._say = say
        self._noted: list[tuple[Event, list[HealthReport]]] = []
        self._given_up = False

    def note(self, event: Event, outputs: Sequence[Output]) -> None:
        """What came of an event."""
        if len(self._noted) == MOST_NOTED:
            self._given_up = True
            self._noted.clear()
            self._say("this machine is too busy to decide everything twice: until the next start it decides once")
        if not self._given_up:
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
