"""Commands of the client on board."""

import json
import signal
import sys
from pathlib import Path
from typing import Annotated

import typer

from recordings.talk import say

commands = typer.Typer(no_args_is_help=True)
train_commands = typer.Typer(no_args_is_help=True, help="The train: positions on its track, used only as the ground allows.")

DEFAULT_CONNECT = "tcp/127.0.0.1:7447"
SITE_FILE = Path("site.toml")  # where one lies here, its station is the one meant
DEFAULT_KEYS = Path("keys/trusted.toml")
MAX_VALID_MS = 3000  # whatever a station says, nothing counts for longer: the default of a train's [trust]


@commands.command()
def listen(
    site: Annotated[str, typer.Argument(help="Site id, such as kokubunji-1.", show_default=False)],
    keys: Annotated[Path, typer.Option("--keys", help="File of trusted public keys (TOML).")] = DEFAULT_KEYS,
    connect: Annotated[
        str | None,
        typer.Option("--connect", help=f"Zenoh endpoint; by default that of ./{SITE_FILE}, or {DEFAULT_CONNECT}.", show_default=False),
    ] = None,
    certificate: Annotated[
        Path | None,
        typer.Option("--certificate", help="For tls endpoints: NAME.pem; NAME.key and ca.pem lie beside it.", show_default=False),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object per message on stdout, everything else on stderr.")] = False,
    count: Annotated[int | None, typer.Option("--count", min=1, help="End after so many messages.", show_default=False)] = None,
) -> None:
    """Verify and print a site's health, message by message; what is not believed is printed with the reason.

    Example: wayside listen kokubunji-1 --keys keys/trusted.toml --connect tcp/10.0.0.1:7447 --json
    """
    from integrity.messages.verification import HealthVerifier
    from recordings.keys import KeyDates, keys_of, read_trusted
    from recordings.link import dial_link, nobody_at
    from recordings.tls_files import check_tls, files_beside
    from train_client import listen as words

    known = read_trusted(keys)
    trusted = keys_of(known, site, keys)
    dates = KeyDates(known[site])
    tls = files_beside(certificate) if certificate else None
    check_tls(tls)
    endpoint = connect or _endpoint_of(SITE_FILE) or DEFAULT_CONNECT
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    notices = sys.stderr if as_json else sys.stdout

    def say(notice: str) -> None:
        print(notice, file=notices, flush=True)

    for warning in dates.warnings():
        say(warning)
    with dial_link([endpoint], lambda: say(f"NO_COMMS: {nobody_at([endpoint])}"), tls) as link:
        print(f"listening for {site} at {endpoint}, {len(trusted)} key{'s' * (len(trusted) != 1)} trusted", file=sys.stderr, flush=True)
        listener = words.Listener(
            link,
            HealthVerifier(site, trusted, MAX_VALID_MS),
            dates,
            lambda received: print(words.as_json(received) if as_json else words.as_line(received), flush=True),
            say,
        )
        listener.run(count)


def _endpoint_of(site_file: Path) -> str | None:
    """Where the station of a site file listens, seen from its own machine; None where there is no such file, or it does not listen."""
    from recordings.site_file import load_site

    if not site_file.exists():
        return None
    listens = load_site(site_file).publish.listen
    return listens[0].replace("/0.0.0.0:", "/127.0.0.1:").replace("/[::]:", "/[::1]:") if listens else None


@train_commands.command()
def run(
    train: Annotated[Path, typer.Argument(help="Train file (TOML).", show_default=False)],
    track: Annotated[Path | None, typer.Option("--track", help="Map, instead of the one that the train file names.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object per position on stdout.")] = False,
) -> None:
    """Run the train client: solve each epoch on the track, believe it only as the ground allows, publish and record it.

    Example: wayside train run train.toml --json
    """
    from google.protobuf.json_format import MessageToDict

    from integrity.errors import ConfigError
    from integrity.messages import wayside_pb2 as pb
    from train_client.runtime import run_train
    from train_client.train_file import load_train

    def show(position: pb.TrainPosition) -> None:
        if as_json:
            known = MessageToDict(position, preserving_proto_field_name=True)  # protobuf's own JSON, which leaves zeros out
            print(json.dumps({"status": "POSITION_UNKNOWN", "reasons": [], "facing": 0, "refused_messages": "0"} | known), flush=True)

    loaded = load_train(train)
    map_file = track or loaded.map_path
    if map_file is None:
        raise ConfigError(f'{train}: names no map: add map = "line.json" to [train], or give --track')
    raise typer.Exit(run_train(loaded, map_file, say, show))


@train_commands.command()
def replay(
    recording: Annotated[Path, typer.Argument(help="A train's recording (MCAP).", show_default=False)],
    train: Annotated[Path | None, typer.Option("--train", help="Train file; by default the recorded one.")] = None,
    track: Annotated[Path | None, typer.Option("--track", help="Map; by default the recorded one.")] = None,
    epochs: Annotated[Path | None, typer.Option("--epochs", help="Positions as CSV.")] = None,
    diff: Annotated[bool, typer.Option("--diff", help="Compare with the recorded positions; exit 1 on any difference.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Decide a train's recording again.

    Example: wayside train replay r291.mcap --train train.toml --track line.json --diff
    """
    from recordings.reader import read_recording
    from train_client import replay as again
    from train_client.map_file import read_map_text
    from train_client.track.checks import load_map
    from train_client.train_file import load_train

    done = again.replay(
        read_recording(recording),
        None if train is None else load_train(train),
        None if track is None else load_map(read_map_text(track), str(track)),
    )
    if epochs:
        again.write_epochs_csv(epochs, done.positions)
    print(json.dumps(again.summary(recording.name, done), indent=2) + "\n" if as_json else again.render(recording.name, done), end="")
    if diff:
        found = again.differences(done.recorded, done.positions)
        print("\n".join(found) or f"{len(done.recorded)} recorded positions, no difference", file=sys.stderr)
        if found:
            raise typer.Exit(1)
