"""The command that solves one receiver's files."""

import json
import sys
import time
from pathlib import Path
from typing import Annotated

import typer

from integrity.gnss.signals import MONITORED_SYSTEMS

SYSTEMS = ",".join(MONITORED_SYSTEMS)
Observations = Annotated[
    list[Path], typer.Argument(metavar="OBS", help="RINEX observation files or UBX logs of one receiver.", show_default=False)
]
NavigationFiles = Annotated[list[Path] | None, typer.Option("--nav", help="RINEX navigation file; may be given several times.")]
Output = Annotated[Path | None, typer.Option("-o", "--output", help="CSV file to write, a row an epoch.")]
Systems = Annotated[str, typer.Option("--systems", help="Of GPS, Galileo, BeiDou, QZSS, GLONASS, SBAS.")]
IonosphereModel = Annotated[
    str | None,
    typer.Option("--ionosphere", help="klobuchar, nequick, free (two frequencies) or none. By default the first that the files allow."),
]
Mask = Annotated[float, typer.Option("--mask", help="Lowest elevation in degrees.")]
Position = Annotated[str | None, typer.Option("--position", help="Where it truly is: ECEF X,Y,Z in metres.")]
Json = Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")]


def solve(
    observations: Observations,
    nav: NavigationFiles = None,
    output: Output = None,
    systems: Systems = SYSTEMS,
    ionosphere: IonosphereModel = None,
    mask: Mask = 10.0,
    position: Position = None,
    as_json: Json = False,
) -> None:
    """Positions of one receiver over its files, each epoch alone: broadcast orbits, weighted least squares, nothing excluded.

    By default the ionosphere is Klobuchar's where the navigation files have its terms, else free where there is a second frequency.

    Example: wayside solve day.rnx.gz --nav brdc.rnx --position -3962108.7,3381309.6,3668678.7 -o day.csv
    """
    from recordings.solve_files import request_of, solve_files
    from recordings.solve_report import as_json_object, explain, write_csv

    began_s = time.perf_counter()
    found = solve_files(request_of(observations, nav or (), systems, ionosphere, mask, position))
    wall_s = time.perf_counter() - began_s
    for warning in found.warnings:
        print(f"warning: {warning}", file=sys.stderr)
    if output:
        write_csv(found, output)
        print(f"{output}: {len(found.track.time_ns)} epochs", file=sys.stderr)
    print(json.dumps(as_json_object(found, wall_s), indent=2) if as_json else explain(found, wall_s))
