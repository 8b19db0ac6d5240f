"""The map file: what it holds, what it refuses, and that no content brings anything but a ConfigError."""

import hashlib
import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.errors import ConfigError
from recordings.toml_file import ConfigProblems
from tests.unit.track.lines import straight
from train_client.track.checks import load_map
from train_client.track.track_map import Boundary, Node, Section, Switch, TrackMap, content_sha256, format_map, parse_map

NODES = (Node("west", "end"), Node("fork", "switch"), Node("east", "end"), Node("yard", "boundary"))
EDGES = (straight("main", "west", "fork", 0, 100), straight("left", "fork", "east", 100, 200), straight("right", "fork", "yard", 100, 150))
SECTIONS = (Section("main", 0.0, 40.0, gnss=False, multipath="cutting"), Section("left", 10.0, 100.0, radio=False, station="s-1"))
TRACK = TrackMap(
    "sample",
    1,
    "JGD2011",
    "2026-03-01T00:00:00Z",
    "",
    NODES,
    EDGES,
    (Switch("fork", (("main", "left"), ("main", "right"))),),
    SECTIONS,
    (Boundary("area", "main", 5.0, 1),),
)
TEXT = format_map(TRACK)
DOCUMENT: dict[str, Any] = json.loads(TEXT)


def changed(change: Callable[[dict[str, Any]], object], hashed: bool = True) -> str:
    """The sample with a change, and with the hash that belongs to it."""
    document = json.loads(TEXT)
    change(document)
    if hashed:
        document["sha256"] = content_sha256(document)
    return json.dumps(document)


def problems(text: str) -> list[str]:
    with pytest.raises(ConfigProblems) as refused:
        parse_map(text, "line.json")
    return str(refused.value).splitlines()


def test_a_map_written_and_read_is_written_the_same() -> None:
    assert format_map(parse_map(TEXT, "line.json")) == TEXT


def test_what_is_not_geometry_comes_back() -> None:
    read = parse_map(TEXT, "line.json")
    assert (read.nodes, read.switches, read.sections, read.boundaries) == (NODES, TRACK.switches, SECTIONS, TRACK.boundaries)


def test_points_come_back_to_the_last_bit() -> None:
    read = parse_map(TEXT, "line.json")
    assert [e.pos_ecef_m.tobytes() for e in read.edges] == [e.pos_ecef_m.tobytes() for e in EDGES]


def test_hash_is_that_of_plain_json_with_sorted_keys() -> None:
    rest = {key: value for key, value in DOCUMENT.items() if key != "sha256"}
    assert DOCUMENT["sha256"] == hashlib.sha256(json.dumps(rest, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def test_layout_of_the_file_is_free() -> None:
    assert parse_map(json.dumps(DOCUMENT, indent=4), "line.json").sha256 == DOCUMENT["sha256"]


def test_a_changed_coordinate_is_refused_with_the_right_hash() -> None:
    text = changed(lambda d: d["edges"][0]["points"][3].__setitem__(1, -3957199.0), hashed=False)
    (problem,) = problems(text)
    assert f"which has {content_sha256(json.loads(text))}: the file is damaged or was changed" in problem


def test_sections_and_boundaries_may_be_left_out() -> None:
    read = parse_map(changed(lambda d: [d.pop("sections"), d.pop("boundaries")]), "line.json")
    assert (read.sections, read.boundaries) == ((), ())


def point(edge: int, index: int, column: int, value: object) -> Callable[[dict[str, Any]], object]:
    return lambda d: d["edges"][edge]["points"][index].__setitem__(column, value)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d.update(version=2), "version = 2: expected 1, the only format that this software knows"),
        (lambda d: d.pop("version"), 'version: missing: add "version"'),
        (lambda d: d.update(sections_=[]), "sections_: no such key: expected id, version"),
        (lambda d: d.update(valid_from="1 March"), 'valid_from = "1 March": expected a UTC time'),
        (lambda d: d.update(frame=""), 'frame = "": expected text in quotes'),
        (lambda d: d.update(nodes=[]), "nodes = []: expected a list, in [ ], not empty"),
        (lambda d: d["nodes"].append(d["nodes"][0]), 'nodes = "west": stands twice'),
        (lambda d: d["nodes"][0].update(kind="ende"), 'nodes.west.kind = "ende": expected "end" or'),
        (lambda d: d["edges"][1].update(to="eest"), 'edges.left.to = "eest": expected the id of a node of this map; did you mean'),
        (lambda d: d["edges"][1].update(id="main"), 'edges = "main": stands twice'),
        (lambda d: d["edges"][0].update(points=[[0, 1, 2, 3, 0]]), "edges.main.points = [[0, 1, 2, 3, 0]]: 1 point: expected two or more"),
        (point(0, 4, 2, "3"), "edges.main.points.4 = [40.0, -3"),
        (point(0, 4, 2, float("nan")), "edges.main.points.4 = [40.0, -3"),
        (point(0, 4, 0, True), "edges.main.points.4 = [true"),
        (point(0, 4, 4, 5.0), "expected five numbers [s_m, x, y, z, cant_rad]"),
        (point(0, 4, 0, 10**400), "edges.main.points.4 = [1000"),
        (point(0, 4, 0, 30.0), "edges.main.points.4 = 30.0: s_m after 30.0 m: expected at least 1 mm more"),
        (lambda d: d["edges"][0].update(gradient=[0.0]), "edges.main.gradient = [0.0]: 1 numbers for 11 points"),
        (lambda d: d["switches"][0].update(allowed=[["main", "middle"]]), 'expected for "middle" the id of an edge of this map'),
        (lambda d: d["switches"].append(d["switches"][0]), 'switches = "fork": stands twice: write all pairs'),
        (
            lambda d: d["sections"][0].update(to_m=100.5),
            "sections.0 = [0.0, 100.5]: expected from_m < to_m within the 0 to 100 m of edge main",
        ),
        (lambda d: d["sections"][0].update(gnss=0), "sections.0.gnss = 0: expected true or false"),
        (lambda d: d["boundaries"][0].update(at_m=-1), "boundaries.area.at_m = -1.0: expected a place within the 0 to 100 m"),
        (lambda d: d["boundaries"][0].update(facing=True), "boundaries.area.facing = true: expected 1 or -1"),
    ],
)
def test_refused_with_place_and_remedy(change: Callable[[dict[str, Any]], object], said: str) -> None:
    assert said in "\n".join(problems(changed(change, hashed=False)))


def test_everything_wrong_is_said_at_once() -> None:
    def spoil(document: dict[str, Any]) -> None:
        document["id"] = "no id"
        document["edges"][0]["points"][2] = [20.0]
        document["edges"][2]["from"] = "nowhere"
        document["sections"][1]["edge"] = "gone"
        del document["nodes"][1]["kind"]

    keys = [problem.split(": ")[1].split(" = ")[0] for problem in problems(changed(spoil))]
    assert keys == ["id", "nodes.fork.kind", "edges.main.points.2", "edges.right.from", "sections.1.edge"]


def test_of_many_wrong_points_the_first_are_shown_and_the_rest_counted() -> None:
    found = problems(changed(lambda d: d["edges"][0].update(points=[[None] * 5] * 300)))
    assert found[10:] == ["line.json: edges.main.points: 290 more like these, the last at 299"]


def test_syntax_is_refused_with_its_line() -> None:
    text = json.dumps(DOCUMENT, indent=1).replace('"valid_from": ', '"valid_from" ')
    (problem,) = problems(text)
    line = text[: text.index('"valid_from"')].count("\n") + 1
    assert problem.startswith(f"line.json:{line}: not JSON")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "not JSON"),
        ("[" * 100_000, "cannot be read (RecursionError)"),
        ('{"id": ' + "9" * 5000 + "}", "cannot be read (ValueError)"),
        ("[]", "expected an object with id, version"),
        ('{"id": "a", "id": "b"}', '"id": stands twice: an object has each key once'),
    ],
)
def test_what_is_no_map_at_all(text: str, said: str) -> None:
    assert said in "\n".join(problems(text))


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8) | st.sampled_from(["main", "fork", "west", 10**400]),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths to every value in a document."""
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [path] * bool(path) + [p for key, member in inside for p in places(member, (*path, key))]


PLACES = places(DOCUMENT)


@settings(max_examples=300, deadline=None)
@given(st.lists(st.tuples(st.sampled_from(PLACES), json_values), min_size=1, max_size=3))
def test_mutated_maps_are_read_or_refused(mutations: list[tuple[tuple[Any, ...], Any]]) -> None:
    document = json.loads(TEXT)
    for path, value in mutations:
        around: Any = document
        try:
            for key in path[:-1]:
                around = around[key]
            around[path[-1]]  # an earlier mutation may have taken it away
        except (KeyError, IndexError, TypeError):
            continue
        if isinstance(around, list | dict):
            around[path[-1]] = value
    rest = {key: value for key, value in document.items() if key != "sha256"}
    document["sha256"] = hashlib.sha256(json.dumps(rest, sort_keys=True, separators=(",", ":")).encode()).hexdigest()
    try:
        track = load_map(json.dumps(document), "line.json")
    except ConfigError as refused:
        assert str(refused).isprintable() or "\n" in str(refused)
    else:
        written = format_map(track)
        assert format_map(parse_map(written, "again")) == written


@settings(max_examples=200, deadline=None)
@given(st.text() | st.binary(max_size=200).map(lambda data: data.decode("latin-1")), st.integers(0, len(TEXT)), st.integers(0, 60))
def test_any_text_is_read_or_refused(noise: str, at: int, replaced: int) -> None:
    with pytest.raises(ConfigError):
        parse_map(TEXT[:at] + noise + "\x00" + TEXT[at + replaced :], "line.json")


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(*[st.floats(-1e7, 1e7)] * 3, st.floats(-1.5, 1.5)), min_size=2, max_size=6), st.floats(-1e6, 1e6))
def test_any_numbers_survive_writing_and_reading(rows: list[tuple[float, ...]], start_m: float) -> None:
    document = json.loads(TEXT)
    document["edges"][0]["points"] = [[start_m + i, *row] for i, row in enumerate(rows)]
    document |= {"sections": [], "boundaries": []}
    document["sha256"] = content_sha256(document)
    read = parse_map(json.dumps(document), "line.json")
    assert np.array_equal(read.edges[0].pos_ecef_m, np.array(rows)[:, :3])
