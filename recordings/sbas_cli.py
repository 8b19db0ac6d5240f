"""The command that computes SBAS protection levels at a point."""

from pathlib import Path
from typing import Annotated

import typer

NavigationFiles = Annotated[
    list[Path], typer.Option("--nav", help="RINEX navigation file; may be given several times.", show_default=False)
]
Messages = Annotated[Path, typer.Option("--messages", help="SBAS messages: .ems, .sbs, or UBX.", show_default=False)]
Position = Annotated[str, typer.Option("--position", help="ECEF position X,Y,Z in metres.", show_default=False)]
Start = Annotated[str | None, typer.Option("--start", help="First epoch, GPS time such as 2025-02-15T17:00:00.", show_default=False)]
End = Annotated[str | None, typer.Option("--end", help="Last epoch, GPS time.", show_default=False)]
Interval = Annotated[float, typer.Option("--interval", help="Seconds between epochs.")]
Mode = Annotated[str, typer.Option("--mode", help="pa: precision approach; npa: en route to non-precision approach.")]
Mask = Annotated[float, typer.Option("--mask", help="Lowest elevation in degrees.")]
Output = Annotated[Path, typer.Option("-o", "--output", help="CSV file to write.", show_default=False)]


def sbas(
    nav: NavigationFiles,
    messages: Messages,
    position: Position,
    output: Output,
    start: Start = None,
    end: End = None,
    interval: Interval = 1.0,
    mode: Mode = "pa",
    mask: Mask = 5.0,
) -> None:
    """SBAS protection levels at a point, from recorded messages and broadcast ephemerides.

    Example: wayside sbas --nav day.nav --messages msas.ems --position -3962108.7,3381309.6,3668678.7 -o levels.csv
    """
    from recordings.sbas_levels import Request, print_summary, request_of, write_levels

    request: Request = request_of(nav, messages, position, start, end, interval, mode, mask)
    print_summary(write_levels(request, output))
