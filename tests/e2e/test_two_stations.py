"""Two real stations vouch for one line: the train needs both. One stands still for a while, and the stop that this costs is released."""

import json
import signal
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from recordings.simulate.server import ReceiverServer
from tests.e2e.commands import wayside
from tests.e2e.field import SITE_ID, Field, make_field, playing, running_station
from tests.e2e.train_field import ANTENNAS, RunningTrain, both_measured, line_of, make_train, running_train, urls

OTHER = "other"
PATIENCE_S = 30.0
Position = dict[str, Any]


@dataclass(frozen=True)
class Told:
    """Positions: trusted, one station silent, it speaks again and a stop still holds, released."""

    trusted: Position
    silent: Position
    latched: Position
    again: Position
    released: Position
    talk: str
    recording: Path


def follow_both(here: Field, there: Field, train_file: Path) -> None:
    """Each station by its own endpoint, and both vouch for the whole line."""
    (here.folder / "line.json").write_text(line_of(SITE_ID, OTHER))
    trusted = here.trusted.read_text() + there.trusted.read_text()
    here.trusted.write_text(trusted)
    text = train_file.read_text().replace(f'stations = ["{SITE_ID}"]', f'stations = ["{SITE_ID}", "{OTHER}"]')
    train_file.write_text(f'{text}\n[[station]]\nid = "{OTHER}"\nconnect = ["{there.endpoint}"]\n')


def valid(position: Position) -> bool:
    return bool(position["status"] == "POSITION_VALID")


def ride(train: RunningTrain, other: subprocess.Popen[str]) -> tuple[Position, Position, Position, Position, Position]:
    """See `Told`."""
    trusted = train.until(lambda p: valid(p) and p["stop"] == "STOP_NONE", PATIENCE_S)
    other.send_signal(signal.SIGSTOP)
    silent = train.until(lambda p: p["trust"] != "TRUST_NORMAL", PATIENCE_S)
    latched = train.until(lambda p: p["stop"] == "STOP_LATCHED", PATIENCE_S)
    other.send_signal(signal.SIGCONT)
    again = train.until(lambda p: valid(p) and int(p["sequence"]) > int(latched["sequence"]), PATIENCE_S)
    train.process.send_signal(signal.SIGUSR1)
    released = train.until(lambda p: p["stop"] == "STOP_NONE" and int(p["sequence"]) > int(again["sequence"]), PATIENCE_S)
    return trusted, silent, latched, again, released


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Told]:
    folders = [tmp_path_factory.mktemp(name) for name in (SITE_ID, OTHER)]
    with ReceiverServer((*"ABC", *ANTENNAS), "127.0.0.1", 0) as server:
        sources = urls(server)
        of_receivers = {name: sources[name] for name in "ABC"}
        here, there = (make_field(folder, of_receivers, 0.1, site_id=site) for folder, site in zip(folders, (SITE_ID, OTHER), strict=True))
        train_file = make_train(here, sources)
        follow_both(here, there, train_file)
        with (
            running_station(here),
            running_station(there) as other,
            running_train(train_file) as train,
            playing(server, both_measured(here.site_file, 60.0)),
        ):
            positions = ride(train, other)
            train.process.send_signal(signal.SIGTERM)
            train.process.wait(10.0)
    (recording,) = (here.folder / "train-recordings").glob("*.mcap")
    yield Told(*positions, (here.folder / "train.log").read_text(), recording)


def states(position: Position) -> dict[str, str]:
    return {station["site"]: station["trust"] for station in position["stations"]}


def test_both_are_trusted_and_both_have_a_say(told: Told) -> None:
    assert (states(told.trusted), told.trusted["vouching"]) == (dict.fromkeys((SITE_ID, OTHER), "TRUST_NORMAL"), [SITE_ID, OTHER])


def test_silence_of_one_ends_trust_although_the_other_says_normal(told: Told) -> None:
    assert (told.silent["trust"], states(told.silent)) == ("TRUST_STALE", {SITE_ID: "TRUST_NORMAL", OTHER: "TRUST_STALE"})


def test_the_one_that_is_silent_is_named(told: Told) -> None:
    assert told.silent["site"] == OTHER


def test_a_stop_is_asked_for_three_seconds_after_trust_was_lost(told: Told) -> None:
    lost_ns, asked_ns = int(told.silent["mono_ns"]), int(told.latched["stop_since_mono_ns"])
    assert 3_000_000_000 <= asked_ns - lost_ns <= 3_100_000_000


def test_the_stop_holds_though_trust_is_back(told: Told) -> None:
    assert (told.again["trust"], told.again["stop"]) == ("TRUST_NORMAL", "STOP_LATCHED")


def test_it_is_released_by_a_signal(told: Told) -> None:
    assert ("stop_reasons" in told.released, "no stop is asked for any more" in told.talk) == (False, True)


def test_the_recording_is_decided_again_without_a_difference(told: Told) -> None:
    done = wayside("train", "replay", told.recording, "--diff", "--json")
    assert (done.code, len(json.loads(done.out)["statuses"])) == (0, 3), done.err
