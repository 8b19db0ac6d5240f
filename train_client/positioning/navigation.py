"""What the antennas of one train were told by satellites, compared before anything is solved with it [000 4.4]; section 1.16.

A set is taken once every antenna has told it alike. What only some have told is not known; where two tell different sets under one
issue and reference time, the satellite is mismatched, until all antennas agree on that set again or on a later one.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.gps_time import NS_PER_S

Told = tuple[str, Ephemeris]
"""An antenna and what it told."""


class NavigationAgreement:
    """Compares; remembers of each antenna what it told last under each satellite, reference time and issue."""

    def __init__(self, antennas: Sequence[str], memory: Iterable[Told] = ()) -> None:
        self.antennas = tuple(antennas)
        self._sets: dict[str, dict[tuple[int, int], dict[str, Ephemeris]]] = {}
        self._mismatched: set[str] = set()
        for antenna, ephemeris in memory:
            self._keep(antenna, ephemeris)

    def told(self, antenna: str, ephemeris: Ephemeris) -> list[Ephemeris]:
        """Take what an antenna tells; returns the set that all antennas have told alike from now on, if there is one.

        Of their copies it is the one transmitted last. ValueError for an antenna that is not one of the train's.
        """
        if antenna not in self.antennas:
            raise ValueError(f"antenna {antenna!r} told {ephemeris.satellite}'s navigation message: expected one of {self.antennas}")
        before = self._agreed(ephemeris)
        self._keep(antenna, ephemeris)
        agreed = self._agreed(ephemeris)
        if agreed is None or (before is not None and _content(before) == _content(agreed)):
            return []
        of_satellite = self._sets[ephemeris.satellite]
        self._sets[ephemeris.satellite] = {key: sets for key, sets in of_satellite.items() if key[0] >= ephemeris.toe_ns}
        self._compare(ephemeris.satellite)
        return [agreed]

    @property
    def mismatched(self) -> tuple[str, ...]:
        """Satellites of which antennas tell different things: not to be used."""
        return tuple(sorted(self._mismatched))

    def forget_before(self, gps_ns: int) -> None:
        """Drop what no epoch at or after `gps_ns` can use."""
        kept = [told for told in self.memory() if told[1].toe_ns + told[1].fit_half_s * NS_PER_S >= gps_ns]
        self._sets, self._mismatched = {}, set()
        for antenna, ephemeris in kept:
            self._keep(antenna, ephemeris)

    def memory(self) -> tuple[Told, ...]:
        """Everything remembered, as values: what another one starts from."""
        return tuple(told for by_key in self._sets.values() for sets in by_key.values() for told in sets.items())

    def _keep(self, antenna: str, ephemeris: Ephemeris) -> None:
        by_key = self._sets.setdefault(ephemeris.satellite, {})
        by_key.setdefault((ephemeris.toe_ns, ephemeris.issue), {})[antenna] = ephemeris
        self._compare(ephemeris.satellite)

    def _compare(self, satellite: str) -> None:
        """Remember whether the antennas tell different things of a satellite."""
        differ = any(len(_contents(sets)) > 1 for sets in self._sets[satellite].values())
        (self._mismatched.add if differ else self._mismatched.discard)(satellite)

    def _agreed(self, like: Ephemeris) -> Ephemeris | None:
        """The set under the same satellite, reference time and issue that all antennas have told alike, or None."""
        sets = self._sets.get(like.satellite, {}).get((like.toe_ns, like.issue), {})
        if len(sets) < len(self.antennas) or len(_contents(sets)) > 1:
            return None
        return max(sets.values(), key=lambda eph: eph.transmission_ns)


def _content(ephemeris: Ephemeris) -> Ephemeris:
    """All but the time of transmission."""
    return replace(ephemeris, transmission_ns=0)


def _contents(sets: dict[str, Ephemeris]) -> set[Ephemeris]:
    return {_content(ephemeris) for ephemeris in sets.values()}
