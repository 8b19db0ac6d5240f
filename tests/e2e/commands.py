"""Commands as processes, and the files that they are given: what all tests of the command line share."""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from tests.rinex_text import write_rinex
from tests.unit.sites import UBX_SITE as SITE_TEXT
from tests.unit.streams import stream
from wayside import main as entry_point

ROOT = Path(__file__).parents[2]
EPOCHS = 60
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
PRECIOUS = b"recorded years ago"  # an output that is there already


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
        if process.exitcode is None:
            process.kill()
        out, err = (Path(scratch, name).read_text() for name in ("out", "err"))
        told = Path(scratch, "code")  # of several threads that wait, multiprocessing tells one the code and may tell another 255
        code = int(told.read_text()) if told.exists() else process.exitcode
        return Ran(-1 if code is None else code, out, err)


def _main(arguments: list[str], scratch: str) -> None:
    for stream_number, name in ((1, "out"), (2, "err")):
        os.dup2(os.open(Path(scratch, name), os.O_WRONLY | os.O_CREAT), stream_number)
    os.chdir(ROOT)
    os.environ.clear()
    os.environ.update(environment())
    sys.argv = ["wayside", *arguments]
    try:
        entry_point()
    except SystemExit as end:
        Path(scratch, "code").write_text(str(end.code))
        raise


def side_by_side(commands: Sequence[Sequence[object]], run: Callable[..., Ran] = wayside) -> list[Ran]:
    """Several commands at once, as many as there are processors."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(lambda arguments: run(*arguments), commands))


def replay_object(*arguments: object) -> dict[str, Any]:
    ran = wayside("replay", *arguments, "--json")
    assert ran.code == 0, ran.err
    found: dict[str, Any] = json.loads(ran.out)
    return found


def written(path: Path, content: bytes | str) -> Path:
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def write_sound_files(folder: Path) -> Path:
    """A site, a scenario with a fault, the fault alone, RINEX of three receivers; and `calm.mcap`, imported from it."""
    written(folder / "site.toml", SITE)
    written(folder / "scenario.toml", SCENARIO + FAULTS)
    written(folder / "faults.toml", FAULTS)
    write_rinex(folder, stream(EPOCHS), "ABC")
    ran = wayside(*import_with(folder), "-o", folder / "calm.mcap")
    assert ran.code == 0, ran.err
    return folder


def import_with(sound: Path, site: Path | None = None, nav: Path | None = None, **files: Path) -> list[object]:
    """The command that imports the sound files, or others in their place; without its output."""
    names = {name: files.get(name, sound / f"{name}.rnx") for name in "ABC"}
    receivers = [option for name in "ABC" for option in ("--receiver", f"{name}={names[name]}")]
    return ["import", "--site", site or sound / "site.toml", *receivers, "--nav", nav or sound / "nav.rnx"]


def five_mistakes(folder: Path) -> Path:
    """A site file whose id, a sigma's name, a probability, a duration and a coordinate are wrong."""
    text = SITE.replace('id = "kokubunji-1"', 'id = "a b"').replace("sigma_common_m = 1.2", "sigma_comon_m = 1.2")
    text = text.replace("missed_detection = 1e-5", "missed_detection = 2.0").replace("valid_for_ms = 3000", 'valid_for_ms = "3000"')
    return written(folder / "five.toml", text.replace("position_ecef_m = [-3962186.571, 3381218.295, 3668678.638]\n", ""))
