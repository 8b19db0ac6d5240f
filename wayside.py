"""The command line: composes the commands of the station, the client and recordings, and turns errors into exit codes.

0 fine; 1 failed; 2 usage or configuration; 3 an integrity alert and `--fail-on alert`; 4 input unreadable; 5 link or hardware;
130 interrupted. stdout is data, stderr is talk.
"""

import os
import signal
import sys
import threading
from contextlib import suppress
from types import FrameType

import typer

from integrity.errors import ConfigError, DecodeError, LinkError, RecordingError, WaysideError
from recordings.campaign.cli import campaign
from recordings.cli import commands as recordings_commands
from recordings.cli import recording_commands
from recordings.keys_cli import commands as keys_commands
from recordings.sbas_cli import sbas
from recordings.solve.cli import solve
from station.cli import commands as station_commands
from train_client.cli import commands as train_client_commands
from train_client.cli import train_commands
from train_client.demo_cli import commands as demo_commands
from train_client.map_cli import commands as map_commands

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Ground-side integrity monitoring for railways that locate their trains by satellite.",
)
app.add_typer(demo_commands)
app.add_typer(station_commands, name="station")
app.add_typer(recordings_commands)
app.add_typer(recording_commands, name="recording")
app.add_typer(train_client_commands)
app.add_typer(train_commands, name="train")
app.add_typer(map_commands, name="map")
app.add_typer(keys_commands, name="keys")
app.command()(campaign)
app.command()(sbas)
app.command()(solve)


INTERRUPTED = 130


def main() -> None:
    """Entry point of the command `wayside`. An interrupt ends it with 130, also where Python drops the exception (in an import)."""
    interrupts = []

    def end(number: int, _: FrameType | None) -> None:
        interrupts.append(number)
        sys.exit(INTERRUPTED)

    signal.signal(signal.SIGINT, end)
    code = run(sys.argv[1:])
    leave(INTERRUPTED if interrupts else code)


def leave(code: int) -> None:
    """End this process. A thread that is still dialling would come back from Zenoh into an interpreter that is being taken down, where
    Python ends it by force and Zenoh aborts the process: while there is one, the interpreter is left standing."""
    if any(thread.daemon for thread in threading.enumerate()):
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError):  # nobody reads it any more
                stream.flush()
        os._exit(code)
    sys.exit(code)


def run(arguments: list[str]) -> int:
    """Run one command; its exit code."""
    try:
        app(arguments, prog_name="wayside")
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else 0 if end.code is None else 1
    except ConfigError as error:
        return _refused(error, 2)
    except (DecodeError, RecordingError) as error:
        return _refused(error, 4)
    except LinkError as error:
        return _refused(error, 5)
    except WaysideError as error:
        return _refused(error, 1)
    except FileNotFoundError as error:
        return _refused(f"{error.filename}: no such file", 2 if str(error.filename).endswith(".toml") else 4)
    except OSError as error:
        return _refused(f"{error.filename or 'input'}: {error.strerror}", 4)
    return 0


def _refused(why: object, code: int) -> int:
    print(f"wayside: {why}", file=sys.stderr)
    return code


if __name__ == "__main__":
    main()
