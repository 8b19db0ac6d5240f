"""Bytes in, the same decisions out as from decoded measurements, however the bytes are cut, and across snapshots."""

from collections.abc import Iterable, Sequence
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.events import EphemerisReceived, Event, Heard, IonosphereReceived, ObservationsReceived, RawBytes, StatusReceived
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.ubx.framing import frame_bytes
from integrity.messages.snapshots import decode_snapshot, encode_snapshot
from integrity.outputs import EpochReport, Output
from integrity.reception import Reception, ReceptionMemory
from integrity.station_monitor import StationMonitor
from recordings.simulate.observations import antennas_of
from recordings.simulate.receiver import as_bytes
from tests.unit.streams import SITE, new_monitor, reports, stream

SECONDS = 12.0
RECEIVERS = SITE.receiver_names
NAV_PVT_NO_FIX = frame_bytes(0x01, 0x07, bytes(92))
MON_RF = frame_bytes(0x0A, 0x38, bytes((0, 1, 0, 0)) + bytes((0, 3, 2, 1)) + bytes(20))  # critical jamming


@cache
def as_sent() -> tuple[Event, ...]:
    return as_bytes(stream(SECONDS), antennas_of(SITE))


def heard(events: Iterable[Event]) -> list[Heard]:
    reception = Reception(RECEIVERS)
    return [x for event in events for x in reception.take(event)]


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


@cache
def whole() -> tuple[Output, ...]:
    return tuple(new_monitor().feed(as_sent()))


def test_bytes_hold_every_row() -> None:
    sent = [e.row for e in stream(SECONDS) if isinstance(e, ObservationsReceived)]
    received = [e.row for e in heard(as_sent()) if isinstance(e, ObservationsReceived)]
    assert [(r.receiver, r.receive_time_ns, r.signals, r.pseudorange_m.tobytes()) for r in received] == [
        (r.receiver, r.receive_time_ns, r.signals, r.pseudorange_m.tobytes()) for r in sent
    ]


def test_ephemerides_and_ionosphere_are_there_before_the_first_row() -> None:
    kinds = [type(e) for e in heard(e for e in as_sent() if isinstance(e, RawBytes) and e.receiver == "B")]
    before = kinds[: kinds.index(ObservationsReceived)]
    seen = {s.partition(".")[0] for e in stream(SECONDS) if isinstance(e, ObservationsReceived) for s in e.row.signals}
    assert (before.count(EphemerisReceived), IonosphereReceived in before) == (len(seen), True)


def test_bytes_are_decided_as_decoded_measurements_are() -> None:
    from_rows = new_monitor().feed(stream(SECONDS))
    assert decisions(whole()) == decisions(from_rows)


def test_it_gets_to_normal() -> None:
    assert reports(whole())[-1].state == "NORMAL"


@settings(deadline=None)
@given(places=st.lists(st.integers(0, 100_000), max_size=4))
def test_cuts_anywhere_change_nothing(places: list[int]) -> None:
    assert decisions(new_monitor().feed(cut(as_sent(), places))) == decisions(whole())


@settings(deadline=None)
@given(place=st.integers(1, 100_000), after=st.integers(1, 30))
def test_a_snapshot_within_a_frame_goes_on_as_if_nothing_had_been(place: int, after: int) -> None:
    events = cut(as_sent(), [place])
    first = new_monitor()
    before = first.feed(events[:after])
    message = encode_snapshot(first.snapshot(), RECEIVERS, 0)
    second = StationMonitor(SITE, decode_snapshot(type(message).FromString(message.SerializeToString())))
    assert decisions([*before, *second.feed(events[after:])]) == decisions(whole())


def test_bytes_of_an_unknown_receiver_are_passed_over() -> None:
    assert heard([RawBytes(0, "X", NAV_PVT_NO_FIX)]) == []


def test_damage_is_counted() -> None:
    reception = Reception(RECEIVERS)
    reception.take(RawBytes(0, "A", b"noise" + NAV_PVT_NO_FIX[:-1] + b"\0" + NAV_PVT_NO_FIX))
    memory = reception.memories()[0]
    assert (memory.bad_frames, memory.skipped_bytes) == (1, 5 + len(NAV_PVT_NO_FIX))


@pytest.mark.parametrize(
    ("frame", "apart_ns", "read"),
    [(MON_RF, NS_PER_S - 1, 1), (MON_RF, NS_PER_S, 2), (NAV_PVT_NO_FIX, 10 * NS_PER_S - 1, 1), (NAV_PVT_NO_FIX, 10 * NS_PER_S, 2)],
)
def test_hearsay_is_read_now_and_then(frame: bytes, apart_ns: int, read: int) -> None:
    found = heard([RawBytes(0, "A", frame), RawBytes(apart_ns, "A", frame)])
    assert sum(isinstance(e, StatusReceived) for e in found) == read


def test_what_a_receiver_says_of_itself_is_among_the_reasons() -> None:
    monitor = new_monitor()
    sent = as_sent()
    first = next(i for i, e in enumerate(sent) if isinstance(e, RawBytes))
    outputs = monitor.feed([*sent[:first], RawBytes(sent[first].mono_ns - NS_PER_S // 2, "A", MON_RF), *sent[first:]])
    health = next(o for o in outputs if not isinstance(o, EpochReport) and hasattr(o, "reasons"))
    assert any(reason.startswith("A reports interference") for reason in health.reasons)


def test_an_empty_memory_is_a_new_reception() -> None:
    assert Reception(RECEIVERS).memories() == tuple(ReceptionMemory(r) for r in RECEIVERS)


@pytest.mark.parametrize("receiver", RECEIVERS)
def test_a_receiver_whose_bytes_are_noise_never_lets_it_be_normal(receiver: str) -> None:
    rng = np.random.default_rng(1)
    spoiled = [
        RawBytes(e.mono_ns, e.receiver, rng.bytes(len(e.data))) if isinstance(e, RawBytes) and e.receiver == receiver else e
        for e in as_sent()
    ]
    states = {o.state for o in new_monitor().feed(spoiled) if hasattr(o, "state")}
    assert "NORMAL" not in states
