"""What receivers say of themselves, in words."""

from dataclasses import replace

import numpy as np
import pytest

from integrity.gnss.receiver_status import Antenna, Jamming, ReceiverStatus, Spoofing
from integrity.hearsay import remarks
from tests.unit.streams import TRIANGLE

HERE = ReceiverStatus(
    model="ZED-F9P HPG 1.51",
    fix_ok=True,
    lat_rad=float(TRIANGLE.lat_rad[1]),
    lon_rad=float(TRIANGLE.lon_rad[1]),
    height_m=float(TRIANGLE.height_m[1]),
    jamming=Jamming.NONE_SEEN,
    spoofing=Spoofing.NONE_SEEN,
    antenna=Antenna.IN_ORDER,
    agc=0.6,
)


def of_b(status: ReceiverStatus) -> list[str]:
    return list(remarks((("B", status),), TRIANGLE))


@pytest.mark.parametrize("status", [HERE, ReceiverStatus(), replace(HERE, lat_rad=None)], ids=["all well", "silent", "half a position"])
def test_nothing_to_remark(status: ReceiverStatus) -> None:
    assert of_b(status) == []


@pytest.mark.parametrize(
    ("status", "remark"),
    [
        (replace(HERE, jamming=Jamming.WARNING), "B reports interference"),
        (replace(HERE, jamming=Jamming.CRITICAL), "B reports interference that leaves it no fix"),
        (replace(HERE, spoofing=Spoofing.INDICATED), "B reports spoofing"),
        (replace(HERE, antenna=Antenna.OPEN), "B reports no antenna"),
        (replace(HERE, fix_ok=False), "B reports no fix of its own"),
    ],
)
def test_a_complaint_is_a_sentence(status: ReceiverStatus, remark: str) -> None:
    assert of_b(status) == [remark]


@pytest.mark.parametrize(("north_m", "said"), [(990.0, False), (1010.0, True)])
def test_a_fix_of_its_own_far_from_its_point(north_m: float, said: bool) -> None:
    assert bool(of_b(replace(HERE, lat_rad=float(TRIANGLE.lat_rad[1]) + north_m / 6.358e6))) == said


def test_another_city_is_said_with_its_distance() -> None:
    (remark,) = of_b(replace(HERE, lat_rad=np.deg2rad(34.7), lon_rad=np.deg2rad(135.5)))
    assert remark.startswith("B reports a fix of its own 3") and remark.endswith("km from its surveyed point")


@pytest.mark.parametrize(("apart_m", "said"), [(4.99, []), (5.01, ["B is said to have its antenna 5.0 m from its surveyed point"])])
def test_an_antenna_said_to_be_elsewhere(apart_m: float, said: list[str]) -> None:
    x_m, y_m, z_m = TRIANGLE.pos_ecef_m[1]
    assert of_b(replace(HERE, stated_ecef_m=(float(x_m), float(y_m), float(z_m) - apart_m))) == said


def test_a_virtual_station_is_named() -> None:
    assert of_b(replace(HERE, virtual=True)) == ["B sends what was computed for a virtual station: there is no antenna"]


def test_every_receiver_has_its_say() -> None:
    said = remarks((("A", ReceiverStatus(fix_ok=False)), ("C", ReceiverStatus(fix_ok=False))), TRIANGLE)
    assert said == ("A reports no fix of its own", "C reports no fix of its own")
