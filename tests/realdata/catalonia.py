"""Real receivers of a regional network, 18 March 2010: four triples, as sites with the promises of the acceptance checks."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

from integrity.gnss.gps_time import format_utc, gps_from_calendar
from recordings.importer import Imported, import_files
from recordings.rinex.navigation import NavigationFile, read_navigation
from recordings.rinex.observation import ObservationFile, read_observations
from recordings.site_file import SiteFile, parse_site

FILES = {
    "CREU": "CREU0770_00-12h.10o.gz",
    "EBRE": "EBRE0770_00-12h.10o.gz",
    "GARR": "GARR0770_00-12h.10o.gz",
    "MATA": "MATA0770_00-12h.10o.gz",
    "UPC1": "UPC10770.11o.gz",
    "UPC2": "UPC20770.11o.gz",
}
NAVIGATION = "brdc0770.10n.gz"
FIVE = gps_from_calendar(2010, 3, 18, 5, 0, 0)
SIX = gps_from_calendar(2010, 3, 18, 6, 0, 0)


@dataclass(frozen=True)
class Triple:
    """Three stations, the hours they are decided in, and the rms that each receiver may have, horizontal and vertical, m."""

    stations: tuple[str, str, str]
    start_ns: int | None
    end_ns: int | None
    epochs: int
    h_rms_m: float
    v_rms_m: float


TRIPLES = {
    "roof": Triple(("UPC1", "UPC2", "GARR"), FIVE, SIX, 120, 1.35, 3.6),
    "ceg": Triple(("CREU", "EBRE", "GARR"), None, None, 1440, 1.3, 2.6),
    "cmg": Triple(("CREU", "MATA", "GARR"), None, None, 1439, 1.3, 2.6),
    "meg": Triple(("MATA", "EBRE", "GARR"), None, None, 1439, 1.3, 2.6),
}


@cache
def observations(data: Path, station: str, receiver: str) -> ObservationFile:
    """The file of a station, read as a receiver of the site."""
    return read_observations(data / "catalonia_2010" / FILES[station], receiver)


@cache
def navigation(data: Path) -> NavigationFile:
    """Broadcast ephemerides of the day."""
    return read_navigation(data / "catalonia_2010" / NAVIGATION)


def site_text(data: Path, triple: Triple, **integrity: object) -> str:
    """The site file of a triple: header coordinates, the promises of the acceptance checks, and settings that differ from them."""
    lines = ["[site]", 'id = "catalonia"', 'frame = "as in the headers"', "epoch_interval_s = 30.0"]
    for receiver, station in zip("ABC", triple.stations, strict=True):
        position = observations(data, station, receiver).approx_position_ecef_m
        assert position is not None
        lines += [f"[receivers.{receiver}]", f'source = "file:{station}"', f"position_ecef_m = {list(position)}"]
    promises = {"false_stops_per_year": 1.0, "missed_detection": 1e-5, "sigma_common_m": 1.2, "sigma_differential_m": 0.5} | integrity
    lines += ["[integrity]", *(f'{k} = "{v}"' if isinstance(v, str) else f"{k} = {v}" for k, v in promises.items())]
    return "\n".join(lines) + "\n"


def site(data: Path, triple: Triple, **integrity: object) -> SiteFile:
    """The same, parsed."""
    return parse_site(site_text(data, triple, **integrity), "catalonia.toml")


def imported(data: Path, triple: Triple, site_file: SiteFile) -> Imported:
    """The events of a triple."""
    files = {receiver: [observations(data, station, receiver)] for receiver, station in zip("ABC", triple.stations, strict=True)}
    return import_files(site_file.config, files, [navigation(data)], triple.start_ns, triple.end_ns)


def utc(gps_ns: int | None) -> str:
    """As `--start` and `--end` want it."""
    assert gps_ns is not None
    return format_utc(gps_ns)
