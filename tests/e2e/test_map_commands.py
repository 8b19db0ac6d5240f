"""`wayside map check` and `wayside map plot` as commands."""

import json
from pathlib import Path

import pytest

from tests.e2e.commands import ROOT, wayside, written
from tests.unit.track.lines import line, straight
from train_client.track.track_map import format_map

SAMPLE = ROOT / "recordings" / "samples" / "line.json"
SOUND = format_map(line(straight("line", "a", "b", 0, 400)))
GAP = format_map(line(straight("first", "a", "n", 0, 100), straight("second", "n", "b", 107, 207)))


def test_check_of_a_sound_map_says_what_it_holds(tmp_path: Path) -> None:
    ran = wayside("map", "check", written(tmp_path / "line.json", SOUND))
    assert (ran.code, ran.out.splitlines()[2:4], ran.out.splitlines()[-1]) == (
        0,
        ["network   1 edge, 2 nodes, 41 points", "length    400.00 m"],
        f"{tmp_path / 'line.json'}: 0 errors, 0 warnings: can be used",
    )


def test_check_of_a_map_with_a_gap_ends_with_2(tmp_path: Path) -> None:
    ran = wayside("map", "check", written(tmp_path / "gap.json", GAP))
    assert (ran.code, ran.out.splitlines()[0][:76]) == (
        2,
        "error: node n: gap: 7.00 m missing between edge first and edge second: expec",
    )


def test_check_as_json_of_a_map_with_a_gap(tmp_path: Path) -> None:
    (error,) = json.loads(wayside("map", "check", written(tmp_path / "gap.json", GAP), "--json").out)["errors"]
    assert (error["check"], error["place"], round(error["value"], 3), error["threshold"], error["unit"]) == (
        "gap",
        "node n",
        7.0,
        0.05,
        "m",
    )


def test_check_as_json_of_a_sound_map(tmp_path: Path) -> None:
    found = json.loads(wayside("map", "check", written(tmp_path / "line.json", SOUND), "--json").out)
    assert (found["ok"], found["errors"], found["facts"]["edges"], found["facts"]["least_radius_m"]) == (True, [], 1, None)


def test_check_as_json_of_what_is_no_map(tmp_path: Path) -> None:
    ran = wayside("map", "check", written(tmp_path / "no.json", '{\n "id": \n}'), "--json")
    assert (ran.code, [error["line"] for error in json.loads(ran.out)["errors"]]) == (2, [3])


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"\xff\xfe", "byte 0xff at 0 is not UTF-8"),
        (b"", "not JSON"),
        (SOUND.replace('"version":1', '"version":2').encode(), "version = 2"),
    ],
)
def test_what_cannot_be_used_is_refused_without_a_traceback(tmp_path: Path, content: bytes, said: str) -> None:
    ran = wayside("map", "plot", written(tmp_path / "bad.json", content), "-o", tmp_path / "out.svg")
    assert (ran.code, said in ran.err, "Traceback" in ran.err) == (2, True, False)


def test_a_missing_map_is_refused(tmp_path: Path) -> None:
    ran = wayside("map", "check", tmp_path / "gone.json")
    assert (ran.code, "cannot be read (No such file or directory)" in ran.out) == (2, True)


def test_plot_writes_a_picture(tmp_path: Path) -> None:
    ran = wayside("map", "plot", written(tmp_path / "line.json", SOUND), "-o", tmp_path / "line.svg")
    assert (ran.code, (tmp_path / "line.svg").read_text()[:4]) == (0, "<svg")


def test_the_sample_line_is_sound() -> None:
    ran = wayside("map", "check", SAMPLE)
    assert (ran.code, ran.out.splitlines()[-1].endswith("0 errors, 0 warnings: can be used")) == (0, True)
