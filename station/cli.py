"""Commands of the station."""

import json
from pathlib import Path
from typing import Annotated

import typer

from recordings.talk import say

commands = typer.Typer(no_args_is_help=True, help="The station at the trackside.")


@commands.command()
def check(
    site: Annotated[Path, typer.Argument(help="Site file (TOML).", show_default=False)],
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Every error of a site file at once, and what its promises mean: radii, thresholds, smallest faults caught.

    Example: wayside station check site.toml
    """
    from station.check import as_json as to_json
    from station.check import check_site, render

    report = check_site(site)
    print(json.dumps(to_json(report), indent=2) + "\n" if as_json else render(report), end="")
    if report.errors:
        raise typer.Exit(2)


@commands.command()
def plan(
    site: Annotated[Path, typer.Argument(help="Site file (TOML).", show_default=False)],
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Which promises a triangle can keep, what faults each catches, how far apart antennas should be, and what to change for more.

    A file that `check` refuses for its promises or its triangle gets a plan, too.

    Example: wayside station plan site.toml
    """
    from station.plan import as_json as to_json
    from station.plan import plan_site, render

    found = plan_site(site)
    print(json.dumps(to_json(found), indent=2) + "\n" if as_json else render(found), end="")


@commands.command()
def run(site: Annotated[Path, typer.Argument(help="Site file (TOML).", show_default=False)]) -> None:
    """Run the station: decide every epoch, publish signed health, record everything. Ends with SIGTERM or Ctrl-C.

    Example: wayside station run site.toml
    """
    from station.check import sound_site
    from station.runtime import run_station

    raise typer.Exit(run_station(sound_site(site), say))


@commands.command()
def configure(site: Annotated[Path, typer.Argument(help="Site file (TOML).", show_default=False)]) -> None:
    """Set the messages and the rate of the site's u-blox receivers, read everything back, and say what is not as it should be.

    Example: wayside station configure site.toml
    """
    from station.check import sound_site
    from station.configure import configure as set_receivers

    set_receivers(sound_site(site), lambda receiver, line: say(f"{receiver}: {line}"))
