"""What receivers were told last of every satellite, and which sets may serve while some of these contradict each other.

A set that contradicts what another receiver was told is not used: who came first stays. As soon as two that agree stand against one, theirs
is used, and his is not. So one receiver that is fed false sets changes nothing for the station, as long as others hear the satellite; where
it was the first of all to be told of a satellite, its set serves until two others are.
"""

from collections.abc import Iterable
from dataclasses import replace

from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.monitors.navigation import message_of
from integrity.monitors.told import Dispute, dispute

_Source = tuple[str, str]  # satellite and message


class ToldSets:
    """The last set of each receiver, satellite and message, and what is disputed among them. All that is remembered are the sets: made
    again from them, it goes on as if never stopped. `most_change` as in `dispute`; None: nothing is compared."""

    def __init__(self, told: Iterable[tuple[str, Ephemeris]], most_change: float | None) -> None:
        self._most_change = most_change
        self._told: dict[_Source, dict[str, Ephemeris]] = {}
        for receiver, eph in told:
            if eph.implausibility() is None:  # no receiver tells others, but memories may be damaged
                self._told.setdefault(_source_of(eph), {})[receiver] = eph
        self._disputes: dict[_Source, Dispute] = {}
        for source in self._told:
            self._compare(source)

    @property
    def disputes(self) -> tuple[Dispute, ...]:
        """By satellite and message."""
        return tuple(self._disputes[source] for source in sorted(self._disputes))

    def tell(self, receiver: str, eph: Ephemeris) -> list[tuple[str, Ephemeris]]:
        """What may serve now that a receiver was told a set, and who was told it: mostly just that.

        That a satellite is not healthy is believed of anybody. Sets that two receivers stand for count as sent after what the odd one was
        told, which may have served before.
        """
        source = _source_of(eph)
        told = self._told.setdefault(source, {})
        told[receiver] = eph
        found = self._compare(source)
        if found is None or receiver not in found.receivers:
            return [(receiver, eph)]
        if found.odd is None or found.odd == receiver:
            return []
        after_ns = told[found.odd].transmission_ns + 1
        agreeing = ((r, told[r]) for r in found.receivers if r != found.odd)
        return [(r, replace(of, transmission_ns=max(of.transmission_ns, after_ns))) for r, of in agreeing]

    def latest_toe_ns(self, eph: Ephemeris) -> int:
        """The latest reference time of its satellite and message that receivers have told, this set's at least; the odd one's left out."""
        source = _source_of(eph)
        odd = self._disputes[source].odd if source in self._disputes else None
        return max([eph.toe_ns, *(of.toe_ns for receiver, of in self._told.get(source, {}).items() if receiver != odd)])

    def _compare(self, source: _Source) -> Dispute | None:
        found = None if self._most_change is None else dispute(self._told[source], self._most_change)
        if found is None:
            self._disputes.pop(source, None)
        else:
            self._disputes[source] = found
        return found


def _source_of(eph: Ephemeris) -> _Source:
    return eph.satellite, message_of(eph)
