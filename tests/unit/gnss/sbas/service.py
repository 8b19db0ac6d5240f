"""A whole SBAS made up: GPS satellites that do not exist, and messages with everything that a receiver at SITE needs of them."""

from collections.abc import Iterable, Sequence
from functools import lru_cache

import numpy as np

from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.sbas.airborne import AVIATION, NoiseModel
from integrity.gnss.sbas.corrections import Corrections, Reason, correct, rows_of
from integrity.gnss.sbas.grid import igps_of
from integrity.gnss.sbas.messages import SbasMessage
from integrity.gnss.sbas.store import PA, SbasStore
from recordings.simulate.constellation import constellation
from tests.unit.gnss.sbas import sent
from tests.unit.gnss.sbas.sent import PRN, SITE, T0_NS, at

S = 1_000_000_000
HOUR_NS = 3600 * S
MASK_RAD = np.deg2rad(5.0)
UDREI, FACTOR, GIVEI = 4, 14, 2
START_S = 60  # by then everything has come
SETTLED = sent.degradation(RSS_UDRE=1, C_ltc_v0=0.0)


@lru_cache(maxsize=1)
def gps() -> tuple[KeplerEphemeris, ...]:
    """The sets that are transmitted around T0_NS."""
    return tuple(
        e for e in constellation(5, T0_NS - HOUR_NS, T0_NS + HOUR_NS) if e.satellite[0] == "G" and e.toe_ns >= T0_NS - HOUR_NS // 2
    )


def issue_of(satellite: str) -> int:
    return next(e.issue for e in gps() if e.satellite == satellite and e.transmission_ns <= T0_NS)


def number(satellite: str) -> int:
    return int(satellite[1:])


@lru_cache(maxsize=1)
def slow() -> tuple[int, ...]:
    """Messages that serve for minutes: mask, degradation, long-term corrections, ionosphere. Places are satellite numbers."""
    satellites = sorted({e.satellite for e in gps() if e.transmission_ns <= T0_NS})
    grid = [sent.iono_mask(band, range(1, 202 if band == 7 else 201), bands=2) for band in (7, 8)]
    grid += [
        sent.iono_delays(band, block, [(20, GIVEI)] * min(15, len(igps_of(band)) - 15 * block)) for band in (7, 8) for block in range(14)
    ]
    return (
        sent.mask(range(1, 33)),
        SETTLED,
        sent.factors(FACTOR, t_lat_s=1),
        *(sent.still(number(s), issue_of(s), dx_m=1.0, daf0_s=2.0**-31) for s in satellites),
        *grid,
    )


def fast_round(second: float, iodf: int, udrei: int = UDREI) -> list[SbasMessage]:
    """Types 2, 3 and 4, a second apart."""
    return [at(second + k, sent.fast([8] * 13, [udrei] * 13, kind=2 + k, iodf=iodf)) for k in range(3)]


def service(*more: tuple[float, int]) -> list[SbasMessage]:
    """Everything, in its order, until START_S, and some more, relative to that: the slow messages end at -1 s, fast ones at -6 and 0 s."""
    first = START_S - 10 - len(slow())
    messages = [at(first + k, bits) for k, bits in enumerate(slow())]
    messages += fast_round(START_S - 8, 0) + fast_round(START_S - 2, 1)
    return messages + [at(START_S + second, bits) for second, bits in more]


def store_of(messages: Iterable[SbasMessage]) -> SbasStore:
    store = SbasStore(PRN)
    for message in messages:
        store.add(message)
    return store


def corrected(
    messages: Iterable[SbasMessage],
    seconds: Sequence[float] = (2.0,),
    mode: int = PA,
    ephemerides: Iterable[KeplerEphemeris] | None = None,
    klobuchar: Klobuchar | None = None,
    noise: NoiseModel = AVIATION,
) -> Corrections:
    """At SITE, so many seconds after START_S, of a store that has heard all messages."""
    sets = gps() if ephemerides is None else tuple(ephemerides)
    satellites = sorted({e.satellite for e in gps()})
    store, rows = store_of(messages), rows_of(satellites)
    states = [store.at(T0_NS + START_S * S + round(s * S), rows) for s in seconds]
    return correct(states, satellites, EphemerisStore(sets), np.array(SITE), mode, MASK_RAD, noise, klobuchar)


def reasons(c: Corrections, epoch: int = 0) -> set[Reason]:
    """Of the satellites in view."""
    return {Reason(int(why)) for why in c.why[epoch] if why not in (Reason.BELOW_MASK, Reason.NO_ORBIT)}
