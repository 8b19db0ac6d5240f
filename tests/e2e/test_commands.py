"""The commands as people run them: real processes, real files."""

import contextlib
import csv
import json
import os
import pty
import re
import select
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

import wayside as command_line
from recordings.reader import read_recording, salvage
from tests.e2e.commands import (
    EPOCHS,
    FAULTS,
    PRECIOUS,
    ROOT,
    SCENARIO,
    SITE,
    Ran,
    environment,
    executed,
    replay_object,
    side_by_side,
    wayside,
    write_sound_files,
    written,
)

SAMPLES = ROOT / "recordings" / "samples"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sound files, and recordings: calm, the same with the fault injected, and simulated with it."""
    folder = write_sound_files(tmp_path_factory.mktemp("sound"))
    made = side_by_side(
        [
            ["simulate", folder / "scenario.toml", "-o", folder / "simulated.mcap"],
            ["inject", folder / "calm.mcap", "--faults", folder / "faults.toml", "-o", folder / "faulty.mcap"],
        ]
    )
    assert [ran.code for ran in made] == [0, 0], made
    return folder


# simulate, replay, inject


@pytest.fixture(scope="module")
def calm(folder: Path) -> dict[str, Any]:
    return replay_object(folder / "calm.mcap")


def test_calm_files_are_normal_after_start_up(calm: dict[str, Any]) -> None:
    assert calm["states"] == {"NORMAL": EPOCHS - 5, "SATELLITE_ANOMALY": 0, "NOT_CONFIRMABLE": 5}


def test_blocks_of_1_7_and_1000_epochs_twice_each_give_one_hash(folder: Path, calm: dict[str, Any]) -> None:
    ran = side_by_side([["replay", folder / "faulty.mcap", "--json", "--block-epochs", n] for n in (1, 7, 1000) * 2])
    hashes = {json.loads(r.out)["decisions_sha256"] for r in ran}
    assert len(hashes) == 1
    assert hashes != {calm["decisions_sha256"]}


@pytest.mark.parametrize("name", ["calm", "faulty", "simulated"])
def test_a_replay_finds_nothing_different(folder: Path, name: str) -> None:
    ran = wayside("replay", folder / f"{name}.mcap", "--diff")
    assert (ran.code, ran.err) == (0, f"all {EPOCHS} epochs decided as recorded\n")


def test_other_promises_are_found_different(folder: Path) -> None:
    ran = wayside("replay", folder / "calm.mcap", "--set", "integrity.false_stops_per_year=1000", "--set", "recover_after_s=9", "--diff")
    assert ran.code == 1
    assert re.search(
        r"^2026-03-02T03:00:05Z: state NORMAL -> NOT_CONFIRMABLE; cause CAUSE_UNSPECIFIED -> NOT_READY$", ran.err, re.MULTILINE
    )


def test_the_fault_that_was_injected_is_found(folder: Path) -> None:
    found = replay_object(folder / "faulty.mcap")
    assert [(e["start"][11:19], e["cause"], e["subjects"]) for e in found["episodes"][1:]] == [("03:00:20", "receiver", ["B"])]


def test_the_truth_goes_along(folder: Path) -> None:
    assert json.loads(wayside("recording", "info", folder / "faulty.mcap", "--json").out)["truth"] == FAULTS


def test_faults_of_a_scenario_are_found_as_faults_that_were_injected(folder: Path) -> None:
    injected, simulated = (replay_object(folder / f"{name}.mcap")["episodes"] for name in ("faulty", "simulated"))
    told = [[(e["start"], e["end"], e["state"], e["cause"], e["subjects"]) for e in episodes] for episodes in (injected, simulated)]
    assert told[0] == told[1]


def test_a_scenario_without_a_fault_is_simulated(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "calm.toml").write_text(SCENARIO)
    ran = wayside("simulate", tmp_path / "calm.toml", "-o", tmp_path / "x.mcap")
    assert (ran.code, ran.err) == (0, f"{tmp_path / 'x.mcap'}: simulated, 0 faults\n")


def test_a_table_has_a_row_per_epoch(folder: Path, tmp_path: Path) -> None:
    wayside("replay", folder / "calm.mcap", "--epochs", tmp_path / "epochs.csv")
    with (tmp_path / "epochs.csv").open(newline="") as file:
        assert len(list(csv.DictReader(file))) == EPOCHS


def test_a_picture_is_sound_xml(folder: Path, tmp_path: Path) -> None:
    wayside("replay", folder / "calm.mcap", "--plot", tmp_path / "calm.svg")
    assert ElementTree.parse(tmp_path / "calm.svg").getroot().tag == "{http://www.w3.org/2000/svg}svg"


def test_a_replay_recorded_anew_replays_the_same(folder: Path, tmp_path: Path) -> None:
    settings = ["--set", "recover_after_s=9"]
    first = replay_object(folder / "calm.mcap", *settings, "--out", tmp_path / "new.mcap")
    assert replay_object(tmp_path / "new.mcap")["decisions_sha256"] == first["decisions_sha256"]


def test_a_setting_changes_the_configuration(folder: Path, calm: dict[str, Any]) -> None:
    assert replay_object(folder / "calm.mcap", "--set", "rule=triangle")["config_sha256"] != calm["config_sha256"]


def test_another_site_file_is_used(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "other.toml").write_text(SITE.replace("kokubunji-1", "elsewhere"))
    assert replay_object(folder / "calm.mcap", "--site", tmp_path / "other.toml")["site"] == "elsewhere"


def test_a_window_is_what_was_asked_for(folder: Path) -> None:
    found = replay_object(folder / "calm.mcap", "--from", "2026-03-02T03:00:10Z", "--to", "2026-03-02T03:00:20Z")
    assert (found["start"], found["end"], found["epochs"]) == ("2026-03-02T03:00:10Z", "2026-03-02T03:00:19Z", 10)


def test_without_json_it_is_words(folder: Path) -> None:
    assert "a receiver is faulty (B)" in wayside("replay", folder / "faulty.mcap").out


@pytest.mark.parametrize(("name", "code"), [("calm", 0), ("faulty", 3)])
def test_an_alert_has_an_exit_code_of_its_own(folder: Path, name: str, code: int) -> None:
    assert wayside("replay", folder / f"{name}.mcap", "--fail-on", "alert").code == code


def test_with_json_nothing_else_is_on_stdout(folder: Path, tmp_path: Path) -> None:
    more = ["--diff", "--fail-on", "alert", "--out", tmp_path / "x.mcap", "--epochs", tmp_path / "x.csv", "--plot", tmp_path / "x.svg"]
    ran = wayside("replay", folder / "faulty.mcap", "--json", *more)
    assert json.loads(ran.out)["epochs"] == EPOCHS


def test_a_password_in_a_scenario_is_not_in_its_recording(folder: Path) -> None:
    assert b"secret" in (folder / "scenario.toml").read_bytes()
    recording = read_recording(folder / "simulated.mcap")
    everything = [entry.data for entry in recording.entries] + [json.dumps(recording.metadata).encode()]
    assert not any(b"secret" in part for part in everything)


# recording info, check, recover


def test_info_says_what_is_in_a_recording(folder: Path) -> None:
    found = json.loads(wayside("recording", "info", folder / "calm.mcap", "--json").out)
    assert (found["site"], found["start"], found["messages"]["/epoch"]) == ("kokubunji-1", "2026-03-02T03:00:00Z", EPOCHS)


def test_info_in_words_shows_the_faults(folder: Path) -> None:
    assert '  kind = "receiver_bias"' in wayside("recording", "info", folder / "faulty.mcap").out


def test_a_whole_recording_passes_its_check(folder: Path) -> None:
    ran = wayside("recording", "check", folder / "calm.mcap", "--json")
    assert (ran.code, json.loads(ran.out)) == (0, {"recording": "calm.mcap", "whole": True, "complaints": []})


@pytest.fixture(scope="module")
def cut(folder: Path) -> Path:
    path = folder / "cut.mcap"
    path.write_bytes((folder / "faulty.mcap").read_bytes()[: (folder / "faulty.mcap").stat().st_size * 3 // 4])
    return path


def test_a_cut_recording_fails_its_check(cut: Path) -> None:
    ran = wayside("recording", "check", cut, "--json")
    assert (ran.code, json.loads(ran.out)["whole"]) == (1, False)


def test_info_of_a_cut_recording_says_so(cut: Path) -> None:
    assert "cut or damaged" in json.loads(wayside("recording", "info", cut, "--json").out)["damage"]


def test_a_recovered_recording_passes_its_check_and_decides_as_recorded(cut: Path, tmp_path: Path) -> None:
    saved = tmp_path / "saved.mcap"
    ran = wayside("recording", "recover", cut, "-o", saved)
    assert (ran.code, ran.out) == (0, "")
    assert [r.code for r in side_by_side([["recording", "check", saved], ["replay", saved, "--diff"]])] == [0, 0]


# Help


def commands_of(found: object, *names: str) -> Iterator[tuple[str, TyperCommand]]:
    """Every command below a group, by its name in full."""
    if isinstance(found, TyperGroup):
        for name, below in found.commands.items():
            yield from commands_of(below, *names, name)
    else:
        assert isinstance(found, TyperCommand)
        yield " ".join(names), found


COMMANDS = dict(commands_of(get_command(command_line.app)))


@pytest.fixture(scope="module")
def helps() -> dict[str, Ran]:
    return dict(zip(COMMANDS, side_by_side([[*command.split(), "--help"] for command in COMMANDS]), strict=True))


def example_in(text: str) -> list[str]:
    """The arguments of the one example, without what the shell does with its output."""
    (line,) = re.findall(r"Example: wayside (.*)", text)
    return shlex.split(str(line).partition(" >> ")[0])


@pytest.mark.parametrize("command", COMMANDS)
def test_help_has_an_example_of_the_command_itself(helps: dict[str, Ran], command: str) -> None:
    assert " ".join(example_in(helps[command].out)).startswith(f"{command} ")


@pytest.mark.parametrize("command", COMMANDS)
def test_the_example_is_one_that_the_command_takes(helps: dict[str, Ran], command: str) -> None:
    arguments = example_in(helps[command].out)[len(command.split()) :]
    COMMANDS[command].make_context(command, arguments)  # raises for an option that is unknown or missing


def test_every_command_that_is_listed_is_asked_for_its_help() -> None:
    groups = sorted({name.split()[0] for name in COMMANDS if " " in name})
    places = [(), *((group,) for group in groups)]
    shown = side_by_side([[*place, "--help"] for place in places])
    listed = {
        (*place, name) for place, ran in zip(places, shown, strict=True) for name in re.findall(r"^│ ([a-z]+)", ran.out, re.MULTILINE)
    }
    assert listed == {(group,) for group in groups} | {tuple(name.split()) for name in COMMANDS}


def test_the_examples_of_simulate_and_replay_run(helps: dict[str, Ran], folder: Path, tmp_path: Path) -> None:
    (tmp_path / "recordings").mkdir()
    (tmp_path / "recordings" / "samples").symlink_to(SAMPLES)
    (tmp_path / "day.mcap").symlink_to(folder / "faulty.mcap")
    assert [executed(*example_in(helps[name].out), cwd=tmp_path).code for name in ("simulate", "replay")] == [0, 0]
    assert {path.name for path in tmp_path.iterdir()} >= {"triangle.mcap", "day.svg"}


def test_an_unknown_command_is_a_matter_of_usage() -> None:
    assert wayside("relpay").code == 2


# Terminals


def on_a_terminal(*arguments: str, **more: str) -> str:
    """What a command prints where stdout is a terminal."""
    try:
        ours, theirs = pty.openpty()
    except OSError as error:
        pytest.skip(f"no pseudo-terminal on this machine: {error}")
    process = subprocess.Popen(
        [sys.executable, "-m", "wayside", *arguments], cwd=ROOT, env=environment(**more), stdout=theirs, stderr=theirs
    )
    os.close(theirs)
    shown = b""
    while select.select([ours], [], [], 30.0)[0]:
        try:
            piece = os.read(ours, 65536)
        except OSError:  # the other end is closed
            break
        if not piece:
            break
        shown += piece
    process.wait(timeout=30)
    os.close(ours)
    return shown.decode()


COLOUR = re.compile(r"\x1b\[(?:\d+;)*(?:3[0-8]|4[0-8]|9[0-7]|10[0-7])(?:;\d+)*m")


def test_a_terminal_has_colour() -> None:
    assert COLOUR.search(on_a_terminal("--help"))


def test_no_color_is_obeyed() -> None:
    assert not COLOUR.search(on_a_terminal("--help", NO_COLOR="1"))


def test_a_file_has_no_escape_sequence(helps: dict[str, Ran]) -> None:
    assert not any("\x1b" in ran.out + ran.err for ran in helps.values())


# Interrupted


@dataclass(frozen=True)
class Interrupted:
    """A long simulation that met Ctrl-C while it was writing."""

    code: int
    err: str
    before: bytes
    part: Path


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory: pytest.TempPathFactory) -> Interrupted:
    here = tmp_path_factory.mktemp("interrupted")
    scenario = written(here / "long.toml", (SCENARIO + FAULTS).replace(f"duration_s = {EPOCHS}", "duration_s = 3000"))
    out = written(here / "long.mcap", PRECIOUS)
    part = here / "long.mcap.part"
    command = [sys.executable, "-m", "wayside", "simulate", str(scenario), "-o", str(out)]
    process = subprocess.Popen(command, cwd=ROOT, env=environment(), stderr=subprocess.PIPE, text=True)
    give_up = time.monotonic() + 60.0
    while process.poll() is None and time.monotonic() < give_up and not (part.exists() and part.stat().st_size > 200_000):
        time.sleep(0.005)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    return Interrupted(process.returncode, err, out.read_bytes(), part)


def test_ctrl_c_has_an_exit_code_of_its_own(interrupted: Interrupted) -> None:
    assert interrupted.code == 130


def test_ctrl_c_leaves_no_traceback(interrupted: Interrupted) -> None:
    assert "Traceback" not in interrupted.err


def test_ctrl_c_leaves_the_file_that_was_there(interrupted: Interrupted) -> None:
    assert interrupted.before == PRECIOUS


def test_what_was_written_before_ctrl_c_can_be_saved(interrupted: Interrupted) -> None:
    assert salvage(interrupted.part).counts()["/epoch"] > 10


def test_an_interrupt_that_python_drops_on_the_way_is_not_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is raised by a signal while a module is imported can get lost in the import system: the command then goes on to its end."""

    def dropped(_: list[str]) -> int:
        with contextlib.suppress(SystemExit):
            signal.raise_signal(signal.SIGINT)
        return 0

    before = signal.getsignal(signal.SIGINT)
    monkeypatch.setattr(command_line, "run", dropped)
    monkeypatch.setattr(command_line, "leave", sys.exit)  # this process goes on, whatever threads it has
    try:
        with pytest.raises(SystemExit) as ended:
            command_line.main()
    finally:
        signal.signal(signal.SIGINT, before)
    assert ended.value.code == 130
