"""Faults put into RTCM 3: MSM messages written again, and nothing else touched."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.events import EphemerisReceived, Event, ObservationsReceived, RawBytes
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import ObservationRow
from integrity.gnss.rtcm.framing import RtcmFramer, frame_bytes, message_number
from integrity.gnss.rtcm.msm import MSM_NUMBERS
from integrity.station_monitor import StationMonitor
from recordings.faults import inject
from recordings.faults.kinds import (
    CodeCarrierDivergence,
    ConstellationClock,
    CorruptBytes,
    Delay,
    Effect,
    IonoFront,
    LowPower,
    Meaconing,
    ReceiverBias,
    ReceiverClockJump,
    ReceiverDrop,
    ReceiverDuplicate,
    ReceiverFreeze,
    ReceiverNoise,
    SatelliteRamp,
    SatelliteStep,
    Spoofing,
)
from tests.unit.faults.everywhere import BEGIN, END, FIRST_NS, MEASURED, MSM, RTCM_SITE, fault, rows_of, with_fault
from tests.unit.faults.raw import recut, stream_of

BEFORE = rows_of(MSM, RTCM_SITE)
EFFECTS: dict[str, Effect] = {
    "satellite_step": SatelliteStep(satellite="R02", size_m=30.0),
    "satellite_ramp": SatelliteRamp(satellite="G07", rate_mps=150.0),
    "code_carrier_divergence": CodeCarrierDivergence(satellite="G07", rate_mps=1.0),
    "constellation_clock": ConstellationClock(system="BeiDou", size_m=12_345.0),
    "low_power": LowPower(satellite="G07", drop_db=17.0),
    "iono_front": IonoFront(slope_mm_per_km=400.0, width_km=100.0, speed_mps=500.0, azimuth_deg=70.0, edge_km=0.0),
    "receiver_bias": ReceiverBias(receiver="B", offset_enu_m=(400.0, -300.0, 20.0)),
    "receiver_noise": ReceiverNoise(receiver="B", factor=5.0),
    "receiver_clock_jump": ReceiverClockJump(receiver="B", size_m=-299_792.458),
    "receiver_freeze": ReceiverFreeze(receiver="B"),
    "spoofing, not coherent": Spoofing(receivers=("A", "B", "C"), coherent=False),
    "meaconing": Meaconing(from_receiver="A", to_receivers=("B",), delay_m=3000.0),
}
ROUND_TRIP = {"pseudorange_m": 3e-4, "carrier_cycles": 4e-4, "doppler_hz": 3e-4, "cn0_dbhz": 0.04}  # half a unit of MSM7 at least


def with_rtcm_fault(effect: Effect, events: Sequence[Event] = MSM) -> tuple[Event, ...]:
    return with_fault(events, effect, RTCM_SITE)


def messages_of(events: Sequence[Event], receiver: str) -> list[bytes]:
    """All of them; a frame with a wrong checksum, or a byte outside of frames, is none of ours."""
    framer = RtcmFramer()
    found = framer.feed(stream_of(events, receiver))
    assert (framer.bad_frames, framer.skipped_bytes, framer.pending) == (0, 0, b"")
    return found


def assert_close(now: ObservationRow, told: ObservationRow) -> None:
    """What was read against what should be there."""
    place = {signal: i for i, signal in enumerate(told.signals)}
    assert set(now.signals) == place.keys()
    assert now.receive_time_ns == told.receive_time_ns
    columns = [place[signal] for signal in now.signals]
    for name, tolerance in ROUND_TRIP.items():
        mine, theirs = getattr(now, name), getattr(told, name)[columns]
        assert np.abs(mine - theirs).max() <= tolerance, name


def decoded(event: Event) -> bool:
    """Whether an event is what bytes can say: RTCM has no orbits of SBAS."""
    return not (isinstance(event, EphemerisReceived) and event.ephemeris.satellite[0] == "S")


@pytest.mark.parametrize("kind", EFFECTS)
def test_what_is_heard_is_the_row_with_the_fault(kind: str) -> None:
    """As on measurements that were decoded from the same bytes, to the units of the message."""
    events = [
        replace(e, row=BEFORE[e.row.receiver, (e.mono_ns - FIRST_NS) // NS_PER_S]) if isinstance(e, ObservationsReceived) else e
        for e in MEASURED
        if decoded(e)
    ]
    expected = rows_of(inject(events, [fault(EFFECTS[kind])], RTCM_SITE), RTCM_SITE)
    for key, row in rows_of(with_rtcm_fault(EFFECTS[kind]), RTCM_SITE).items():
        assert_close(row, expected[key])


@pytest.mark.parametrize("kind", EFFECTS)
def test_frames_are_sound_and_only_messages_of_the_fault_change(kind: str) -> None:
    """Numbers in the same order, of the same kind; what is no MSM stays to the bit; nobody else's bytes change."""
    after = with_rtcm_fault(EFFECTS[kind])
    touched = [r for r in RTCM_SITE.receiver_names if stream_of(after, r) != stream_of(MSM, r)]
    assert touched == (["B"] if "receiver" in EFFECTS[kind].model_dump() or kind == "meaconing" else ["A", "B", "C"])
    for receiver in touched:
        was, now = messages_of(MSM, receiver), messages_of(after, receiver)
        assert [message_number(m) for m in now] == [message_number(m) for m in was]
        assert all(a == b for a, b in zip(now, was, strict=True) if message_number(a) not in MSM_NUMBERS)


@pytest.mark.parametrize(("kind", "number"), [("satellite_step", 1087), ("satellite_ramp", 1077), ("constellation_clock", 1127)])
def test_messages_of_other_systems_keep_their_bytes(kind: str, number: int) -> None:
    was, now = messages_of(MSM, "B"), messages_of(with_rtcm_fault(EFFECTS[kind]), "B")
    assert {message_number(a) for a, b in zip(now, was, strict=True) if a != b} == {number}


def test_epochs_without_the_fault_keep_their_bytes() -> None:
    after = with_rtcm_fault(EFFECTS["spoofing, not coherent"])
    changed = [i for i, (a, b) in enumerate(zip(MSM, after, strict=True)) if a is not b]
    assert {(MSM[i].mono_ns - MSM[0].mono_ns) // NS_PER_S for i in changed} == set(range(BEGIN, END))


def test_signals_that_nobody_changed_keep_their_bits() -> None:
    """Of the satellite whose rough range moved with one of its signals, too: it is told in the units of the fine one."""
    now = rows_of(with_rtcm_fault(EFFECTS["low_power"]), RTCM_SITE)
    for receiver in RTCM_SITE.receiver_names:
        row, was = now[receiver, BEGIN], BEFORE[receiver, BEGIN]
        same = [i for i, signal in enumerate(was.signals) if signal[:3] != "G07"]
        assert row.signals == tuple(was.signals[i] for i in same)
        assert np.array_equal(row.pseudorange_m, was.pseudorange_m[same])


def test_a_satellite_that_is_lost_leaves_the_message_with_its_mask() -> None:
    was, now = messages_of(MSM, "B"), messages_of(with_rtcm_fault(EFFECTS["low_power"]), "B")
    shorter = [(a, b) for a, b in zip(now, was, strict=True) if a != b]
    assert len(shorter) == END - BEGIN
    for a, b in shorter:  # the satellite mask begins in bit 73, G07 is its seventh bit
        masks = [int.from_bytes(m, "big") >> 8 * len(m) - 73 - 64 & (1 << 64) - 1 for m in (a, b)]
        assert masks[0] ^ masks[1] == 1 << 64 - 7
        assert len(a) < len(b)


def test_a_message_that_loses_all_its_satellites_stays_as_an_empty_one() -> None:
    """It may be the one that says that no more follow."""
    faults = [fault(LowPower(satellite=s, drop_db=60.0)) for s in sorted({s[:3] for s in BEFORE["B", BEGIN].signals if s[0] == "C"})]
    now = rows_of(inject(MSM, faults, RTCM_SITE), RTCM_SITE)
    assert sorted(now) == sorted(BEFORE)
    assert {s[0] for s in now["B", BEGIN].signals} == set("GERJS")


# Bursts


def test_a_row_that_the_next_one_completes_is_changed_as_well() -> None:
    """Of a caster that always says that more follows: in DF393, bit 54 of a message."""

    def announcing(message: bytes) -> bytes:
        bits = int.from_bytes(message, "big") | 1 << 8 * len(message) - 55
        return bits.to_bytes(len(message), "big") if message_number(message) in MSM_NUMBERS else message

    events = tuple(
        replace(e, data=b"".join(frame_bytes(announcing(m)) for m in RtcmFramer().feed(e.data))) if isinstance(e, RawBytes) else e
        for e in MSM
    )
    was, now = (rows_of(x, RTCM_SITE) for x in (events, with_rtcm_fault(EFFECTS["receiver_bias"], events)))
    assert sorted(was) == sorted(key for key in BEFORE if key[1] < 19)  # the last is never over
    assert {key for key in was if not np.array_equal(was[key].pseudorange_m, now[key].pseudorange_m)} == {
        ("B", epoch) for epoch in range(BEGIN, END)
    }


@settings(max_examples=6, deadline=None, derandomize=True)
@given(size=st.integers(1, 2000), kind=st.sampled_from(["receiver_bias", "low_power", "receiver_freeze"]))
def test_how_bytes_are_cut_changes_no_byte_of_the_outcome(size: int, kind: str) -> None:
    cut, whole = (with_rtcm_fault(EFFECTS[kind], events) for events in (recut(MSM, size), MSM))
    assert [stream_of(cut, r) for r in RTCM_SITE.receiver_names] == [stream_of(whole, r) for r in RTCM_SITE.receiver_names]


def test_a_recording_may_begin_within_an_epoch() -> None:
    """Its first row is partly in the snapshot, and stays; those after it are faulty."""
    start = next(
        i for i, e in enumerate(MSM) if isinstance(e, RawBytes) and (e.receiver, e.mono_ns) == ("B", MSM[0].mono_ns + 7 * NS_PER_S)
    )
    event = MSM[start]
    assert isinstance(event, RawBytes)
    monitor = StationMonitor(RTCM_SITE)
    monitor.feed([*MSM[:start], replace(event, data=event.data[:900])])
    rest = [replace(event, data=event.data[900:]), *MSM[start + 1 :]]
    after = inject(rest, [fault(EFFECTS["receiver_bias"])], RTCM_SITE, snapshot=monitor.snapshot())
    whole = stream_of(inject(MSM, [fault(EFFECTS["receiver_bias"], 8.0)], RTCM_SITE), "B")
    assert stream_of(after, "B") == whole[-len(stream_of(after, "B")) :]


@pytest.mark.parametrize("effect", [Delay(receiver="B", seconds=2.5), ReceiverDuplicate(receiver="B"), ReceiverDrop(receiver="B")])
def test_links_of_rtcm_break_no_frame(effect: Effect) -> None:
    after = with_rtcm_fault(effect)
    was, now = messages_of(MSM, "B"), messages_of(after, "B")
    per_epoch = sum(message_number(m) in MSM_NUMBERS for m in was) // 20
    more = {"delay": 0, "receiver_duplicate": 10 * per_epoch, "receiver_drop": -10 * per_epoch}[effect.kind]
    assert len(now) - len(was) == more


def test_bits_flip_in_rtcm_too() -> None:
    after = with_rtcm_fault(CorruptBytes(receiver="B", rate=0.01))
    framer = RtcmFramer()
    framer.feed(stream_of(after, "B"))
    assert framer.bad_frames > 0


def test_a_message_that_the_decoder_refused_stays() -> None:
    """The first of each epoch comes twice: told already, it says nothing."""

    def doubled(data: bytes) -> bytes:
        messages = RtcmFramer().feed(data)
        first = next(i for i, message in enumerate(messages) if message_number(message) in MSM_NUMBERS)
        return b"".join(frame_bytes(message) for message in [*messages[: first + 1], *messages[first:]])

    events = tuple(replace(event, data=doubled(event.data)) if isinstance(event, RawBytes) else event for event in MSM)
    (was, now) = (messages_of(x, "B") for x in (events, with_rtcm_fault(EFFECTS["receiver_bias"], events)))
    copies = [i for i in range(1, len(was)) if was[i] == was[i - 1]]
    assert len(copies) == 20
    assert [now[i] for i in copies] == [was[i] for i in copies]
    assert sum(now[i - 1] != was[i - 1] for i in copies) == END - BEGIN


def test_a_frozen_receiver_repeats_all_messages_of_an_epoch_that_had_more() -> None:
    """From the fault on GLONASS (1087) is not told any more, but in what is repeated."""

    def without(event: Event) -> Event:
        if not isinstance(event, RawBytes) or event.mono_ns < FIRST_NS + BEGIN * NS_PER_S:
            return event
        return replace(event, data=b"".join(frame_bytes(m) for m in RtcmFramer().feed(event.data) if message_number(m) != 1087))

    events = tuple(without(event) for event in MSM)
    now = rows_of(with_rtcm_fault(EFFECTS["receiver_freeze"], events), RTCM_SITE)
    for epoch in range(BEGIN, END):
        assert now["B", epoch].signals == BEFORE["B", BEGIN - 1].signals
        assert np.array_equal(now["B", epoch].pseudorange_m, BEFORE["B", BEGIN - 1].pseudorange_m)
    assert "R" not in {signal[0] for signal in now["B", END].signals}
