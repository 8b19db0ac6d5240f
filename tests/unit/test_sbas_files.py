"""Recorded SBAS messages in their three forms, each written here, and the command that computes levels from them."""

import csv
import gzip
import struct
from collections.abc import Callable
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from integrity.errors import ConfigError, DecodeError
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS
from integrity.gnss.sbas.messages import SbasMessage, frame_of
from integrity.gnss.ubx.framing import frame_bytes
from recordings.sbas_cli import sbas
from recordings.sbas_files import read_sbas
from recordings.sbas_levels import request_of
from tests.rinex_text import navigation_text
from tests.unit.gnss.sbas import sent
from tests.unit.gnss.sbas.sent import PRN, SITE, T0_NS, at
from tests.unit.gnss.sbas.service import gps

Line = Callable[[SbasMessage], str]
Words = Callable[[SbasMessage], bytes]
Measured = Callable[[float], bytes]
MESSAGES = [at(0, sent.mask([1, 5])), at(1, sent.degradation()), at(2, sent.factors(14))]
TOW_S = T0_NS % WEEK_NS // NS_PER_S
POSITION = ",".join(map(str, SITE))


def ems(message: SbasMessage) -> str:
    second = (message.sent_ns - T0_NS) // NS_PER_S + 1
    return f"{message.prn} 25 02 15 17 {second // 60:02d} {second % 60:02d} {message.kind} {frame_of(message.bits) << 6:064X}"


def sbs(message: SbasMessage, behind: int = 0) -> str:
    week, tow_ns = divmod(message.sent_ns + NS_PER_S, WEEK_NS)
    return f"{week} {tow_ns // NS_PER_S} {message.prn} {message.kind:2d} : {message.bits << 6 | behind:058X}"


def rawx(second: float) -> bytes:
    return frame_bytes(0x02, 0x15, struct.pack("<dHb5x", TOW_S + second, T0_NS // WEEK_NS, 18))


def raw(second: float) -> bytes:
    return frame_bytes(0x02, 0x10, struct.pack("<ihBB", round((TOW_S + second) * 1000), T0_NS // WEEK_NS, 0, 0))


def sfrbx(message: SbasMessage) -> bytes:
    words = struct.unpack(">8I", (frame_of(message.bits) << 6).to_bytes(32, "big"))
    return frame_bytes(0x02, 0x13, bytes((1, message.prn, 0, 0, 8, 0, 2, 0)) + struct.pack("<8I", *words))


def sfrb(message: SbasMessage) -> bytes:
    frame = frame_of(message.bits)
    words = [frame >> 218 - 32 * k & 0xFFFFFFFF for k in range(7)] + [frame & 0x3FFFFFF | 0x5 << 26, 0x22D, 0x101177]
    return frame_bytes(0x02, 0x11, bytes((4, message.prn)) + struct.pack("<10I", *words))


def written(path: Path, content: str | bytes) -> Path:
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


@pytest.mark.parametrize("line", [ems, sbs])
def test_lines_of_text_give_their_messages(tmp_path: Path, line: Line) -> None:
    file = read_sbas(written(tmp_path / "a", "\n".join(line(m) for m in MESSAGES) + "\n"))
    assert (list(file.messages), file.problems) == (MESSAGES, {})


@pytest.mark.parametrize(("measured", "words", "late"), [(rawx, sfrbx, 0.0), (rawx, sfrbx, 0.75), (raw, sfrb, -0.001)])
def test_words_of_a_receiver_belong_to_the_second_before(tmp_path: Path, measured: Measured, words: Words, late: float) -> None:
    """The frame that is sent in a second comes with the measurements of the next, whichever of them these are."""
    log = b"".join(b"$GPTXT,*00\r\n" + measured(k + 1 + late) + words(m) for k, m in enumerate(MESSAGES))
    file = read_sbas(written(tmp_path / "a.ubx", log))
    assert (list(file.messages), file.problems) == (MESSAGES, {})


def test_gzip_is_opened(tmp_path: Path) -> None:
    file = read_sbas(written(tmp_path / "a.ems.gz", gzip.compress("\n".join(map(ems, MESSAGES)).encode())))
    assert list(file.messages) == MESSAGES


def test_a_gzip_file_cut_off_gives_what_is_there(tmp_path: Path) -> None:
    packed = gzip.compress("\n".join(map(ems, MESSAGES * 1)).encode())
    file = read_sbas(written(tmp_path / "a.ems.gz", packed[:-9]))
    assert file.problems["file cut off"] == 1


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("rubbish", "line not readable"),
        (ems(MESSAGES[1])[:-8] + "00000000", "CRC wrong"),
        (ems(MESSAGES[1]).replace("137 25", "100 25"), "PRN of no SBAS"),
        (ems(MESSAGES[1]).replace("25 02 15", "25 02 30"), "no such time"),
        (ems(MESSAGES[1]).replace(" 10 ", " 11 "), "type is not that of the message"),
        (ems(MESSAGES[0]), "message repeated"),
        (ems(SbasMessage(PRN, MESSAGES[0].sent_ns, MESSAGES[1].bits)), "two messages at one time"),
        (f"137 25 02 15 17 00 09 1 {0:064X}", "preamble wrong"),
    ],
)
def test_what_is_dropped_is_counted(tmp_path: Path, line: str, problem: str) -> None:
    file = read_sbas(written(tmp_path / "a.ems", f"{ems(MESSAGES[0])}\n{line}\n"))
    assert (list(file.messages), file.problems) == (MESSAGES[:1], {problem: 1})


@pytest.mark.parametrize(("behind", "problems"), [(0, {}), (None, {}), (1, {"CRC wrong": 1})])
def test_bits_behind_a_message_are_zero_or_begin_its_crc(tmp_path: Path, behind: int | None, problems: dict[str, int]) -> None:
    bits = MESSAGES[1].bits
    end = (frame_of(bits) & 0xFFFFFF) >> 18 if behind is None else behind
    assert read_sbas(written(tmp_path / "a.sbs", sbs(MESSAGES[0]) + "\n" + sbs(MESSAGES[1], end))).problems == problems


def test_words_before_the_time_is_known_are_counted(tmp_path: Path) -> None:
    file = read_sbas(written(tmp_path / "a.ubx", sfrbx(MESSAGES[0]) + rawx(2.0) + sfrbx(MESSAGES[1])))
    assert (list(file.messages), file.problems) == (MESSAGES[1:2], {"message before the time was known": 1})


@pytest.mark.parametrize("content", [b"", b"a text", rawx(1.0), b"\x1f\x8b\x08 damaged", ems(MESSAGES[0])[:-9].encode() + b"0" * 9])
def test_a_file_without_messages_is_an_error(tmp_path: Path, content: bytes) -> None:
    with pytest.raises(DecodeError, match="expected"):
        read_sbas(written(tmp_path / "a", content))


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A navigation file and messages of twenty seconds."""
    directory = tmp_path_factory.mktemp("sbas")
    nav = written(directory / "a.nav", navigation_text(gps(), None))
    more = [at(k, 63 << 212 | 0x53 << 218) for k in range(3, 20)]
    return nav, written(directory / "a.ems", "\n".join(map(ems, MESSAGES + more)))


def command(*arguments: str) -> list[str]:
    app = typer.Typer()
    app.command()(sbas)
    result = CliRunner().invoke(app, list(arguments), catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.output.splitlines()


def test_the_command_writes_a_row_a_second_of_the_messages(tmp_path: Path, inputs: tuple[Path, Path]) -> None:
    nav, messages = inputs
    out = tmp_path / "levels.csv"
    command("--nav", str(nav), "--nav", str(nav), "--messages", str(messages), "--position", POSITION, "-o", str(out))
    with out.open() as file:
        rows = list(csv.DictReader(file))
    assert (len(rows), rows[0]["gps_time"], rows[-1]["gps_time"]) == (19, "2025-02-15T17:00:02", "2025-02-15T17:00:20")


def test_the_command_takes_its_own_epochs(tmp_path: Path, inputs: tuple[Path, Path]) -> None:
    nav, messages = inputs
    out = tmp_path / "levels.csv"
    times = ("--start", "2025-02-15T17:00:05", "--end", "2025-02-15T17:00:07", "--interval", "0.5", "--mode", "npa", "--mask", "10")
    command("--nav", str(nav), "--messages", str(messages), "--position", POSITION, *times, "-o", str(out))
    times_of_rows = [line.split(",")[0].rpartition(":")[2] for line in out.read_text().splitlines()[1:]]
    assert times_of_rows == ["05", "05.5", "06", "06.5", "07"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"mode": "cat"}, "--mode"),
        ({"mask_deg": 91.0}, "--mask"),
        ({"mask_deg": float("nan")}, "--mask"),
        ({"interval_s": 0.0}, "--interval"),
        ({"position": "1,2,3"}, "--position"),
        ({"position": "35 N"}, "--position"),
        ({"position": "1e400,0,0"}, "--position"),
        ({"start": "2025-02-15T17:00:05Z"}, "without Z"),
        ({"start": "yesterday"}, "--start"),
        ({"end": "2025-02-15T16:00:00"}, "--end"),
    ],
)
def test_a_wrong_request_says_what_is_wrong(inputs: tuple[Path, Path], change: dict[str, object], words: str) -> None:
    nav, messages = inputs
    right: dict[str, object] = {"position": POSITION, "start": None, "end": None, "interval_s": 1.0, "mode": "pa", "mask_deg": 5.0}
    with pytest.raises(ConfigError, match=words):
        request_of([nav], messages, **right | change)  # type: ignore[arg-type]
