"""Faults between receiver and station: bits that flip, pieces that come twice, pieces that come late."""

import numpy as np
import pytest

from integrity.errors import ConfigError
from integrity.events import Event, ObservationsReceived, RawBytes, Tick
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.ubx.rawx import RXM_RAWX
from integrity.states import Cause, State
from recordings.faults import inject
from recordings.faults.kinds import CorruptBytes, Delay, ReceiverBias, ReceiverDrop, ReceiverDuplicate
from tests.unit.faults.raw import BYTES, MEASURED, SECONDS, decided, fault, framed, recut, stream_of, with_fault
from tests.unit.streams import SITE, START_NS

RATE = 1e-3
CORRUPT = CorruptBytes(receiver="B", rate=RATE)


def flips(events: tuple[Event, ...], receiver: str = "B") -> list[int]:
    """What was flipped in each byte of the stream."""
    was, now = (np.frombuffer(stream_of(e, receiver), np.uint8) for e in (BYTES, events))
    return (was ^ now).tolist()  # type: ignore[no-any-return]


def of_second(events: tuple[Event, ...], receiver: str, second: int) -> bytes:
    return b"".join(
        e.data for e in events if isinstance(e, RawBytes) and e.receiver == receiver and e.mono_ns == START_NS + second * NS_PER_S
    )


def test_bits_flip_at_the_rate_given() -> None:
    """About 27,000 bytes: 27 flips, 5 of standard deviation; 4 of them are allowed."""
    begin = len(stream_of(BYTES[: BYTES.index(next(e for e in BYTES if e.mono_ns == START_NS + 40 * NS_PER_S))], "B"))
    end = len(stream_of(BYTES[: BYTES.index(next(e for e in BYTES if e.mono_ns == START_NS + 80 * NS_PER_S))], "B"))
    found = flips(with_fault(BYTES, CORRUPT))
    expected = RATE * (end - begin)
    assert abs(sum(f != 0 for f in found[begin:end]) - expected) < 4.0 * expected**0.5
    assert not any(found[:begin] + found[end:])


def test_one_bit_of_a_byte_flips_at_most() -> None:
    assert {f.bit_count() for f in flips(with_fault(BYTES, CorruptBytes(receiver="B", rate=1.0)))} == {0, 1}


def test_every_bit_may_flip() -> None:
    assert set(flips(with_fault(BYTES, CorruptBytes(receiver="B", rate=1.0)))) == {0} | {1 << bit for bit in range(8)}


def test_other_receivers_are_spared() -> None:
    assert not any(flips(with_fault(BYTES, CORRUPT), "A"))


def test_flips_depend_on_the_seed() -> None:
    first, again, other = (inject(BYTES, [fault(CORRUPT)], SITE, seed) for seed in (4, 4, 5))
    assert flips(first) == flips(again) != flips(other)


def test_flips_do_not_depend_on_how_bytes_are_cut_nor_on_what_was_before() -> None:
    whole = with_fault(BYTES, CORRUPT)
    cut = recut(BYTES, 333)
    assert stream_of(inject(cut, [fault(CORRUPT)], SITE), "B") == stream_of(whole, "B")
    later = tuple(e for e in BYTES if e.mono_ns >= START_NS + 30 * NS_PER_S)
    assert of_second(inject(later, [fault(CORRUPT)], SITE), "B", 60) == of_second(whole, "B", 60)


def test_damaged_measurements_are_missed_not_believed() -> None:
    """At a flip in ten bytes no frame is left: silence, and that is what is published."""
    events = with_fault(BYTES, CorruptBytes(receiver="B", rate=0.1))
    assert sum(f[:2] == RXM_RAWX for f in framed(events, "B")[0]) == SECONDS - 40
    silent = [d for d in decided(events) if START_NS + 43 * NS_PER_S <= int(str(d[0])) < START_NS + 80 * NS_PER_S]
    assert {(d[2], d[3], d[4]) for d in silent} == {(State.NOT_CONFIRMABLE, Cause.DATA, ("B",))}


def test_without_bytes_nothing_can_flip() -> None:
    with pytest.raises(ConfigError, match="has no bytes of B, only its measurements"):
        with_fault(MEASURED, CORRUPT)


def test_a_rate_that_flips_nothing_is_refused() -> None:
    with pytest.raises(ConfigError, match="no bit happens to flip"):
        with_fault(BYTES, CorruptBytes(receiver="B", rate=1e-12))


def test_a_link_of_a_silent_receiver_has_no_faults() -> None:
    with pytest.raises(ConfigError, match="another fault has silenced B then"):
        inject(BYTES, [fault(CORRUPT), fault(ReceiverDrop(receiver="B"))], SITE)


def test_every_burst_comes_twice() -> None:
    events = with_fault(BYTES, ReceiverDuplicate(receiver="B"))
    times = [len(of_second(events, "B", k)) / len(of_second(BYTES, "B", k)) for k in range(SECONDS)]
    assert times == [2.0 if 40 <= k < 80 else 1.0 for k in range(SECONDS)]
    assert of_second(events, "B", 50) == 2 * of_second(BYTES, "B", 50)


def test_every_row_comes_twice() -> None:
    events = with_fault(MEASURED, ReceiverDuplicate(receiver="B"))
    rows = [(e.row.receive_time_ns - START_NS) // NS_PER_S for e in events if isinstance(e, ObservationsReceived) and e.row.receiver == "B"]
    assert rows == sorted([*range(SECONDS), *range(40, 80)])


def arrivals(events: tuple[Event, ...], receiver: str) -> list[tuple[float, float]]:
    """When rows were measured and when they came, in seconds of the stream."""
    rows = [e for e in events if isinstance(e, ObservationsReceived) and e.row.receiver == receiver]
    return [((e.row.receive_time_ns - START_NS) / NS_PER_S, (e.mono_ns - START_NS) / NS_PER_S) for e in rows]


def test_rows_come_later_and_those_after_them_wait() -> None:
    came = arrivals(with_fault(MEASURED, Delay(receiver="B", seconds=3.5)), "B")
    assert came == [(k, k + 3.5 if 40 <= k < 80 else 82.5 if 80 <= k < 83 else float(k)) for k in range(SECONDS)]


def test_bytes_come_later_in_their_order() -> None:
    events = with_fault(BYTES, Delay(receiver="B", seconds=3.5))
    assert stream_of(events, "B") == stream_of(BYTES, "B")
    came = [(e.mono_ns - START_NS) / NS_PER_S for e in events if isinstance(e, RawBytes) and e.receiver == "B"]
    assert came == [k + 3.5 if 40 <= k < 80 else 82.5 if 80 <= k < 83 else float(k) for k in range(SECONDS)]


def test_bytes_of_the_epoch_before_are_not_delayed_with_those_that_came_in_one_piece_with_them() -> None:
    """With the last 100 bytes of each burst in one piece with the next, the epoch before the fault is complete a second late, not more."""
    late = inject(recut(BYTES, 100), [fault(Delay(receiver="B", seconds=2.0))], SITE)
    assert stream_of(late, "B") == stream_of(BYTES, "B")
    first = next(i for i, e in enumerate(late) if isinstance(e, RawBytes) and e.receiver == "B" and e.mono_ns == START_NS + 40 * NS_PER_S)
    piece = late[first]
    assert isinstance(piece, RawBytes) and len(piece.data) == 100


def test_ticks_and_other_receivers_stay_in_place() -> None:
    after = with_fault(BYTES, Delay(receiver="B", seconds=0.5))
    assert [e for e in after if isinstance(e, RawBytes) and e.receiver != "B"] == [
        e for e in BYTES if isinstance(e, RawBytes) and e.receiver != "B"
    ]
    assert [e for e in after if isinstance(e, Tick)] == [e for e in BYTES if isinstance(e, Tick)]


@pytest.mark.parametrize("events", [MEASURED, BYTES], ids=["measurements", "bytes"])
def test_a_long_delay_is_noticed_when_it_passes_the_deadline(events: tuple[Event, ...]) -> None:
    """Last heard at 39 s: the shell's tick comes after two seconds and a nanosecond."""
    ticks = {e.mono_ns for e in with_fault(events, Delay(receiver="B", seconds=3.5)) if isinstance(e, Tick)}
    assert ticks - {e.mono_ns for e in events if isinstance(e, Tick)} == {START_NS + 41 * NS_PER_S + 1}


def test_what_is_late_comes_after_everything_of_its_time() -> None:
    events = with_fault(BYTES, Delay(receiver="B", seconds=1.0))
    order = [
        "tick" if isinstance(e, Tick) else e.receiver
        for e in events
        if isinstance(e, Tick | RawBytes) and e.mono_ns == START_NS + 60 * NS_PER_S
    ]
    assert order == ["A", "C", "tick", "B"]


def test_frames_that_came_twice_are_changed_twice() -> None:
    bias, twice = ReceiverBias(receiver="B", offset_enu_m=(15.0, 0.0, 0.0)), ReceiverDuplicate(receiver="B")
    assert with_fault(with_fault(BYTES, twice), bias) == with_fault(with_fault(BYTES, bias), twice)
