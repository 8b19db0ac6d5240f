"""RTCM in, the same decisions out however the bytes are cut, and across snapshots; dated by satellites before the host's clock."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.errors import DecodeError
from integrity.events import EphemerisReceived, Event, Heard, ObservationsReceived, RawBytes, StatusReceived, Tick
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS, utc_from_gps
from integrity.gnss.rtcm.framing import RtcmFramer, frame_bytes, message_number
from integrity.gnss.rtcm.msm_writer import encode_row
from integrity.gnss.rtcm.navigation import encode_ephemeris
from integrity.gnss.rtcm.navigation_tables import EPHEMERIS_NUMBERS
from integrity.gnss.rtcm.station import AntennaPosition, encode_position
from integrity.messages import wayside_pb2 as pb
from integrity.messages.receptions import decode_reception, decode_status, encode_reception, encode_status
from integrity.messages.snapshots import decode_snapshot, encode_snapshot
from integrity.outputs import Output
from integrity.reception import Reception
from integrity.reception.rtcm import CLOCK_AFTER_NS
from integrity.station_monitor import StationMonitor
from recordings.simulate.observations import antennas_of
from recordings.simulate.rtcm import as_rtcm
from tests.unit.streams import SITE, START_NS, reports, stream

SECONDS = 12.0
RTCM_SITE = replace(SITE, receivers=tuple(replace(receiver, protocol="rtcm3") for receiver in SITE.receivers))
ROW = next(e.row for e in stream(SECONDS) if isinstance(e, ObservationsReceived))
SETS = [e.ephemeris for e in stream(SECONDS) if isinstance(e, EphemerisReceived) and isinstance(e.ephemeris, KeplerEphemeris)]
POSITION = frame_bytes(encode_position(AntennaPosition(7, False, 1.0, -2.0, 3.0, None)))
MSM = b"".join(map(frame_bytes, encode_row(ROW, 7)))


@cache
def as_sent() -> tuple[Event, ...]:
    return tuple(e for e in as_rtcm(stream(SECONDS), antennas_of(SITE)) if isinstance(e, RawBytes | Tick))


@cache
def whole() -> tuple[Output, ...]:
    return tuple(StationMonitor(RTCM_SITE).feed(as_sent()))


def decisions(outputs: Sequence[Output]) -> list[tuple[object, ...]]:
    """What was decided, with every number."""
    return [(r.gps_time_ns, r.state, r.cause, r.subjects, r.excluded, r.statistic.tobytes(), r.e_enu_m.tobytes()) for r in reports(outputs)]


def cut(events: Sequence[Event], places: Sequence[int]) -> list[Event]:
    """Each burst in pieces that end at these places; pieces of one burst arrive at one time."""
    pieces: list[Event] = []
    for event in events:
        if not isinstance(event, RawBytes):
            pieces.append(event)
            continue
        ends = sorted({0, len(event.data), *(p % len(event.data) for p in places)})
        pieces += [RawBytes(event.mono_ns, event.receiver, event.data[a:b]) for a, b in pairwise(ends)]
    return pieces


def heard(*data: bytes, clock_ahead_ns: int | None = 0) -> list[Heard]:
    """What receiver A is heard to say, a while after its first bytes, and after a tick of a clock that is ahead by so much."""
    reception = Reception("A", protocols={"A": "rtcm3"})
    reception.take(RawBytes(-CLOCK_AFTER_NS, "A", b"?"))
    if clock_ahead_ns is not None:
        reception.take(Tick(0, utc_from_gps(ROW.receive_time_ns + clock_ahead_ns), None))
    return [x for piece in data for x in reception.take(RawBytes(0, "A", piece))]


def times_ns(found: Sequence[Heard]) -> list[int]:
    return [x.row.receive_time_ns for x in found if isinstance(x, ObservationsReceived)]


def test_it_gets_to_normal() -> None:
    assert reports(whole())[-1].state == "NORMAL"


@settings(deadline=None, max_examples=25)
@given(places=st.lists(st.integers(0, 100_000), max_size=4))
def test_cuts_anywhere_change_nothing(places: list[int]) -> None:
    assert decisions(StationMonitor(RTCM_SITE).feed(cut(as_sent(), places))) == decisions(whole())


@settings(deadline=None, max_examples=25)
@given(place=st.integers(1, 100_000), after=st.integers(1, 30))
def test_a_snapshot_within_a_frame_goes_on_as_if_nothing_had_been(place: int, after: int) -> None:
    events = cut(as_sent(), [place])
    first = StationMonitor(RTCM_SITE)
    before = first.feed(events[:after])
    message = encode_snapshot(first.snapshot(), SITE.receiver_names, 0)
    second = StationMonitor(RTCM_SITE, decode_snapshot(type(message).FromString(message.SerializeToString())))
    assert decisions([*before, *second.feed(events[after:])]) == decisions(whole())


def test_receivers_of_both_protocols_are_decided_together() -> None:
    mixed = replace(SITE, receivers=(replace(SITE.receivers[0], protocol="rtcm3"), *SITE.receivers[1:]))
    events = as_rtcm(stream(SECONDS), antennas_of(SITE)[:1])
    assert reports(StationMonitor(mixed).feed(events))[-1].state == "NORMAL"


# Which week


@pytest.mark.parametrize("weeks", [0, -0.49, 0.49])
def test_without_ephemerides_the_clock_of_the_host_tells_the_week(weeks: float) -> None:
    assert times_ns(heard(MSM, clock_ahead_ns=round(weeks * WEEK_NS))) == [ROW.receive_time_ns]


def test_a_clock_that_is_put_right_puts_times_right() -> None:
    reception = Reception("A", protocols={"A": "rtcm3"})
    found: list[Heard] = []
    for mono_ns, wrong_ns in ((0, 3 * WEEK_NS), (CLOCK_AFTER_NS, 3 * WEEK_NS), (CLOCK_AFTER_NS + 1, 0)):
        reception.take(Tick(mono_ns, utc_from_gps(ROW.receive_time_ns - wrong_ns), None))
        found += reception.take(RawBytes(mono_ns, "A", MSM))
    assert times_ns(found) == [ROW.receive_time_ns - 3 * WEEK_NS, ROW.receive_time_ns]


@pytest.mark.parametrize(("waited_ns", "times"), [(CLOCK_AFTER_NS - 1, []), (CLOCK_AFTER_NS, [ROW.receive_time_ns])])
def test_ephemerides_are_waited_for_before_the_clock_is_believed(waited_ns: int, times: list[int]) -> None:
    reception = Reception("A", protocols={"A": "rtcm3"})
    reception.take(Tick(0, utc_from_gps(ROW.receive_time_ns), None))
    assert times_ns([x for mono_ns in (0, waited_ns) for x in reception.take(RawBytes(mono_ns, "A", MSM))]) == times


def test_a_clock_that_is_ahead_does_no_harm_where_ephemerides_come_late() -> None:
    """Time that once was ahead could not go back."""
    events: list[Event] = []
    late: dict[str, bytes] = {}  # ephemerides of each receiver, which come three seconds later than they were sent
    for event in as_sent():
        if isinstance(event, RawBytes):
            messages = RtcmFramer().feed(event.data)
            sets, others = (
                [frame_bytes(m) for m in messages if (message_number(m) in EPHEMERIS_NUMBERS) == is_set] for is_set in (True, False)
            )
            come = late.pop(event.receiver, b"") if event.mono_ns >= START_NS + 3 * NS_PER_S else b""
            late[event.receiver] = late.get(event.receiver, b"") + b"".join(sets)
            events.append(replace(event, data=come + b"".join(others)))
        elif isinstance(event, Tick):
            events.append(replace(event, utc_ns=event.utc_ns + 3 * WEEK_NS))
    assert reports(StationMonitor(RTCM_SITE).feed([replace(events[-1], mono_ns=START_NS), *events]))[-1].state == "NORMAL"


@pytest.mark.parametrize("clock_ahead_ns", [None, -3 * WEEK_NS, 100 * WEEK_NS])
def test_ephemerides_tell_the_week_better(clock_ahead_ns: int | None) -> None:
    assert times_ns(heard(frame_bytes(encode_ephemeris(SETS[0])), MSM, clock_ahead_ns=clock_ahead_ns)) == [ROW.receive_time_ns]


def test_a_set_of_a_satellite_that_is_gone_tells_nothing() -> None:
    old = replace(SETS[0], **{name: getattr(SETS[0], name) - 9 * WEEK_NS for name in ("toe_ns", "toc_ns", "transmission_ns")})
    sets = [frame_bytes(encode_ephemeris(eph)) for eph in (SETS[1], SETS[2], old)]
    assert times_ns(heard(*sets, MSM)) == [ROW.receive_time_ns]


@pytest.mark.parametrize(
    ("said", "clock_ahead_ns"), [(b"", 0), (frame_bytes(encode_ephemeris(SETS[0])), 3 * WEEK_NS)], ids=["clock", "sky"]
)
def test_what_tells_the_week_is_remembered(said: bytes, clock_ahead_ns: int) -> None:
    first = Reception("A", protocols={"A": "rtcm3"})
    first.take(Tick(0, utc_from_gps(ROW.receive_time_ns + clock_ahead_ns), None))
    first.take(RawBytes(0, "A", said))
    second = Reception("A", [decode_reception(encode_reception(first.memories()[0]))], {"A": "rtcm3"})
    assert times_ns(second.take(RawBytes(CLOCK_AFTER_NS, "A", MSM))) == [ROW.receive_time_ns]


def test_without_any_time_nothing_is_measured() -> None:
    assert heard(MSM, clock_ahead_ns=None) == []


# What else is said, and what is remembered


def test_a_position_is_what_the_receiver_is_said_to_have() -> None:
    (found,) = heard(POSITION)
    assert isinstance(found, StatusReceived) and (found.status.stated_ecef_m, found.status.virtual) == ((1.0, -2.0, 3.0), True)
    assert decode_status(encode_status(found.status)) == found.status


def test_damage_is_counted() -> None:
    reception = Reception("A", protocols={"A": "rtcm3"})
    reception.take(RawBytes(0, "A", b"noise" + POSITION[:-1] + bytes([POSITION[-1] ^ 1]) + POSITION))
    (memory,) = reception.memories()
    assert (memory.bad_frames, memory.skipped_bytes) == (1, 5 + len(POSITION))


def test_a_memory_is_the_same_after_it_was_a_message() -> None:
    monitor = StationMonitor(RTCM_SITE)
    monitor.feed(cut(as_sent(), [3000])[:20])
    for memory in monitor.snapshot().reception:
        message = encode_reception(memory)
        assert decode_reception(type(message).FromString(message.SerializeToString())) == memory


@pytest.mark.parametrize(
    "rtcm",
    [pb.RtcmMemory(lock_signal=["G01.1C"]), pb.RtcmMemory(channels={99: 0}), pb.RtcmMemory(open_messages=[b"no message"])],
    ids=["a lock without a time", "a slot that is none", "an open epoch that is none"],
)
def test_a_memory_that_no_one_can_have_is_refused(rtcm: pb.RtcmMemory) -> None:
    with pytest.raises(DecodeError):
        decode_reception(pb.ReceptionMemory(receiver="A", rtcm=rtcm))


def test_a_stated_position_of_two_numbers_is_refused() -> None:
    with pytest.raises(DecodeError, match="expected three finite numbers"):
        decode_status(pb.ReceiverStatus(stated_ecef_m=[1.0, 2.0]))
