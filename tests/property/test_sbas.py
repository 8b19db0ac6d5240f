"""Whatever an SBAS sends: no exception, no value out of its field's range, and no satellite used without a sigma.

Frames are messages of every type with bits flipped, most with a CRC that is right again: what a faulty or hostile sender could send.
The suite tries some thousands; a million: SBAS_FRAMES=1000000 pytest -n 0 tests/property/test_sbas.py -k frames
"""

import os
import random
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from integrity.errors import DecodeError
from integrity.gnss.ephemeris.broadcast import GeoEphemeris
from integrity.gnss.sbas import contents as c
from integrity.gnss.sbas import messages as m
from integrity.gnss.sbas.messages import SbasMessage, frame_of, message_of
from integrity.gnss.sbas.protection import protection
from integrity.gnss.sbas.reading import contents
from integrity.gnss.sbas.store import NPA, PA, SATELLITES, SbasStore
from recordings.sbas_files import read_sbas
from tests.unit.gnss.sbas import sent
from tests.unit.gnss.sbas.sent import PRN, T0_NS, at
from tests.unit.gnss.sbas.service import START_S, corrected, service, slow

EXAMPLES = 20
FRAMES = int(os.environ.get("SBAS_FRAMES", "10000")) // EXAMPLES  # of an example
KINDS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 17, 18, 24, 25, 26, 27, 28, 62, 63)
seeds = st.integers(0, 2**32)


@lru_cache(maxsize=1)
def sound() -> tuple[int, ...]:
    """Messages that make sense, to begin with."""
    return (
        *slow()[:4],
        *slow()[-6:],
        sent.fast([8, -9], [3, 4]),
        sent.integrity([1, 2, 3]),
        sent.geo(),
        sent.moving(7, 20, 3825, dx_m=1.0, dvz_mps=0.001),
        sent.mixed([1] * 6, [2] * 6, block=1, iodf=1, half=0),
        sent.service(4, 15, [(20, 120, 50, 150, 1)]),
        sent.covariance(3, 4, E11=200, E12=-3, E44=7),
    )


def mutated(seed: int, count: int) -> Iterator[int]:
    """Messages: sound ones with some bits flipped, or any bits of a type."""
    chance = random.Random(seed)
    for _ in range(count):
        if chance.random() < 0.5:
            bits = chance.choice(sound())
            for _ in range(chance.choice((0, 1, 1, 2, 5, 40))):
                bits ^= 1 << chance.randrange(m.MESSAGE_BITS - 8)
        else:
            bits = chance.choice(m.PREAMBLES) << 218 | chance.choice(KINDS) << 212 | chance.getrandbits(212)
        yield bits


def out_of_range(said: c.Content) -> list[object]:
    """Values that no field of that type can have; every limit is that of DO-229D, A.4.4."""
    limits: list[tuple[Sequence[float], float, float]] = []
    match said:
        case c.Fast():
            limits = [(said.prc_m, -256.0, 255.875), (said.udrei, 0, 15), ([said.iodf, said.iodp], 0, 3), ([said.first], 1, 40)]
        case c.Integrity():
            limits = [(said.iodf, 0, 3), (said.udrei, 0, 15)]
        case c.FastDegradation():
            limits = [([said.t_lat_s], 0, 15), (said.indicator, 0, 15), ([said.iodp], 0, 3)]
        case c.PrnMask():
            limits = [(said.numbers, 1, 210), ([len(said.numbers)], 0, 51), ([said.iodp], 0, 3)]
        case c.Degradation():
            limits = [(said[:3], 0, 2.0461), (said[3:], 0, 511.0)]
        case c.Mixed():
            limits = [one for part in said.long_term for one in long_term_limits(part)]
            return [*([] if said.fast is None else out_of_range(said.fast)), *beyond(limits)]
        case c.IonoMask():
            limits = [(said.igps, 1, 201), ([said.band], 0, 10), ([said.iodi], 0, 3), ([said.bands], 0, 11)]
        case c.IonoDelays():
            limits = [
                ([d for d in said.delay_m if d is not None], 0, 63.75),
                (said.givei, 0, 15),
                ([said.band], 0, 10),
                ([said.block], 0, 13),
            ]
        case c.Service():
            limits = [([said.number, said.messages], 1, 8), ([said.inside, said.outside], 0, 15), ([said.priority], 0, 3)]
            limits += [([a.lat1_deg, a.lat2_deg], -90, 90) for a in said.areas] + [
                ([a.lon1_deg, a.lon2_deg], -180, 180) for a in said.areas
            ]
        case c.Covariances():
            limits = [(one.R, -2048, 2044) for one in said.satellites] + [([one.place], 1, 51) for one in said.satellites]
        case c.Almanac():
            limits = [([one.prn], 120, 158) for one in said.satellites] + [(one.pos_ecef_m, -42.6e6, 42.6e6) for one in said.satellites]
        case c.NetworkTime():
            limits = [
                ([said.tow_s, said.t0t_s], 0, 604_799),
                ([said.day], 0, 7),
                ([said.week], 0, 1023),
                ([said.leap_s, said.future_leap_s], -128, 127),
            ]
        case GeoEphemeris():
            return [] if said.implausibility() is None else [said]
    return beyond(limits)


def long_term_limits(part: c.LongTerm) -> list[tuple[Sequence[float], float, float]]:
    return [
        (part.d_pos_ecef_m, -128.0, 127.875),
        (part.d_vel_ecef_mps, -0.0625, 0.0625),
        ([part.daf0_s], -(2.0**-21), 2.0**-21),
        ([part.daf1], -(2.0**-32), 2.0**-32),
        ([part.place], 1, 51),
        ([part.iod], 0, 255),
        ([abs(part.t0_ns - T0_NS)], 0, 43_800e9),  # half a day of the message, sent within ten minutes
    ]


def beyond(limits: Sequence[tuple[Sequence[float], float, float]]) -> list[object]:
    return [value for values, low, high in limits for value in values if not low <= value <= high]


@given(seed=seeds)
@settings(max_examples=EXAMPLES, deadline=None, phases=[Phase.generate])  # a seed does not shrink
def test_frames_say_nothing_out_of_range(seed: int) -> None:
    wrong = []
    for k, bits in enumerate(mutated(seed, FRAMES)):
        said = contents(SbasMessage(PRN, T0_NS + k * 10**9 % (600 * 10**9), bits))
        if not isinstance(said, str) and out_of_range(said):
            wrong.append((hex(bits), out_of_range(said)))
    assert wrong == []


@given(seed=seeds, flips=st.sets(st.integers(0, m.FRAME_BITS - 1), min_size=1, max_size=3))
def test_frames_with_up_to_three_bits_wrong_are_refused(seed: int, flips: set[int]) -> None:
    """CRC-24Q finds every one of these: its distance is 6 at this length."""
    bits = next(mutated(seed, 1))
    assert isinstance(message_of(frame_of(bits) ^ sum(1 << k for k in flips)), str)


@given(frame=st.integers(-(2**10), 2 ** (m.FRAME_BITS + 10)))
def test_any_number_is_a_frame_or_not(frame: int) -> None:
    bits = message_of(frame)
    assert isinstance(bits, str) or frame_of(bits) == frame


@given(seed=seeds)
@settings(max_examples=EXAMPLES, deadline=None, phases=[Phase.generate])
def test_a_store_takes_all_frames(seed: int) -> None:
    store = SbasStore(PRN)
    count = max(FRAMES // 5, 1)
    for k, bits in enumerate(mutated(seed, count)):
        store.add(at(k, bits))
    rows = store.at(T0_NS + count * 10**9, range(len(SATELLITES))).rows
    assert set(np.unique(rows["udrei"])) <= set(range(16)) and set(np.unique(rows["factor"])) <= set(range(16))


@given(seed=seeds, mode=st.sampled_from((PA, NPA)))
@settings(max_examples=30, deadline=None)
def test_who_is_used_has_a_sigma(seed: int, mode: int) -> None:
    """A sound service, and then anything: a satellite is out, or its sigma is a number of at least that of its own noise."""
    more = [(float(k + 1), bits) for k, bits in enumerate(mutated(seed, 40))]
    found = corrected(service(*more), tuple(range(0, 60, 3)), mode)
    assert np.all(found.sigma_m[found.used] >= 0.36)


@given(seed=seeds)
@settings(max_examples=20, deadline=None)
def test_levels_are_numbers_or_missing(seed: int) -> None:
    more = [(float(k + 1), bits) for k, bits in enumerate(mutated(seed, 20))]
    levels = protection(corrected(service(*more), tuple(range(0, 30, 3))), PA)
    enough = levels.n_used >= 4
    assert np.array_equal(np.isfinite(levels.hpl_m), enough) and np.all(levels.hpl_m[enough] > 0.0)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("sbas") / "a"


LINE = f"137 25 02 15 17 00 01 1 {frame_of(sent.mask([1])) << 6:064X}\n".encode()
UBX = bytes.fromhex("b5620215")


@given(
    pieces=st.lists(
        st.one_of(
            st.binary(max_size=80),
            st.just(LINE),
            st.tuples(st.integers(0, len(LINE) - 1), st.binary(min_size=1, max_size=1)).map(
                lambda x: LINE[: x[0]] + x[1] + LINE[x[0] + 1 :]
            ),
            st.just(b"2353 579601 137  1 : " + LINE[24:82] + b"\n"),
            st.binary(max_size=60).map(lambda x: UBX + x),
            st.just(b"\x1f\x8b\x08"),
        ),
        max_size=8,
    )
)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_any_file_is_read_or_refused(file: Path, pieces: list[bytes]) -> None:
    file.write_bytes(b"".join(pieces))
    try:
        read = read_sbas(file)
    except DecodeError:
        return
    assert len(read.messages) > 0 and all(0 <= message.bits < 1 << m.MESSAGE_BITS for message in read.messages)
    assert read.messages == tuple(sorted(read.messages, key=lambda one: (one.sent_ns, one.prn)))


def test_every_type_is_tried() -> None:
    assert {bits >> 212 & 63 for bits in mutated(1, 2000)} >= set(KINDS)


def test_service_begins_settled() -> None:
    """What the others build on."""
    assert START_S > 0 and corrected(service()).used.sum() >= 4
