"""Ways along the railhead: where a place comes to lie when it is moved by a distance, and how far two places are apart."""

import heapq
import math
from typing import NamedTuple

from train_client.track.track_map import EdgeEnd, TrackMap

MOST_NODES = 1000  # passed on one way; a train is shorter than a thousand edges
ROUNDING_M = 1e-6  # of an s that was computed


class Place(NamedTuple):
    """A place on the map. `direction` is 1 where growing s leads the same way as where one came from, -1 where the other way."""

    edge_index: int
    s_m: float
    direction: int = 1


class Unreachable(NamedTuple):
    """Why there is no such place, or no such way."""

    why: str


def shifted(track: TrackMap, edge_index: int, s_m: float, distance_m: float) -> Place | Unreachable:
    """The place that lies `distance_m` (map metres; positive towards growing s of the edge one starts on) from a place.

    It passes nodes with one allowed continuation. A distance that ends exactly at a node stays on the edge before it.
    """
    if not math.isfinite(distance_m):
        return Unreachable(f"a distance of {distance_m} m: expected a number")
    at_m = _on_edge(track, edge_index, s_m)
    if isinstance(at_m, Unreachable):
        return at_m
    forwards, left_m = distance_m >= 0.0, abs(distance_m)
    growing = forwards  # growing: whether the way leads towards growing s of the edge that it is on
    for _ in range(MOST_NODES):
        edge = track.edges[edge_index]
        end_m = float(edge.s_m[-1] if growing else edge.s_m[0])
        room_m = abs(end_m - at_m)
        if left_m <= room_m:
            return Place(edge_index, min(at_m + left_m, end_m) if growing else max(at_m - left_m, end_m), 1 if growing == forwards else -1)
        left_m -= room_m
        entered = track.continuations[EdgeEnd(edge_index, growing)]
        if len(entered) != 1:
            return _stopped(track, edge_index, growing, left_m, len(entered))
        edge_index, growing = entered[0].edge, not entered[0].last
        at_m = float(track.edges[edge_index].s_m[0 if growing else -1])
    return Unreachable(f"{left_m:.1f} m more after {MOST_NODES} nodes: expected a distance of a train's length, not of a journey")


def arc_between(track: TrackMap, a: Place, b: Place, limit_m: float) -> float | Unreachable:
    """Distance along the track from a to b in map metres, positive where the way leaves a towards growing s.

    Every allowed way of up to `limit_m` is followed, either way and over switches; the distance is known only if exactly one reaches b.
    """
    a_m, b_m = _on_edge(track, a.edge_index, a.s_m), _on_edge(track, b.edge_index, b.s_m)
    if isinstance(a_m, Unreachable):
        return a_m
    if isinstance(b_m, Unreachable):
        return b_m
    if not 0.0 <= limit_m < math.inf:
        return Unreachable(f"a limit of {limit_m} m: expected a number, 0 or more")
    arcs_m = [b_m - a_m] if a.edge_index == b.edge_index and abs(b_m - a_m) <= limit_m else []
    edge = track.edges[a.edge_index]
    to_end_m, to_beginning_m = float(edge.s_m[-1]) - a_m, a_m - float(edge.s_m[0])
    open_ways = [(EdgeEnd(a.edge_index, True), to_end_m, 1), (EdgeEnd(a.edge_index, False), to_beginning_m, -1)]
    passed = 0
    while open_ways:
        end, gone_m, sign = open_ways.pop()
        for entered in track.continuations[end] if gone_m <= limit_m else ():
            edge = track.edges[entered.edge]
            length_m = float(edge.s_m[-1] - edge.s_m[0])
            if entered.edge == b.edge_index:
                reached_m = gone_m + abs(b_m - float(edge.s_m[-1 if entered.last else 0]))
                arcs_m += [sign * reached_m] if reached_m <= limit_m else []
            open_ways.append((EdgeEnd(entered.edge, not entered.last), gone_m + length_m, sign))
            passed += 1
        if passed > MOST_NODES:
            return Unreachable(f"more than {MOST_NODES} nodes within {limit_m:.0f} m: expected a limit of a train's length")
    if len(arcs_m) == 1:
        return arcs_m[0]
    ways = (
        "no allowed way"
        if not arcs_m
        else f"{len(arcs_m)} ways, of " + ", ".join(f"{abs(arc_m):.1f} m" for arc_m in sorted(arcs_m, key=abs)[:4])
    )
    return Unreachable(f"{ways} from {_words(track, a)} to {_words(track, b)} within {limit_m:.0f} m")


def shortest_way(track: TrackMap, a: Place, b: Place) -> float | Unreachable:
    """The shortest allowed way from a to b in map metres, positive where it leaves a towards growing s (Dijkstra over ends of edges)."""
    a_m, b_m = _on_edge(track, a.edge_index, a.s_m), _on_edge(track, b.edge_index, b.s_m)
    if isinstance(a_m, Unreachable):
        return a_m
    if isinstance(b_m, Unreachable):
        return b_m
    best_m = b_m - a_m if a.edge_index == b.edge_index else math.inf
    edge = track.edges[a.edge_index]
    to_end_m, to_beginning_m = float(edge.s_m[-1]) - a_m, a_m - float(edge.s_m[0])
    ways = [(to_end_m, 1, EdgeEnd(a.edge_index, True)), (to_beginning_m, -1, EdgeEnd(a.edge_index, False))]
    heapq.heapify(ways)
    left: set[EdgeEnd] = set()
    while ways and ways[0][0] < abs(best_m):
        gone_m, sign, end = heapq.heappop(ways)
        for entered in () if end in left else track.continuations[end]:
            edge = track.edges[entered.edge]
            reached_m = gone_m + abs(b_m - float(edge.s_m[-1 if entered.last else 0]))
            if entered.edge == b.edge_index and reached_m < abs(best_m):
                best_m = sign * reached_m
            heapq.heappush(ways, (gone_m + float(edge.s_m[-1] - edge.s_m[0]), sign, EdgeEnd(entered.edge, not entered.last)))
        left.add(end)
    if math.isfinite(best_m):
        return best_m
    return Unreachable(f"no allowed way from {_words(track, a)} to {_words(track, b)}")


def _on_edge(track: TrackMap, edge_index: int, s_m: float) -> float | Unreachable:
    """The s of a place, put on the edge where it is off by no more than rounding."""
    if not 0 <= edge_index < len(track.edges):
        return Unreachable(f"no edge {edge_index}: the map has {len(track.edges)}")
    edge = track.edges[edge_index]
    first_m, last_m = float(edge.s_m[0]), float(edge.s_m[-1])
    if not first_m - ROUNDING_M <= s_m <= last_m + ROUNDING_M:
        return Unreachable(f"s = {s_m} m is not on edge {edge.id}, which goes from {first_m:.3f} to {last_m:.3f} m")
    return min(max(s_m, first_m), last_m)


def _stopped(track: TrackMap, edge_index: int, growing: bool, left_m: float, n_ways: int) -> Unreachable:
    edge = track.edges[edge_index]
    node = edge.to_node if growing else edge.from_node
    why = (
        f"the map ends at node {node} of edge {edge.id}"
        if n_ways == 0
        else f"{n_ways} ways go on at node {node}, and the switch is not known"
    )
    return Unreachable(f"{why}: {left_m:.3f} m lie beyond")


def _words(track: TrackMap, place: Place) -> str:
    return f"{track.edges[place.edge_index].id} {place.s_m:.1f} m"
