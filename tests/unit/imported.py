"""A simulated stream written as RINEX files of three receivers, changed or not, and imported again."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from integrity.config import SiteConfig
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.observations import ObservationRow
from recordings.importer import Imported, import_files
from recordings.rinex.navigation import NavigationFile, read_navigation
from recordings.rinex.observation import ObservationFile, read_observations
from tests.rinex_text import LEAP_SECONDS, navigation_of, navigation_text, observation_text, rows_of
from tests.unit.streams import SITE, stream

EPOCHS = 20
EVENTS = stream(EPOCHS)
EPHEMERIDES, KLOBUCHAR = navigation_of(EVENTS)
ROWS = {name: rows_of(EVENTS, name) for name in SITE.receiver_names}
AT = [row.receive_time_ns for row in ROWS["A"]]

Rows = Mapping[str, Sequence[ObservationRow]]


def observation_file(directory: Path, name: str, rows: Sequence[ObservationRow], leap_seconds: int = LEAP_SECONDS) -> ObservationFile:
    path = directory / f"{name}.rnx"
    path.write_text(observation_text(rows, leap_seconds=leap_seconds), "ascii")
    return read_observations(path, name[0])


def navigation_file(
    directory: Path, ephemerides: Sequence[KeplerEphemeris] = EPHEMERIDES, leap_seconds: int = LEAP_SECONDS
) -> NavigationFile:
    path = directory / "nav.rnx"
    path.write_text(navigation_text(ephemerides, KLOBUCHAR, leap_seconds), "ascii")
    return read_navigation(path)


def imported(
    directory: Path,
    changed: Rows | None = None,
    site: SiteConfig = SITE,
    ephemerides: Sequence[KeplerEphemeris] = EPHEMERIDES,
    start_ns: int | None = None,
    end_ns: int | None = None,
) -> Imported:
    """The stream written as RINEX and read again, with other rows for some receivers."""
    files = {name: [observation_file(directory, name, rows)] for name, rows in (ROWS | dict(changed or {})).items()}
    return import_files(site, files, [navigation_file(directory, ephemerides)], start_ns, end_ns)


def epochs_of(result: Imported) -> list[int]:
    """Times of the rows of A; those of the others are checked to be the same."""
    times = {name: [row.receive_time_ns for row in rows_of(result.events, name)] for name in SITE.receiver_names}
    assert times["A"] == times["B"] == times["C"]
    return times["A"]


def without(rows: Sequence[ObservationRow], *numbers: int) -> list[ObservationRow]:
    return [row for k, row in enumerate(rows) if k not in numbers]
