"""The command that shows it all."""

import json
import signal
import sys
import time
from pathlib import Path
from typing import Annotated

import typer

commands = typer.Typer(no_args_is_help=True)


@commands.command()
def demo(
    fault: Annotated[
        str | None, typer.Option("--fault", metavar="KIND", help="Only this one of the story's faults, after start-up.", show_default=False)
    ] = None,
    seconds: Annotated[
        float | None, typer.Option("--seconds", min=1.0, help="End the story after so many seconds.", show_default=False)
    ] = None,
    picture: Annotated[
        Path | None, typer.Option("--picture", help="Draw what was recorded as an animated picture (SVG).", show_default=False)
    ] = None,
    no_page: Annotated[bool, typer.Option("--no-page", help="No page in a browser. There is none yet.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout at the end, everything else on stderr.")] = False,
) -> None:
    """Show the whole of it in two minutes: simulated receivers, a real station, a real train, faults one after the other.

    Needs no hardware, no configuration, no network. Exit 0 only if everything was as expected.

    Example: wayside demo --fault spoofing
    """
    began_ns = time.monotonic_ns()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(130))

    from train_client.demo.demo import run_demo
    from train_client.demo.screen import Screen
    from train_client.demo.summary import as_json_object, render
    from train_client.demo.wish import Wish

    try:
        with Screen(sys.stderr if as_json else sys.stdout) as screen:
            summary = run_demo(Wish(fault, seconds, began_ns), screen)
    except SystemExit:
        print("\nended before the end of the story; station and train are ended too", file=sys.stderr)
        raise
    print(render(summary), file=sys.stderr if as_json else sys.stdout)
    if as_json:
        print(json.dumps(as_json_object(summary), indent=2))
    if picture and summary.station_recordings and summary.train_recordings:
        from recordings.reader import read_recording
        from train_client.demo.picture import animated_svg

        station, train = (read_recording(paths[0]) for paths in (summary.station_recordings, summary.train_recordings))
        picture.write_text(animated_svg(station, train), "utf-8")
    if summary.failed:
        raise typer.Exit(1)
