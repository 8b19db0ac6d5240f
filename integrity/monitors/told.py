"""What receivers were told of one satellite, each against the others: they hear the same satellite, which sends all of them the same.

A receiver that is told another set than the others is being fed one, or its words are damaged beyond what parity finds. Two that agree
against one name it; of two that differ nobody can be named.
"""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import lru_cache
from itertools import combinations
from math import hypot
from operator import attrgetter
from typing import Literal, NamedTuple, get_args

import numpy as np

from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris.broadcast import Ephemeris, group_delays_s
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.navigation.collector import ARRIVES_WITHIN_NS
from integrity.gnss.observations import Floats
from integrity.gnss.positioning import URA_NOMINAL_M
from integrity.monitors.navigation import SAME_WITHIN_M, compared, is_usable, message_of

# By then every receiver has been told what one was told first: a set takes 30 s of words, twice that where one was lost, and casters
# come round within two minutes. Own choice.
FOLLOW_NS = 120 * NS_PER_S
Quantity = Literal["orbit", "clock", "group delay"]
EARTH_CENTRE = np.zeros(3)
MAY_CHANGE = ("transmission_ns", "healthy", "accuracy_m")  # of a set, which is sent many times
SAID = {kind: attrgetter(*(f.name for f in fields(kind) if f.name not in MAY_CHANGE)) for kind in get_args(Ephemeris)}


class Dispute(NamedTuple):
    """What receivers were told of a satellite by one message, and what cannot all be true: one of them may be fed a false one.

    `receivers`: all that contradict another, by name. `odd`: the one that all others contradict, which are two at least and agree; None
    where nobody can be named. `quantity`: what differs most, by `size_m`, between the two sets that are farthest apart, and their
    `issues`. It holds in epochs from `from_ns` on, by when all others have had the time to be told the same, until a set ends.
    """

    satellite: str
    message: str
    receivers: tuple[str, ...]
    odd: str | None
    quantity: Quantity
    size_m: float
    issues: tuple[int, ...]
    from_ns: int
    until_ns: int


def fed(disputes: Sequence[Dispute], receivers: Sequence[str], epoch_ns: int) -> Floats:
    """Of how many satellites each receiver was told otherwise than all others, at an epoch, (R,): one may be words that were damaged beyond
    what parity finds, of several it is being fed."""
    odd = {(of.odd, of.satellite) for of in disputes if of.from_ns <= epoch_ns <= of.until_ns}
    return np.array([sum(name == receiver for name, _ in odd) for receiver in receivers], dtype=np.float64)


class _Contradiction(NamedTuple):
    quantity: Quantity
    size_m: float
    since_ns: int


def dispute(told: Mapping[str, Ephemeris], most_change: float) -> Dispute | None:
    """What of the last sets that receivers (the keys) were told of one satellite, by one message, contradicts; None where nothing does.

    One receiver may be told a new set before another is, so what differs is judged as a change is: beyond `most_change` sigmas, no two
    sets are true. Two orbits or clocks of one issue never are; group delays, which Galileo changes under an issue, are judged by sigmas,
    and health is no matter of dispute. Only sets count that may serve when the last of them arrived, or later. Nothing else is asked, not
    even the time: whenever it is asked again, the answer is the same. (Words may say that they are sent some minutes later than they are.)
    """
    usable = {receiver: told[receiver] for receiver in sorted(told) if is_usable(told[receiver])}
    last_ns = max((eph.transmission_ns for eph in usable.values()), default=0)
    current = {receiver: eph for receiver, eph in usable.items() if last_ns - ARRIVES_WITHIN_NS <= _end_ns(eph)}
    alike: dict[tuple[object, ...], list[Ephemeris]] = {}
    for eph in current.values():
        alike.setdefault(_says(eph), []).append(eph)
    if len(alike) < 2:
        return None
    first = {says: min(sets, key=_sent) for says, sets in alike.items()}
    of_each = {receiver: first[_says(eph)] for receiver, eph in current.items()}
    pairs = list(combinations(current, 2))
    found = {(a, b): _contradiction(of_each[a], of_each[b], most_change) for a, b in pairs}
    contrary = {pair: of for pair, of in found.items() if of is not None}
    if not contrary:
        return None
    receivers = tuple(r for r in current if any(r in pair for pair in contrary))
    alone = [r for r in receivers if len(current) > 2 and all((r in pair) == (pair in contrary) for pair in pairs)]
    (a, b), widest = max(contrary.items(), key=lambda item: item[1].size_m)
    return Dispute(
        *(current[a].satellite, message_of(current[a]), receivers),
        odd=alone[0] if alone else None,
        quantity=widest.quantity,
        size_m=widest.size_m,
        issues=tuple(sorted({current[a].issue, current[b].issue})),
        from_ns=max(of.since_ns for of in contrary.values()) + FOLLOW_NS,
        until_ns=min(_end_ns(current[r]) for r in receivers),
    )


@lru_cache(maxsize=64)
def _contradiction(a: Ephemeris, b: Ephemeris, most_change: float) -> _Contradiction | None:
    """How two sets of one satellite exclude each other from when both may be used on, as the centre of the Earth sees them; None where
    they do not. The order of the two makes no difference."""
    since_ns = max(max(eph.transmission_ns, eph.toe_ns - round(eph.fit_half_s * NS_PER_S)) for eph in (a, b))
    until_ns = min(_end_ns(a), _end_ns(b))
    if a is b or since_ns - ARRIVES_WITHIN_NS > until_ns:
        return None
    apart = compared([a], [b], min(since_ns, until_ns), EARTH_CENTRE)
    orbit_m, clock_m, delay_m = float(apart.apart_m[0]), abs(float(apart.range_m[0])), _delays_apart_m(a, b)
    sigma_m = hypot(*(max(eph.accuracy_m or 0.0, URA_NOMINAL_M) for eph in (a, b)))
    if apart.change[0] <= most_change and apart.reissued_m[0] <= SAME_WITHIN_M and delay_m <= most_change * sigma_m:
        return None
    if delay_m > max(orbit_m, clock_m):
        return _Contradiction("group delay", delay_m, since_ns)
    return _Contradiction("orbit", orbit_m, since_ns) if orbit_m >= clock_m else _Contradiction("clock", clock_m, since_ns)


def _says(eph: Ephemeris) -> tuple[object, ...]:
    """What a set says of orbit and clock."""
    said: tuple[object, ...] = SAID[type(eph)](eph)
    return said


def _sent(eph: Ephemeris) -> tuple[int, float]:
    return eph.transmission_ns, eph.accuracy_m or 0.0


def _delays_apart_m(a: Ephemeris, b: Ephemeris) -> float:
    """The largest difference of the delays that both sets tell."""
    delays = zip(group_delays_s(a), group_delays_s(b), strict=True)
    return SPEED_OF_LIGHT_MPS * max(abs(x - y) for x, y in delays if x is not None and y is not None)


def _end_ns(eph: Ephemeris) -> int:
    return eph.toe_ns + round(eph.fit_half_s * NS_PER_S)
