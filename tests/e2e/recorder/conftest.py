"""A recorder on a real disk, and what it said."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from integrity.events import Event
from recordings.recorder import Recorder
from station.recording import manner_of
from tests.e2e.recorder.recorded import BOOT_ID, SITE


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def recorder(tmp_path: Path, said: list[str]) -> Iterator[Recorder[Event]]:
    made = Recorder(tmp_path / "rec", manner_of(SITE, BOOT_ID), said.append)
    yield made
    made.close()
