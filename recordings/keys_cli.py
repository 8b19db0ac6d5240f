"""Commands on signing keys, and on certificates for tests and first steps."""

import re
import sys
from pathlib import Path
from typing import Annotated

import typer

from integrity.errors import ConfigError

commands = typer.Typer(no_args_is_help=True, help="Keys with which stations sign and which trains trust; certificates for tests.")

KeyFile = Annotated[Path, typer.Argument(help="A private key (PEM).", show_default=False)]
Folder = Annotated[Path, typer.Argument(help="Folder of the authority.", show_default=False)]
FOR_TESTS = "for tests and first steps: nothing is revoked, nothing renews itself"
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


@commands.command()
def ca(
    directory: Folder, days: Annotated[int, typer.Option("--days", min=1, max=3650, help="How long the authority is to count.")] = 730
) -> None:
    """Make a certificate authority for tests and first steps: ca.pem, and ca.key, which stays where certificates are made.

    Example: wayside keys ca tls
    """
    from recordings.certificates import CA_CERTIFICATE, new_authority

    ends = new_authority(directory, days)
    print(f"{directory / CA_CERTIFICATE}: new authority, ends {ends:%Y-%m-%dT%H:%M:%SZ}; {FOR_TESTS}", file=sys.stderr)


@commands.command()
def certificate(
    directory: Folder,
    name: Annotated[str, typer.Argument(help="Common name: the id of a site or train.", show_default=False)],
    site: Annotated[bool, typer.Option("--site", help="For a station: it dials and is dialled.")] = False,
    train: Annotated[bool, typer.Option("--train", help="For a train, or another reader: it only dials.")] = False,
    router: Annotated[bool, typer.Option("--router", help="For a router: it dials and is dialled.")] = False,
    host: Annotated[list[str] | None, typer.Option("--host", help="Where it is dialled, besides on its own machine; repeat it.")] = None,
    days: Annotated[int, typer.Option("--days", min=1, max=3650, help="How long it is to count, at most as long as the authority.")] = 365,
) -> None:
    """Make a certificate of the authority in a folder: NAME.pem and NAME.key; on stdout the table that names them in a site or train file.

    Example: wayside keys certificate tls kokubunji-1 --site --host 10.0.0.1
    """
    from recordings.certificates import CA_CERTIFICATE, Role, new_certificate
    from recordings.toml_file import format_toml

    roles = [role for role, wanted in ((Role.SITE, site), (Role.TRAIN, train), (Role.ROUTER, router)) if wanted]
    if len(roles) != 1:
        raise ConfigError(f"{len(roles)} kinds of certificate given: expected exactly one of --site, --train and --router")
    if host and roles == [Role.TRAIN]:
        raise ConfigError("--host: a train only dials, nobody dials it: leave it out, or make the certificate of a site or router")
    ends = new_certificate(directory, name, roles[0], host or [], days)
    paths = {"root_ca": CA_CERTIFICATE, "certificate": f"{name}.pem", "private_key": f"{name}.key"}
    print(format_toml({"publish": {"tls": {key: str(directory / file) for key, file in paths.items()}}}), end="")
    print(f"{directory / name}.pem: new certificate of {name}, ends {ends:%Y-%m-%dT%H:%M:%SZ}; {FOR_TESTS}", file=sys.stderr)


def _site(file: Path, site: str | None) -> str:
    from recordings.site_schema import NAME_PATTERN

    name = file.stem if site is None else site
    if not re.fullmatch(NAME_PATTERN, name):
        raise ConfigError(f'{name!r} is no site id: expected letters, digits, "-" and "_": give it with --site, such as --site north-1')
    return name
