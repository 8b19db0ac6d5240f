"""What an injection must not do."""

import numpy as np
import pytest

from integrity.errors import ConfigError
from integrity.events import ObservationsReceived
from recordings.faults import Fault, inject
from recordings.faults.kinds import (
    CodeCarrierDivergence,
    ConstellationClock,
    IonoFront,
    Jamming,
    LowPower,
    Meaconing,
    Multipath,
    ReceiverBias,
    ReceiverFreeze,
    SatelliteStep,
    Spoofing,
    WrongEphemeris,
)
from tests.unit.faults.made import END_NS, EPOCHS, FIRST_NS, SEEN, SITE, START_NS, STREAM, changes, rows_of, with_fault


def test_input_events_are_not_changed() -> None:
    before = [rows_of(STREAM, "A")[t].pseudorange_m.copy() for t in EPOCHS]
    with_fault(ReceiverBias(receiver="A", offset_enu_m=(15.0, 0.0, 0.0)))
    assert all(np.array_equal(b, rows_of(STREAM, "A")[t].pseudorange_m) for b, t in zip(before, EPOCHS, strict=True))


def test_the_order_of_faults_does_not_matter() -> None:
    faults = [
        Fault(START_NS, END_NS, ReceiverFreeze(receiver="A")),
        Fault(EPOCHS[3], EPOCHS[8], SatelliteStep(satellite=SEEN[0][:3], size_m=10.0)),
        Fault(EPOCHS[2], EPOCHS[9], ReceiverBias(receiver="A", offset_enu_m=(5.0, 0.0, 0.0))),
    ]
    forward, backward = (changes(inject(STREAM, order, SITE), "A") for order in (faults, faults[::-1]))
    assert [list(f.values()) for f in forward.values()] == [pytest.approx(list(b.values()), abs=1e-6) for b in backward.values()]


NOTHING = {
    "before the recording": (
        Fault(1, 2, SatelliteStep(satellite="G01", size_m=1.0)),
        "covers no epoch: the recording spans 2010-03-18T04:59:45Z",
    ),
    "satellite unseen": (
        Fault(START_NS, END_NS, SatelliteStep(satellite="G31", size_m=1.0)),
        f"G31 is not seen then; seen are {SEEN[0][:3]}, ",
    ),
    "ephemeris unknown": (
        Fault(START_NS, END_NS, WrongEphemeris(satellite="G32", offset_m=100.0, direction="along")),
        "no ephemeris of G32",
    ),
    "nothing to repeat": (Fault(FIRST_NS, END_NS, ReceiverFreeze(receiver="A")), "no row of the receiver before it"),
    "spoofed to where it is": (Fault(START_NS, END_NS, Spoofing(receivers=("A",))), "the ranges are what they would be anyway"),
    "system unseen": (
        Fault(START_NS, END_NS, ConstellationClock(system="Galileo", size_m=1.0)),
        "no satellite of Galileo is seen then; seen are GPS; the recording spans",
    ),
    "drift not begun": (
        Fault(START_NS, EPOCHS[6], CodeCarrierDivergence(satellite=SEEN[0][:3], rate_mps=1.0)),
        "the drift has not begun",
    ),
    "weaker only later": (
        Fault(START_NS, EPOCHS[6], LowPower(satellite=SEEN[0][:3], drop_db=9.0, ramp_s=60.0)),
        "the ramp has not begun",
    ),
    "front elsewhere": (
        Fault(START_NS, END_NS, IonoFront(slope_mm_per_km=100.0, width_km=50.0, speed_mps=0.0, azimuth_deg=0.0, edge_km=-5000.0)),
        "is pierced behind its edge then",
    ),
    "reflection of a satellite unseen": (
        Fault(START_NS, END_NS, Multipath(receiver="A", satellites=(SEEN[0][:3], "G31"), amplitude_m=1.0, period_s=60.0)),
        "G31 is not seen then",
    ),
    "ramp not begun": (Fault(START_NS, EPOCHS[6], Jamming(receivers=("A",), drop_db=9.0, ramp_s=60.0)), "the ramp has not begun"),
}


def test_a_repeater_of_a_receiver_that_measures_nothing_then_is_refused() -> None:
    """Of A all rows within the fault are gone."""
    silent = [e for e in STREAM if not (isinstance(e, ObservationsReceived) and e.row.receiver == "A" and START_NS <= e.mono_ns < END_NS)]
    repeater = Fault(START_NS, END_NS, Meaconing(from_receiver="A", to_receivers=("B", "C"), delay_m=300.0))
    with pytest.raises(ConfigError, match="A hears nothing then"):
        inject(silent, [repeater], SITE)


@pytest.mark.parametrize("case", NOTHING)
def test_a_fault_that_does_nothing_is_refused(case: str) -> None:
    fault, message = NOTHING[case]
    with pytest.raises(ConfigError) as caught:
        inject(STREAM, [fault], SITE)
    assert message in str(caught.value)
