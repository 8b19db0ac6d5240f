"""The commands as people run them: real processes, real files; and whatever is wrong with the files, a clear word and nothing lost."""

import csv
import gzip
import json
import os
import pty
import re
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from xml.etree import ElementTree

import pytest

from integrity.gnss.gps_time import DAY_S, NS_PER_S
from integrity.messages import wayside_pb2 as pb
from recordings.reader import read_recording, salvage
from recordings.replay import decide_and_record, replayable
from recordings.writer import RecordingWriter
from tests.rinex_text import observation_text, rows_of, write_rinex
from tests.unit.sites import SITE as SITE_TEXT
from tests.unit.streams import stream
from wayside import main as entry_point

ROOT = Path(__file__).parents[2]
SAMPLES = ROOT / "recordings" / "samples"
EPOCHS = 60
PRECIOUS = b"recorded years ago"
SITE = SITE_TEXT.replace("recover_after_s = 30.0", "recover_after_s = 5.0").replace("tolerance_m = 20.0\n", "")
SCENARIO = f"""\
[scenario]
start = "2026-03-02T03:00:00Z"
duration_s = {EPOCHS}
seed = 1
{SITE}"""
FAULTS = """\
[[fault]]
kind = "receiver_bias"
receiver = "B"
start_s = 20
duration_s = 10
offset_enu_m = [30.0, -20.0, 0.0]
"""


@dataclass(frozen=True)
class Ran:
    """What a process left behind."""

    code: int
    out: str
    err: str


def environment(**more: str) -> dict[str, str]:
    kept = {k: v for k, v in os.environ.items() if k not in ("NO_COLOR", "FORCE_COLOR", "PY_COLORS", "GITHUB_ACTIONS")}
    return kept | {"PYTHONPATH": str(ROOT), "COLUMNS": "240", "TERM": "xterm-256color"} | more


def executed(*arguments: object, cwd: Path = ROOT) -> Ran:
    """A command from the very beginning, interpreter and all."""
    command = [sys.executable, "-m", "wayside", *map(str, arguments)]
    done = subprocess.run(command, cwd=cwd, env=environment(), capture_output=True, text=True, timeout=120, check=False)
    return Ran(done.returncode, done.stdout, done.stderr)


# Importing numpy and scipy takes most of a second, so most commands are forked off a process that has done so already.
FORKED = get_context("forkserver")
FORKED.set_forkserver_preload(["wayside", "recordings.replay", "recordings.importer", "recordings.report.plot", __name__])


def wayside(*arguments: object) -> Ran:
    """A command in a process of its own."""
    with TemporaryDirectory() as scratch:
        process = FORKED.Process(target=_main, args=([str(a) for a in arguments], scratch))
        process.start()
        process.join(120)
        out, err = (Path(scratch, name).read_text() for name in ("out", "err"))
        return Ran(-1 if process.exitcode is None else process.exitcode, out, err)


def _main(arguments: list[str], scratch: str) -> None:
    for stream_number, name in ((1, "out"), (2, "err")):
        os.dup2(os.open(Path(scratch, name), os.O_WRONLY | os.O_CREAT), stream_number)
    os.chdir(ROOT)
    os.environ.clear()
    os.environ.update(environment())
    sys.argv = ["wayside", *arguments]
    entry_point()


def side_by_side(commands: Sequence[Sequence[object]], run: Callable[..., Ran] = wayside) -> list[Ran]:
    """Several commands at once, as many as there are processors."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(lambda arguments: run(*arguments), commands))


def receiver_options(names: dict[str, Path]) -> list[str]:
    return [option for name in "ABC" for option in ("--receiver", f"{name}={names[name]}")]


def import_with(sound: Path, site: Path | None = None, nav: Path | None = None, **files: Path) -> list[object]:
    names = {name: files.get(name, sound / f"{name}.rnx") for name in "ABC"}
    return ["import", "--site", site or sound / "site.toml", *receiver_options(names), "--nav", nav or sound / "nav.rnx"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sound files: a site, a scenario, faults, RINEX; recordings: calm, the same with faults injected, and simulated with them."""
    folder = tmp_path_factory.mktemp("sound")
    (folder / "site.toml").write_text(SITE)
    (folder / "scenario.toml").write_text(SCENARIO + FAULTS)
    (folder / "faults.toml").write_text(FAULTS)
    write_rinex(folder, stream(EPOCHS), "ABC")
    made = side_by_side(
        [
            ["simulate", folder / "scenario.toml", "-o", folder / "simulated.mcap"],
            [*import_with(folder), "-o", folder / "calm.mcap"],
        ],
        executed,
    )
    made.append(executed("inject", folder / "calm.mcap", "--faults", folder / "faults.toml", "-o", folder / "faulty.mcap"))
    assert [ran.code for ran in made] == [0, 0, 0], made
    return folder


def replay_object(*arguments: object) -> dict[str, Any]:
    ran = wayside("replay", *arguments, "--json")
    assert ran.code == 0, ran.err
    found: dict[str, Any] = json.loads(ran.out)
    return found


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
    everything = [m.message.SerializeToString() for m in recording.entries] + [json.dumps(recording.metadata).encode()]
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


# Bad input: each is refused with a word, and what is already there stays


BadCase = Callable[[Path, Path], list[object]]


def written(path: Path, content: bytes | str) -> Path:
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def of_another_year(sound: Path, here: Path, name: str) -> Path:
    rows = [replace(row, receive_time_ns=row.receive_time_ns - 365 * DAY_S * NS_PER_S) for row in rows_of(stream(EPOCHS), name)]
    return written(here / f"{name}-2025.rnx", observation_text(rows))


def with_metadata(sound: Path, path: Path, dropped: str) -> Path:
    recording = read_recording(sound / "calm.mcap")
    todo = replayable(recording)
    decide_and_record(path, todo.site, todo.events, {"import": {"dropped": dropped}}, todo.snapshot)
    return path


def with_message(sound: Path, path: Path, spoil: Callable[[pb.Observations], None]) -> Path:
    """A recording one of whose rows is not what it should be."""
    entries = read_recording(sound / "calm.mcap").entries
    with RecordingWriter(path, "test", replayable(read_recording(sound / "calm.mcap")).events[0].mono_ns, entries[0].log_ns, {}) as writer:
        for k, entry in enumerate(entries):
            if isinstance(entry.message, pb.Observations) and k > 200:
                spoil(entry.message)
            writer.write(entry.message, entry.log_ns)
    return path


def without_a_range(row: pb.Observations) -> None:
    row.pseudorange_m.pop()


def five_mistakes(here: Path) -> Path:
    text = SITE.replace('id = "kokubunji-1"', 'id = "a b"').replace("sigma_common_m = 1.2", "sigma_comon_m = 1.2")
    text = text.replace("missed_detection = 1e-5", "missed_detection = 2.0").replace("valid_for_ms = 3000", 'valid_for_ms = "3000"')
    return written(here / "five.toml", text.replace("position_ecef_m = [-3962186.571, 3381218.295, 3668678.638]\n", ""))


def foreign_recording(sound: Path, path: Path) -> Path:
    content = (sound / "calm.mcap").read_bytes()
    return written(path, content.replace(b"wayside.v1", b"wayside.v9", 1))  # the profile in its header


def cut_recording(sound: Path, here: Path, share: float) -> Path:
    content = (sound / "calm.mcap").read_bytes()
    return written(here / f"cut-{share}.mcap", content[: int(len(content) * share)])


def output(here: Path, name: str) -> list[object]:
    return ["-o", written(here / f"{name}.out.mcap", PRECIOUS)]


# What is wrong: the command, its exit code, and what stderr must say: the file and what to do about it.
BAD: dict[str, tuple[BadCase, int, str]] = {
    "empty observations": (
        lambda s, h: [*import_with(s, A=written(h / "empty.rnx", b"")), *output(h, "empty-obs")],
        4,
        r"empty\.rnx, line 1: found an empty file; expected a RINEX file; fetch",
    ),
    "empty navigation": (
        lambda s, h: [*import_with(s, nav=written(h / "empty.nav", b"")), *output(h, "empty-nav")],
        4,
        r"empty\.nav, line 1: found an empty file; expected a RINEX file; fetch",
    ),
    "all observations of another year": (
        lambda s, h: [*import_with(s, **{n: of_another_year(s, h, n) for n in "ABC"}), *output(h, "year-all")],
        4,
        r"no ephemeris serves the epochs 2025-03-02T.* cover 2026-03-02T.*; give the navigation file of that day with --nav",
    ),
    "one receiver of another year": (
        lambda s, h: [*import_with(s, B=of_another_year(s, h, "B")), *output(h, "year-one")],
        4,
        r"no epoch is common to all receivers.*A has 60 from 2026.*B has 60 from 2025",
    ),
    "text as observations": (
        lambda s, h: [*import_with(s, A=s / "site.toml"), *output(h, "text-obs")],
        4,
        r"site\.toml, line 1: found .*; expected RINEX VERSION / TYPE.*; give a RINEX file",
    ),
    "navigation as observations": (
        lambda s, h: [*import_with(s, A=s / "nav.rnx"), *output(h, "nav-as-obs")],
        4,
        r"nav\.rnx, line 1: found file type .*; expected 'O' for observation data; give the file",
    ),
    "a damaged gzip file": (
        lambda s, h: [
            *import_with(s, A=written(h / "a.rnx.gz", gzip.compress((s / "A.rnx").read_bytes())[:99] + bytes(99))),
            *output(h, "gzip"),
        ],
        4,
        r"a\.rnx\.gz, line 1: found .*; expected .*; fetch",
    ),
    "bytes as observations": (
        lambda s, h: [*import_with(s, A=written(h / "noise.rnx", bytes(range(256)) * 40)), *output(h, "noise")],
        4,
        r"noise\.rnx, line 1: found .*; expected RINEX",
    ),
    "observations that are not there": (
        lambda s, h: [*import_with(s, A=h / "nowhere.rnx"), *output(h, "nowhere")],
        4,
        r"nowhere\.rnx: no such file",
    ),
    "no navigation": (
        lambda s, h: [*import_with(s)[:-2], *output(h, "no-nav")],
        2,
        r"no navigation file: give the broadcast ephemerides of the day with --nav FILE",
    ),
    "a receiver that the site has not": (
        lambda s, h: [*import_with(s), "--receiver", "D=x.rnx", *output(h, "receiver-d")],
        2,
        r"--receiver D=x\.rnx: expected NAME=FILE with NAME one of A, B, C",
    ),
    "a receiver without a file": (
        lambda s, h: [*import_with(s)[:5], "--nav", s / "nav.rnx", *output(h, "one-receiver")],
        2,
        r"no file for receiver B, C: add --receiver B=FILE",
    ),
    "a window that is none": (
        lambda s, h: [*import_with(s), "--start", "noon", *output(h, "noon")],
        2,
        r"not a UTC time: 'noon'; write it like",
    ),
    "a window beside the files": (
        lambda s, h: [*import_with(s), "--start", "2027-01-01T00:00:00Z", *output(h, "beside")],
        4,
        r"receiver A: no epoch between the times asked for; A has 60 from 2026",
    ),
    "a site file with five mistakes": (
        lambda s, h: [*import_with(s, site=five_mistakes(h)), *output(h, "five")],
        2,
        r"five\.toml:2: site\.id = .*\n(.*\n)*.*five\.toml:\d+: integrity\.missed_detection = 2\.0: expected",
    ),
    "a site file that is not there": (
        lambda s, h: [*import_with(s, site=h / "none.toml"), *output(h, "no-site")],
        2,
        r"none\.toml: cannot be read .*: give the path of a readable TOML file",
    ),
    "another site file with five mistakes": (
        lambda s, h: ["replay", s / "calm.mcap", "--site", five_mistakes(h), "--out", written(h / "five-replay.out.mcap", PRECIOUS)],
        2,
        r"five\.toml:2: site\.id = ",
    ),
    "an empty recording": (
        lambda s, h: ["replay", written(h / "empty.mcap", b""), "--out", written(h / "empty-rec.out.mcap", PRECIOUS)],
        4,
        r"empty\.mcap: not an MCAP recording",
    ),
    "text as a recording": (
        lambda s, h: ["recording", "recover", s / "site.toml", *output(h, "text-rec")],
        4,
        r"site\.toml: not an MCAP recording",
    ),
    "a folder as a recording": (lambda s, h: ["recording", "recover", s, *output(h, "folder")], 4, r"Is a directory"),
    "a recording that is not there": (
        lambda s, h: ["replay", h / "none.mcap", "--out", written(h / "no-rec.out.mcap", PRECIOUS)],
        4,
        r"none\.mcap: no such file",
    ),
    "a recording cut near its end": (
        lambda s, h: ["replay", cut_recording(s, h, 0.99), "--out", written(h / "cut99.out.mcap", PRECIOUS)],
        4,
        r"cut-0\.99\.mcap: cut or damaged at byte \d+.*; `wayside recording recover \S+cut-0\.99\.mcap -o OUT\.mcap` saves",
    ),
    "a recording cut in its middle": (
        lambda s, h: ["inject", cut_recording(s, h, 0.5), "--faults", s / "faults.toml", *output(h, "cut50")],
        4,
        r"cut-0\.5\.mcap: cut or damaged at byte \d+.*; `wayside recording recover \S+cut-0\.5\.mcap -o OUT\.mcap` saves",
    ),
    "a recording cut in its first second": (
        lambda s, h: ["recording", "recover", cut_recording(s, h, 0.01), *output(h, "cut01")],
        4,
        r"cut-0\.01\.mcap: cut or damaged at byte \d+.*; nothing to decide",
    ),
    "a recording of an unknown schema": (
        lambda s, h: ["replay", foreign_recording(s, h / "v9.mcap"), "--out", written(h / "v9.out.mcap", PRECIOUS)],
        4,
        r"v9\.mcap: profile 'wayside\.v9', expected 'wayside\.v1'",
    ),
    "an unknown schema to inject into": (
        lambda s, h: ["inject", foreign_recording(s, h / "v9b.mcap"), "--faults", s / "faults.toml", *output(h, "v9b")],
        4,
        r"v9b\.mcap: profile 'wayside\.v9', expected 'wayside\.v1'",
    ),
    "an unknown schema to recover": (
        lambda s, h: ["recording", "recover", foreign_recording(s, h / "v9c.mcap"), *output(h, "v9c")],
        4,
        r"v9c\.mcap: profile 'wayside\.v9', expected 'wayside\.v1'",
    ),
    "metadata that is no JSON": (
        lambda s, h: ["replay", with_metadata(s, h / "meta.mcap", '{"A": '), "--out", written(h / "meta.out.mcap", PRECIOUS)],
        4,
        r"meta\.mcap: ",
    ),
    "metadata of another shape": (
        lambda s, h: ["replay", with_metadata(s, h / "meta2.mcap", '{"A": [1]}'), "--out", written(h / "meta2.out.mcap", PRECIOUS)],
        4,
        r"meta2\.mcap: ",
    ),
    "a row that does not fit its signals": (
        lambda s, h: [
            "replay",
            with_message(s, h / "row.mcap", without_a_range),
            "--out",
            written(h / "row.out.mcap", PRECIOUS),
        ],
        4,
        r"row\.mcap.*pseudorange_m has shape",
    ),
    "a kind of fault that there is not": (
        lambda s, h: [
            "inject",
            s / "calm.mcap",
            "--faults",
            written(h / "kind.toml", FAULTS.replace("receiver_bias", "receiver_bais")),
            *output(h, "kind"),
        ],
        2,
        r'kind\.toml:2: fault\.0\.kind = "receiver_bais": no such kind: expected one of .*; did you mean "receiver_bias"\?',
    ),
    "a fault outside the recording": (
        lambda s, h: [
            "inject",
            s / "calm.mcap",
            "--faults",
            written(h / "late.toml", FAULTS.replace("start_s = 20", "start_s = 2000")),
            *output(h, "late"),
        ],
        2,
        r"receiver_bias from .* covers no epoch: the recording spans .*; choose a start within it",
    ),
    "a fault file of bytes": (
        lambda s, h: ["inject", s / "calm.mcap", "--faults", written(h / "bytes.toml", b"\xff\xfe"), *output(h, "bytes")],
        4,
        r"bytes\.toml: not UTF-8 text",
    ),
    "a scenario without its times": (
        lambda s, h: ["simulate", written(h / "no-start.toml", SCENARIO.replace("duration_s", "duration")), *output(h, "no-start")],
        2,
        r"no-start\.toml:\d+: scenario.*duration",
    ),
    "a scenario that is no TOML": (
        lambda s, h: ["simulate", written(h / "no.toml", "start = ["), *output(h, "no-toml")],
        2,
        r"no\.toml:1: .*not TOML",
    ),
    "a setting that there is not": (
        lambda s, h: ["replay", s / "calm.mcap", "--set", "integrity.rul=full", "--out", written(h / "rul.out.mcap", PRECIOUS)],
        2,
        r"--set: integrity\.rul = \"full\": .*did you mean \"rule\"\?",
    ),
    "another thing to fail on": (
        lambda s, h: ["replay", s / "calm.mcap", "--fail-on", "rain", "--out", written(h / "rain.out.mcap", PRECIOUS)],
        2,
        r"--fail-on rain: the only choice is alert",
    ),
    "blocks of no epoch": (
        lambda s, h: ["replay", s / "calm.mcap", "--block-epochs", "0", "--out", written(h / "zero.out.mcap", PRECIOUS)],
        2,
        r"--block-epochs",
    ),
    "an end before the start": (
        lambda s, h: [
            *("replay", s / "calm.mcap", "--from", "2026-03-02T03:00:20Z", "--to", "2026-03-02T03:00:10Z"),
            *("--out", written(h / "end.out.mcap", PRECIOUS)),
        ],
        2,
        r"the time window ends \(2026-03-02T03:00:10Z\) before it begins",
    ),
    "a folder that is not there to write to": (
        lambda s, h: ["simulate", s / "scenario.toml", "-o", h / "nowhere" / "x.mcap"],
        2,
        r"nowhere/x\.mcap.*(folder|directory)",
    ),
}


@dataclass(frozen=True)
class Refused:
    """What became of the commands on bad input, and of the outputs that were there before."""

    ran: dict[str, Ran]
    outputs: dict[str, bytes]
    leftovers: list[str]


@pytest.fixture(scope="module")
def refused(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Refused:
    here = tmp_path_factory.mktemp("bad")
    commands = {what: case(folder, here) for what, (case, _, _) in BAD.items()}
    outputs = sorted(here.glob("*.out.mcap"))
    ran = dict(zip(commands, side_by_side(list(commands.values())), strict=True))
    return Refused(ran, {path.name: path.read_bytes() for path in outputs}, [path.name for path in here.glob("*.part")])


@pytest.mark.parametrize("what", BAD)
def test_bad_input_has_its_exit_code(refused: Refused, what: str) -> None:
    assert refused.ran[what].code == BAD[what][1], refused.ran[what].err


@pytest.mark.parametrize("what", BAD)
def test_bad_input_is_refused_in_words(refused: Refused, what: str) -> None:
    assert "Traceback" not in refused.ran[what].err


@pytest.mark.parametrize("what", BAD)
def test_the_refusal_says_where_and_what_would_be_right(refused: Refused, what: str) -> None:
    assert re.search(BAD[what][2], refused.ran[what].err), refused.ran[what].err


@pytest.mark.parametrize("what", BAD)
def test_the_refusal_is_short_and_on_stderr(refused: Refused, what: str) -> None:
    assert (refused.ran[what].out, len(refused.ran[what].err.splitlines()) <= 12) == ("", True), refused.ran[what].err


def test_every_output_that_was_there_is_untouched(refused: Refused) -> None:
    assert [name for name, content in refused.outputs.items() if content != PRECIOUS] == []
    assert len(refused.outputs) == len(BAD) - 1  # one of them writes to nowhere


def test_nothing_half_written_is_left_behind(refused: Refused) -> None:
    assert refused.leftovers == []


def test_five_mistakes_are_all_told_at_once(refused: Refused) -> None:
    told = refused.ran["a site file with five mistakes"].err
    for key in ("site.id", "integrity.sigma_comon_m", "integrity.missed_detection", "publish.valid_for_ms", "receivers.B"):
        assert re.search(rf"five\.toml:\d+: {re.escape(key)}", told), (key, told)


def test_the_same_five_mistakes_are_told_by_check(tmp_path: Path) -> None:
    ran = wayside("station", "check", five_mistakes(tmp_path), "--json")
    assert ran.code == 2
    assert len(json.loads(ran.out)["errors"]) == 5


# Bad input that can be imported: what of it is beyond doubt is decided, honestly


def imported(folder: Path, here: Path, texts: Mapping[str, str], site: Path | None = None) -> tuple[Ran, Path]:
    files = {name: written(here / f"{name}.rnx", text) for name, text in texts.items()}
    ran = wayside(*import_with(folder, site, **files), "-o", here / "out.mcap")
    assert ran.code == 0, ran.err
    return ran, here / "out.mcap"


def text_of(name: str) -> str:
    return observation_text(rows_of(stream(EPOCHS), name))


def test_a_file_cut_in_mid_epoch_loses_that_epoch_and_says_so(folder: Path, tmp_path: Path) -> None:
    text = text_of("B")
    ran, out = imported(folder, tmp_path, {"B": text[: text.rindex(">") + 500]})
    assert "receiver B: dropped 1 x epoch cut off" in ran.err
    assert replay_object(out)["epochs"] == EPOCHS - 1


def test_numbers_that_are_none_are_never_vouched_for(folder: Path, tmp_path: Path) -> None:
    lines = text_of("B").split("\n")
    spoiled = [line[:3] + "           nan" + line[17:] if re.match(r"[GE]\d\d", line) and len(line) > 60 else line for line in lines]
    ran, out = imported(folder, tmp_path, {"B": "\n".join(spoiled)})
    found = replay_object(out)
    assert re.search(r"receiver B: dropped \d+ x field not a number", ran.err)
    assert (found["states"]["NORMAL"], found["alignment"]["B"]["dropped"] > EPOCHS) == (0, True)


def test_absurd_ranges_are_never_vouched_for(folder: Path, tmp_path: Path) -> None:
    lines = text_of("B").split("\n")
    spoiled = [
        line[:3] + f"{9.9e8:14.3f}" + line[17:] if re.match(r"[GE]\d\d\d? ", line[:4] + " ") and len(line) > 60 else line for line in lines
    ]
    ran, out = imported(folder, tmp_path, {"B": "\n".join(spoiled)})
    assert re.search(r"receiver B: dropped \d+ x absurd pseudorange", ran.err)
    assert replay_object(out)["states"]["NORMAL"] == 0


def test_no_signal_at_all_is_never_vouched_for(folder: Path, tmp_path: Path) -> None:
    texts = {n: re.sub(r"(?m)^([GE]\d\d).{14}", r"\g<1>              ", text_of(n)) for n in "ABC"}
    _, out = imported(folder, tmp_path, texts)
    assert replay_object(out)["states"]["NORMAL"] == 0


def test_repeated_epochs_are_counted_and_decided_once(folder: Path, tmp_path: Path, calm: dict[str, Any]) -> None:
    rows = [copy for row in rows_of(stream(EPOCHS), "B") for copy in (row, row)]
    ran, out = imported(folder, tmp_path, {"B": observation_text(rows)})
    assert f"receiver B: dropped {EPOCHS} x epoch repeated" in ran.err
    assert replay_object(out)["states"] == calm["states"]


def test_time_that_jumps_back_is_counted_and_decided_once(folder: Path, tmp_path: Path, calm: dict[str, Any]) -> None:
    rows = rows_of(stream(EPOCHS), "B")
    ran, out = imported(folder, tmp_path, {"B": observation_text([*rows[:40], *rows[20:]])})
    assert "receiver B: dropped 20 x epoch repeated" in ran.err
    assert replay_object(out)["states"] == calm["states"]


@pytest.fixture(scope="module")
def swapped(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    here = tmp_path_factory.mktemp("swapped")
    site = (
        SITE.replace("[receivers.A]", "[receivers.X]").replace("[receivers.B]", "[receivers.A]").replace("[receivers.X]", "[receivers.B]")
    )
    _, out = imported(folder, here, {}, written(here / "swapped.toml", site))
    return replay_object(out)


def test_two_receivers_with_swapped_coordinates_are_never_vouched_for(swapped: dict[str, Any]) -> None:
    assert swapped["states"] == {"NORMAL": 0, "SATELLITE_ANOMALY": 0, "NOT_CONFIRMABLE": EPOCHS}


def test_swapped_coordinates_are_hinted_at_from_the_first_epoch_on(swapped: dict[str, Any]) -> None:
    first = swapped["episodes"][0]
    assert first["start"] == "2026-03-02T03:00:00Z"
    assert "receivers A and B stand at each other's points: antennas or coordinates exchanged?" in first["reasons"]


# Help


COMMANDS = ["import", "replay", "inject", "simulate", "recording info", "recording check", "recording recover", "station check"]


@pytest.fixture(scope="module")
def helps() -> dict[str, Ran]:
    return dict(zip(COMMANDS, side_by_side([[*command.split(), "--help"] for command in COMMANDS], executed), strict=True))


def example_in(text: str) -> list[str]:
    (line,) = re.findall(r"Example: wayside (.*)", text)
    return str(line).split()


@pytest.mark.parametrize("command", COMMANDS)
def test_help_has_an_example_of_the_command_itself(helps: dict[str, Ran], command: str) -> None:
    assert " ".join(example_in(helps[command].out)).startswith(command)


def test_every_command_is_asked_for_its_help() -> None:
    top = executed("--help").out
    groups = {"recording": executed("recording", "--help").out, "station": executed("station", "--help").out}
    names = re.findall(r"^│ ([a-z]+)", top, re.MULTILINE)
    listed = [name for name in names if name not in groups]
    listed += [f"{group} {name}" for group, text in groups.items() for name in re.findall(r"^│ ([a-z]+)", text, re.MULTILINE)]
    assert sorted(listed) == sorted(COMMANDS)


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
