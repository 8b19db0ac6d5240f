"""A train file: read whole, refused with everything that is wrong at once. Relative paths in it count from where it lies."""

import hashlib
import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import Field

from integrity.gnss.gps_time import NS_PER_S
from recordings.site_schema import (
    Endpoints,
    Name,
    OptionalProtocol,
    OptionalSigma,
    OptionalText,
    Section,
    Sigma,
    Text,
    TlsSection,
    protocol_of,
    read_section,
    read_tls,
    source_problem,
    without_certificates,
)
from recordings.tls_files import TlsFiles, files_of
from recordings.toml_file import ConfigProblems, Problem, TomlDocument, did_you_mean, parse_toml, read_toml
from train_client.config import AntennaConfig, TrainConfig
from train_client.stop import StopLimits
from train_client.trust import TrustLimits

FACING = {"increasing": 1, "decreasing": -1, "either": 0}
# Noise and multipath of GPS L1 and L2 combined, 2.98 times those of one (IS-GPS-200, 20.3.3.3.3.3, of errors alike and independent), as if
# all of a range's error were of that kind: on a train, between reflecting surfaces, most of it is. Measure it on yours.
PAIR_OVER_SINGLE = 3.0
S = TypeVar("S", bound=Section)
Metres = Annotated[float, Field(ge=-1000, le=1000, description="metres, from -1000 to 1000")]


class TrainSection(Section):
    """`[train]`: the train, its map, and the pace of its receivers.

    `facing`: where the front end points on the map, where that is known; otherwise the antennas tell.
    """

    id: Name
    length_m: Annotated[float, Field(gt=0, le=2000, description="metres, above 0 and at most 2000")]
    map: OptionalText = None
    facing: Literal["increasing", "decreasing", "either"] = "either"
    epoch_interval_s: Annotated[float, Field(ge=0.05, le=10, description="seconds, from 0.05 to 10")] = 1.0
    max_speed_mps: Annotated[float, Field(gt=0, le=200, description="metres per second, above 0 and at most 200")] = 100.0
    sigma_range_m: Sigma = 1.0  # own choice: twice what a good receiver has on open line; measure it on yours
    sigma_range_low_m: Sigma = 0.5
    sigma_range_pair_m: OptionalSigma = None  # by default `PAIR_OVER_SINGLE` times those of one signal
    sigma_range_pair_low_m: OptionalSigma = None


class AntennaSection(Section):
    """`[[antenna]]`: where an antenna is mounted and where its receiver's bytes come from."""

    id: Name
    source: OptionalText = None
    protocol: OptionalProtocol = None
    x_m: Metres
    y_m: Metres = 0.0
    height_m: Annotated[float, Field(ge=0, le=10, description="metres above railhead, from 0 to 10")]
    receiver: OptionalText = None
    model: OptionalText = None
    clock: Text = "own"
    oscillator: Annotated[float, Field(gt=0, le=1e-3, description="a relative frequency, above 0 and at most 0.001")] = 1e-6


class TrustSection(Section):
    """`[trust]`: whom to believe, how often before GNSS is trusted again, for how long at most, and when its loss asks for a stop."""

    stations: Annotated[tuple[Name, ...], Field(strict=False, description='a list of site ids, such as ["kokubunji-1"]')]
    public_keys: Text = "keys/trusted.toml"
    recover_messages: Annotated[int, Field(ge=1, le=100_000, description="a whole number from 1 to 100000")] = 10
    max_valid_ms: Annotated[int, Field(ge=100, le=60_000, description="whole milliseconds, from 100 to 60000")] = 3000
    no_comms_after_s: Annotated[float, Field(ge=0, le=600, description="seconds, from 0 to 600")] = 2.0
    stop_after_s: Annotated[float, Field(ge=0, le=600, description="seconds, from 0 to 600")] = 3.0
    release: Literal["operator", "automatic"] = "operator"


class PublishSection(Section):
    """`[publish]`: Zenoh endpoints of stations or routers, the first that is there."""

    connect: Endpoints = ("tcp/127.0.0.1:7447",)


class StationSection(Section):
    """`[[station]]`: one of those trusted that is not to be had at `[publish] connect`, and where it is."""

    id: Name
    connect: Endpoints


class RecordSection(Section):
    """`[record]`: where recordings are kept."""

    directory: Text = "train-recordings"


SECTIONS: dict[str, type[Section]] = {
    "train": TrainSection,
    "antenna": AntennaSection,
    "trust": TrustSection,
    "publish": PublishSection,
    "station": StationSection,
    "publish.tls": TlsSection,
    "record": RecordSection,
}


@dataclass(frozen=True)
class TrainFile:
    """A train file that can be used. `text` is its TOML as read; paths are resolved; `connect`: stations by the endpoints they are at."""

    file: str
    text: str
    config: TrainConfig
    sources: dict[str, str | None]
    map_path: Path | None
    keys_path: Path
    connect: dict[tuple[str, ...], tuple[str, ...]]
    tls: TlsFiles | None
    directory: Path


def load_train(path: Path) -> TrainFile:
    """Read a train file; ConfigProblems with every error."""
    return resolve_train(read_toml(path), path.parent)


def parse_train(text: str, file: str) -> TrainFile:
    """The same for text that is not in a file of its own; `file` is the name that problems carry."""
    return resolve_train(parse_toml(text, file), Path())


def resolve_train(document: TomlDocument, folder: Path) -> TrainFile:
    """The train that a parsed file describes."""
    train, problems = read_section(document, ("train",), TrainSection, SECTIONS)
    trust, found = read_section(document, ("trust",), TrustSection, SECTIONS)
    publish, more = read_section(document, ("publish",), PublishSection, SECTIONS)
    tls, of_tls = read_tls(document, SECTIONS)
    record, rest = read_section(document, ("record",), RecordSection, SECTIONS)
    antennas, of_antennas = _antennas(document, train.length_m)
    elsewhere, of_stations = _stations(document, trust.stations)
    problems += [*found, *more, *of_tls, *rest, *of_antennas, *of_stations]
    if tls is None:
        problems += without_certificates(document, {"connect": publish.connect})
    known = tuple(SECTIONS)
    problems += [
        document.problem((key,), "no such key" + (did_you_mean(key, known) or f": expected one of {', '.join(known)}"))
        for key in document.values
        if key not in known
    ]
    if problems:
        raise ConfigProblems(problems)
    return TrainFile(
        file=document.file,
        text=document.text,
        config=_config(train, antennas, trust),
        sources={antenna.id: antenna.source for antenna in antennas},
        map_path=None if train.map is None else folder / train.map,
        keys_path=folder / trust.public_keys,
        connect=_by_endpoints(trust.stations, publish.connect, elsewhere),
        tls=files_of(tls, folder),
        directory=folder / record.directory,
    )


def _stations(document: TomlDocument, trusted: object) -> tuple[list[StationSection], list[Problem]]:
    """Those that have endpoints of their own, and what is wrong with these and with the list of all."""
    problems = []
    if isinstance(trusted, tuple | list):
        if not trusted:
            problems.append(document.problem(("trust", "stations"), "expected one station or more: without any nothing is ever trusted"))
        if len(set(trusted)) < len(trusted):
            problems.append(document.problem(("trust", "stations"), "a station stands there twice: take one of them out"))
    tables = document.values.get("station", [])
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        return [], [*problems, document.problem(("station",), "expected tables [[station]], each with id and connect")]
    stations = []
    for index, table in enumerate(tables):
        station, found = _read_one(document, ("station", str(index)), table, StationSection)
        stations.append(station)
        problems += found
        if not found and isinstance(trusted, tuple | list) and station.id not in trusted:
            problems.append(document.problem(("station", str(index), "id"), "not among the stations of [trust]: add it there"))
    for name, count in Counter(station.id for station in stations).items():
        if count > 1 and name:
            problems.append(document.problem(("station",), f"{count} tables are about {name!r}: write its endpoints into one list"))
    return stations, problems


def _by_endpoints(
    trusted: tuple[str, ...], connect: tuple[str, ...], elsewhere: list[StationSection]
) -> dict[tuple[str, ...], tuple[str, ...]]:
    """One link serves all stations that are at the same endpoints."""
    own = {station.id: station.connect for station in elsewhere}
    links: dict[tuple[str, ...], tuple[str, ...]] = {}
    for site in trusted:
        at = tuple(own.get(site, connect))
        links[at] = (*links.get(at, ()), site)
    return links


def _antennas(document: TomlDocument, length_m: float) -> tuple[list[AntennaSection], list[Problem]]:
    tables = document.values.get("antenna", [])
    if not isinstance(tables, list) or not tables or not all(isinstance(table, dict) for table in tables):
        return [], [document.problem(("antenna",), "expected one table [[antenna]] or more, each with id, source, x_m and height_m")]
    antennas, problems = [], []
    for index, table in enumerate(tables):
        antenna, found = _read_one(document, ("antenna", str(index)), table, AntennaSection)
        antennas.append(antenna)
        problems += found
    problems += _places_and_sources(document, antennas, length_m)
    for name, count in Counter(antenna.id for antenna in antennas).items():
        if count > 1 and name:
            problems.append(document.problem(("antenna",), f"{count} antennas are called {name!r}: give each a name of its own"))
    if not problems and len({antenna.x_m for antenna in antennas}) < len(antennas):
        problems.append(document.problem(("antenna",), "two antennas at one x_m: the distance between them would tell nothing"))
    return antennas, problems


def _places_and_sources(document: TomlDocument, antennas: list[AntennaSection], length_m: float) -> Iterator[Problem]:
    """Antennas that are not on the train, malformed sources, and two antennas fed from one; what is wrong already is passed over."""
    first_with: dict[str, int] = {}
    for index, antenna in enumerate(antennas):
        at = ("antenna", str(index))
        if isinstance(antenna.x_m, float) and isinstance(length_m, float) and not -length_m <= antenna.x_m <= 0.0:
            yield document.problem((*at, "x_m"), f"expected 0 to -{length_m:g}: metres from the front end, backwards negative")
        if not isinstance(antenna.source, str) or not antenna.source:
            continue
        wrong = source_problem(antenna.source)
        other = first_with.setdefault(antenna.source.partition("?")[0], index)
        if wrong:
            yield document.problem((*at, "source"), wrong)
        elif other != index:
            yield document.problem((*at, "source"), f"antenna {antennas[other].id} has the same source: expected each with its own")


def _read_one(document: TomlDocument, at: tuple[str, str], table: dict[str, Any], kind: type[S]) -> tuple[S, list[Problem]]:
    """`read_section` looks tables up by name; those of an array have a number."""
    inner = TomlDocument(document.file, document.text, {at[0]: {at[1]: table}}, document.lines)
    return read_section(inner, at, kind, SECTIONS)


def _config(train: TrainSection, antennas: list[AntennaSection], trust: TrustSection) -> TrainConfig:
    config = TrainConfig(
        train_id=train.id,
        length_m=train.length_m,
        antennas=tuple(AntennaConfig(a.id, a.x_m, a.y_m, a.height_m, protocol_of(a.protocol, a.source)) for a in antennas),
        epoch_interval_ns=round(train.epoch_interval_s * NS_PER_S),
        facing=FACING[train.facing],
        most_speed_mps=train.max_speed_mps,
        sigma_range_m=train.sigma_range_m,
        sigma_range_low_m=train.sigma_range_low_m,
        sigma_range_pair_m=train.sigma_range_pair_m or PAIR_OVER_SINGLE * train.sigma_range_m,
        sigma_range_pair_low_m=train.sigma_range_pair_low_m or PAIR_OVER_SINGLE * train.sigma_range_low_m,
        stations=tuple(trust.stations),
        max_valid_ms=trust.max_valid_ms,
        trust=TrustLimits(trust.recover_messages, round(trust.no_comms_after_s * NS_PER_S)),
        stop=StopLimits(round(trust.stop_after_s * NS_PER_S), trust.release == "operator"),
        config_sha256="",
    )
    content = asdict(config)
    del content["config_sha256"]
    digest = hashlib.sha256(json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False).encode()).hexdigest()
    return replace(config, config_sha256=digest)
