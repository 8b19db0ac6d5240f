"""All SBAS satellites that are heard, and the one of them whose corrections are used: those of two are never mixed.

Source: RTCA DO-229D, 2.1.1.3, A.4.4.11 and A.4.4.12 (where SBAS satellites stand).
"""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from integrity.gnss.frames import enu_axes, geodetic_from_ecef
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Floats
from integrity.gnss.sbas.grid import NEVER
from integrity.gnss.sbas.messages import SbasMessage
from integrity.gnss.sbas.store import MISSED_MESSAGES, SbasStore, State

NOBODY = 0


class SbasReceiver:
    """Takes messages in order of time. Of the SBAS satellites that send, are not in test mode and have told where they stand (types 9 and
    17), the highest one is taken, and held for as long as it is one of them."""

    def __init__(self, pos_ecef_m: Floats) -> None:
        self._stores: dict[int, SbasStore] = {}
        self._nobody = SbasStore(NOBODY)
        self._held: SbasStore | None = None
        self._pos_ecef_m = np.asarray(pos_ecef_m, dtype=np.float64)
        lat, lon, _ = geodetic_from_ecef(self._pos_ecef_m)
        self._up: Floats = enu_axes(lat, lon)[2]

    @property
    def refused(self) -> Counter[str]:
        """Messages that could not be used, by reason."""
        return sum((store.refused for store in self._stores.values()), Counter())

    def add(self, message: SbasMessage) -> None:
        """The next message."""
        if message.prn not in self._stores:
            self._stores[message.prn] = SbasStore(message.prn)
        self._stores[message.prn].add(message)

    def at(self, t_ns: int, rows: Sequence[int]) -> State:
        """What the satellite that is used says for these satellites (`SbasStore.at`); nothing at all where none is heard."""
        if self._held is None or not _serves(self._held, t_ns):
            heights = [(self._sine_of_elevation(store), -prn) for prn, store in self._stores.items() if _serves(store, t_ns)]
            known = [(sine, prn) for sine, prn in heights if sine is not None]
            self._held = self._stores[-max(known)[1]] if known else self._held
        return (self._held or self._nobody).at(t_ns, rows)

    def _sine_of_elevation(self, store: SbasStore) -> float | None:
        """None where it is not known; velocities do not matter for this."""
        head = store.head
        almanacs = (one for other in self._stores.values() for one in other.head.almanac if one.prn == head.prn)
        known = next((one.pos_ecef_m for one in almanacs), None)
        if head.geo is not None:
            known = head.geo.x_m, head.geo.y_m, head.geo.z_m
        if known is None:
            return None
        d = np.array(known) - self._pos_ecef_m
        return float((d * self._up).sum() / np.sqrt((d * d).sum()))


def _serves(store: SbasStore, t_ns: int) -> bool:
    head = store.head
    return head.last_ns != NEVER and t_ns >= head.blocked_until_ns and t_ns - head.last_ns <= (MISSED_MESSAGES + 1) * NS_PER_S
