"""Commands on signing keys."""

import re
import sys
from pathlib import Path
from typing import Annotated

import typer

from integrity.errors import ConfigError

commands = typer.Typer(no_args_is_help=True, help="Keys with which stations sign, and which trains trust.")

KeyFile = Annotated[Path, typer.Argument(help="A private key (PEM).", show_default=False)]
Site = Annotated[str | None, typer.Option("--site", help="Site id; by default the file's name without its ending.", show_default=False)]


@commands.command()
def new(file: KeyFile, site: Site = None) -> None:
    """Make a station's key; on stdout the table by which a train trusts it.

    Example: wayside keys new kokubunji-1.pem >> trusted.toml
    """
    from recordings.keys import new_key, trusted_table

    name = _site(file, site)
    key = new_key(file)
    print(trusted_table(name, key.public), end="")
    print(f"{file}: new key {key.key_id.hex()} of site {name}; keep it at the station, and give trains only the table", file=sys.stderr)


@commands.command()
def show(file: KeyFile, site: Site = None) -> None:
    """The table by which a train trusts a station's key, on stdout.

    Example: wayside keys show kokubunji-1.pem >> trusted.toml
    """
    from recordings.keys import load_key, trusted_table

    name = _site(file, site)
    key = load_key(file)
    print(trusted_table(name, key.public), end="")
    print(f"{file}: key {key.key_id.hex()} of site {name}", file=sys.stderr)


def _site(file: Path, site: str | None) -> str:
    from recordings.site_schema import NAME_PATTERN

    name = file.stem if site is None else site
    if not re.fullmatch(NAME_PATTERN, name):
        raise ConfigError(f'{name!r} is no site id: expected letters, digits, "-" and "_": give it with --site, such as --site north-1')
    return name
