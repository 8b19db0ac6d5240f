"""Checks of what meets at the nodes: do ends meet, does the track go on smoothly, is it known how."""

import math
from collections.abc import Iterator, Mapping

from train_client.track.edge_checks import CANT_TOLERANCE_RAD, MOST_TURN_RAD
from train_client.track.findings import Finding
from train_client.track.geometry import Shape, angle_rad
from train_client.track.track_map import EdgeEnd, TrackMap

MEETING_M = 0.05  # between edge ends at one node: survey class A
ENDS_OF_KIND = {"end": (1, 1), "joint": (2, 2), "switch": (3, 99), "crossing": (4, 99), "boundary": (1, 99)}


def node_findings(track: TrackMap, shapes: Mapping[int, Shape]) -> Iterator[Finding]:
    """Of all nodes; `shapes` by the index of those edges that have one."""
    switched = {switch.node for switch in track.switches}
    for node in track.nodes:
        ends = track.ends_at[node.id]
        place = f"node {node.id}"
        if not ends:
            yield Finding(False, "orphan", place, None, 0.0, 1.0, "ends", "no edge ends here: take the node out, or give it its edge")
            continue
        least, most = ENDS_OF_KIND[node.kind]
        if not least <= len(ends) <= most:
            message = (
                f'{len(ends)} edge end{"s" * (len(ends) != 1)} at a node of kind "{node.kind}": correct the kind, or from and to of an edge'
            )
            yield Finding(True, "kind", place, None, float(len(ends)), float(least if len(ends) < least else most), "ends", message)
        if len(ends) > 2 and node.id not in switched:
            names = ", ".join(track.edges[end.edge].id for end in ends)
            message = f"{len(ends)} edges ({names}) and no entry in switches: add which of them may be passed one into the other"
            yield Finding(True, "switch", place, None, float(len(ends)), 2.0, "ends", message)
            continue
        yield from _meeting(track, place, ends)
        for end in ends:
            for entered in track.continuations[end]:
                if end < entered and end.edge in shapes and entered.edge in shapes:
                    yield from _passage(track, place, end, entered, shapes)
    yield from _strangers(track)
    yield from _islands(track)


def _meeting(track: TrackMap, place: str, ends: tuple[EdgeEnd, ...]) -> Iterator[Finding]:
    first = track.edges[ends[0].edge]
    for end in ends[1:]:
        edge = track.edges[end.edge]
        apart_m = math.dist(edge.pos_ecef_m[-1 if end.last else 0].tolist(), first.pos_ecef_m[-1 if ends[0].last else 0].tolist())
        if not apart_m <= MEETING_M:
            message = f"{apart_m:.2f} m missing between edge {first.id} and edge {edge.id}: expected {MEETING_M} m at most;"
            message += " survey what is missing, or correct from and to"
            yield Finding(True, "gap", place, None, apart_m, MEETING_M, "m", message)


def _passage(track: TrackMap, place: str, end: EdgeEnd, entered: EdgeEnd, shapes: Mapping[int, Shape]) -> Iterator[Finding]:
    """Whether the track goes on from one edge into another without a kink, and with the same cant."""
    a, b, at_a, at_b = shapes[end.edge], shapes[entered.edge], -1 if end.last else 0, -1 if entered.last else 0
    out = a.along[at_a] if end.last else -a.along[at_a]
    into = -b.along[at_b] if entered.last else b.along[at_b]
    curvature = max(abs(float(a.curvature_per_m[at_a])), abs(float(b.curvature_per_m[at_b])))
    explained_rad = curvature * 0.5 * float(a.chord_m[at_a] + b.chord_m[at_b])
    turn_rad = float(angle_rad(out[None], into[None])[0]) - explained_rad
    names = f"from edge {track.edges[end.edge].id} into edge {track.edges[entered.edge].id}"
    if not turn_rad <= MOST_TURN_RAD:
        message = f"{names} the track turns by {math.degrees(turn_rad):.1f} deg more than its curves: expected"
        message += f" {math.degrees(MOST_TURN_RAD):.1f} deg at most; correct the points, or take the pair out of switches"
        yield Finding(True, "kink", place, None, turn_rad, MOST_TURN_RAD, "rad", message)
    cant_a, cant_b = float(track.edges[end.edge].cant_rad[at_a]), float(track.edges[entered.edge].cant_rad[at_b])
    jump_rad = abs(cant_a - (cant_b if end.last != entered.last else -cant_b))
    if not jump_rad <= CANT_TOLERANCE_RAD:
        against = "" if end.last != entered.last else " (they run against each other: its sign turns)"
        message = (
            f"{names} cant changes from {cant_a:.4f} to {cant_b:.4f} rad{against}: expected {CANT_TOLERANCE_RAD} rad difference at most;"
        )
        yield Finding(True, "twist", place, None, jump_rad, CANT_TOLERANCE_RAD, "rad", f"{message} correct the cant of one of them")


def _strangers(track: TrackMap) -> Iterator[Finding]:
    """Pairs of a switch whose edges do not end at its node."""
    for switch in track.switches:
        here = {track.edges[end.edge].id for end in track.ends_at[switch.node]}
        for name in sorted({name for pair in switch.allowed for name in pair} - here):
            message = f"switches lets edge {name} pass here, but it does not end here: correct the pair, or from and to of the edge"
            yield Finding(True, "switch", f"node {switch.node}", None, None, None, "", message)


def _islands(track: TrackMap) -> Iterator[Finding]:
    """Parts of the network that cannot be reached from its largest part (by number of edges)."""
    part_of = {node.id: node.id for node in track.nodes}

    def root(node: str) -> str:
        while part_of[node] != node:
            part_of[node] = part_of[part_of[node]]
            node = part_of[node]
        return node

    for edge in track.edges:
        part_of[root(edge.from_node)] = root(edge.to_node)
    parts: dict[str, list[str]] = {}
    for edge in track.edges:
        parts.setdefault(root(edge.from_node), []).append(edge.id)
    largest = max(parts.values(), key=len)
    for names in parts.values():
        if names is not largest:
            message = f"{', '.join(names[:5])}{', …' * (len(names) > 5)} cannot be reached from the rest: correct from and to of its edges"
            yield Finding(False, "orphan", f"edge {names[0]}", None, float(len(names)), None, "edges", message)
