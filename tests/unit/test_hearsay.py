"""What receivers say of themselves, in words."""

from dataclasses import replace

import numpy as np
import pytest

from integrity.gnss.receiver_status import Antenna, Jamming, ReceiverStatus, Spoofing
from integrity.hearsay import remarks, told_apart
from integrity.monitors.told import Dispute
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


# ---- what they were told

APART = Dispute("G05", "LNAV", ("A", "B", "C"), "B", "orbit", 312.04, (45,), from_ns=100, until_ns=200)
OF_G07 = APART._replace(satellite="G07", size_m=1500.0, issues=(46, 45))
UNNAMED = APART._replace(odd=None, receivers=("A", "B"))


@pytest.mark.parametrize(
    ("disputes", "sentences"),
    [
        ([], ()),
        ([APART], ("B was told another orbit of G05 than A and C: 312.0 m apart, issue 45",)),
        ([APART._replace(quantity="clock", size_m=0.14)], ("B was told another clock of G05 than A and C: 0.14 m apart, issue 45",)),
        ([APART, OF_G07], ("B was told other orbits of 2 satellites than A and C, of G07 most: 1.5 km apart, issues 46 and 45",)),
        ([UNNAMED], ("A and B were told different orbits of G05: 312.0 m apart, issue 45",)),
        ([UNNAMED._replace(receivers=("A", "B", "C"))], ("A, B and C were told different orbits of G05: 312.0 m apart, issue 45",)),
        (
            [APART, UNNAMED._replace(satellite="G07")],
            (
                "B was told another orbit of G05 than A and C: 312.0 m apart, issue 45",
                "A and B were told different orbits of G07: 312.0 m apart, issue 45",
            ),
        ),
    ],
    ids=["nothing", "one", "a clock", "of two satellites", "nobody named", "three ways", "two of two kinds"],
)
def test_what_was_told_apart_in_words(disputes: list[Dispute], sentences: tuple[str, ...]) -> None:
    assert told_apart(disputes, 150) == sentences


@pytest.mark.parametrize(("epoch_ns", "said"), [(99, False), (100, True), (200, True), (201, False)])
def test_it_is_said_for_as_long_as_it_holds(epoch_ns: int, said: bool) -> None:
    assert bool(told_apart([APART], epoch_ns)) == said
