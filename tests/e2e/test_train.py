"""The train client as a process, beside a real station: it stops by its own clock, and what it recorded is decided again."""

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from integrity.gnss.gps_time import parse_utc
from integrity.messages import wayside_pb2 as pb
from integrity.messages.key_expressions import train_key
from recordings.link import dial_link
from recordings.simulate.server import ReceiverServer
from tests.benchmarks.train_stops import line, measure
from tests.e2e.field import REPOSITORY, make_field, playing, running_station
from tests.e2e.train_field import ANTENNAS, both_measured, make_train, running_train, urls
from train_client.track.track_map import content_sha256


def wayside(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-m", "wayside", *map(str, arguments)], cwd=REPOSITORY, capture_output=True, text=True)


@dataclass(frozen=True)
class Ridden:
    """A ride of ten seconds: how the train ended, what it told, its recording, its files, and what somebody else heard over Zenoh."""

    exit_code: int
    positions: list[dict[str, Any]]
    recording: Path
    train_file: Path
    talk: str
    heard: list[pb.TrainPosition]


@pytest.fixture(scope="module")
def ridden(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Ridden]:
    folder = tmp_path_factory.mktemp("ride")
    with ReceiverServer((*"ABC", *ANTENNAS), "127.0.0.1", 0) as server:
        sources = urls(server)
        place = make_field(folder, {name: sources[name] for name in "ABC"}, 0.1)
        train_file = make_train(place, sources)
        with playing(server, both_measured(place.site_file, 40.0)), running_station(place), running_train(train_file) as train:
            train.until(lambda p: p["status"] == "POSITION_VALID", 30.0)
            heard: list[pb.TrainPosition] = []
            with dial_link([place.endpoint], lambda: None) as link:
                link.subscribe(train_key("r291"), lambda arrival: heard.append(pb.TrainPosition.FromString(arrival.data)))
                train.until(lambda p: int(p["sequence"]) > 150, 30.0)
            train.process.send_signal(signal.SIGTERM)
            exit_code = train.process.wait(10.0)
            positions = list(train.positions)
    (recording,) = (folder / "train-recordings").glob("*.mcap")
    yield Ridden(exit_code, positions, recording, train_file, (folder / "train.log").read_text(), heard)


def test_it_ends_calmly(ridden: Ridden) -> None:
    assert ridden.exit_code == 0, ridden.talk


def test_it_is_trusted_and_valid(ridden: Ridden) -> None:
    assert {"POSITION_PROVISIONAL", "POSITION_VALID"} <= {p["status"] for p in ridden.positions}


def test_others_hear_over_zenoh_what_it_tells(ridden: Ridden) -> None:
    told = {int(p["sequence"]): p["front"]["offset_m"] for p in ridden.positions if "front" in p}
    heard = {message.sequence: message.front.offset_m for message in ridden.heard if message.HasField("front")}
    assert len(heard) > 20 and heard.items() <= told.items()


def test_its_recording_is_decided_again_without_a_difference(ridden: Ridden) -> None:
    done = wayside(
        "train", "replay", ridden.recording, "--train", ridden.train_file, "--track", ridden.train_file.parent / "line.json", "--diff"
    )
    assert (done.returncode, done.stderr.strip().endswith("no difference")) == (0, True), done.stderr


def test_another_length_is_a_difference(ridden: Ridden, tmp_path: Path) -> None:
    longer = tmp_path / "longer.toml"
    longer.write_text(ridden.train_file.read_text().replace("length_m = 40.0", "length_m = 41.0"))
    assert wayside("train", "replay", ridden.recording, "--train", longer, "--diff").returncode == 1


def test_what_was_told_is_what_is_decided_again(ridden: Ridden, tmp_path: Path) -> None:
    """The numbers on stdout, live, against those of the replay, to the millimetre."""
    csv = tmp_path / "epochs.csv"
    assert wayside("train", "replay", ridden.recording, "--epochs", csv).returncode == 0
    fronts = [line.split(",")[5] for line in csv.read_text().splitlines()[1:]]
    told = [f"{p['front']['offset_m']:.3f}" if "front" in p else "" for p in ridden.positions]
    assert fronts[: len(told)] == told


def test_two_replays_say_the_same(ridden: Ridden) -> None:
    first, second = (json.loads(wayside("train", "replay", ridden.recording, "--json").stdout) for _ in range(2))
    assert first == second


def test_the_recording_is_whole(ridden: Ridden) -> None:
    assert wayside("recording", "check", ridden.recording).returncode == 0


def test_over_the_hour_each_file_is_decided_alone_as_it_was(tmp_path: Path) -> None:
    """A new file begins with the hour and a snapshot: in the midst of trust."""
    start_ns = parse_utc("2026-03-02T03:59:51Z")
    with ReceiverServer((*"ABC", *ANTENNAS), "127.0.0.1", 0) as server:
        sources = urls(server)
        place = make_field(tmp_path, {name: sources[name] for name in "ABC"}, 0.1)
        train_file = make_train(place, sources)
        events = both_measured(place.site_file, 14.0, start_ns=start_ns)
        with running_station(place), running_train(train_file) as train, playing(server, events):
            train.until(lambda p: int(p.get("gps_time_ns", 0)) > start_ns + 13 * 10**9 and p["status"] == "POSITION_VALID", 60.0)
            train.process.send_signal(signal.SIGTERM)
            train.process.wait(10.0)
    files = sorted((tmp_path / "train-recordings").glob("*.mcap"))
    assert [wayside("train", "replay", file, "--diff").stderr.rpartition(", ")[2] for file in files] == ["no difference\n"] * 2


def test_a_recording_of_a_train_is_not_taken_for_one_of_a_station(ridden: Ridden) -> None:
    assert wayside("replay", ridden.recording).returncode == 4


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("line.json", "no-line.json"), "cannot be read"),
        (("keys/trusted.toml", "keys/none.toml"), "No such file"),
        (("x_m = -3.0", 'x_m = "front"'), "x_m"),
    ],
    ids=["map", "keys", "value"],
)
def test_it_does_not_start_with_files_that_are_wrong(ridden: Ridden, tmp_path: Path, change: tuple[str, str], said: str) -> None:
    file = ridden.train_file.with_name(f"wrong-{change[1][:4]}.toml")
    file.write_text(ridden.train_file.read_text().replace(*change))
    done = wayside("train", "run", file)
    assert (done.returncode, said in done.stderr) == (2, True), done.stderr


def test_a_map_with_a_gap_is_refused(ridden: Ridden) -> None:
    """120 m are missing in the middle: the map says so, and no train runs on it."""
    track = json.loads((ridden.train_file.parent / "line.json").read_text())
    track["edges"][0]["points"] = [p for p in track["edges"][0]["points"] if not 400.0 < p[0] < 520.0]
    del track["sha256"]
    gappy = ridden.train_file.with_name("gappy.json")
    track["sha256"] = content_sha256(track)
    gappy.write_text(json.dumps(track))
    done = wayside("train", "run", ridden.train_file, "--track", gappy)
    assert (done.returncode, "gap" in done.stderr) == (2, True), done.stderr


def test_trust_ends_in_time_when_the_station_is_killed_or_stopped_or_cut_off() -> None:
    """Thirty moments of the thousand of `python -m tests.benchmarks.train_stops`; how long others keep this machine busy does not count."""
    found = measure(30, 5, 5)
    assert (found["measured"], found["ended_otherwise"], found["errors"]) == (30, 0, []), line(found)
    assert found["worst_unhindered_ms"] <= found["allowed_ms"], line(found)
