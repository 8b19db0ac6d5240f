"""The command line: composes the commands of the station and of recordings, and turns errors into exit codes.

0 fine; 1 failed; 2 usage or configuration; 3 an integrity alert and `--fail-on alert`; 4 input unreadable; 5 link or hardware;
130 interrupted. stdout is data, stderr is talk.
"""

import sys

import click
import typer

from integrity.errors import ConfigError, DecodeError, RecordingError, WaysideError
from recordings.cli import commands as app
from recordings.cli import recording_commands
from station.cli import commands as station_commands

app.add_typer(recording_commands, name="recording")
app.add_typer(station_commands, name="station")
app.info.help = "Ground-side integrity monitoring for railways that locate their trains by satellite."


def main() -> None:
    """Entry point of the command `wayside`."""
    sys.exit(run(sys.argv[1:]))


def run(arguments: list[str]) -> int:
    """Run one command; its exit code."""
    try:
        result = app(arguments, prog_name="wayside", standalone_mode=False)
    except (click.exceptions.NoArgsIsHelpError, click.UsageError) as error:
        error.show()
        return 2
    except (click.Abort, KeyboardInterrupt):
        return 130
    except ConfigError as error:
        return _refused(error, 2)
    except (DecodeError, RecordingError) as error:
        return _refused(error, 4)
    except WaysideError as error:
        return _refused(error, 1)
    except FileNotFoundError as error:
        return _refused(f"{error.filename}: no such file", 2 if str(error.filename).endswith(".toml") else 4)
    except OSError as error:
        return _refused(f"{error.filename or ''}: {error.strerror}", 4)
    return result if isinstance(result, int) else 0


def _refused(why: object, code: int) -> int:
    typer.echo(f"wayside: {why}", err=True)
    return code


if __name__ == "__main__":
    main()
