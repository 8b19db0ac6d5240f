"""From any snapshot a recording is decided as in the whole."""

import pytest

from integrity.errors import ConfigError
from integrity.gnss.gps_time import NS_PER_S, parse_utc
from integrity.states import Cause
from recordings.replay import replayable, window
from recordings.summary import decisions_sha256
from tests.unit.recording.replayed import Recorded, minutes, replayed
from tests.unit.streams import reports


def test_there_is_a_snapshot_at_the_head_and_every_hour(slow: Recorded) -> None:
    taken = [e.log_ns for e in slow.contents.entries if e.topic == "/snapshot"]
    assert [(t - taken[0]) // (60 * NS_PER_S) for t in taken] == [0, 60, 120]


def test_a_snapshot_in_the_middle_remembers_a_satellite_that_is_out(slow: Recorded) -> None:
    snapshot = replayable(slow.contents, None, minutes(61)).snapshot
    assert snapshot is not None
    assert [x.satellite for x in snapshot.exclusions] == ["G07"]


def test_a_snapshot_in_the_middle_remembers_how_strong_signals_were(slow: Recorded) -> None:
    part = [r.cause for r in replayed(slow.contents, start_ns=minutes(61)) if minutes(62) <= r.gps_time_ns < minutes(64)]
    assert set(part) == {Cause.JAMMING}


@pytest.mark.parametrize("from_minute", [0, 1, 30, 59, 60, 61, 74, 76, 119, 120, 121, 134])
def test_from_a_time_is_decided_as_in_the_whole(slow: Recorded, from_minute: int) -> None:
    start_ns = minutes(from_minute)
    whole = [r for r in replayed(slow.contents) if r.gps_time_ns >= start_ns]
    part = [r for r in replayed(slow.contents, start_ns=start_ns) if r.gps_time_ns >= start_ns]
    assert whole
    assert decisions_sha256(part) == decisions_sha256(whole)


@pytest.mark.parametrize(("from_minute", "epochs"), [(59, 270), (61, 150), (119, 150), (121, 30), (134, 30)])
def test_from_a_time_only_the_hour_around_it_is_decided(slow: Recorded, from_minute: int, epochs: int) -> None:
    assert len(replayed(slow.contents, start_ns=minutes(from_minute))) == epochs


@pytest.mark.parametrize("block_epochs", [1, 7])
def test_from_a_snapshot_another_block_size_changes_nothing(slow: Recorded, block_epochs: int) -> None:
    start_ns = minutes(61)
    assert decisions_sha256(replayed(slow.contents, block_epochs, start_ns)) == decisions_sha256(replayed(slow.contents, 1000, start_ns))


def test_an_end_is_not_included(slow: Recorded) -> None:
    at = [r.gps_time_ns for r in reports(slow.outputs)]
    assert [r.gps_time_ns for r in replayed(slow.contents, end_ns=at[10])] == at[:10]


def test_a_window_that_ends_before_it_begins_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"ends \(2026-03-02T03:00:00Z\) before it begins \(2026-03-02T04:00:00Z\)"):
        window("2026-03-02T04:00:00Z", "2026-03-02T03:00:00Z")


def test_a_window_in_no_time_is_refused_with_an_example() -> None:
    with pytest.raises(ConfigError, match="'yesterday'; write it like 2010-03-18T05:20:00Z"):
        window("yesterday", None)


def test_a_window_is_utc() -> None:
    assert window("2026-03-02T03:00:00Z", None) == (parse_utc("2026-03-02T03:00:00Z"), None)
