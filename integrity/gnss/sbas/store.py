"""What the messages of one SBAS satellite have told so far, kept for as long as it may matter; `at` gives it for a time.

Corrections belong to satellites by their place in the PRN mask with the same IODP. Masks of two issues are kept, so that messages under
the old one still serve while the new one is being sent (A.4.4.2); what comes before its mask waits for it. Time-outs count from the
reception of a message (table A-25): they are applied where the state is used. Source: RTCA DO-229D, A.4.4.
"""

from collections import Counter, deque
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from integrity.gnss.ephemeris.broadcast import GeoEphemeris
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.sbas.contents import (
    Almanac,
    Content,
    Covariance,
    Covariances,
    Degradation,
    DoNotUse,
    Fast,
    FastDegradation,
    GeoAlmanac,
    Integrity,
    IonoDelays,
    IonoMask,
    LongTerm,
    Mixed,
    NetworkTime,
    PrnMask,
    Service,
)
from integrity.gnss.sbas.grid import NEVER, Grid, GridStore
from integrity.gnss.sbas.messages import BLOCK, SbasMessage
from integrity.gnss.sbas.reading import contents
from integrity.gnss.sbas.service import Services

SATELLITES = (
    *(f"G{n:02d}" for n in range(1, 38)),  # PRN mask numbers 1 to 37
    *(f"R{n:02d}" for n in range(1, 25)),  # 38 to 61: slots
    *(f"S{n:02d}" for n in range(20, 59)),  # 120 to 158
)
ROW_OF = {satellite: row for row, satellite in enumerate(SATELLITES)}
_ROW_OF_NUMBER = dict(enumerate((*range(37), *range(37, 61)), start=1)) | {120 + k: 61 + k for k in range(39)}

PA, NPA = 0, 1  # precision approach; en route to non-precision approach
# By degradation factor indicator, a, m/s2, and the time-outs of fast corrections for PA and NPA, s. Table A-8.
FACTOR_MPS2 = (
    *(0.0, 0.00005, 0.00009, 0.00012, 0.00015, 0.00020, 0.00030, 0.00045),
    *(0.00060, 0.00090, 0.00150, 0.00210, 0.00270, 0.00330, 0.00460, 0.00580),
)
FAST_TIMEOUT_S = (
    (120, 120, 102, 90, 90, 78, 66, 54, 42, 30, 30, 18, 18, 18, 12, 12),
    (180, 180, 153, 135, 135, 117, 99, 81, 63, 45, 45, 27, 27, 27, 18, 18),
)
NOT_MONITORED, DO_NOT_USE = 14, 15  # UDRE indicators
ALARM_IODF = 3  # not in the sequence 0, 1, 2: A.4.4.3
TEST_BLOCKS_NS = 60 * NS_PER_S  # after type 0. Table A-25
MISSED_MESSAGES = 4  # in a row: an alert, which is sent four times, may be among them
MOST_WAITING = 512  # messages: some five minutes, in which every mask is sent
KEPT_FAST = 40  # corrections of a satellite: 180 s of one every 5 s

# What is known of a satellite: two long-term corrections (the newest first), and of fast ones the pair for the rate, for PA and NPA.
_ROW = np.dtype(
    [
        ("mask_ns", "i8"),  # reception of the latest mask that has it
        ("prc_m", "f8"),
        ("of_ns", "i8"),  # t_of
        ("n_fast", "i8"),
        ("udrei", "i8"),
        ("udre_ns", "i8"),  # sent: the UDRE indicator in force
        ("u_ns", "i8"),  # t_u
        ("alarm", "?"),
        ("in_sequence", "?"),
        ("previous_m", "f8", (2,)),
        ("dt_s", "f8", (2,)),  # NaN: no pair
        ("factor", "i8"),
        ("factor_ns", "i8"),
        ("lt_ns", "i8", (2,)),  # sent
        ("iod", "i8", (2,)),
        ("velocity_code", "i8", (2,)),
        ("t0_ns", "i8", (2,)),
        ("d_pos", "f8", (2, 3)),
        ("d_vel", "f8", (2, 3)),
        ("daf0", "f8", (2,)),
        ("daf1", "f8", (2,)),
        ("cov_ns", "i8"),
        ("scale", "f8"),
        ("R", "f8", (10,)),
    ]
)
Rows = NDArray[Any]  # of _ROW


class Head(NamedTuple):
    """What holds for all satellites; times are those of transmission, NEVER where nothing has come. `I_fc_s`: for PA and NPA."""

    prn: int
    last_ns: int = NEVER
    blocked_until_ns: int = NEVER  # by type 0
    mask_ns: int = NEVER
    degradation: Degradation | None = None
    degradation_ns: int = NEVER
    t_lat_s: float = 0.0
    I_fc_s: tuple[float, float] = (FAST_TIMEOUT_S[PA][0], FAST_TIMEOUT_S[NPA][0])
    services: Services = Services()
    service_ns: int = NEVER
    covariance_ns: int = NEVER
    geo: GeoEphemeris | None = None
    almanac: tuple[GeoAlmanac, ...] = ()
    time: NetworkTime | None = None


class State(NamedTuple):
    """What is known at the GPS time `t_ns`; `rows` (S,) of `_ROW` for the satellites asked for."""

    t_ns: int
    head: Head
    rows: Rows
    grid: Grid


_Placed = Fast | FastDegradation | LongTerm | Covariance  # with IODP


class _Sent(NamedTuple):
    """One fast correction."""

    of_ns: int
    prc_m: float
    iodf: int


class SbasStore:
    """Takes the messages of one SBAS satellite, in order of time. `refused` counts what could not be used, by reason."""

    def __init__(self, prn: int) -> None:
        self.refused: Counter[str] = Counter()
        self._head = Head(prn)
        self._forget()

    def _forget(self) -> None:
        self._head = Head(self._head.prn, self._head.last_ns, self._head.blocked_until_ns)
        self._rows = _no_rows()
        self._fast: list[deque[_Sent]] = [deque(maxlen=KEPT_FAST) for _ in SATELLITES]
        self._masks: dict[int, tuple[int | None, ...]] = {}  # rows by IODP, the newest last
        self._waiting: deque[tuple[_Placed, int]] = deque(maxlen=MOST_WAITING)
        self._iodp_fast: int | None = None
        self._grid = GridStore()

    @property
    def head(self) -> Head:
        """What holds for all satellites."""
        return self._head

    def at(self, t_ns: int, rows: Sequence[int]) -> State:
        """What the messages added so far say, for satellites by `ROW_OF`."""
        return State(t_ns, self._head, self._rows[np.asarray(rows, dtype=np.intp)], self._grid.grid)

    def add(self, message: SbasMessage) -> None:
        """The next message; one that is not later than the last is refused."""
        last_ns = self._head.last_ns
        if message.prn != self._head.prn or message.sent_ns <= last_ns:
            self.refused["another satellite's, repeated or late"] += 1
            return
        if last_ns != NEVER and message.sent_ns - last_ns > MISSED_MESSAGES * NS_PER_S:
            self._rows["udre_ns"] = NEVER
        self._head = self._head._replace(last_ns=message.sent_ns)
        said = contents(message)
        if isinstance(said, str):
            self.refused[said] += 1
        else:
            self._take(said, message.sent_ns, message.received_ns)

    def _take(self, said: Content, sent_ns: int, received_ns: int) -> None:
        match said:
            case Fast() | FastDegradation():
                self._place(said, sent_ns)
            case Mixed():
                if said.fast is not None:
                    self._place(said.fast, sent_ns)
                for long_term in said.long_term:
                    self._place(long_term, sent_ns)
            case Covariances():
                for covariance in said.satellites:
                    self._place(covariance, sent_ns)
            case Integrity():
                self._add_integrity(said, sent_ns)
            case PrnMask():
                self._add_mask(said, sent_ns)
            case IonoDelays():
                self._grid.add_delays(said, sent_ns, received_ns)
            case IonoMask():
                self._grid.add_mask(said, received_ns)
            case DoNotUse():
                self._forget()
                self._head = self._head._replace(blocked_until_ns=received_ns + TEST_BLOCKS_NS)
            case Service():
                self._head = self._head._replace(services=self._head.services.with_message(said), service_ns=sent_ns)
            case Degradation():
                self._head = self._head._replace(degradation=said, degradation_ns=sent_ns)
            case GeoEphemeris():
                self._head = self._head._replace(geo=said)
            case Almanac():
                self._head = self._head._replace(almanac=said.satellites)
            case NetworkTime():
                self._head = self._head._replace(time=said)

    def _place(self, said: _Placed, sent_ns: int) -> None:
        """What belongs to places of a mask; it waits where the mask is not here."""
        if said.iodp not in self._masks:
            self._waiting.append((said, sent_ns))
            return
        match said:
            case Fast():
                self._add_fast(said, sent_ns)
            case FastDegradation():
                self._add_factors(said, sent_ns)
            case LongTerm():
                self._add_long_term(said, sent_ns)
            case Covariance():
                self._add_covariance(said, sent_ns)

    def _add_mask(self, mask: PrnMask, sent_ns: int) -> None:
        rows = tuple(_ROW_OF_NUMBER.get(number) for number in mask.numbers)
        self._masks.pop(mask.iodp, None)
        self._masks[mask.iodp] = rows
        for old in list(self._masks)[:-2]:
            del self._masks[old]
        self._rows["mask_ns"][[row for row in rows if row is not None]] = sent_ns
        self._head = self._head._replace(mask_ns=sent_ns)
        waited, self._waiting = self._waiting, deque(maxlen=MOST_WAITING)
        for said, its_sent_ns in waited:
            self._place(said, its_sent_ns)

    def _row(self, iodp: int, place: int) -> int | None:
        """Row of a place (from 1) of a mask; None where there is no satellite, or none whose corrections are kept."""
        rows = self._masks[iodp]
        return rows[place - 1] if place <= len(rows) else None

    def _add_fast(self, fast: Fast, sent_ns: int) -> None:
        self._iodp_fast = fast.iodp
        for k, (prc_m, udrei) in enumerate(zip(fast.prc_m, fast.udrei, strict=True)):
            row = self._row(fast.iodp, fast.first + k)
            if row is not None:
                self._correct(row, _Sent(sent_ns, prc_m, fast.iodf), udrei)

    def _correct(self, row: int, sent: _Sent, udrei: int) -> None:
        """A fast correction of a satellite. One that is not monitored or not to be used ends the series that its rate comes from."""
        history = self._fast[row]
        if udrei >= NOT_MONITORED:
            history.clear()
        else:
            history.append(sent)
        known = self._rows[row]
        known["prc_m"], known["of_ns"], known["n_fast"] = sent.prc_m, sent.of_ns, len(history)
        known["udrei"], known["udre_ns"], known["u_ns"] = udrei, sent.of_ns, sent.of_ns
        self._pair(row, alarmed=False)

    def _pair(self, row: int, alarmed: bool) -> None:
        """Choose the two corrections of the rate. A.4.4.3: the last two; in an alarm, those about half a time-out apart."""
        history, known = self._fast[row], self._rows[row]
        known["dt_s"] = np.nan
        if len(history) < 2:
            return
        current, previous = history[-1], history[-2]
        alarm = alarmed or ALARM_IODF in (current.iodf, previous.iodf)
        known["alarm"] = alarm
        known["in_sequence"] = (current.iodf - previous.iodf) % 3 == 1
        for mode, I_fc_s in enumerate(self._head.I_fc_s):
            if alarm:
                previous = _about(list(history)[:-1], current.of_ns - round(I_fc_s * NS_PER_S / 2))
            known["previous_m"][mode] = previous.prc_m
            known["dt_s"][mode] = (current.of_ns - previous.of_ns) / NS_PER_S

    def _add_integrity(self, integrity: Integrity, sent_ns: int) -> None:
        """A.4.4.4: an indicator counts where its IODF is that of the fast corrections in use, or 3, an alarm."""
        if self._iodp_fast is None or self._iodp_fast not in self._masks:
            self.refused["type 6 without fast corrections"] += 1
            return
        for k, udrei in enumerate(integrity.udrei):
            row = self._row(self._iodp_fast, k + 1)
            if row is None:
                continue
            iodf = integrity.iodf[k // BLOCK]
            history, known = self._fast[row], self._rows[row]
            if iodf == ALARM_IODF:
                known["udrei"], known["udre_ns"] = udrei, sent_ns
                self._pair(row, alarmed=True)
            elif history and history[-1].iodf == iodf:
                known["udrei"], known["udre_ns"], known["u_ns"] = udrei, sent_ns, sent_ns
            if udrei >= NOT_MONITORED and known["udrei"] == udrei:
                history.clear()
                known["n_fast"] = 0

    def _add_factors(self, factors: FastDegradation, sent_ns: int) -> None:
        rows = self._masks[factors.iodp]
        in_use = [(row, factor) for row, factor in zip(rows, factors.indicator, strict=False) if row is not None]
        for row, factor in in_use:
            self._rows[row]["factor"], self._rows[row]["factor_ns"] = factor, sent_ns
        I_fc_s = (self._shortest(PA, in_use), self._shortest(NPA, in_use))
        changed = I_fc_s != self._head.I_fc_s
        self._head = self._head._replace(t_lat_s=factors.t_lat_s, I_fc_s=I_fc_s)
        if changed:
            for row, _ in in_use:
                self._pair(row, alarmed=bool(self._rows[row]["alarm"]))

    @staticmethod
    def _shortest(mode: int, factors: Sequence[tuple[int, int]]) -> float:
        return float(min((FAST_TIMEOUT_S[mode][factor] for _, factor in factors), default=FAST_TIMEOUT_S[mode][0]))

    def _add_long_term(self, one: LongTerm, sent_ns: int) -> None:
        row = self._row(one.iodp, one.place)
        if row is None:
            return
        known = self._rows[row]
        if known["iod"][0] != one.iod:  # the one before is kept for as long as the new ephemeris has not been received
            for name in _LONG_TERM_FIELDS:
                known[name][1] = known[name][0]
        for name, value in zip(_LONG_TERM_FIELDS, _long_term_values(one, sent_ns), strict=True):
            known[name][0] = value

    def _add_covariance(self, one: Covariance, sent_ns: int) -> None:
        self._head = self._head._replace(covariance_ns=sent_ns)
        row = self._row(one.iodp, one.place)
        if row is not None:
            self._rows[row]["cov_ns"], self._rows[row]["scale"], self._rows[row]["R"] = sent_ns, one.scale, one.R


def _about(sent: Sequence[_Sent], t_ns: int) -> _Sent:
    """The one nearest to a time."""
    return min(sent, key=lambda one: abs(one.of_ns - t_ns))


_LONG_TERM_FIELDS = ("lt_ns", "iod", "velocity_code", "t0_ns", "d_pos", "d_vel", "daf0", "daf1")


def _long_term_values(one: LongTerm, sent_ns: int) -> tuple[Any, ...]:
    return sent_ns, one.iod, one.velocity_code, one.t0_ns, one.d_pos_ecef_m, one.d_vel_ecef_mps, one.daf0_s, one.daf1


def _no_rows() -> Rows:
    rows = np.zeros(len(SATELLITES), dtype=_ROW)
    for name in ("mask_ns", "of_ns", "udre_ns", "u_ns", "factor_ns", "lt_ns", "t0_ns", "cov_ns"):
        rows[name] = NEVER
    rows["iod"] = -1
    rows["dt_s"] = np.nan
    return rows
