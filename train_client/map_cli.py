"""Commands on track maps."""

import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from recordings.toml_file import ConfigProblems, Problem
from train_client.map_file import read_map_text
from train_client.track.checks import MapCheck, MapFacts, check_map
from train_client.track.findings import Finding
from train_client.track.track_map import TrackMap, parse_map

commands = typer.Typer(no_args_is_help=True, help="Track maps.")

MapFile = Annotated[Path, typer.Argument(metavar="MAP", help="Track map (JSON).", show_default=False)]


@commands.command()
def check(file: MapFile, as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False) -> None:
    """Everything wrong with a map at once, and its size and extremes; exit 2 where no train may run on it.

    Example: wayside map check line.json
    """
    track: TrackMap | None = None
    found: MapCheck | None = None
    unreadable: tuple[Problem, ...] = ()
    try:
        track = parse_map(read_map_text(file), str(file))
        found = check_map(track)
    except ConfigProblems as error:
        unreadable = error.problems
    print(json.dumps(_object(file, track, found, unreadable), indent=2) if as_json else _page(file, track, found, unreadable))
    if unreadable or (found is not None and found.errors):
        raise typer.Exit(2)


@commands.command()
def plot(file: MapFile, output: Annotated[Path, typer.Option("-o", "--output", help="Picture (SVG).", show_default=False)]) -> None:
    """Draw a map: the plan, and curvature, cant, gradient and height over distance.

    Example: wayside map plot line.json -o line.svg
    """
    from train_client.track.plot import map_svg

    track = parse_map(read_map_text(file), str(file))
    misplaced = check_map(track)
    if misplaced.facts is None:
        raise ConfigProblems(Problem(str(file), None, "", "", str(finding)) for finding in misplaced.errors)
    output.write_text(map_svg(track), "utf-8")


def _page(file: Path, track: TrackMap | None, found: MapCheck | None, unreadable: tuple[Problem, ...]) -> str:
    """A line per finding, the facts, the outcome."""
    if track is None or found is None:
        lines = [f"error: {problem}" for problem in unreadable]
        return "\n".join([*lines, f"{file}: {_count(len(unreadable), 'error')}: refused"])
    lines = [f"error: {finding}" for finding in found.errors] + [f"warning: {finding}" for finding in found.warnings]
    lines += [""] * bool(lines) + _facts_lines(track, found.facts) + [""]
    outcome = "refused" if found.errors else "can be used"
    return "\n".join([*lines, f"{file}: {_count(len(found.errors), 'error')}, {_count(len(found.warnings), 'warning')}: {outcome}"])


def _facts_lines(track: TrackMap, facts: MapFacts | None) -> list[str]:
    lines = [f"map       {track.id}, frame {track.frame}, valid from {track.valid_from}", f"sha256    {track.sha256}"]
    if facts is None:
        return lines
    radius = "straight" if math.isinf(facts.least_radius_m) else f"{facts.least_radius_m:.1f} m"
    return [
        *lines,
        f"network   {_count(facts.edges, 'edge')}, {_count(facts.nodes, 'node')}, {_count(facts.points, 'point')}",
        f"length    {facts.length_m:.2f} m",
        f"radius    {radius} at least",
        f"cant      {facts.greatest_cant_rad:.4f} rad at most",
        f"gradient  {facts.greatest_gradient * 100:.2f} % at most",
        f"sagitta   {facts.sagitta_m * 1000:.1f} mm at most between track and chord (L^2 / 8R)",
    ]


def _object(file: Path, track: TrackMap | None, found: MapCheck | None, unreadable: tuple[Problem, ...]) -> dict[str, Any]:
    """The same for a machine; what could not be computed is null, and so is the radius of a straight line."""
    problems = [asdict(problem) for problem in unreadable]
    facts = None if found is None or found.facts is None else asdict(found.facts)
    if facts is not None and math.isinf(facts["least_radius_m"]):
        facts["least_radius_m"] = None
    return {
        "ok": not problems and found is not None and not found.errors,
        "file": str(file),
        "map": None if track is None else {key: getattr(track, key) for key in ("id", "version", "frame", "valid_from", "sha256")},
        "errors": problems + _listed(() if found is None else found.errors),
        "warnings": _listed(() if found is None else found.warnings),
        "facts": facts,
    }


def _listed(findings: tuple[Finding, ...]) -> list[dict[str, Any]]:
    return [{key: value for key, value in asdict(finding).items() if key != "error"} for finding in findings]


def _count(n: int, word: str) -> str:
    return f"{n} {word}{'s' * (n != 1)}"
