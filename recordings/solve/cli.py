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
Exclude = Annotated[
    bool, typer.Option("--exclude/--no-exclude", help="Test whether ranges fit together, and leave out one that stands out as faulty.")
]
FalseAlarm = Annotated[
    float | None,
    typer.Option(
        "--false-alarm", metavar="P", help="Probability per epoch that the tests fail although nothing is wrong. 1e-5 by default."
    ),
]
Velocity = Annotated[bool, typer.Option("--velocity/--no-velocity", help="Velocity and clock drift, where Doppler was measured.")]
Smooth = Annotated[
    float | None,
    typer.Option(
        "--smooth",
        metavar="SECONDS",
        help="Smooth ranges with the carrier over so many seconds (Hatch); files in order of time. With one frequency the changing "
        "ionosphere pulls them by twice its rate times the window: at 1 mm/s 0.2 m in 100 s, 1.2 m in 600 s; with --ionosphere free not.",
    ),
]
Residuals = Annotated[
    Path | None, typer.Option("--residuals", help="CSV file to write, a row a range: residual, use, the position without it.")
]
Json = Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")]


def solve(
    observations: Observations,
    nav: NavigationFiles = None,
    output: Output = None,
    systems: Systems = SYSTEMS,
    ionosphere: IonosphereModel = None,
    mask: Mask = 10.0,
    position: Position = None,
    exclude: Exclude = True,
    false_alarm: FalseAlarm = None,
    velocity: Velocity = True,
    smooth: Smooth = None,
    residuals: Residuals = None,
    as_json: Json = False,
) -> None:
    """Positions of one receiver over its files, each epoch alone: broadcast orbits, weighted least squares.

    An epoch whose ranges do not fit together, and in which none can be blamed for it, has no position; --no-exclude gives it all the same.
    By default the ionosphere is Klobuchar's where the navigation files have its terms, else free where there is a second frequency.

    Example: wayside solve day.rnx.gz --nav brdc.rnx --position -3962108.7,3381309.6,3668678.7 -o day.csv
    """
    from recordings.solve.files import solve_files
    from recordings.solve.report import as_json_object, explain
    from recordings.solve.request import request_of
    from recordings.solve.table import write_csv

    began_s = time.perf_counter()
    words = (observations, nav or (), systems, ionosphere, mask, position)
    request = request_of(*words, exclude, false_alarm, velocity, smooth, output, residuals)
    found = solve_files(request)
    wall_s = time.perf_counter() - began_s
    for warning in found.warnings:
        print(f"warning: {warning}", file=sys.stderr)
    if output:
        write_csv(found, output)
        print(f"{output}: {len(found.track.time_ns)} epochs", file=sys.stderr)
    print(json.dumps(as_json_object(found, wall_s), indent=2) if as_json else explain(found, wall_s))
