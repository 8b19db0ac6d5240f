"""A satellite that broadcasts a wrong orbit."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from integrity.errors import ConfigError
from integrity.events import EphemerisReceived, Event, ObservationsReceived
from integrity.gnss.constants import EARTH_ROTATION_RADPS
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.ephemeris.states import satellite_states
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Floats
from recordings.faults import Fault, inject
from recordings.faults.kinds import (
    WrongEphemeris,
)
from tests.unit.faults.made import (
    END_NS,
    EPOCHS,
    FIRST_NS,
    SEEN,
    SITE,
    START_NS,
    STREAM,
    ephemeris,
    with_fault,
)

# Ephemerides


def orbit_displacement_m(true: KeplerEphemeris, wrong: KeplerEphemeris, gps_ns: int) -> Floats:
    """Along, cross, radial."""
    (pos, vel), (other, _) = (
        (s.pos_ecef_m[:, 0, 0], s.vel_ecef_mps[:, 0, 0])
        for s in (satellite_states([e], np.array([[0]]), np.array([gps_ns])) for e in (true, wrong))
    )
    radial = pos / np.linalg.norm(pos)
    h = np.cross(pos, vel + np.cross([0.0, 0.0, EARTH_ROTATION_RADPS], pos))
    cross = h / np.linalg.norm(h)
    return np.array([np.cross(cross, radial), cross, radial]) @ (other - pos)


def altered(events: Sequence[Event], satellite: str) -> list[KeplerEphemeris]:
    known = {e.ephemeris for e in STREAM if isinstance(e, EphemerisReceived)}
    found = [e.ephemeris for e in events if isinstance(e, EphemerisReceived) and e.ephemeris.satellite == satellite]
    return [e for e in found if isinstance(e, KeplerEphemeris) and e not in known]


@pytest.mark.parametrize("axis", ["along", "cross", "radial"])
@pytest.mark.parametrize("offset_m", [700.0, -2500.0])
@pytest.mark.parametrize("after_s", [0, 600])
@pytest.mark.parametrize("signal", SEEN)
def test_a_wrong_ephemeris_is_displaced_as_told(axis: str, offset_m: float, after_s: int, signal: str) -> None:
    satellite = signal[:3]
    wrong, _ = altered(
        with_fault(WrongEphemeris.model_validate({"satellite": satellite, "offset_m": offset_m, "direction": axis})), satellite
    )
    found = orbit_displacement_m(ephemeris(int(satellite[1:])), wrong, START_NS + after_s * NS_PER_S) / offset_m
    expected = np.array([axis == "along", axis == "cross", axis == "radial"], dtype=np.float64)
    assert np.abs(found - expected)[expected == 1.0].max() < 0.02
    assert np.abs(found - expected)[expected == 0.0].max() < 0.05


def test_a_wrong_ephemeris_enters_before_the_first_faulty_epoch_and_leaves_after_the_last() -> None:
    satellite = SEEN[0][:3]
    events = with_fault(WrongEphemeris(satellite=satellite, offset_m=700.0, direction="along"))
    places = [i for i, e in enumerate(events) if isinstance(e, EphemerisReceived) and e.mono_ns > FIRST_NS]
    following = [e.row.receive_time_ns for i in places if isinstance(e := events[i + 1], ObservationsReceived)]
    assert following == [START_NS, END_NS]


def test_the_true_ephemeris_enters_again_with_a_later_transmission() -> None:
    satellite = SEEN[0][:3]
    wrong, again = altered(with_fault(WrongEphemeris(satellite=satellite, offset_m=700.0, direction="along")), satellite)
    assert again == ephemeris(int(satellite[1:]), transmission_ns=END_NS)
    assert (wrong.issue, wrong.transmission_ns) == (7 + 128, START_NS)


def test_an_ephemeris_that_arrives_during_the_fault_is_wrong_likewise_and_true_afterwards() -> None:
    number = int(SEEN[0][1:3])
    arriving = ephemeris(number, transmission_ns=EPOCHS[9], issue=20)
    place = next(i for i, e in enumerate(STREAM) if e.mono_ns == EPOCHS[9])
    events = [*STREAM[:place], EphemerisReceived(EPOCHS[9], arriving), *STREAM[place:]]
    fault = Fault(START_NS, END_NS, WrongEphemeris(satellite=f"G{number:02d}", offset_m=700.0, direction="cross"))
    _, during, again = altered(inject(events, [fault], SITE), f"G{number:02d}")
    assert orbit_displacement_m(arriving, during, EPOCHS[9]) == pytest.approx([0.0, 700.0, 0.0], abs=14.0)
    assert again == replace(arriving, transmission_ns=END_NS)


def test_an_orbit_that_no_station_accepts_is_refused() -> None:
    low = [
        replace(e, ephemeris=replace(e.ephemeris, sqrt_a=5001.0))
        if isinstance(e, EphemerisReceived) and isinstance(e.ephemeris, KeplerEphemeris)
        else e
        for e in STREAM
    ]
    fault = Fault(START_NS, END_NS, WrongEphemeris(satellite=SEEN[0][:3], offset_m=-100_000.0, direction="radial"))
    with pytest.raises(ConfigError, match="no orbit that a station accepts"):
        inject(low, [fault], SITE)
