"""A recording decided again says the same, in any blocks, and so do repeated, backward and silent streams."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from integrity.errors import RecordingError
from integrity.events import Event, ObservationsReceived, Tick
from integrity.gnss.gps_time import NS_PER_S, format_utc
from integrity.outputs import EpochReport
from integrity.states import Cause, State
from recordings.diff import differences, recorded_reports
from recordings.replay import decide, decide_and_record, replayable
from recordings.summary import decisions_sha256
from tests.unit.recording.replayed import SECONDS, SITE, Recorded, replayed
from tests.unit.streams import reports, rows_changed, stream, ticks_only, with_signals

# Replay equals record


def test_the_stream_of_these_tests_meets_every_kind_of_decision(fast: Recorded) -> None:
    causes = {r.cause for r in reports(fast.outputs)}
    assert {Cause.NOT_READY, Cause.NONE} < causes
    assert any(r.excluded for r in reports(fast.outputs))
    assert {h.cause for h in fast.outputs if not isinstance(h, EpochReport)} >= {Cause.DATA}


@pytest.mark.parametrize("block_epochs", [1, 7, 60, 1000])
def test_a_replay_publishes_what_was_published_silences_and_alerts_included(fast: Recorded, block_epochs: int) -> None:
    todo = replayable(fast.contents)
    outputs, _ = decide(todo.site, todo.events, todo.snapshot, block_epochs)
    assert len(outputs) == len(fast.outputs)
    assert [type(o) for o in outputs] == [type(o) for o in fast.outputs]
    assert [(o.state, o.cause, o.subjects, o.mono_ns) for o in outputs] == [(o.state, o.cause, o.subjects, o.mono_ns) for o in fast.outputs]


@pytest.mark.parametrize("which", ["fast", "slow"])
def test_blocks_of_1_7_and_1000_epochs_twice_each_give_one_hash(which: str, request: pytest.FixtureRequest) -> None:
    contents = request.getfixturevalue(which).contents
    assert len({decisions_sha256(replayed(contents, block_epochs)) for block_epochs in (1, 7, 1000) * 2}) == 1


@pytest.mark.parametrize("which", ["fast", "slow"])
@pytest.mark.parametrize("block_epochs", [1, 7, 1000])
def test_no_epoch_differs_from_the_record(which: str, block_epochs: int, request: pytest.FixtureRequest) -> None:
    contents = request.getfixturevalue(which).contents
    assert differences(recorded_reports(contents, None, None), replayed(contents, block_epochs)) == []


def test_the_hash_of_a_replay_is_that_of_what_was_decided_live(fast: Recorded) -> None:
    assert decisions_sha256(replayed(fast.contents)) == decisions_sha256(reports(fast.outputs))


def test_a_replay_recorded_again_has_the_same_bytes(fast: Recorded, tmp_path: Path) -> None:
    todo = replayable(fast.contents)
    decide_and_record(tmp_path / "again.mcap", todo.site, todo.events, fast.contents.metadata, todo.snapshot)
    assert (tmp_path / "again.mcap").read_bytes() == fast.path.read_bytes()


def test_a_changed_decision_is_a_difference(fast: Recorded) -> None:
    decided = replayed(fast.contents)
    decided[9] = replace(decided[9], state=State.NOT_CONFIRMABLE, cause=Cause.DATA)
    (line,) = differences(recorded_reports(fast.contents, None, None), decided)
    assert line == f"{format_utc(decided[9].gps_time_ns)}: state NORMAL -> NOT_CONFIRMABLE; cause CAUSE_UNSPECIFIED -> DATA"


def test_an_epoch_that_is_not_decided_any_more_is_a_difference(fast: Recorded) -> None:
    decided = replayed(fast.contents)
    (line,) = differences(recorded_reports(fast.contents, None, None), [r for k, r in enumerate(decided) if k != 9])
    assert line == f"{format_utc(decided[9].gps_time_ns)}: decided only in the recording"


def test_an_epoch_that_was_not_decided_then_is_a_difference(fast: Recorded) -> None:
    decided, then = replayed(fast.contents), recorded_reports(fast.contents, None, None)
    (line,) = differences(then[:9] + then[10:], decided)
    assert line == f"{format_utc(decided[9].gps_time_ns)}: decided only now"


def test_nothing_to_record_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="nothing to record"):
        decide_and_record(tmp_path / "x.mcap", SITE, [], {})


# Repeated, backward and silent streams, as a station may have recorded them


def published(events: Sequence[Event]) -> list[tuple[object, ...]]:
    outputs, _ = decide(SITE, events)
    return [(r.gps_time_ns, r.state, r.cause, r.excluded) for r in reports(outputs)]


def test_epochs_that_come_twice_are_decided_once_and_as_before() -> None:
    twice = [copy for event in stream(SECONDS) for copy in ([event, event] if isinstance(event, ObservationsReceived) else [event])]
    assert published(twice) == published(stream(SECONDS))


def test_time_that_jumps_back_is_not_decided_again() -> None:
    events = stream(SECONDS)
    rows = [e for e in events if isinstance(e, ObservationsReceived)]
    again = [replace(e, mono_ns=rows[-1].mono_ns + NS_PER_S) for e in rows[:30]]
    assert published([*events, *again]) == published(events)


def test_a_stream_in_which_no_receiver_speaks_is_never_normal() -> None:
    silent = [e for e in stream(SECONDS) if isinstance(e, Tick)]
    outputs, _ = decide(SITE, silent)
    assert {(o.state, o.cause) for o in outputs[1:]} == {(State.NOT_CONFIRMABLE, Cause.DATA)}


def test_after_the_last_row_only_silence_is_published() -> None:
    events = stream(SECONDS)
    outputs, _ = decide(SITE, [*events, *ticks_only(events[-1], 10)])
    assert [o.state for o in outputs[-8:]] == [State.NOT_CONFIRMABLE] * 8


def test_receivers_without_a_signal_are_never_normal() -> None:
    events = rows_changed(stream(SECONDS), lambda row: with_signals(row, lambda _: False))
    outputs, _ = decide(SITE, events)
    assert State.NORMAL not in {o.state for o in outputs}
