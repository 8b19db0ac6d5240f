"""Faults put into the bytes of receivers: the same decisions as on what the bytes say, and no byte touched that does not concern them."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.events import EphemerisReceived, Event, IonosphereReceived, ObservationsReceived, RawBytes
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import ROW_ARRAYS, ObservationRow
from integrity.gnss.ubx.framing import Framer, frame_bytes
from integrity.gnss.ubx.rawx import RAWX_HEADER, RXM_RAWX, decode_rawx
from integrity.gnss.ubx.sfrbx import RXM_SFRBX
from integrity.reception import Reception
from recordings.faults import inject
from recordings.faults.kinds import (
    AntennaMoved,
    CodeCarrierDivergence,
    ConstellationClock,
    ConstellationFrame,
    Delay,
    Effect,
    IonoFront,
    Jamming,
    LowPower,
    Meaconing,
    Multipath,
    ReceiverBias,
    ReceiverClockJump,
    ReceiverDrop,
    ReceiverDuplicate,
    ReceiverFreeze,
    ReceiverNoise,
    ReceiverRamp,
    SatelliteAcceleration,
    SatelliteRamp,
    SatelliteStep,
    Spoofing,
    TwoReceivers,
)
from tests.unit.faults.raw import BYTES, MEASURED, SECONDS, decided, fault, framed, recut, stream_of, with_fault
from tests.unit.streams import SITE, START_NS, epoch_of, new_monitor

NMEA = b"$GNGGA,030000.00,,,,,0,,,,,,,,*00\r\n"
DAMAGED = frame_bytes(0x01, 0x07, bytes(92))[:-1] + b"\x00"
EFFECTS: dict[str, Effect] = {
    "satellite_step": SatelliteStep(satellite="G07", size_m=30.0),
    "satellite_ramp": SatelliteRamp(satellite="G07", rate_mps=1.0),
    "receiver_bias": ReceiverBias(receiver="B", offset_enu_m=(12.0, -9.0, 0.0)),
    "receiver_ramp": ReceiverRamp(receiver="B", rate_mps=1.0),
    "receiver_freeze": ReceiverFreeze(receiver="B"),
    "receiver_drop": ReceiverDrop(receiver="B"),
    "antenna_moved": AntennaMoved(receiver="C", offset_enu_m=(12.0, -9.0, 0.0)),
    "two_receivers": TwoReceivers(receivers=("A", "B"), offset_enu_m=(12.0, -9.0, 0.0)),
    "spoofing": Spoofing(receivers=("A", "B", "C"), drift_mps=0.5),
    "spoofing, not coherent": Spoofing(receivers=("A", "B", "C"), coherent=False),
    "jamming": Jamming(receivers=("A", "B"), drop_db=12.3, ramp_s=5.0),
    "receiver_duplicate": ReceiverDuplicate(receiver="B"),
    "delay": Delay(receiver="B", seconds=3.5),
    "satellite_acceleration": SatelliteAcceleration(satellite="G07", rate_mps2=0.1),
    "code_carrier_divergence": CodeCarrierDivergence(satellite="G07", rate_mps=1.0),
    "low_power": LowPower(satellite="G07", drop_db=16.0),
    "constellation_clock": ConstellationClock(system="Galileo", size_m=30.0),
    "constellation_frame": ConstellationFrame(system="Galileo", offset_ecef_m=(60.0, 0.0, -20.0)),
    "iono_front": IonoFront(slope_mm_per_km=400.0, width_km=50.0, speed_mps=300.0, azimuth_deg=20.0, edge_km=0.0),
    "receiver_noise": ReceiverNoise(receiver="B", factor=20.0),
    "receiver_clock_jump": ReceiverClockJump(receiver="B", size_m=299_792.458),
    "receiver_clock_jump, no whole ms": ReceiverClockJump(receiver="B", size_m=1000.0),
    "multipath": Multipath(receiver="B", satellites=("G07", "E11"), amplitude_m=20.0, period_s=60.0),
    "meaconing": Meaconing(from_receiver="A", to_receivers=("B", "C"), delay_m=300.0),
}  # and wrong_ephemeris: test_words
SURELY_SEEN = ("satellite_step", "receiver_bias", "receiver_noise", "receiver_drop", "jamming", "spoofing", "meaconing")


@pytest.mark.parametrize("kind", EFFECTS)
def test_a_fault_in_bytes_is_decided_as_the_same_fault_in_measurements(kind: str) -> None:
    on_bytes = decided(with_fault(BYTES, EFFECTS[kind]))
    assert on_bytes == decided(with_fault(MEASURED, EFFECTS[kind]))
    if kind in SURELY_SEEN:
        assert on_bytes != decided(BYTES)


def noisy(events: tuple[Event, ...]) -> tuple[Event, ...]:
    """With a text line and a damaged frame before each burst."""
    return tuple(replace(e, data=NMEA + DAMAGED + e.data) if isinstance(e, RawBytes) else e for e in events)


@pytest.mark.parametrize("kind", EFFECTS)
def test_no_frame_is_broken_and_nothing_else_is_touched(kind: str) -> None:
    """Of a receiver that sends on, every frame but measurements, text and damage stay; of a silent one, all of it is gone or there."""
    before, after = noisy(BYTES), with_fault(noisy(BYTES), EFFECTS[kind])
    for receiver in SITE.receiver_names:
        (was, bad_was, skipped_was), (now, bad_now, skipped_now) = framed(before, receiver), framed(after, receiver)
        bursts = sum(f[:2] == RXM_RAWX for f in now) - SECONDS  # more, or fewer, than there were
        assert bad_now - bad_was == bursts * bad_was // SECONDS
        assert skipped_now - skipped_was == bursts * skipped_was // SECONDS
        if not bursts:
            assert [f for f in now if f[:2] != RXM_RAWX] == [f for f in was if f[:2] != RXM_RAWX]


def test_without_faults_events_are_the_same() -> None:
    assert inject(BYTES, [], SITE) == BYTES


@pytest.mark.parametrize("receiver", ["A", "C"])
def test_receivers_without_a_fault_keep_their_bytes(receiver: str) -> None:
    assert stream_of(with_fault(BYTES, EFFECTS["receiver_bias"]), receiver) == stream_of(BYTES, receiver)


def test_epochs_without_a_fault_keep_their_bytes() -> None:
    after = with_fault(BYTES, EFFECTS["spoofing"])
    touched = {(b.mono_ns - START_NS) // NS_PER_S for a, b in zip(BYTES, after, strict=True) if a is not b}
    assert touched == set(range(40, 80))


@settings(max_examples=8, deadline=None, derandomize=True)
@given(
    size=st.integers(1, 700), kind=st.sampled_from(["receiver_bias", "jamming", "receiver_freeze", "receiver_drop", "receiver_duplicate"])
)
def test_how_bytes_are_cut_changes_no_byte_of_the_outcome(size: int, kind: str) -> None:
    cut, whole = (with_fault(events, EFFECTS[kind]) for events in (recut(BYTES, size), BYTES))
    assert [stream_of(cut, receiver) for receiver in SITE.receiver_names] == [
        stream_of(whole, receiver) for receiver in SITE.receiver_names
    ]


def rows_of(events: tuple[Event, ...], receiver: str) -> list[ObservationRow]:
    reception = Reception(SITE.receiver_names)
    heard = [h for event in events for h in reception.take(event)]
    return [h.row for h in heard if isinstance(h, ObservationsReceived) and h.row.receiver == receiver]


@pytest.mark.parametrize("kind", [kind for kind in EFFECTS if kind not in ("receiver_drop", "receiver_duplicate", "delay")])
def test_measurements_in_bytes_are_those_of_the_row(kind: str) -> None:
    """Ranges and carriers to the bit; Doppler to a float of 32 bits, 0.25 mHz at 5 kHz; C/N0 to a whole decibel."""
    for told, read in zip(rows_of(with_fault(MEASURED, EFFECTS[kind]), "B"), rows_of(with_fault(BYTES, EFFECTS[kind]), "B"), strict=True):
        assert (told.signals, told.receive_time_ns) == (read.signals, read.receive_time_ns)
        for name in ROW_ARRAYS:
            tolerance = {"doppler_hz": 2.5e-4, "cn0_dbhz": 0.5}.get(name, 0.0)
            apart = np.abs(getattr(told, name).astype(float) - getattr(read, name)).max(initial=0.0)
            assert apart <= tolerance, name


def test_signals_that_jamming_takes_leave_the_frame() -> None:
    now, _, _ = framed(with_fault(BYTES, Jamming(receivers=("A",), drop_db=15.0)), "A")
    payload = [f.payload for f in now if f[:2] == RXM_RAWX][50]
    (row,) = decode_rawx([payload], "A")
    assert row is not None
    assert 0 < len(row.signals) == RAWX_HEADER.unpack_from(payload)[3] < len(rows_of(BYTES, "A")[50].signals)


def test_a_frozen_receiver_sends_its_last_measurements_under_new_times() -> None:
    payloads = [f.payload for f in framed(with_fault(BYTES, EFFECTS["receiver_freeze"]), "B")[0] if f[:2] == RXM_RAWX]
    assert [p[RAWX_HEADER.size :] == payloads[39][RAWX_HEADER.size :] for p in payloads] == [39 <= k < 80 for k in range(SECONDS)]
    assert [epoch_of(row) for row in decode_rawx(payloads, "B") if row is not None] == list(range(SECONDS))


def test_a_receiver_that_freezes_after_a_fault_repeats_it() -> None:
    bias = fault(EFFECTS["receiver_bias"], 30.0, 40.0)
    both = inject(BYTES, [bias, fault(EFFECTS["receiver_freeze"])], SITE)
    assert np.array_equal(rows_of(both, "B")[60].pseudorange_m, rows_of(inject(BYTES, [bias], SITE), "B")[39].pseudorange_m)


def test_a_silent_receiver_sends_nothing_at_all() -> None:
    events = with_fault(BYTES, EFFECTS["receiver_drop"])
    assert [(e.mono_ns - START_NS) // NS_PER_S for e in events if isinstance(e, RawBytes) and e.receiver == "B"] == [
        *range(40),
        *range(80, 120),
    ]


def test_a_receiver_silent_to_the_end_sends_no_half_burst() -> None:
    trailing = (*BYTES, RawBytes(BYTES[-1].mono_ns, "B", NMEA))
    assert stream_of(with_fault(trailing, EFFECTS["receiver_drop"], 40.0, None), "B") == stream_of(BYTES[: BYTES.index(burst(40))], "B")


def burst(second: int) -> RawBytes:
    """Of receiver B."""
    return next(e for e in BYTES if isinstance(e, RawBytes) and e.receiver == "B" and e.mono_ns == START_NS + second * NS_PER_S)


def test_a_recording_may_begin_within_a_frame() -> None:
    """What the snapshot had received of it is not there to be changed: the frame stays, those after it are faulty."""
    start = next(i for i, e in enumerate(BYTES) if isinstance(e, RawBytes) and e.mono_ns == START_NS + 40 * NS_PER_S)
    monitor = new_monitor()
    monitor.feed([*BYTES[:start], replace(burst(40), data=burst(40).data[:-50])])
    rest = [replace(e, data=e.data[-50:]) if e is burst(40) else e for e in BYTES[start:]]
    after = inject(rest, [fault(EFFECTS["receiver_bias"])], SITE, snapshot=monitor.snapshot())
    whole = stream_of(with_fault(BYTES, EFFECTS["receiver_bias"], 41.0), "B")
    assert stream_of(after, "B") == whole[-len(stream_of(after, "B")) :]


def mixed(receiver: str) -> tuple[Event, ...]:
    """Bytes of one receiver, measurements of the others and ephemerides as such."""
    as_such = [e for e in MEASURED if isinstance(e, EphemerisReceived | IonosphereReceived)]
    paired = zip((e for e in MEASURED if not isinstance(e, EphemerisReceived | IonosphereReceived)), BYTES, strict=True)
    return (*as_such, *(raw if isinstance(raw, RawBytes) and raw.receiver == receiver else told for told, raw in paired))


@pytest.mark.parametrize("kind", ["receiver_bias", "spoofing", "receiver_drop", "jamming", "delay"])
def test_bytes_of_one_receiver_and_measurements_of_others_go_together(kind: str) -> None:
    assert decided(with_fault(mixed("B"), EFFECTS[kind])) == decided(with_fault(MEASURED, EFFECTS[kind]))


def test_faults_of_all_levels_go_together() -> None:
    effects = ("satellite_step", "receiver_freeze", "jamming", "delay")
    faults = [fault(EFFECTS[kind], 40.0 + 3.0 * i) for i, kind in enumerate(effects)]
    assert decided(inject(BYTES, faults, SITE)) == decided(inject(MEASURED, faults[::-1], SITE))


def test_time_never_steps_back() -> None:
    events = inject(BYTES, [fault(EFFECTS["delay"]), fault(EFFECTS["receiver_drop"], 85.0, 95.0)], SITE)
    assert all(a.mono_ns <= b.mono_ns for a, b in pairwise(events))
    assert Framer().feed(stream_of(events, "B"))[-1][:2] == RXM_RAWX != RXM_SFRBX
