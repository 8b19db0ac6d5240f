"""Records of Kepler elements: the examples of the format itself, number by number, and variations of them."""

from pathlib import Path

import pytest

from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.gps_time import BDT_BEHIND_GPS_NS, NS_PER_S, gps_from_week
from tests import rinex_examples as example
from tests.rinex_examples import Rows, kepler, with_value
from tests.unit.rinex.navigation_files import HEADER_2, HEADER_3, read, record, record_2

TOE_NS = gps_from_week(1025, 409_904.0)  # as the example of GPS itself says
BDT_WEEK_0 = 1356  # GPS week in which BeiDou's weeks begin to count


def gps(line: int, column: int, value: float | None) -> KeplerEphemeris:
    return kepler(example.GPS_HEAD, with_value(example.GPS, line, column, value))


def galileo(rows: Rows, line: int, column: int, value: float | None) -> KeplerEphemeris:
    return kepler(example.GALILEO_HEAD, with_value(rows, line, column, value))


@pytest.mark.parametrize(
    "text",
    [HEADER_2 + record_2(" 6", example.GPS_HEAD, example.GPS), HEADER_3 + record(example.GPS_HEAD, example.GPS)],
    ids=["RINEX 2", "RINEX 3"],
)
def test_gps_record(tmp_path: Path, text: str) -> None:
    (eph,) = read(tmp_path, text).ephemerides
    assert isinstance(eph, KeplerEphemeris)
    assert (eph.satellite, eph.message, eph.issue, eph.healthy, eph.accuracy_m, eph.fit_half_s) == ("G06", "LNAV", 91, True, 2.4, 7200.0)
    assert (eph.toe_ns, eph.toc_ns, eph.transmission_ns) == (TOE_NS, TOE_NS, gps_from_week(1025, 406_800.0))
    assert (eph.af0, eph.af1, eph.af2) == (-0.839701388031e-3, -0.165982783074e-10, 0.0)
    assert (eph.group_delay_s, eph.group_delay_2_s) == (-0.99e-8, None)
    assert (eph.sqrt_a, eph.e, eph.m0, eph.delta_n) == (0.515365489006e4, 0.626740418375e-2, 0.162092304801, 0.116040547840e-8)
    assert (eph.i0, eph.i_dot, eph.omega) == (0.111541663136e1, 0.307155651409e-9, 0.206958726335e1)
    assert (eph.omega0, eph.omega_dot) == (0.329237003460, -0.638312302555e-8)
    assert (eph.cuc, eph.cus, eph.crc, eph.crs) == (0.484101474285e-5, 0.652112066746e-5, 0.326593750000e3, 0.934062500000e2)
    assert (eph.cic, eph.cis) == (-0.242143869400e-7, -0.596046447754e-7)


def test_qzss_record() -> None:
    eph = kepler(example.QZSS_HEAD, example.QZSS)
    assert (eph.satellite, eph.message, eph.issue, eph.accuracy_m) == ("J01", "LNAV", 69, 2.4)
    assert (eph.toe_ns, eph.transmission_ns) == (gps_from_week(1792, 202_512.0), gps_from_week(1792, 198_900.0))
    assert (eph.group_delay_s, eph.group_delay_2_s) == (-4.656612873077e-9, None)


def test_beidou_record() -> None:
    """All its times are BeiDou's, 14 s behind those of GPS."""
    eph = kepler(example.BEIDOU_HEAD, example.BEIDOU)
    assert (eph.satellite, eph.message, eph.issue, eph.healthy, eph.accuracy_m, eph.fit_half_s) == ("C01", "D2", 1, True, 2.4, 7200.0)
    toe_ns = gps_from_week(BDT_WEEK_0 + 435, 518_400.0) + BDT_BEHIND_GPS_NS
    assert (eph.toe_ns, eph.toc_ns, eph.transmission_ns) == (toe_ns, toe_ns, toe_ns)
    assert (eph.group_delay_s, eph.group_delay_2_s) == (1.42e-8, -1.04e-8)


def test_galileo_records() -> None:
    inav, fnav = (kepler(example.GALILEO_HEAD, rows) for rows in (example.INAV, example.FNAV))
    assert (inav.message, inav.issue, inav.accuracy_m, inav.fit_half_s) == ("INAV", 93, 3.12, 14_400.0)
    assert (inav.toe_ns, inav.transmission_ns) == (gps_from_week(1849, 439_800.0), gps_from_week(1849, 440_734.0))
    assert (inav.group_delay_s, inav.group_delay_2_s) == (-0.605359673500e-8, -0.651925802231e-8)
    assert (fnav.message, fnav.transmission_ns) == ("FNAV", gps_from_week(1849, 440_730.0))
    assert (fnav.group_delay_s, fnav.group_delay_2_s) == (-0.651925802231e-8, None)


@pytest.mark.parametrize(("satellite", "message"), [("C05", "D2"), ("C06", "D1"), ("C58", "D1"), ("C59", "D2"), ("C63", "D2")])
def test_beidou_sends_d2_from_geostationary_orbit(satellite: str, message: str) -> None:
    assert kepler(satellite + example.BEIDOU_HEAD[3:], example.BEIDOU).message == message


@pytest.mark.parametrize(("sources", "message"), [(1, "INAV"), (4, "INAV"), (513, "INAV"), (516, "INAV"), (517, "INAV"), (258, "FNAV")])
def test_data_sources_say_which_message_of_galileo_it_is(sources: int, message: str) -> None:
    assert galileo(example.INAV, 5, 1, float(sources)).message == message


@pytest.mark.parametrize(
    ("sources", "reason"), [(0, "kind of navigation message not clear"), (515, "kind of navigation message not clear")]
)
def test_data_sources_that_say_nothing_or_both(tmp_path: Path, sources: int, reason: str) -> None:
    file = read(tmp_path, HEADER_3 + record(example.GALILEO_HEAD, with_value(example.INAV, 5, 1, float(sources))))
    assert file.problems == {reason: 1}


@pytest.mark.parametrize(("health", "healthy"), [(0, True), (1, False), (2, False), (4, False), (8, True), (504, True)])
def test_inav_is_healthy_where_e1b_is(health: int, healthy: bool) -> None:
    assert galileo(example.INAV, 6, 1, float(health)).healthy is healthy


@pytest.mark.parametrize(("health", "healthy"), [(0, True), (7, True), (8, False), (16, False), (32, False), (455, True)])
def test_fnav_is_healthy_where_e5a_is(health: int, healthy: bool) -> None:
    assert galileo(example.FNAV, 6, 1, float(health)).healthy is healthy


@pytest.mark.parametrize(("sisa_m", "accuracy_m"), [(0.0, 0.0), (1.07, 1.07), (1.0, 1.0), (-1.0, None), (None, None)])
def test_galileo_accuracy_is_taken_as_it_stands(sisa_m: float | None, accuracy_m: float | None) -> None:
    assert galileo(example.INAV, 6, 0, sisa_m).accuracy_m == accuracy_m


@pytest.mark.parametrize("health", [1, 31, 32, 63])
def test_gps_health_other_than_zero_is_unhealthy(health: int) -> None:
    assert gps(6, 1, float(health)).healthy is False


@pytest.mark.parametrize(("health", "healthy"), [(0, True), (1, True), (2, False), (16, False), (32, False), (33, False)])
def test_qzss_is_healthy_whatever_its_last_bit_says(health: int, healthy: bool) -> None:
    """That is of a signal which no satellite with the others sends."""
    assert kepler(example.QZSS_HEAD, with_value(example.QZSS, 6, 1, float(health))).healthy is healthy


def test_beidou_unhealthy() -> None:
    assert kepler(example.BEIDOU_HEAD, with_value(example.BEIDOU, 6, 1, 1.0)).healthy is False


@pytest.mark.parametrize(
    ("written_m", "accuracy_m"),
    # Nominal values and upper bounds of IS-GPS-200, 20.3.3.3.1.3: both mean the index, whose upper bound we keep.
    [
        (0.0, 2.4), (2.0, 2.4), (2.4, 2.4), (2.8, 3.4), (3.4, 3.4), (4.0, 4.85), (4.85, 4.85), (5.7, 6.85), (8.0, 9.65), (11.3, 13.65),
        (16.0, 24.0), (24.0, 24.0), (32.0, 48.0), (64.0, 96.0), (96.0, 96.0), (4096.0, 6144.0), (6144.0, 6144.0), (6144.1, None),
        (8192.0, None), (-1.0, None),
    ],
)  # fmt: skip
def test_gps_accuracy_is_the_upper_bound_of_its_index(written_m: float, accuracy_m: float | None) -> None:
    assert gps(6, 0, written_m).accuracy_m == accuracy_m


@pytest.mark.parametrize(
    ("fit", "fit_half_s"), [(0.0, 7200.0), (4.0, 7200.0), (1.0, 10_800.0), (6.0, 10_800.0), (8.0, 14_400.0), (None, 7200.0)]
)
def test_gps_fit_interval_in_hours_or_as_flag_or_not_at_all(fit: float | None, fit_half_s: float) -> None:
    assert gps(7, 1, fit).fit_half_s == fit_half_s


@pytest.mark.parametrize(("flag", "fit_half_s"), [(0.0, 5400.0), (None, 5400.0), (1.0, 7200.0)])
def test_qzss_fit_interval_by_its_flag(flag: float | None, fit_half_s: float) -> None:
    assert kepler(example.QZSS_HEAD, with_value(example.QZSS, 7, 1, flag)).fit_half_s == fit_half_s


def test_beidou_without_the_second_group_delay() -> None:
    assert kepler(example.BEIDOU_HEAD, with_value(example.BEIDOU, 6, 3, None)).group_delay_2_s is None


def test_qzss_without_group_delay_is_none(tmp_path: Path) -> None:
    """So RINEX writes "do not use"."""
    file = read(tmp_path, HEADER_3 + record(example.QZSS_HEAD, with_value(example.QZSS, 6, 2, None)))
    assert file.problems == {"a parameter is not a number": 1}


@pytest.mark.parametrize(
    ("head", "rows", "lead_s"),
    [
        (example.GPS_HEAD, example.GPS, 7200),
        (example.QZSS_HEAD, example.QZSS, 3600),
        (example.GALILEO_HEAD, example.INAV, -600),  # Galileo sends a set after its reference time
        (example.BEIDOU_HEAD, example.BEIDOU, 0),
    ],
)
@pytest.mark.parametrize("written", [None, 0.9999e9])
def test_unknown_transmission_time_is_the_usual_one(head: str, rows: Rows, lead_s: int, written: float | None) -> None:
    eph = kepler(head, with_value(rows, 7, 0, written))
    assert eph.toe_ns - eph.transmission_ns == lead_s * NS_PER_S
