"""A front in the ionosphere, against pierce points found by bisection on the ray."""

import math

import numpy as np
import pytest

from integrity.errors import ConfigError
from integrity.gnss.observations import Floats
from recordings.faults.kinds import IonoFront
from tests.unit.faults.everywhere import BEGIN, END, MEASURED, SETS, WAS, Delta, deltas, satellite_ecef_m, wavelength_m, with_fault
from tests.unit.many_signals import CLOCKS_M
from tests.unit.streams import POINTS

SHELL_M = 6_721_000.0
L1_M = 299_792_458.0 / 1_575_420_000.0
EAST_AT_C = IonoFront(slope_mm_per_km=400.0, width_km=100.0, speed_mps=500.0, azimuth_deg=70.0, edge_km=0.0)


def middle_and_azimuth(azimuth_deg: float) -> tuple[Floats, Floats]:
    """Up (geodetic) in the middle of the antennas, and the direction of the front there."""
    x, y, z = np.mean(list(POINTS.values()), axis=0)
    lon, lat = math.atan2(y, x), math.atan(z / math.hypot(x, y) / (1.0 - 0.00669437999))
    for _ in range(5):  # height 0 is good for 1e-6 rad
        normal_m = 6_378_137.0 / math.sqrt(1.0 - 0.00669437999 * math.sin(lat) ** 2)
        lat = math.atan2(z + 0.00669437999 * normal_m * math.sin(lat), math.hypot(x, y))
    up = np.array([math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)])
    east = np.array([-math.sin(lon), math.cos(lon), 0.0])
    a = math.radians(azimuth_deg)
    return up, math.sin(a) * east + math.cos(a) * np.cross(up, east)


def pierced_m(receiver: str, signal: str, epoch: int, azimuth_deg: float) -> float:
    """Great-circle distance of the pierce point from the middle of the site, along the azimuth."""
    antenna = np.array(POINTS[receiver])
    where = satellite_ecef_m(SETS[signal[:3]], WAS[receiver, epoch], signal, CLOCKS_M[receiver])
    near, far = 0.0, 1.0
    for _ in range(60):
        half = (near + far) / 2.0
        below = np.linalg.norm(antenna + half * (where - antenna)) < SHELL_M
        near, far = (half, far) if below else (near, half)
    up, towards = middle_and_azimuth(azimuth_deg)
    point = antenna + near * (where - antenna)
    return SHELL_M * math.atan2(float(point @ towards), float(point @ up))


def assert_by_bands(found: Delta) -> None:
    """All signals of a satellite are delayed by the square of their wavelengths, and their carriers advanced by as much."""
    for signal, (code_m, carrier_m, rate_mps) in found.items():
        first = next(s for s in found if s[:3] == signal[:3])
        ratio = (wavelength_m(signal) / wavelength_m(first)) ** 2
        assert code_m == pytest.approx(found[first][0] * ratio, abs=1e-6)
        assert carrier_m == pytest.approx(-code_m, abs=1e-6)
        assert rate_mps == pytest.approx(found[first][2] * ratio, abs=1e-6)


@pytest.mark.parametrize("receiver", POINTS)
def test_delays_are_those_of_the_slope_behind_the_edge(receiver: str) -> None:
    """Where the satellite is is good to the turn of the Earth in 77 ms, 30 m at the pierce point: 12 mm."""
    reached = set()
    for epoch, found in deltas(EAST_AT_C, receiver).items():
        for signal, (code_m, _, _) in found.items():
            behind_m = 500.0 * (epoch - BEGIN) - pierced_m(receiver, signal, epoch, 70.0)
            expected = 400e-6 * min(max(behind_m, 0.0), 100e3) * (wavelength_m(signal) / L1_M) ** 2
            assert code_m == pytest.approx(expected, abs=0.025)
            reached.add(0 if behind_m < 0.0 else 1 if behind_m < 100e3 else 2)
        assert_by_bands(found)
    assert reached == {0, 1, 2}


def test_antennas_see_the_gradient_between_their_pierce_points() -> None:
    """120 m apart, 400 mm/km: up to 5 cm; to 1 % of that, as both have the same satellite."""
    a, c = deltas(EAST_AT_C, "A")[BEGIN], deltas(EAST_AT_C, "C")[BEGIN]
    for signal in a.keys() & c.keys():
        x_a, x_c = (pierced_m(receiver, signal, BEGIN, 70.0) for receiver in "AC")
        if signal[4:] == "1C" and -99e3 < x_a < -1e3:
            assert a[signal][0] - c[signal][0] == pytest.approx(400e-6 * (x_c - x_a) * (wavelength_m(signal) / L1_M) ** 2, abs=5e-4)


def test_the_doppler_is_the_rate_of_the_carrier() -> None:
    """Where the front is over a signal from one second to the next, also by the motion of the pierce point."""
    found = deltas(EAST_AT_C)
    compared = 0
    for before, after in zip(range(BEGIN, END - 1), range(BEGIN + 1, END), strict=True):
        for signal, (_, carrier_m, rate_mps) in found[after].items():
            _, earlier_m, earlier_mps = found[before][signal]
            if rate_mps and earlier_mps:
                compared += 1
                assert (rate_mps + earlier_mps) / 2.0 == pytest.approx(carrier_m - earlier_m, abs=2e-5)
    assert compared > 10


def test_without_an_edge_the_front_comes_over_one_satellite_after_the_other() -> None:
    found = deltas(IonoFront(slope_mm_per_km=400.0, width_km=100.0, speed_mps=1000.0, azimuth_deg=70.0))
    assert not any(code_m for code_m, _, _ in found[BEGIN].values())
    struck = {signal[:3] for signal, (code_m, _, _) in found[END - 1].items() if code_m}
    hindmost = min((signal for signal in found[BEGIN] if signal[4:] in ("1C", "2I")), key=lambda s: pierced_m("B", s, BEGIN, 70.0))
    assert struck == {hindmost[:3]}
    went_m = pierced_m("B", hindmost, END - 1, 70.0) - pierced_m("B", hindmost, BEGIN, 70.0)
    overtaken_m = 1000.0 * (END - 1 - BEGIN) - went_m
    assert found[END - 1][hindmost][0] == pytest.approx(400e-6 * overtaken_m * (wavelength_m(hindmost) / L1_M) ** 2, rel=0.02)


def test_a_front_that_reaches_nobody_is_refused() -> None:
    with pytest.raises(ConfigError, match="no signal of a satellite with an ephemeris is pierced behind its edge then"):
        with_fault(MEASURED, IonoFront(slope_mm_per_km=400.0, width_km=100.0, speed_mps=100.0, azimuth_deg=0.0, edge_km=-4000.0))
