"""Navigation words, and RTCM ephemerides, of a satellite with a displaced orbit, or a clock that is off, in them.

LNAV of GPS and QZSS, I/NAV and F/NAV of Galileo, D1 and D2 of BeiDou, GLONASS; RTCM 1019, 1020, 1042, 1044, 1045 and 1046. The orbit's
parameters and the issue change, and parity or CRC with them; everything else in a message stays, its time above all. Messages that no
decision comes from (CNAV, the position of SBAS satellites in their message 9) stay as they are.
"""

import math
import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache

from integrity.errors import ConfigError
from integrity.gnss.ephemeris.broadcast import Ephemeris, KeplerEphemeris
from integrity.gnss.navigation.bits import Layout
from integrity.gnss.navigation.kinds import kind_of
from integrity.gnss.rtcm.navigation import ephemeris_of
from integrity.gnss.rtcm.navigation_tables import TABLES
from integrity.gnss.ubx.sfrbx import HEADER_BYTES, decode_sfrbx
from recordings.faults.kinds import WrongEphemeris
from recordings.faults.orbits import ISSUES, wrong_orbit
from recordings.faults.pages import begun_ns, page_of, replaced, words_of
from recordings.faults.received import FrameAt, WordsAt
from recordings.faults.scenario import Fault
from recordings.faults.truth import Truth

ORBIT = ("sqrt_a", "delta_n", "m0", "i0", "omega0", "omega", "x_m", "y_m", "z_m", "vx_mps", "vy_mps", "vz_mps")
CLOCK = ("af0", "tau_n_s")  # of these and the orbit's, those that a fault has changed are sent otherwise
TURNS = ("m0", "omega0", "omega")  # angles that are sent between -pi and pi
ISSUE_FIELDS = ("issue", "iodc", "iode", "aode")


def wrong_words(fault: Fault, effect: WrongEphemeris, truth: Truth, words: Sequence[WordsAt]) -> Iterator[tuple[FrameAt, bytes]]:
    """The frames whose words began while the fault lasts, with the payload that they have then; RTCM messages that came then.

    Words of a set that never becomes complete in the recording stay: nobody can say where its orbit would be. ConfigError where the
    displaced orbit is none, or a message has no room for it.
    """
    sets = _Sets(fault, effect, truth)
    for frame, near_ns in words:
        if frame.begin < 0 or near_ns is None:
            continue
        payload = _wrong_message(sets, frame, near_ns) if frame.protocol == "rtcm3" else _wrong_sfrbx(sets, frame, near_ns)
        if payload is not None:
            yield frame, payload


class _Sets:
    """The sets of the satellite that receivers were told of in the recording, and each of them displaced."""

    def __init__(self, fault: Fault, effect: WrongEphemeris, truth: Truth) -> None:
        self.fault, self.satellite = fault, effect.satellite
        self._true = [eph for eph in truth.store.ephemerides if eph.satellite == effect.satellite]
        self._frames: dict[tuple[str, int], int] = {}
        self.displaced: Callable[[Ephemeris], Ephemeris] = cache(
            lambda true: wrong_orbit(fault, effect, true, max(fault.start_ns, true.transmission_ns))
        )

    def of_issue(self, message: str, issue: int, near_ns: int) -> Ephemeris | None:
        """The set of an issue nearest to a time. Nobody is told of F/NAV's sets where I/NAV is heard: their orbits are the same."""
        same = [eph for eph in self._true if isinstance(eph, KeplerEphemeris) and eph.issue == issue]
        of_message = [eph for eph in same if eph.message == message] or (same if message == "FNAV" else [])
        return min(of_message, key=lambda eph: (abs(eph.transmission_ns - near_ns), eph.transmission_ns), default=None)

    def in_force(self, begun: int) -> Ephemeris | None:
        """The set that the last frame, or this one, began to send; the first one for frames before it."""
        in_order = sorted(self._true, key=lambda eph: eph.transmission_ns)
        sent = [eph for eph in in_order if eph.transmission_ns <= begun]
        return sent[-1] if sent else in_order[0] if in_order else None

    def first_told(self, told: Ephemeris) -> Ephemeris | None:
        """The set that a message repeats."""
        same = [eph for eph in self._true if replace(eph, transmission_ns=told.transmission_ns) == told]
        return min(same, key=lambda eph: eph.transmission_ns, default=None)

    def frame_begun_ns(self, frame: FrameAt, common: int | None, begun: int) -> int:
        """All strings of a frame of GLONASS began with the first of them that came, however late they were passed on."""
        return begun if common is None else self._frames.setdefault((frame.receiver, common), begun)


def _wrong_sfrbx(sets: _Sets, frame: FrameAt, near_ns: int) -> bytes | None:
    said = decode_sfrbx(frame.payload)
    kind = None if said is None or said.satellite != sets.satellite else kind_of(said.satellite, said.signal)
    data = None if kind is None or said is None else kind.data_of(said)
    if said is None or kind is None or data is None:
        return None
    number = kind.number_of(data)
    page = page_of(kind, number, data)
    if page is None:
        return None
    begun = begun_ns(kind, number, page, near_ns)
    if kind.name == "GLONASS":
        begun = sets.frame_begun_ns(frame, kind.common_of(number, data), begun)
    if not sets.fault.covers(begun):
        return None
    issue = page.issue
    true = sets.in_force(begun) if issue is None else sets.of_issue(kind.name, issue % ISSUES[said.satellite[0]], near_ns)
    if true is None:
        return None
    bits = _with_orbit(sets, page.layout, page.bits, true)
    words = words_of(kind, page, bits, said.words)
    return frame.payload[:HEADER_BYTES] + struct.pack(f"<{len(words)}I", *words)


def _wrong_message(sets: _Sets, frame: FrameAt, near_ns: int) -> bytes | None:
    """An RTCM message: the table in front, what stands behind it stays."""
    told = ephemeris_of(frame.payload, near_ns, near_ns)
    if told is None or told.satellite != sets.satellite or not sets.fault.covers(near_ns):
        return None
    true = sets.first_told(told)
    if true is None:
        return None
    table, size = TABLES[frame.kind[0]], len(frame.payload)
    whole, behind = int.from_bytes(frame.payload, "big"), 8 * size - table.bits
    bits = _with_orbit(sets, table, whole >> behind, true)
    return (bits << behind | whole & (1 << behind) - 1).to_bytes(size, "big")


def _with_orbit(sets: _Sets, layout: Layout, bits: int, true: Ephemeris) -> int:
    """A message of a true set, or a page of it, as one of the wrong set."""
    wrong = sets.displaced(true)
    values: dict[str, float] = {}
    if isinstance(true, KeplerEphemeris) and isinstance(wrong, KeplerEphemeris):
        issues = ISSUES[true.satellite[0]]
        sent = {name: layout.integer(bits, name) for name in ISSUE_FIELDS if name in layout.fields}
        values |= {name: issue - issue % issues + wrong.issue for name, issue in sent.items()}
    for name in (*ORBIT, *CLOCK):
        value = getattr(wrong, name, None)
        if name in layout.fields and value is not None and value != getattr(true, name):
            values[name] = math.remainder(value, math.tau) if name in TURNS else value
    try:
        return replaced(layout, bits, values)
    except ValueError as error:
        raise ConfigError(f"{sets.fault}: {sets.satellite} cannot send the orbit: {error}; make the offset smaller") from None
