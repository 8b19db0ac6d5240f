"""The recordings that these tests read, each made once."""

from pathlib import Path

import pytest

from recordings.reader import Contents, read_recording
from recordings.replay import decide_and_record
from recordings.simulate.observations import simulate
from tests.unit.recording.replayed import (
    EVENTS,
    SITE,
    SLOW_EPOCHS,
    SLOW_INTERVAL_S,
    SLOW_SITE,
    Recorded,
    recorded,
    spoiled_around_the_second_snapshot,
)
from tests.unit.recording.written import METADATA, SECONDS, SITE_FILE, stepped
from tests.unit.streams import START_NS, rows_changed, stream


@pytest.fixture(scope="session")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording in which every kind of message stands."""
    path = tmp_path_factory.mktemp("whole") / "whole.mcap"
    decide_and_record(path, SITE_FILE, rows_changed(stream(SECONDS), stepped), METADATA)
    return path


@pytest.fixture(scope="session")
def contents(whole: Path) -> Contents:
    return read_recording(whole)


@pytest.fixture(scope="session")
def fast(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    return recorded(tmp_path_factory.mktemp("fast") / "fast.mcap", SITE, EVENTS)


@pytest.fixture(scope="session")
def slow(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    events = simulate(SLOW_SITE.config, START_NS, SLOW_EPOCHS * SLOW_INTERVAL_S, 1.0 / SLOW_INTERVAL_S, seed=1)
    path = tmp_path_factory.mktemp("slow") / "slow.mcap"
    return recorded(path, SLOW_SITE, rows_changed(events, spoiled_around_the_second_snapshot))
