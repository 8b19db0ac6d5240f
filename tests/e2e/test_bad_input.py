"""Whatever is wrong with the files, a clear word and nothing lost; and what of bad input is beyond doubt is decided, honestly."""

import gzip
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from integrity.gnss.gps_time import DAY_S, NS_PER_S, gps_from_utc
from integrity.messages import wayside_pb2 as pb
from recordings.reader import read_recording
from recordings.replay import decide_and_record, replayable
from recordings.writer import RecordingWriter
from tests.e2e.commands import (
    EPOCHS,
    FAULTS,
    PRECIOUS,
    SCENARIO,
    SITE,
    Ran,
    five_mistakes,
    import_with,
    replay_object,
    side_by_side,
    wayside,
    write_sound_files,
    written,
)
from tests.rinex_text import observation_text, rows_of
from tests.unit.streams import stream

BadCase = Callable[[Path, Path], list[object]]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_sound_files(tmp_path_factory.mktemp("sound"))


@pytest.fixture(scope="module")
def calm(folder: Path) -> dict[str, Any]:
    return replay_object(folder / "calm.mcap")


def of_another_year(here: Path, name: str) -> Path:
    rows = [replace(row, receive_time_ns=row.receive_time_ns - 365 * DAY_S * NS_PER_S) for row in rows_of(stream(EPOCHS), name)]
    return written(here / f"{name}-2025.rnx", observation_text(rows))


def with_metadata(sound: Path, path: Path, dropped: str) -> Path:
    todo = replayable(read_recording(sound / "calm.mcap"))
    decide_and_record(path, todo.site, todo.events, {"import": {"dropped": dropped}}, todo.snapshot)
    return path


def with_a_range_less(sound: Path, path: Path) -> Path:
    """The recording; from some row on, each has a range less than it has signals."""
    entries = read_recording(sound / "calm.mcap").entries
    with RecordingWriter(path, "test", gps_from_utc(entries[0].log_ns), entries[0].log_ns, {}) as writer:
        for k, entry in enumerate(entries):
            if isinstance(entry.message, pb.Observations) and k > 200:
                entry.message.pseudorange_m.pop()
            writer.add(entry.topic, entry.data, entry.log_ns)
    return path


def foreign_recording(sound: Path, path: Path) -> Path:
    content = (sound / "calm.mcap").read_bytes()
    return written(path, content.replace(b"wayside.v1", b"wayside.v9", 1))  # the profile in its header


def cut_recording(sound: Path, here: Path, share: float) -> Path:
    content = (sound / "calm.mcap").read_bytes()
    return written(here / f"cut-{share}.mcap", content[: int(len(content) * share)])


# What is wrong: the command without its output, its exit code, and what stderr must say: the file and what to do about it.
BAD: dict[str, tuple[BadCase, int, str]] = {
    "empty observations": (
        lambda s, h: import_with(s, A=written(h / "empty.rnx", b"")),
        4,
        r"empty\.rnx, line 1: found an empty file; expected a RINEX file; fetch",
    ),
    "empty navigation": (
        lambda s, h: import_with(s, nav=written(h / "empty.nav", b"")),
        4,
        r"empty\.nav, line 1: found an empty file; expected a RINEX file; fetch",
    ),
    "all observations of another year": (
        lambda s, h: import_with(s, **{n: of_another_year(h, n) for n in "ABC"}),
        4,
        r"no ephemeris serves the epochs 2025-03-02T.* cover 2026-03-02T.*; give the navigation file of that day with --nav",
    ),
    "one receiver of another year": (
        lambda s, h: import_with(s, B=of_another_year(h, "B")),
        4,
        r"no epoch is common to all receivers.*A has 60 from 2026.*B has 60 from 2025",
    ),
    "text as observations": (
        lambda s, h: import_with(s, A=s / "site.toml"),
        4,
        r"site\.toml, line 1: found .*; expected RINEX VERSION / TYPE.*; give a RINEX file",
    ),
    "navigation as observations": (
        lambda s, h: import_with(s, A=s / "nav.rnx"),
        4,
        r"nav\.rnx, line 1: found file type .*; expected 'O' for observation data; give the file",
    ),
    "a damaged gzip file": (
        lambda s, h: import_with(s, A=written(h / "a.rnx.gz", gzip.compress((s / "A.rnx").read_bytes())[:99] + bytes(99))),
        4,
        r"a\.rnx\.gz, line 1: found .*; expected .*; fetch",
    ),
    "bytes as observations": (
        lambda s, h: import_with(s, A=written(h / "noise.rnx", bytes(range(256)) * 40)),
        4,
        r"noise\.rnx, line 1: found .*; expected RINEX",
    ),
    "observations that are not there": (lambda s, h: import_with(s, A=h / "nowhere.rnx"), 4, r"nowhere\.rnx: no such file"),
    "no navigation": (
        lambda s, h: import_with(s)[:-2],
        2,
        r"no navigation file: give the broadcast ephemerides of the day with --nav FILE",
    ),
    "a receiver that the site has not": (
        lambda s, h: [*import_with(s), "--receiver", "D=x.rnx"],
        2,
        r"--receiver D=x\.rnx: expected NAME=FILE with NAME one of A, B, C",
    ),
    "a receiver without a file": (
        lambda s, h: [*import_with(s)[:5], "--nav", s / "nav.rnx"],
        2,
        r"no file for receiver B, C: add --receiver B=FILE",
    ),
    "a window that is none": (
        lambda s, h: [*import_with(s), "--start", "noon"],
        2,
        r"not a UTC time: 'noon'; write it like",
    ),
    "a window beside the files": (
        lambda s, h: [*import_with(s), "--start", "2027-01-01T00:00:00Z"],
        4,
        r"receiver A: no epoch between the times asked for; A has 60 from 2026",
    ),
    "a site file with five mistakes": (
        lambda s, h: import_with(s, site=five_mistakes(h)),
        2,
        r"five\.toml:2: site\.id = .*\n(.*\n)*.*five\.toml:\d+: integrity\.missed_detection = 2\.0: expected",
    ),
    "a site file that is not there": (
        lambda s, h: import_with(s, site=h / "none.toml"),
        2,
        r"none\.toml: cannot be read .*: give the path of a readable TOML file",
    ),
    "another site file with five mistakes": (
        lambda s, h: ["replay", s / "calm.mcap", "--site", five_mistakes(h)],
        2,
        r"five\.toml:2: site\.id = ",
    ),
    "an empty recording": (lambda s, h: ["replay", written(h / "empty.mcap", b"")], 4, r"empty\.mcap: not an MCAP recording"),
    "text as a recording": (lambda s, h: ["recording", "recover", s / "site.toml"], 4, r"site\.toml: not an MCAP recording"),
    "a folder as a recording": (lambda s, h: ["recording", "recover", s], 4, r"Is a directory"),
    "a recording that is not there": (lambda s, h: ["replay", h / "none.mcap"], 4, r"none\.mcap: no such file"),
    "a recording cut near its end": (
        lambda s, h: ["replay", cut_recording(s, h, 0.99)],
        4,
        r"cut-0\.99\.mcap: cut or damaged at byte \d+.*; `wayside recording recover \S+cut-0\.99\.mcap -o OUT\.mcap` saves",
    ),
    "a recording cut in its middle": (
        lambda s, h: ["inject", cut_recording(s, h, 0.5), "--faults", s / "faults.toml"],
        4,
        r"cut-0\.5\.mcap: cut or damaged at byte \d+.*; `wayside recording recover \S+cut-0\.5\.mcap -o OUT\.mcap` saves",
    ),
    "a recording cut in its first second": (
        lambda s, h: ["recording", "recover", cut_recording(s, h, 0.01)],
        4,
        r"cut-0\.01\.mcap: cut or damaged at byte \d+.*; nothing to decide",
    ),
    "a recording of an unknown schema": (
        lambda s, h: ["replay", foreign_recording(s, h / "v9.mcap")],
        4,
        r"v9\.mcap: profile 'wayside\.v9', expected 'wayside\.v1'",
    ),
    "an unknown schema to inject into": (
        lambda s, h: ["inject", foreign_recording(s, h / "v9b.mcap"), "--faults", s / "faults.toml"],
        4,
        r"v9b\.mcap: profile 'wayside\.v9', expected 'wayside\.v1'",
    ),
    "an unknown schema to recover": (
        lambda s, h: ["recording", "recover", foreign_recording(s, h / "v9c.mcap")],
        4,
        r"v9c\.mcap: profile 'wayside\.v9', expected 'wayside\.v1'",
    ),
    "metadata that is no JSON": (lambda s, h: ["replay", with_metadata(s, h / "meta.mcap", '{"A": ')], 4, r"meta\.mcap: "),
    "metadata of another shape": (lambda s, h: ["replay", with_metadata(s, h / "meta2.mcap", '{"A": [1]}')], 4, r"meta2\.mcap: "),
    "a row that does not fit its signals": (
        lambda s, h: ["replay", with_a_range_less(s, h / "row.mcap")],
        4,
        r"row\.mcap.*pseudorange_m has shape",
    ),
    "a kind of fault that there is not": (
        lambda s, h: [
            *("inject", s / "calm.mcap"),
            *("--faults", written(h / "kind.toml", FAULTS.replace("receiver_bias", "receiver_bais"))),
        ],
        2,
        r'kind\.toml:2: fault\.0\.kind = "receiver_bais": no such kind: expected one of .*; did you mean "receiver_bias"\?',
    ),
    "a fault outside the recording": (
        lambda s, h: [
            *("inject", s / "calm.mcap"),
            *("--faults", written(h / "late.toml", FAULTS.replace("start_s = 20", "start_s = 2000"))),
        ],
        2,
        r"receiver_bias from .* covers no epoch: the recording spans .*; choose a start within it",
    ),
    "a fault file of bytes": (
        lambda s, h: ["inject", s / "calm.mcap", "--faults", written(h / "bytes.toml", b"\xff\xfe")],
        4,
        r"bytes\.toml: not UTF-8 text",
    ),
    "a scenario without its times": (
        lambda s, h: ["simulate", written(h / "no-start.toml", SCENARIO.replace("duration_s", "duration"))],
        2,
        r"no-start\.toml:\d+: scenario.*duration",
    ),
    "a scenario that is no TOML": (lambda s, h: ["simulate", written(h / "no.toml", "start = [")], 2, r"no\.toml:1: .*not TOML"),
    "a setting that there is not": (
        lambda s, h: ["replay", s / "calm.mcap", "--set", "integrity.rul=full"],
        2,
        r"--set: integrity\.rul = \"full\": .*did you mean \"rule\"\?",
    ),
    "another thing to fail on": (
        lambda s, h: ["replay", s / "calm.mcap", "--fail-on", "rain"],
        2,
        r"--fail-on rain: the only choice is alert",
    ),
    "blocks of no epoch": (lambda s, h: ["replay", s / "calm.mcap", "--block-epochs", "0"], 2, r"--block-epochs"),
    "an end before the start": (
        lambda s, h: ["replay", s / "calm.mcap", "--from", "2026-03-02T03:00:20Z", "--to", "2026-03-02T03:00:10Z"],
        2,
        r"the time window ends \(2026-03-02T03:00:10Z\) before it begins",
    ),
    "a folder that is not there to write to": (
        lambda s, h: ["simulate", s / "scenario.toml", "-o", h / "nowhere" / "x.mcap"],
        2,
        r"nowhere/x\.mcap.*(folder|directory)",
    ),
}


def with_output(command: list[object], path: Path) -> list[object]:
    """The command, told to write where something is already; one that writes elsewhere as it stands."""
    if "-o" in command:
        return command
    return [*command, "--out" if command[0] == "replay" else "-o", written(path, PRECIOUS)]


@dataclass(frozen=True)
class Refused:
    """What became of the commands on bad input, and of the outputs that were there before."""

    ran: dict[str, Ran]
    outputs: dict[str, bytes]
    leftovers: list[str]


@pytest.fixture(scope="module")
def refused(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Refused:
    here = tmp_path_factory.mktemp("bad")
    commands = [with_output(case(folder, here), here / f"{what}.out.mcap") for what, (case, _, _) in BAD.items()]
    outputs = sorted(here.glob("*.out.mcap"))
    ran = dict(zip(BAD, side_by_side(commands), strict=True))
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
