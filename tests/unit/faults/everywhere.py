"""All signals of six systems at three receivers, once a second for 20 s, as measurements, as RXM-RAWX and as MSM7; and faults in them."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from integrity.config import SiteConfig
from integrity.events import Event, ObservationsReceived
from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.ephemeris.states import satellite_states
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Floats, ObservationRow
from integrity.reception import Reception
from recordings.faults import Fault, inject
from recordings.faults.kinds import Effect
from tests.unit.many_signals import CHANNELS, EPOCHS, as_msm, as_rawx, rows, sets_in_force
from tests.unit.streams import SITE, START_NS

EVENT_NS = START_NS + 2000 * NS_PER_S
FIRST_NS = EVENT_NS - EPOCHS // 2 * NS_PER_S
BEGIN, END = 5, 15  # epochs of every fault
MEASURED = rows(EVENT_NS)
RAWX = as_rawx(MEASURED)
MSM = as_msm(MEASURED)
RTCM_SITE = replace(SITE, receivers=tuple(replace(receiver, protocol="rtcm3") for receiver in SITE.receivers))
SETS = {eph.satellite: eph for eph in sets_in_force(EVENT_NS)}

# Carriers in hertz by system and band, as the interface documents have them; GLONASS of channel 0, and between channels.
HERTZ = {
    **dict.fromkeys(("G1", "E1", "J1", "S1"), 1_575_420_000.0),
    **dict.fromkeys(("G2", "J2"), 1_227_600_000.0),
    **dict.fromkeys(("G5", "E5", "J5"), 1_176_450_000.0),
    "E7": 1_207_140_000.0,
    "C2": 1_561_098_000.0,
    "C6": 1_268_520_000.0,
    "C7": 1_207_140_000.0,
}
GLONASS_HERTZ = {"R1": (1_602_000_000.0, 562_500.0), "R2": (1_246_000_000.0, 437_500.0)}

Rows = dict[tuple[str, int], ObservationRow]  # by receiver and epoch


def wavelength_m(signal: str) -> float:
    band = signal[0] + signal[4]
    first, step = GLONASS_HERTZ.get(band, (HERTZ.get(band, 0.0), 0.0))
    return SPEED_OF_LIGHT_MPS / (first + step * CHANNELS.get(signal[:3], 0))


def fault(effect: Effect, begin: float = BEGIN, end: float = END) -> Fault:
    return Fault(FIRST_NS + round(begin * NS_PER_S), FIRST_NS + round(end * NS_PER_S), effect)


def with_fault(events: Sequence[Event], effect: Effect, site: SiteConfig = SITE) -> tuple[Event, ...]:
    return inject(events, [fault(effect)], site)


def rows_of(events: Sequence[Event], site: SiteConfig = SITE) -> Rows:
    """What a station hears: by receiver and epoch, in seconds since the first."""
    reception = Reception(site.receiver_names, protocols=site.protocols)
    heard = [h for event in events for h in reception.take(event)]
    measured = [h.row for h in heard if isinstance(h, ObservationsReceived)]
    return {(row.receiver, round((row.receive_time_ns - FIRST_NS) / NS_PER_S)): row for row in measured}


Delta = dict[str, tuple[float, float, float]]
"""By signal: how much longer code and carrier are, m, and how much faster the Doppler says that the range grows, m/s."""


def delta(now: ObservationRow, was: ObservationRow) -> Delta:
    place = {signal: i for i, signal in enumerate(was.signals)}
    found = {}
    for i, signal in enumerate(now.signals):
        k, wavelength = place[signal], wavelength_m(signal)
        found[signal] = (
            float(now.pseudorange_m[i] - was.pseudorange_m[k]),
            float(now.carrier_cycles[i] - was.carrier_cycles[k]) * wavelength,
            float(was.doppler_hz[k] - now.doppler_hz[i]) * wavelength,
        )
    return found


WAS = rows_of(MEASURED)


def deltas(effect: Effect, receiver: str = "B") -> dict[int, Delta]:
    """What a fault does to measurements, by epoch; those of the others are checked to be the very same."""
    now = rows_of(with_fault(MEASURED, effect))
    assert all(now[key] is WAS[key] for key in WAS if not BEGIN <= key[1] < END)
    return {epoch: delta(now[receiver, epoch], WAS[receiver, epoch]) for epoch in range(BEGIN, END)}


def assert_only(found: Delta, struck: Callable[[str], bool]) -> None:
    """All signals that are struck have changed, no others, and there are some."""
    changed = {signal for signal, numbers in found.items() if any(numbers)}
    assert changed == {signal for signal in found if struck(signal)} != set()


def satellite_ecef_m(eph: Ephemeris, row: ObservationRow, signal: str, clock_m: float) -> Floats:
    """Where the satellite was at transmission, in ECEF at reception: to a millisecond's motion of its clock, a metre."""
    travel_s = (row.pseudorange_m[row.signals.index(signal)] - clock_m) / SPEED_OF_LIGHT_MPS
    sent_ns = row.receive_time_ns - round((travel_s + clock_m / SPEED_OF_LIGHT_MPS) * NS_PER_S)
    x, y, z = satellite_states([eph], np.array([[0]]), np.array([sent_ns])).pos_ecef_m[:, 0, 0]
    turn = 7.2921151467e-5 * travel_s
    return np.array([x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn), z])
