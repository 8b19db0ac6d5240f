"""Commands of the client on board."""

import signal
import sys
from pathlib import Path
from typing import Annotated

import typer

commands = typer.Typer(no_args_is_help=True)

DEFAULT_CONNECT = "tcp/127.0.0.1:7447"
DEFAULT_KEYS = Path("keys/trusted.toml")
MAX_VALID_MS = 3000  # whatever a station says, nothing counts for longer: the default of a train's [trust]


@commands.command()
def listen(
    site: Annotated[str, typer.Argument(help="Site id, such as kokubunji-1.", show_default=False)],
    keys: Annotated[Path, typer.Option("--keys", help="File of trusted public keys (TOML).")] = DEFAULT_KEYS,
    connect: Annotated[str, typer.Option("--connect", help="Zenoh endpoint of the station or of a router.")] = DEFAULT_CONNECT,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object per message on stdout, everything else on stderr.")] = False,
    count: Annotated[int | None, typer.Option("--count", min=1, help="End after so many messages.", show_default=False)] = None,
) -> None:
    """Verify and print a site's health, message by message; what is not believed is printed with the reason.

    Example: wayside listen kokubunji-1 --keys keys/trusted.toml --connect tcp/10.0.0.1:7447 --json
    """
    from integrity.messages.verification import HealthVerifier
    from recordings.keys import keys_of, read_trusted
    from recordings.link import dial_link
    from train_client import listen as words

    trusted = keys_of(read_trusted(keys), site, keys)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    notices = sys.stderr if as_json else sys.stdout

    def say(notice: str) -> None:
        print(notice, file=notices, flush=True)

    with dial_link([connect], lambda: say(f"NO_COMMS: nobody is at {connect}; it is tried again every second")) as link:
        print(f"listening for {site} at {connect}, {len(trusted)} key{'s' * (len(trusted) != 1)} trusted", file=sys.stderr, flush=True)
        listener = words.Listener(
            link,
            HealthVerifier(site, trusted, MAX_VALID_MS),
            lambda received: print(words.as_json(received) if as_json else words.as_line(received), flush=True),
            say,
        )
        listener.run(count)
