"""Protection levels against numpy's linear algebra, the service areas of type 27, and which SBAS satellite is used."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from integrity.gnss.sbas.contents import Area, Service
from integrity.gnss.sbas.corrections import Corrections, Reason
from integrity.gnss.sbas.protection import along_track_m, protection
from integrity.gnss.sbas.receiver import SbasReceiver
from integrity.gnss.sbas.service import Services, contains
from integrity.gnss.sbas.store import NPA, PA
from tests.unit.gnss.sbas import sent
from tests.unit.gnss.sbas.sent import SITE, T0_NS, at
from tests.unit.gnss.sbas.service import corrected, service

S = 1_000_000_000
HIGH, LOW = {"x_m": -34_173_000.0, "y_m": 24_694_000.0}, {"x_m": 0.0, "y_m": 42_164_000.0}  # above 144 and 90 deg E


@pytest.fixture(scope="module")
def sky() -> Corrections:
    return corrected(service())


def only(c: Corrections, count: int) -> Corrections:
    """The same with the first satellites only."""
    first = np.cumsum(c.used, axis=1) <= count
    return replace(c, why=np.where(c.used & first, Reason.USED, Reason.NOT_MONITORED))


def covariance(c: Corrections) -> "np.typing.NDArray[np.float64]":
    used = c.used[0]
    G = np.vstack((c.u_enu[:, 0, used], np.ones(used.sum()))).T
    return np.linalg.inv(G.T @ np.diag(1.0 / c.sigma_m[0, used] ** 2) @ G)


@pytest.mark.parametrize(("mode", "k_h"), [(PA, 6.0), (NPA, 6.18)])
def test_horizontal_is_the_larger_axis_of_the_ellipse(sky: Corrections, mode: int, k_h: float) -> None:
    major = np.sqrt(np.linalg.eigvalsh(covariance(sky)[:2, :2])[-1])
    assert protection(sky, mode).hpl_m[0] == pytest.approx(k_h * major, rel=1e-9)


def test_vertical_is_sigma_up(sky: Corrections) -> None:
    assert protection(sky, PA).vpl_m[0] == pytest.approx(5.33 * np.sqrt(covariance(sky)[2, 2]), rel=1e-9)


@pytest.mark.parametrize("climb", [0.0, 0.04, -0.5])
@pytest.mark.parametrize("heading_deg", [0.0, 37.0, 90.0, 200.0])
def test_along_the_track_is_sigma_in_that_direction(sky: Corrections, heading_deg: float, climb: float) -> None:
    u = np.array([np.sin(np.deg2rad(heading_deg)), np.cos(np.deg2rad(heading_deg)), climb]) / np.hypot(1.0, climb)
    expected = 6.0 * np.sqrt(u @ covariance(sky)[:3, :3] @ u)
    assert along_track_m(protection(sky, PA), u, PA)[0] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("heading_deg", range(0, 180, 20))
def test_along_a_level_track_is_never_more_than_horizontal(sky: Corrections, heading_deg: int) -> None:
    p = protection(sky, PA)
    u = np.array([np.sin(np.deg2rad(heading_deg)), np.cos(np.deg2rad(heading_deg)), 0.0])
    assert along_track_m(p, u, PA)[0] <= p.hpl_m[0] * (1.0 + 1e-12)


@pytest.mark.parametrize(("count", "known"), [(4, True), (3, False)])
def test_four_satellites_are_needed(sky: Corrections, count: int, known: bool) -> None:
    p = protection(only(sky, count), PA)
    assert (bool(np.isfinite(p.hpl_m[0])), int(p.n_used[0])) == (known, count)


def test_satellites_in_one_plane_give_no_level(sky: Corrections) -> None:
    az = np.deg2rad(np.linspace(10.0, 350.0, len(sky.satellites)))
    ring = np.stack((np.sin(az), np.cos(az), np.ones_like(az))) / np.sqrt(2.0)  # on a cone: up cannot be told from the clock
    assert np.isnan(protection(replace(sky, u_enu=ring[:, None, :].copy()), PA).hpl_m[0])


def test_one_satellite_more_never_makes_it_worse(sky: Corrections) -> None:
    levels = [protection(only(sky, n), PA).hpl_m[0] for n in range(4, int(sky.used.sum()) + 1)]
    assert all(more <= fewer * (1.0 + 1e-12) for fewer, more in pairwise(levels))


SQUARE, TRIANGLE = Area(30.0, 170.0, 50.0, -170.0, True), Area(30.0, 10.0, 50.0, 30.0, False)


@pytest.mark.parametrize(
    ("area", "lat", "lon", "inside"),
    [
        (SQUARE, 40.0, 179.0, True),
        (SQUARE, 40.0, -179.0, True),
        (SQUARE, 40.0, 160.0, False),
        (SQUARE, 50.0, 170.0, True),
        (SQUARE, 50.1, 175.0, False),
        (TRIANGLE, 35.0, 25.0, True),  # coordinate 3 is 30 N 30 E
        (TRIANGLE, 45.0, 12.0, False),
        (TRIANGLE, 40.0, 20.0, True),
        (Area(0.0, 5.0, 0.0, 9.0, True), 0.0, 6.0, False),
    ],
)
def test_what_is_in_an_area(area: Area, lat: float, lon: float, inside: bool) -> None:
    assert contains(area, lat, lon) is inside


def services(*messages: Service) -> Services:
    known = Services()
    for one in messages:
        known = known.with_message(one)
    return known


HERE = (Area(30.0, 130.0, 45.0, 150.0, True),)
FIRST, SECOND = Service(1, 2, 1, 0, 4, 10, HERE), Service(1, 2, 2, 3, 6, 10, HERE)


@pytest.mark.parametrize(
    ("messages", "lat", "expected"),
    [
        ((FIRST,), 36.0, None),
        ((FIRST, SECOND), 36.0, 4.0),  # the higher priority decides
        ((FIRST, SECOND), 10.0, 10.0),
        ((FIRST, SECOND._replace(priority=0)), 36.0, 2.0),  # of the same priority the smaller
        ((FIRST, SECOND, FIRST._replace(iods=2, inside=2)), 36.0, 4.0),  # a set that is not complete may only raise it
        ((FIRST, SECOND, FIRST._replace(iods=2, inside=9)), 36.0, 8.0),
        ((FIRST, SECOND, FIRST._replace(iods=2, inside=2, messages=1)), 36.0, 1.25),
    ],
)
def test_areas_decide_by_priority_and_factor(messages: tuple[Service, ...], lat: float, expected: float | None) -> None:
    assert services(*messages).delta_udre(lat, 140.0) == expected


def heard(*messages: tuple[float, int, int]) -> SbasReceiver:
    receiver = SbasReceiver(np.array(SITE))
    for second, prn, bits in messages:
        receiver.add(at(second, bits, prn))
    return receiver


def used(receiver: SbasReceiver, second: float) -> int:
    return receiver.at(T0_NS + round(second * S), []).head.prn


def test_the_highest_sbas_satellite_is_taken() -> None:
    assert used(heard((0, 129, sent.geo(**LOW)), (0, 137, sent.geo(**HIGH))), 2.0) == 137


def test_a_satellite_that_has_not_said_where_it_is_is_not_taken() -> None:
    assert used(heard((0, 129, sent.geo(**LOW)), (0, 137, sent.degradation())), 2.0) == 129


def test_the_one_in_use_is_held() -> None:
    receiver = heard((0, 129, sent.geo(**LOW)))
    assert used(receiver, 2.0) == 129
    receiver.add(at(1, sent.geo(**HIGH), 137))
    assert used(receiver, 3.0) == 129


@pytest.mark.parametrize("end", ["silence", "test mode"])
def test_the_one_in_use_is_left_when_it_ends(end: str) -> None:
    receiver = heard((0, 129, sent.geo(**LOW)), (1, 137, sent.degradation()))
    before = used(receiver, 2.5)
    for second in range(2, 12):
        receiver.add(at(second, sent.geo(**HIGH), 137))
        if end == "test mode":
            receiver.add(at(second, sent.fast([1], [1], kind=0), 129))
    assert (before, used(receiver, 13.0)) == (129, 137)


def test_without_any_satellite_nothing_is_known() -> None:
    assert used(SbasReceiver(np.array(SITE)), 0.0) == 0
