"""MSM 4 to 7 with a fault in them, and what they have no room for."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.errors import ConfigError
from integrity.events import Event, RawBytes
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.rtcm.framing import RtcmFramer, frame_bytes, message_number
from integrity.gnss.rtcm.msm import MSM_NUMBERS
from integrity.gnss.rtcm.msm_writer import encode_row
from recordings.faults.kinds import CodeCarrierDivergence, Effect, SatelliteRamp, SatelliteStep
from tests.unit.faults.everywhere import BEGIN, MSM, RTCM_SITE, WAS, rows_of, with_fault
from tests.unit.faults.raw import stream_of
from tests.unit.many_signals import CHANNELS


@cache
def of_kind(kind: int) -> tuple[Event, ...]:
    """The same rows in messages of another kind."""
    later = {key: b"".join(map(frame_bytes, encode_row(WAS[key], kind, 1, CHANNELS))) for key in WAS}
    out: list[Event] = []
    for event in MSM:
        if isinstance(event, RawBytes):
            key = event.receiver, (event.mono_ns - MSM[0].mono_ns) // NS_PER_S
            orbits = b"".join(frame_bytes(m) for m in RtcmFramer().feed(event.data) if message_number(m) not in MSM_NUMBERS)
            out.append(replace(event, data=orbits + later[key]))
        else:
            out.append(event)
    return tuple(out)


@pytest.mark.parametrize("kind", [4, 5, 6, 7])
@pytest.mark.parametrize("size_m", [0.5, 400.0, -5000.0])
def test_a_message_stays_of_its_kind(kind: int, size_m: float) -> None:
    """A step beyond 292 m, what a signal can add to the rough range, moves the rough one. To half a unit of a range or a phase."""
    events = of_kind(kind)
    was, after = rows_of(events, RTCM_SITE), with_fault(events, SatelliteStep(satellite="E11", size_m=size_m), RTCM_SITE)
    now = rows_of(after, RTCM_SITE)
    assert {(message_number(m) or 0) % 10 for m in RtcmFramer().feed(stream_of(after, "A")) if message_number(m) in MSM_NUMBERS} == {kind}
    coarse_m = 299_792.458 * (2.0**-24 if kind < 6 else 2.0**-29) / 2.0 + 1e-6
    for i, signal in enumerate(now["A", BEGIN].signals):
        moved_m = now["A", BEGIN].pseudorange_m[i] - was["A", BEGIN].pseudorange_m[i]
        assert moved_m == pytest.approx(size_m, abs=coarse_m) if signal[:3] == "E11" else moved_m == 0.0


@pytest.mark.parametrize(
    ("effect", "message"),
    [
        (
            CodeCarrierDivergence(satellite="G07", rate_mps=5000.0),
            r"a carrier .* from the rough range does not fit, .* 1171\.\d m",
        ),
        (SatelliteRamp(satellite="G07", rate_mps=9000.0), r"a rate of 9000\.0 m/s does not fit, .* at most 8191 m/s"),
    ],
)
def test_what_a_message_has_no_room_for_is_refused(effect: Effect, message: str) -> None:
    with pytest.raises(ConfigError, match=r"G07\.\w\w cannot be told in RTCM message 1077: " + message):
        with_fault(MSM, effect, RTCM_SITE)


@settings(max_examples=12, deadline=None, derandomize=True)
@given(size_m=st.floats(-1e5, 1e5).filter(lambda size: abs(size) > 0.1), kind=st.sampled_from([4, 5, 6, 7]))
def test_a_fault_and_its_opposite_leave_what_was_told(size_m: float, kind: int) -> None:
    """To the bit: shifts are whole units of the message, wherever the rough range has gone meanwhile."""
    events = of_kind(kind)
    there = with_fault(events, SatelliteStep(satellite="G07", size_m=size_m), RTCM_SITE)
    back = with_fault(there, SatelliteStep(satellite="G07", size_m=-size_m), RTCM_SITE)
    was, now = (rows_of(x, RTCM_SITE)["A", BEGIN] for x in (events, back))
    assert np.array_equal(was.pseudorange_m, now.pseudorange_m)
    assert np.array_equal(was.carrier_cycles, now.carrier_cycles, equal_nan=True)


def test_what_stands_behind_the_cells_of_a_message_stays() -> None:
    """Bytes that a later version of the format may have meant for something."""

    def longer(data: bytes) -> bytes:
        messages = RtcmFramer().feed(data)
        return b"".join(frame_bytes(m + b"\xa5\x5a" if message_number(m) in MSM_NUMBERS else m) for m in messages)

    events = tuple(replace(event, data=longer(event.data)) if isinstance(event, RawBytes) else event for event in MSM)
    after = with_fault(events, SatelliteStep(satellite="E11", size_m=10.0), RTCM_SITE)
    now = RtcmFramer().feed(stream_of(after, "A"))
    assert {m[-2:] for m in now if message_number(m) in MSM_NUMBERS} == {b"\xa5\x5a"}
    assert [message for message in now if message not in RtcmFramer().feed(stream_of(events, "A"))] != []
