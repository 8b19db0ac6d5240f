"""SBAS messages: what is written is read, what is damaged is refused, and times of day find their day."""

import pytest

from integrity.gnss.ephemeris.broadcast import GeoEphemeris
from integrity.gnss.gps_time import DAY_S, NS_PER_S, WEEK_NS
from integrity.gnss.sbas import messages as m
from integrity.gnss.sbas.contents import (
    Almanac,
    Area,
    Covariance,
    Covariances,
    Degradation,
    DoNotUse,
    Fast,
    FastDegradation,
    Integrity,
    IonoDelays,
    IonoMask,
    LongTerm,
    Mixed,
    NetworkTime,
    PrnMask,
    Service,
)
from integrity.gnss.sbas.messages import SbasMessage, frame_of, joined, message_of, split
from integrity.gnss.sbas.reading import contents
from tests.unit.gnss.sbas import sent
from tests.unit.gnss.sbas.sent import PRN, T0_NS, at


def test_a_frame_gives_its_message() -> None:
    assert message_of(frame_of(sent.mask([1, 5]))) == sent.mask([1, 5])


@pytest.mark.parametrize("bit", range(0, 250, 7))
def test_one_wrong_bit_anywhere_is_noticed(bit: int) -> None:
    assert isinstance(message_of(frame_of(sent.degradation()) ^ 1 << bit), str)


def test_numbers_side_by_side_come_apart_again() -> None:
    assert split(joined([5, 0, 4095, 7], 12), 4, 12) == [5, 0, 4095, 7]


def test_type_1_names_satellites_by_mask_number() -> None:
    assert contents(at(0, sent.mask([1, 37, 38, 61, 120, 210], iodp=2))) == PrnMask(2, (1, 37, 38, 61, 120, 210))


def test_type_1_with_52_satellites_is_refused() -> None:
    assert contents(at(0, sent.mask(range(1, 53)))) == "type 1 with more than 51 satellites"


def test_fast_corrections_are_signed_eighths_of_a_metre() -> None:
    read = contents(at(0, sent.fast([-2048, 2047, 1], [0, 13, 15], kind=3, iodf=3, iodp=1)))
    assert read == Fast(1, 3, 14, (-256.0, 255.875, 0.125, *(0.0,) * 10), (0, 13, 15, *(14,) * 10))


def test_type_5_has_room_for_a_satellite_more_than_a_mask() -> None:
    read = contents(at(0, sent.fast([1] * 13, [2] * 13, kind=5)))
    assert isinstance(read, Fast)
    assert read.first + len(read.prc_m) - 1 == m.MOST_IN_MASK


def test_type_6() -> None:
    read = contents(at(0, sent.integrity([1, 2, 3], (3, 2, 1, 0))))
    assert read == Integrity((3, 2, 1, 0), (1, 2, 3, *(14,) * 48))


def test_type_7() -> None:
    assert contents(at(0, sent.factors(15, t_lat_s=9, iodp=3))) == FastDegradation(3, 9.0, (15,) * 51)


def test_type_10_has_the_units_of_its_table() -> None:
    read = contents(at(0, sent.degradation()))
    assert isinstance(read, Degradation)
    assert read._asdict() == pytest.approx(sent.DEGRADATION)


def test_type_9_is_an_orbit_at_its_own_time() -> None:
    read = contents(at(0, sent.geo(x_m=-34_173_000.08, vz_mps=-0.524, ax_mps2=0.0000125, af0=2.0**-31)))
    assert isinstance(read, GeoEphemeris)
    assert (read.satellite, read.toe_ns, round(read.x_m, 2), read.accuracy_m) == ("S37", T0_NS - 16 * NS_PER_S, -34_173_000.08, 6.85)


def test_type_9_that_is_nowhere_is_refused() -> None:
    assert contents(at(0, sent.geo(x_m=0.0))) == "type 9 that is no orbit"


@pytest.mark.parametrize("seconds", [-10, 10])
def test_a_time_of_day_is_that_of_the_nearest_day(seconds: int) -> None:
    """Around the end of a week: a reference time of ten seconds later or earlier is in the other week."""
    midnight_ns = 2353 * WEEK_NS
    t0_16s = (DAY_S - 16) // 16 if seconds < 0 else 1
    read = contents(SbasMessage(PRN, midnight_ns - seconds * NS_PER_S, sent.geo(t0_16s=t0_16s)))
    assert isinstance(read, GeoEphemeris)
    assert read.toe_ns - midnight_ns == (-16 if seconds < 0 else 16) * NS_PER_S


@pytest.mark.parametrize(
    "bits", [sent.geo(t0_16s=5400), sent.moving(7, 20, 5400), sent.message(m.ALMANAC_LAYOUT, 17, {"satellites": 0, "t0_64s": 1350})]
)
def test_a_time_beyond_the_day_is_refused(bits: int) -> None:
    assert "beyond the day" in str(contents(at(0, bits)))


def test_type_12_tells_the_time() -> None:
    fields = {"a0_s": -(2.0**-30), "leap_s": 18.0, "future_leap_s": -1.0, "tow_s": 579_600, "week": 305, "glonass": 1, "t0t_4096s": 3}
    read = contents(at(0, sent.message(m.TIME_LAYOUT, 12, fields)))
    assert isinstance(read, NetworkTime)
    assert (read.tow_s, read.week, read.leap_s, read.future_leap_s, read.a0_s) == (579_600, 305, 18.0, -1.0, -(2.0**-30))


@pytest.mark.parametrize("wrong", [{"tow_s": 604_800}, {"t0t_4096s": 148}, {"day": 8}])
def test_type_12_beyond_the_end_of_the_week_is_refused(wrong: dict[str, float]) -> None:
    assert isinstance(contents(at(0, sent.message(m.TIME_LAYOUT, 12, wrong))), str)


def test_type_17_leaves_out_empty_places() -> None:
    one = m.ALMANAC_OF_ONE.message({"prn": 129, "health": 32, "x_m": -32_344_000.0, "z_m": -52_000.0, "vz_mps": -60.0})
    read = contents(at(0, sent.message(m.ALMANAC_LAYOUT, 17, {"satellites": one << 2 * 67, "t0_64s": 956})))
    assert isinstance(read, Almanac)
    assert [(a.prn, a.health, a.pos_ecef_m, a.vel_ecef_mps) for a in read.satellites] == [
        (129, 32, (-32_344_000.0, 0.0, -52_000.0), (0.0, 0.0, -60.0))
    ]


def test_type_18() -> None:
    assert contents(at(0, sent.iono_mask(8, [1, 200], bands=3, iodi=2))) == IonoMask(2, 3, 8, (1, 200))


@pytest.mark.parametrize(("band", "igp"), [(8, 201), (9, 193), (10, 193)])
def test_type_18_with_a_grid_point_beyond_its_band_is_refused(band: int, igp: int) -> None:
    assert isinstance(contents(at(0, sent.iono_mask(band, [igp]))), str)


def test_type_26_knows_do_not_use() -> None:
    read = contents(at(0, sent.iono_delays(7, 13, [(511, 3), (510, 15), (0, 0)], iodi=1)))
    assert read == IonoDelays(1, 7, 13, (None, 63.75, 0.0, *(0.0,) * 12), (3, 15, 0, *(15,) * 12))


def test_type_26_with_a_block_beyond_its_band_is_refused() -> None:
    assert isinstance(contents(at(0, sent.iono_delays(9, 13, []))), str)


def test_type_25_with_velocity() -> None:
    read = contents(at(0, sent.moving(7, 255, 3825, dx_m=-128.0, dvz_mps=2.0**-11, daf0_s=-(2.0**-31), daf1=2.0**-39)))
    expected = LongTerm(0, 7, 255, 1, (-128.0, 0.0, 0.0), (0.0, 0.0, 2.0**-11), -(2.0**-31), 2.0**-39, T0_NS)
    assert read == Mixed(None, (expected,))


def test_type_24_has_both_kinds() -> None:
    one = m.STILL_OF_ONE.message({"number": 51, "iod": 7, "dz_m": -32.0})
    half = m.STILL_LAYOUT.message({"velocity_code": 0, "satellites": one, "iodp": 0})
    read = contents(at(0, sent.mixed([1, -1, 0, 0, 0, 0], [5] * 6, block=3, iodf=2, half=half)))
    assert read == Mixed(
        Fast(0, 2, 40, (0.125, -0.125, 0.0, 0.0, 0.0, 0.0), (5,) * 6),
        (LongTerm(0, 51, 7, 0, (0.0, 0.0, -32.0), (0.0, 0.0, 0.0), 0.0, 0.0, T0_NS),),
    )


def test_type_27() -> None:
    read = contents(at(0, sent.service(1, 15, [(-90, -180, 90, 180, 1)], iods=5, messages_less_1=1, number_less_1=1, priority=2)))
    assert read == Service(5, 2, 2, 2, 1, 15, (Area(-90.0, -180.0, 90.0, 180.0, True),))


@pytest.mark.parametrize("wrong", [{"number_less_1": 1}, {"regions": 6}])
def test_type_27_that_counts_wrong_is_refused(wrong: dict[str, float]) -> None:
    assert isinstance(contents(at(0, sent.service(1, 15, [], **wrong))), str)


def test_type_28_is_scaled() -> None:
    read = contents(at(0, sent.covariance(9, 6, E11=511.0 - 0.0, E44=3, E12=-512.0)))
    assert read == Covariances((Covariance(0, 9, 2.0, (1022.0, -1024.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 6.0)),))


@pytest.mark.parametrize(("bits", "empty"), [(m.PREAMBLES[1] << 218, True), (sent.fast([1], [2], kind=0), False)])
def test_type_0_is_not_for_use_whatever_is_in_it(bits: int, empty: bool) -> None:
    assert contents(at(0, bits)) == DoNotUse(empty)


@pytest.mark.parametrize("kind", [62, 63])
def test_types_that_say_nothing(kind: int) -> None:
    assert contents(at(0, m.PREAMBLES[1] << 218 | kind << 212)) is None
