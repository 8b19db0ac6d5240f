"""Commands of the station."""

import json
from pathlib import Path
from typing import Annotated

import typer

commands = typer.Typer(no_args_is_help=True, help="The station at the trackside.")


@commands.callback()
def _group() -> None:
    """Keep `station` a group while it has one command."""


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
    print(json.dumps(to_json(report), indent=2) if as_json else render(report))
    if report.errors:
        raise typer.Exit(2)
