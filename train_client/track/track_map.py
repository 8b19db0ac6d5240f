"""The track map: one JSON file, read whole and refused with everything that is wrong with it at once.

    {"id": "sample", "version": 1, "frame": "JGD2011", "valid_from": "2026-03-01T00:00:00Z", "sha256": "…",
     "nodes": [{"id": "west", "kind": "end"}, {"id": "fork", "kind": "switch"}, …],
     "edges": [{"id": "main", "from": "west", "to": "fork", "points": [[s_m, x, y, z, cant_rad], …], "gradient": [0.012, …]}, …],
     "switches": [{"node": "fork", "allowed": [["main", "left"], ["main", "right"]]}],
     "sections": [{"edge": "main", "from_m": 0.0, "to_m": 80.0, "gnss": false, "radio": true, "multipath": "cutting", "station": "s-1"}],
     "boundaries": [{"id": "area-west", "edge": "main", "at_m": 40.0, "facing": 1}]}

- `version` is that of the format, 1 so far. `frame` names the frame of all coordinates; `valid_from` is a UTC time.
- `sha256` is SHA-256 (hex) of the other keys as JSON with sorted keys, no spaces, ASCII only, numbers as Python's json writes them
  (whole numbers may stand without a decimal point); how the file itself is laid out does not matter. It names the edition of the map.
- Ids are of letters, digits, "-", "_" and ".". `kind` of a node: "end" (of the map), "joint" (of two edges), "switch", "crossing",
  "boundary" (the railway goes on, the map does not).
- A point: running distance s_m along the railhead in metres, growing by at least 1 mm; ECEF x, y, z in metres of the middle between the
  railheads; cant in radians, positive with the right rail low, right and left as seen towards growing s. `gradient` (optional): one
  number a point, rise over run, positive where the track climbs with growing s.
- `switches`: pairs of edges that may be passed one into the other, either way. A node with two edge ends needs no entry.
- `sections` (optional): where there is no GNSS or no radio (default: there is), the multipath class, and which station vouches there.
- `boundaries` (optional): where the area under control ends; it lies towards growing (`facing` 1) or shrinking (-1) s.

Sources: train_positioning.md 1.3 and 4 [000 3.3; 001 29, 38, 41].
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from integrity.gnss.observations import Floats, freeze
from recordings.toml_file import ConfigProblems
from train_client.track import reading as kinds
from train_client.track.reading import Kind, Reading, Table, is_number, read_json

VERSION = 1
NODE_KINDS = ("end", "joint", "switch", "crossing", "boundary")
LEAST_STEP_M = 1e-3  # closer points are one point given twice
MOST_METRES = 1e7  # no coordinate on the Earth, and no railway, goes beyond
MOST_CANT_RAD = 1.5  # a quarter turn; what is plausible is a matter of `checks`


@dataclass(frozen=True)
class Node:
    """Where edges end."""

    id: str
    kind: str


@dataclass(frozen=True, eq=False)
class Edge:
    """A piece of track between two nodes, N points: `s_m` (N,), `pos_ecef_m` (N, 3), `cant_rad` (N,), `gradient` (N,) or None."""

    id: str
    from_node: str
    to_node: str
    s_m: Floats
    pos_ecef_m: Floats
    cant_rad: Floats
    gradient: Floats | None = None

    def __post_init__(self) -> None:
        freeze(self)


@dataclass(frozen=True)
class Switch:
    """Which edges may be passed one into the other at a node."""

    node: str
    allowed: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Section:
    """What holds on a stretch of an edge."""

    edge: str
    from_m: float
    to_m: float
    gnss: bool = True
    radio: bool = True
    multipath: str | None = None
    station: str | None = None


@dataclass(frozen=True)
class Boundary:
    """Where the area under control ends; it lies towards growing (facing 1) or shrinking (-1) s."""

    id: str
    edge: str
    at_m: float
    facing: int


class EdgeEnd(NamedTuple):
    """One of the two ends of an edge: `last` is False at its first point, True at its last."""

    edge: int
    last: bool


@dataclass(frozen=True, eq=False)
class TrackMap:
    """A map. `sha256` is that of the text it was read from."""

    id: str
    version: int
    frame: str
    valid_from: str
    sha256: str
    nodes: tuple[Node, ...]
    edges: tuple[Edge, ...]
    switches: tuple[Switch, ...] = ()
    sections: tuple[Section, ...] = ()
    boundaries: tuple[Boundary, ...] = ()

    @cached_property
    def edge_index(self) -> dict[str, int]:
        """Index into `edges` by id."""
        return {edge.id: index for index, edge in enumerate(self.edges)}

    @cached_property
    def ends_at(self) -> dict[str, tuple[EdgeEnd, ...]]:
        """The edge ends that meet at each node."""
        ends: dict[str, list[EdgeEnd]] = {node.id: [] for node in self.nodes}
        for index, edge in enumerate(self.edges):
            ends[edge.from_node].append(EdgeEnd(index, False))
            ends[edge.to_node].append(EdgeEnd(index, True))
        return {node: tuple(found) for node, found in ends.items()}

    @cached_property
    def continuations(self) -> dict[EdgeEnd, tuple[EdgeEnd, ...]]:
        """Where a train that leaves an edge by an end may enter the next: none at the end of the map, several at a facing switch.

        At a node without a switch entry, whatever else ends there.
        """
        allowed = {switch.node: {frozenset(pair) for pair in switch.allowed} for switch in self.switches}
        return {
            end: tuple(
                other
                for other in ends
                if other != end
                and (node not in allowed or frozenset((self.edges[end.edge].id, self.edges[other.edge].id)) in allowed[node])
            )
            for node, ends in self.ends_at.items()
            for end in ends
        }


def parse_map(text: str, file: str) -> TrackMap:
    """The map in a text; `file` is the name that problems carry. Raises ConfigProblems (a ConfigError) with everything that is wrong."""
    reading = Reading(file)
    document = read_json(text, reading)
    head = reading.table("", document, _MAP, {"switches": [], "sections": [], "boundaries": []})
    if not isinstance(document, dict):
        raise ConfigProblems(reading.problems)
    lists = {key: document[key] if isinstance(document.get(key), list) else [] for key in _LISTS}
    parts = _parts(reading, lists)
    if head is None or reading.problems:
        raise ConfigProblems(reading.problems)
    right = content_sha256(document)
    if head["sha256"] != right:
        message = f"does not belong to this content, which has {right}: the file is damaged or was changed; get it again"
        reading.note("sha256", head["sha256"], f"{message}, or write this hash in its place if the change is meant and was checked")
        raise ConfigProblems(reading.problems)
    return TrackMap(head["id"], head["version"], head["frame"], head["valid_from"], head["sha256"], **parts)


def _parts(reading: Reading, lists: Mapping[str, list[Any]]) -> Table:
    """Nodes, edges and the rest; what is wrong with them is noted, whole and sound only if nothing is."""
    ids = {key: reading.ids(key, lists[key]) for key in ("nodes", "edges", "boundaries")}
    at_node, on_edge = kinds.known(ids["nodes"], "a node"), kinds.known(ids["edges"], "an edge")
    nodes = reading.tables("nodes", lists["nodes"], _NODE, {})
    found = [_edge(reading, index, value, at_node) for index, value in enumerate(lists["edges"])]
    edges = {edge.id: edge for edge in found if edge is not None}
    switches = reading.tables("switches", lists["switches"], {"node": at_node, "allowed": kinds.pairs(on_edge)}, {})
    reading.once("switches", [switch["node"] for switch in switches], "write all pairs of a node into one entry")
    sections = reading.tables("sections", lists["sections"], _SECTION | {"edge": on_edge}, _SECTION_DEFAULTS)
    boundaries = reading.tables("boundaries", lists["boundaries"], _BOUNDARY | {"edge": on_edge}, {})
    _misplaced(reading, edges, sections, boundaries)
    return {
        "nodes": tuple(Node(**node) for node in nodes),
        "edges": tuple(edges.values()),
        "switches": tuple(Switch(**switch) for switch in switches),
        "sections": tuple(Section(**section) for section in sections),
        "boundaries": tuple(Boundary(**boundary) for boundary in boundaries),
    }


def format_map(track: TrackMap) -> str:
    """The map as canonical JSON on one line, with the hash that belongs to it; parses to the same map."""
    document: dict[str, Any] = {
        "id": track.id,
        "version": track.version,
        "frame": track.frame,
        "valid_from": track.valid_from,
        "nodes": [vars(node) for node in track.nodes],
        "edges": [_edge_values(edge) for edge in track.edges],
        "switches": [vars(switch) for switch in track.switches],
        "sections": [vars(section) for section in track.sections],
        "boundaries": [vars(boundary) for boundary in track.boundaries],
    }
    return _canonical(document | {"sha256": content_sha256(document)})


def content_sha256(document: dict[str, Any]) -> str:
    """SHA-256 (hex) of a parsed map without its `sha256`."""
    return hashlib.sha256(_canonical({key: value for key, value in document.items() if key != "sha256"}).encode()).hexdigest()


def _canonical(document: dict[str, Any]) -> str:
    return json.dumps(document, sort_keys=True, separators=(",", ":"), allow_nan=False)


def _edge_values(edge: Edge) -> dict[str, Any]:
    points = np.column_stack((edge.s_m, edge.pos_ecef_m, edge.cant_rad)).tolist()
    values = {"id": edge.id, "from": edge.from_node, "to": edge.to_node, "points": points}
    return values if edge.gradient is None else values | {"gradient": edge.gradient.tolist()}


def _some(value: Any) -> list[Any]:
    if not isinstance(value, list) or not value:
        raise ValueError("a list, in [ ], not empty")
    return value


def _version(value: Any) -> int:
    if type(value) is not int or value != VERSION:
        raise ValueError(f"{VERSION}, the only format that this software knows: get the map in it, or newer software")
    return value


_metres = kinds.metres_within(MOST_METRES)
_LISTS: dict[str, Kind] = {"nodes": _some, "edges": _some, "switches": kinds.array, "sections": kinds.array, "boundaries": kinds.array}
_MAP: dict[str, Kind] = {
    "id": kinds.name,
    "version": _version,
    "frame": kinds.text,
    "valid_from": kinds.utc,
    "sha256": kinds.sha256,
    **_LISTS,
}
_NODE: dict[str, Kind] = {"id": kinds.name, "kind": kinds.one_of(*NODE_KINDS)}
_EDGE: dict[str, Kind] = {"id": kinds.name, "from": kinds.name, "to": kinds.name, "points": kinds.array, "gradient": kinds.array}
_SECTION: dict[str, Kind] = {
    "edge": kinds.name,
    "from_m": _metres,
    "to_m": _metres,
    "gnss": kinds.one_of(True, False),
    "radio": kinds.one_of(True, False),
    "multipath": kinds.optional_name,
    "station": kinds.optional_name,
}
_SECTION_DEFAULTS = {"gnss": True, "radio": True, "multipath": None, "station": None}
_BOUNDARY: dict[str, Kind] = {"id": kinds.name, "edge": kinds.name, "at_m": _metres, "facing": kinds.one_of(1, -1)}


def _edge(reading: Reading, index: int, value: Any, at_node: Kind) -> Edge | None:
    place = kinds.place("edges", index, value)
    before = len(reading.problems)
    table = reading.table(place, value, _EDGE | {"from": at_node, "to": at_node}, {"gradient": None})
    given = value.get("points") if isinstance(value, dict) else None
    points = _points(reading, f"{place}.points", given) if isinstance(given, list) else None
    if table is None or points is None:
        return None
    gradient = _gradient(reading, f"{place}.gradient", table["gradient"], len(points))
    if len(reading.problems) > before:
        return None
    s_m, pos_ecef_m, cant_rad = points[:, 0].copy(), points[:, 1:4].copy(), points[:, 4].copy()
    return Edge(table["id"], table["from"], table["to"], s_m, pos_ecef_m, cant_rad, gradient)


def _points(reading: Reading, key: str, rows: list[Any]) -> Floats | None:
    """Points (N, 5), or None with the problems noted."""
    if len(rows) < 2:
        reading.note(key, rows, f"{len(rows)} point{'s' * (len(rows) != 1)}: expected two or more, [s_m, x, y, z, cant_rad] each")
        return None
    expected = "expected five numbers [s_m, x, y, z, cant_rad], metres on the Earth and radians, no NaN, none in quotes"
    wrong: list[tuple[int, object, str]] = [(index, row, expected) for index, row in enumerate(rows) if not _is_point(row)]
    if wrong:
        reading.listed(key, wrong)
        return None
    points = np.array(rows, dtype=np.float64)
    back = np.flatnonzero(~(np.diff(points[:, 0]) >= LEAST_STEP_M))
    wrong = [
        (int(i) + 1, rows[i + 1][0], f"s_m after {rows[i][0]} m: expected at least 1 mm more; sort the points, take out what stands twice")
        for i in back
    ]
    reading.listed(key, wrong)
    return None if wrong else points


def _is_point(row: Any) -> bool:
    if type(row) is not list or len(row) != 5:
        return False
    return all(is_number(value, -MOST_METRES, MOST_METRES) for value in row[:4]) and is_number(row[4], -MOST_CANT_RAD, MOST_CANT_RAD)


def _gradient(reading: Reading, key: str, values: list[Any] | None, n_points: int) -> Floats | None:
    if values is None:
        return None
    if len(values) != n_points:
        reading.note(key, values, f"{len(values)} numbers for {n_points} points: expected one a point, or leave gradient out")
        return None
    expected = "expected rise over run, a number from -1 to 1"
    wrong: list[tuple[int, object, str]] = [(i, value, expected) for i, value in enumerate(values) if not is_number(value, -1, 1)]
    reading.listed(key, wrong)
    return None if wrong else np.array(values, dtype=np.float64)


def _misplaced(reading: Reading, edges: dict[str, Edge], sections: list[Table], boundaries: list[Table]) -> None:
    """Sections and boundaries outside their edges."""
    for index, section in enumerate(sections):
        edge = edges.get(section["edge"])
        low, high = section["from_m"], section["to_m"]
        if edge is not None and not edge.s_m[0] <= low < high <= edge.s_m[-1]:
            expected = f"expected from_m < to_m within the {edge.s_m[0]:g} to {edge.s_m[-1]:g} m of edge {edge.id}"
            reading.note(f"sections.{index}", [low, high], expected)
    for boundary in boundaries:
        edge = edges.get(boundary["edge"])
        if edge is not None and not edge.s_m[0] <= boundary["at_m"] <= edge.s_m[-1]:
            expected = f"expected a place within the {edge.s_m[0]:g} to {edge.s_m[-1]:g} m of edge {edge.id}"
            reading.note(f"boundaries.{boundary['id']}.at_m", boundary["at_m"], expected)
