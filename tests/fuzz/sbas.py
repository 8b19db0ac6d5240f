"""SBAS: messages of every type, with the CRC redone over damaged contents, through the store to protection levels; and files of them."""

import tempfile
from collections import Counter
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from random import Random

import numpy as np

from integrity.errors import DecodeError
from integrity.gnss.ephemeris.broadcast import GeoEphemeris
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS, civil_from_days
from integrity.gnss.navigation.bits import Layout
from integrity.gnss.sbas import contents as c
from integrity.gnss.sbas import messages as m
from integrity.gnss.sbas.airborne import AVIATION
from integrity.gnss.sbas.corrections import correct, rows_of
from integrity.gnss.sbas.messages import FRAME_BITS, SbasMessage, frame_of, message_of
from integrity.gnss.sbas.protection import protection
from integrity.gnss.sbas.reading import contents
from integrity.gnss.sbas.receiver import SbasReceiver
from integrity.gnss.sbas.store import NPA, PA
from recordings.sbas_files import read_sbas
from recordings.simulate.constellation import IONOSPHERE
from tests.fuzz import bounds
from tests.fuzz.mutations import bits_flipped, damaged, random_message, with_extremes
from tests.fuzz.target import Piece, Target
from tests.unit.gnss.sbas import sent
from tests.unit.gnss.sbas.sent import PRN, SITE, T0_NS
from tests.unit.gnss.sbas.service import MASK_RAD, fast_round, gps, slow

FRAME_BYTES = 32  # 250 bits and six that are zero
PADDING_BITS = 8 * FRAME_BYTES - FRAME_BITS
KEPT = ("preamble", "kind")
LAYOUTS: dict[int, Layout] = {
    0: m.FAST_LAYOUT,
    1: m.MASK_LAYOUT,
    **dict.fromkeys((2, 3, 4, 5), m.FAST_LAYOUT),
    6: m.INTEGRITY_LAYOUT,
    7: m.FAST_DEGRADATION_LAYOUT,
    9: m.GEO_LAYOUT,
    10: m.DEGRADATION_LAYOUT,
    12: m.TIME_LAYOUT,
    17: m.ALMANAC_LAYOUT,
    18: m.IONO_MASK_LAYOUT,
    24: m.MIXED_LAYOUT,
    25: m.LONG_TERM_LAYOUT,
    26: m.IONO_DELAY_LAYOUT,
    27: m.SERVICE_LAYOUT,
    28: m.COVARIANCE_LAYOUT,
}
# Fields that hold several of one kind: where a satellite, a half or a point begins in them.
PARTS = {
    17: ("satellites", m.ALMANAC_OF_ONE),
    25: ("half_1", m.STILL_LAYOUT),
    24: ("half", m.MOVING_LAYOUT),
    28: ("satellites", m.COVARIANCE_OF_ONE),
}


def frame_bytes(bits: int) -> bytes:
    return (frame_of(bits) << PADDING_BITS).to_bytes(FRAME_BYTES, "big")


@cache
def whole_service() -> list[bytes]:
    """What every satellite sends, in its order."""
    return [frame_bytes(bits) for bits in (sent.geo(), *slow())]


@cache
def more() -> list[bytes]:
    """What some send: with some of it, corrections need more than before, or are fewer."""
    found = [sent.service(3, 9, [(20, 100, 60, 160, 1)]), sent.covariance(5, 2, E11=100, E22=80, E12=-5)]
    found += [sent.moving(4, 1, 3820, dx_m=1.0, dvx_mps=0.01), sent.mixed([1] * 6, [5] * 6, block=1, iodf=1, half=0)]
    found += [sent.message(LAYOUTS[kind], kind, {}) for kind in (12, 17)] + [sent.message(m.FAST_LAYOUT, kind, {}) for kind in (62, 63)]
    return [frame_bytes(bits) for bits in (*found, sent.integrity([4] * 51))]


def sound(rng: Random) -> list[bytes]:
    """The whole service, with fast corrections between, every six seconds."""
    some, often = rng.sample(more(), rng.randint(0, 4)), whole_service()[:4]
    fast = [[frame_bytes(one.bits) for one in fast_round(0, k)] for k in range(3)]
    found = []
    for k, frame in enumerate(2 * whole_service()):
        if k % 3 == 0:
            found += fast[k // 3 % 3]
        found += [frame, *rng.choices([*often, *some], k=rng.choice((0, 0, 1)))]
    return found + fast[0] + fast[1]


def touch(rng: Random, frame: bytes) -> bytes:
    """Damage that the CRC finds, or damage under a right one."""
    what = rng.randrange(8)
    if what == 0:
        return damaged(rng, frame)
    if what == 1:
        return bits_flipped(rng, frame)
    bits = int.from_bytes(frame, "big") >> PADDING_BITS + m.CRC_BITS
    if what == 2:
        return frame_bytes(bits ^ 1 << rng.randrange(m.TYPE_AT + 6))
    if what == 3:
        return frame_bytes(rng.choice(m.PREAMBLES) << 218 | rng.choice(list(LAYOUTS)) << m.TYPE_AT | rng.getrandbits(m.TYPE_AT))
    layout = LAYOUTS.get(bits >> m.TYPE_AT & 0x3F)
    if layout is None:
        return frame_bytes(bits ^ rng.getrandbits(m.TYPE_AT))
    return frame_bytes(_with_other_parts(rng, layout, bits) if what == 4 else with_extremes(rng, layout, bits, KEPT))


def _with_other_parts(rng: Random, layout: Layout, bits: int) -> int:
    kind = bits >> m.TYPE_AT & 0x3F
    if kind not in PARTS:
        return random_message(rng, layout, (*KEPT, *[name for name in ("iodp", "iodi", "band") if name in layout.fields]), bits)
    name, part = PARTS[kind]
    one = with_extremes(rng, part, rng.getrandbits(part.bits))
    n = layout.fields[name].bits // part.bits
    every = m.joined([one if rng.random() < 0.5 else rng.getrandbits(part.bits) for _ in range(n)], part.bits)
    return bits & ~layout.mask(name) | layout.message({name: every})


def examine(pieces: Sequence[Piece], rng: Random) -> Counter[str]:
    """Two receivers of the same messages, one of which is asked now and then; protection levels at times; files of the messages."""
    receiver, asked, told = SbasReceiver(np.array(SITE)), SbasReceiver(np.array(SITE)), Counter[str]()
    now_ns, messages, calm = T0_NS, list[SbasMessage](), rng.random() < 0.7
    satellites = sorted({eph.satellite for eph in gps()})
    rows = rows_of(satellites)
    for frame, untouched in pieces:
        bits = message_of(int.from_bytes(frame[:FRAME_BYTES].ljust(FRAME_BYTES, b"\0"), "big") >> PADDING_BITS)
        assert isinstance(bits, int) or not untouched, f"a frame that nobody touched: {bits}"
        now_ns += NS_PER_S if calm else rng.choice((NS_PER_S,) * 300 + (0, -NS_PER_S, 3 * NS_PER_S, 61 * NS_PER_S, WEEK_NS // 2))
        if isinstance(bits, str):
            told["refused frames"] += 1
            continue
        message = SbasMessage(PRN if rng.random() < 0.95 else PRN - 8, now_ns, bits)
        messages.append(message)
        _assert_in_range(message, told)
        receiver.add(message)
        asked.add(message)
        if rng.random() < 0.03:
            asked.at(now_ns + 2 * NS_PER_S, rows)
            _assert_levels(receiver, now_ns, satellites, rng, told)
    _assert_levels(receiver, now_ns, satellites, rng, told)
    assert len(receiver.refused) <= 20, receiver.refused
    if rng.random() < 0.3:
        _assert_files(messages, rng, told)
    return told


def _assert_in_range(message: SbasMessage, told: Counter[str]) -> None:
    said = contents(message)
    told[type(said).__name__] += 1
    match said:
        case c.PrnMask():
            assert len(said.numbers) <= 51 and list(said.numbers) == sorted(set(said.numbers) & set(range(1, 211)))
        case c.Fast():
            _assert_fast(said)
        case c.Mixed():
            for one in said.long_term:
                assert 1 <= one.place <= 51 and max(map(abs, one.d_pos_ecef_m)) <= 128.0 and abs(one.daf0_s) <= 2.0**-20
                assert max(map(abs, one.d_vel_ecef_mps)) <= 0.0625 and abs(one.daf1) <= 2.0**-32
                assert abs(one.t0_ns - message.sent_ns) <= 43_200 * NS_PER_S
            if said.fast is not None:
                _assert_fast(said.fast)
        case GeoEphemeris():
            bounds.assert_sets_in_range((said,))
            assert abs(said.toe_ns - message.sent_ns) <= 43_200 * NS_PER_S
        case c.NetworkTime():
            assert said.tow_s < 604_800 and abs(said.a0_s) <= 2.0 and abs(said.a1_sps) < 2.0**-26
        case c.Almanac():
            assert all(120 <= one.prn <= 158 and max(map(abs, one.pos_ecef_m)) <= 4.26e7 for one in said.satellites)
        case c.IonoMask():
            assert said.band <= 10 and all(1 <= igp <= 201 for igp in said.igps)
        case c.IonoDelays():
            assert said.band <= 10 and all(d is None or 0.0 <= d <= 63.75 for d in said.delay_m)
        case c.Service():
            assert said.number <= said.messages <= 8 and len(said.areas) <= 5
            assert all(max(abs(a.lat1_deg), abs(a.lat2_deg)) <= 90 and max(abs(a.lon1_deg), abs(a.lon2_deg)) <= 180 for a in said.areas)
        case c.Covariances():
            assert all(1 <= one.place <= 51 and 2.0**-5 <= one.scale <= 4.0 for one in said.satellites)


def _assert_fast(fast: c.Fast) -> None:
    assert len(fast.prc_m) == len(fast.udrei) and fast.first >= 1 and fast.first + len(fast.prc_m) - 1 <= 52
    assert all(-256.0 <= prc_m <= 255.875 for prc_m in fast.prc_m) and all(0 <= udrei <= 15 for udrei in fast.udrei)


def _assert_levels(receiver: SbasReceiver, now_ns: int, satellites: list[str], rng: Random, told: Counter[str]) -> None:
    """Of what may be used, every number is one and every sigma is more than that of the receiver alone."""
    mode = rng.choice((PA, NPA))
    times_ns = sorted(now_ns + rng.randrange(rng.choice((3, 3, 200)) * NS_PER_S) for _ in range(2))
    states = [receiver.at(t_ns, rows_of(satellites)) for t_ns in times_ns]
    store = EphemerisStore(gps())
    found = correct(states, satellites, store, np.array(SITE), mode, MASK_RAD, AVIATION, rng.choice((None, IONOSPHERE)))
    levels = protection(found, mode)
    used = found.used
    for name in ("range_m", "iono_m", "d_clock_s", "sigma_m", "el_rad"):
        assert np.isfinite(getattr(found, name)[used]).all(), name
    assert (found.sigma_m[used] >= 0.36).all() and (np.abs(found.range_m[used]) <= 1e4).all() and (found.iono_m[used] >= 0.0).all()
    assert np.isfinite(found.d_pos_ecef_m[:, used]).all()
    known = np.isfinite(levels.hpl_m)
    assert (known == np.isfinite(levels.vpl_m)).all() and (levels.n_used[known] >= 4).all() and (levels.hpl_m[known] > 0.0).all()
    told.update({"levels": int(known.sum()), "satellites used": int(used.sum())})


def _assert_files(messages: list[SbasMessage], rng: Random, told: Counter[str]) -> None:
    """As text, with lines damaged: what comes back is among what was written, or has a right CRC and time."""
    lines = list(map(rng.choice((_ems, _sbs)), messages))
    damaged_lines = [damaged(rng, line) if rng.random() < 0.2 else line for line in lines]
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "messages"
        path.write_bytes(b"\n".join(damaged_lines))
        try:
            found = read_sbas(path)
        except DecodeError:
            return
    for one in found.messages:
        assert 120 <= one.prn <= 158 and 0 <= one.sent_ns < 2**62
    back = {(one.sent_ns, one.prn): one.bits for one in found.messages}
    untouched = [one for one, line, after in zip(messages, lines, damaged_lines, strict=True) if line == after]
    times = Counter((one.sent_ns, one.prn) for one in messages)
    assert all((one.sent_ns, one.prn) in back for one in untouched)
    changed = [one for one in untouched if times[one.sent_ns, one.prn] == 1 and back[one.sent_ns, one.prn] != one.bits]
    assert len(changed) <= len(lines) - len(untouched)  # a damaged line may have taken its time
    told["of files"] += len(back)


def _ems(message: SbasMessage) -> bytes:
    seconds = message.sent_ns // NS_PER_S + 1
    days, second = divmod(seconds, 86_400)
    year, month, day = civil_from_days(days + 3657)  # 1980-01-06
    time = f"{year % 100:02d} {month:02d} {day:02d} {second // 3600:02d} {second // 60 % 60:02d} {second % 60:02d}"
    return f"{message.prn} {time} {message.kind} {frame_bytes(message.bits).hex().upper()}".encode()


def _sbs(message: SbasMessage) -> bytes:
    week, tow_s = divmod(message.sent_ns // NS_PER_S + 1, WEEK_NS // NS_PER_S)
    return f"{week} {tow_s} {message.prn} {message.kind} : {message.bits << 6:058X}".encode()


def split(data: bytes) -> list[bytes]:
    """Any bytes as messages with a right CRC."""
    parts = (data[k : k + FRAME_BYTES].ljust(FRAME_BYTES, b"\0") for k in range(0, len(data), FRAME_BYTES))
    return [frame_bytes(int.from_bytes(part, "big") >> PADDING_BITS + m.CRC_BITS) for part in parts]


TARGET = Target(sound, touch, split, examine)
