"""Records of state vectors, GLONASS and SBAS: the examples of the format itself, number by number, and variations of them."""

from pathlib import Path

import pytest

from integrity.gnss.ephemeris.broadcast import GeoEphemeris, GlonassEphemeris
from integrity.gnss.gps_time import NS_PER_S, gps_from_week, parse_utc
from tests import rinex_examples as example
from tests.rinex_examples import Rows, ephemeris, with_value
from tests.unit.rinex.navigation_files import HEADER_2_GEO, HEADER_2_GLONASS, HEADER_3, HEADER_3_05, read, record, record_2

FIFTH: Rows = (*example.GLONASS, (183.0, 3.725290298462e-9, 3.0, None))  # status flags, delta tau, F_T, health flags


def glonass(rows: Rows, line: int, column: int, value: float | None, head: str = example.GLONASS_HEAD) -> GlonassEphemeris:
    found = ephemeris(head, with_value(rows, line, column, value))
    assert isinstance(found, GlonassEphemeris)
    return found


def geo(line: int, column: int, value: float | None) -> GeoEphemeris:
    found = ephemeris(example.SBAS_HEAD, with_value(example.SBAS, line, column, value))
    assert isinstance(found, GeoEphemeris)
    return found


@pytest.mark.parametrize(
    "text",
    [
        HEADER_2_GLONASS + record_2(" 2", example.GLONASS_HEAD, example.GLONASS),
        HEADER_3 + record(example.GLONASS_HEAD, example.GLONASS),
    ],
    ids=["RINEX 2", "RINEX 3"],
)
def test_glonass_record(tmp_path: Path, text: str) -> None:
    """Its times are UTC, its issue counts quarters of the Moscow day: 3 h 15 min are 13."""
    (eph,) = read(tmp_path, text).ephemerides
    assert isinstance(eph, GlonassEphemeris)
    assert (eph.satellite, eph.channel, eph.issue, eph.healthy, eph.fit_half_s) == ("R02", 1, 13, True, 1200.0)
    assert eph.toe_ns == parse_utc("2006-10-01T00:15:00Z")
    assert eph.transmission_ns == parse_utc("2006-10-01T00:00:30Z")
    assert (eph.x_m, eph.y_m, eph.z_m) == pytest.approx((15_553_634.2773, -19_901_129.8828, 3_553_335.44922), abs=1e-6)
    assert (eph.vx_mps, eph.vy_mps, eph.vz_mps) == pytest.approx((-419.38495636, 324.192047119, 3_526.66091919), abs=1e-9)
    assert (eph.ax_mps2, eph.ay_mps2, eph.az_mps2) == pytest.approx((0.0, -0.931322574615e-6, -0.186264514923e-5), abs=1e-18)
    assert (eph.tau_n_s, eph.gamma_n) == (0.506537035108e-4, 0.181898940355e-11)


@pytest.mark.parametrize(
    "text",
    [HEADER_2_GEO + record_2("22", "S22 2003 10 18 00 01 04", example.SBAS), HEADER_3 + record(example.SBAS_HEAD, example.SBAS)],
    ids=["RINEX 2", "RINEX 3"],
)
def test_sbas_record(tmp_path: Path, text: str) -> None:
    (eph,) = read(tmp_path, text).ephemerides
    assert isinstance(eph, GeoEphemeris)
    assert (eph.satellite, eph.issue, eph.healthy, eph.accuracy_m, eph.fit_half_s) == ("S22", 23, True, 4.85, 360.0)
    assert (eph.toe_ns, eph.transmission_ns) == (gps_from_week(1240, 518_464.0), gps_from_week(1240, 518_442.0))
    assert (eph.x_m, eph.y_m, eph.z_m) == pytest.approx((24_828_323.92, -34_089_208.72, -16_505.6), abs=1e-6)
    assert (eph.vx_mps, eph.vy_mps, eph.vz_mps) == pytest.approx((-0.359375, -1.480625, 0.836), abs=1e-12)
    assert (eph.ax_mps2, eph.ay_mps2, eph.az_mps2) == pytest.approx((-1.375e-4, -5.0e-5, 6.25e-5), abs=1e-18)
    assert (eph.af0, eph.af1) == (-1.005828380585e-7, 6.366462912410e-12)


@pytest.mark.parametrize("health", [1, 2, 4, 7])
def test_glonass_unhealthy(health: int) -> None:
    assert glonass(example.GLONASS, 1, 3, float(health)).healthy is False


@pytest.mark.parametrize(
    ("flags", "healthy"),
    [(None, True), (0.9999e9, True), (0, True), (1, True), (2, False), (3, True), (4, False), (7, False)],
)
def test_health_flags_of_the_fifth_line(flags: float | None, healthy: bool) -> None:
    """Bits: of string 3; the almanac's is reported; the almanac's (1 is healthy)."""
    assert glonass(FIFTH, 4, 3, flags).healthy is healthy


@pytest.mark.parametrize(("f_t", "accuracy_m"), [(0, 1.0), (3, 4.0), (14, 512.0), (15, 7.0), (0.9999e9, 7.0), (None, 7.0)])
def test_accuracy_by_the_table_of_f_t_and_as_usual_where_the_file_has_none(f_t: float | None, accuracy_m: float) -> None:
    assert glonass(FIFTH, 4, 2, f_t).accuracy_m == accuracy_m


@pytest.mark.parametrize(("written", "delta_tau_n_s"), [(3.725290298462e-9, 3.725290298462e-9), (0.9999e9, None), (None, None)])
def test_delay_of_the_second_band(written: float | None, delta_tau_n_s: float | None) -> None:
    assert glonass(FIFTH, 4, 1, written).delta_tau_n_s == delta_tau_n_s


@pytest.mark.parametrize(("written", "channel"), [(-7, -7), (6, 6), (249, -7), (255, -1)])
def test_channels_as_signed_or_unsigned_bytes(written: int, channel: int) -> None:
    assert glonass(example.GLONASS, 2, 3, float(written)).channel == channel


@pytest.mark.parametrize(
    ("line", "column", "value", "reason"),
    [
        (2, 3, 7.0, "channel 7, expected -7 to 6"),
        (2, 3, 0.5, "health or channel out of range"),
        (2, 3, -8.0, "health or channel out of range"),
        (1, 3, None, "field missing"),
        (1, 3, -1.0, "health or channel out of range"),
        (1, 0, 0.0, "2.02159e+07 m from the centre of the Earth, expected 2.5e+07 to 2.6e+07"),
        (3, 1, None, "a parameter is not a number"),
    ],
)
def test_a_glonass_record_that_cannot_be_right(tmp_path: Path, line: int, column: int, value: float | None, reason: str) -> None:
    file = read(tmp_path, HEADER_3 + record(example.GLONASS_HEAD, with_value(example.GLONASS, line, column, value)))
    assert file.problems == {reason: 1}


@pytest.mark.parametrize(("column", "value"), [(0, 512.0), (0, 0.5), (0, -1.0), (2, 16.0), (2, 2.5), (3, 8.0)])
def test_a_fifth_line_that_is_none(tmp_path: Path, column: int, value: float) -> None:
    """It may be the fourth, doubled."""
    file = read(tmp_path, HEADER_3_05 + record(example.GLONASS_HEAD, with_value(FIFTH, 4, column, value)))
    assert file.problems == {"status, accuracy or health flags out of range": 1}


@pytest.mark.parametrize(("health", "healthy"), [(0, True), (1, False), (2, True), (14, True), (16, False), (31, False), (63, False)])
def test_sbas_is_healthy_where_ranging_is_known_to_be_on(health: int, healthy: bool) -> None:
    assert geo(1, 3, float(health)).healthy is healthy


@pytest.mark.parametrize(("written_m", "accuracy_m"), [(16.0, 24.0), (4096.0, 6144.0), (32_767.0, None), (None, None)])
def test_sbas_accuracy(written_m: float | None, accuracy_m: float | None) -> None:
    assert geo(2, 3, written_m).accuracy_m == accuracy_m


@pytest.mark.parametrize(
    ("line", "column", "value", "reason"),
    [
        (3, 3, 256.0, "issue or health out of range"),
        (1, 3, 64.0, "issue or health out of range"),
        (3, 3, None, "field missing"),
        (1, 0, 14_828.0, "3.71745e+07 m from the centre of the Earth, expected 4.1e+07 to 4.35e+07"),
    ],
)
def test_an_sbas_record_that_cannot_be_right(tmp_path: Path, line: int, column: int, value: float | None, reason: str) -> None:
    file = read(tmp_path, HEADER_3 + record(example.SBAS_HEAD, with_value(example.SBAS, line, column, value)))
    assert file.problems == {reason: 1}


def test_unknown_transmission_time_of_sbas_is_its_reference_time() -> None:
    eph = geo(0, 2, 0.9999e9)
    assert eph.transmission_ns == eph.toe_ns


@pytest.mark.parametrize("frame_s", [None, 0.9999e9, 11_700.0, 43_200.0])
def test_frame_time_of_glonass_that_is_unknown_or_cannot_be_is_the_usual_one(frame_s: float | None) -> None:
    """11,700 s would be the reference time by the clock of Moscow."""
    eph = glonass(example.GLONASS, 0, 2, frame_s)
    assert eph.toe_ns - eph.transmission_ns == 900 * NS_PER_S
