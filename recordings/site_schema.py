"""The tables of a site file, key by key: type, range, default, and in words what each key expects.

Every range is a limit of plausibility (a slip of the unit, a typing error), not a threshold of a check: those are in `limits.py`.
"""

import re
from collections.abc import Collection, Mapping
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from integrity.config import HostClock, IntegrityConfig, Protocol, Rule, SatelliteFaultPolicy
from recordings.toml_file import Parts, Problem, TomlDocument, did_you_mean, dotted

NAME_PATTERN = "[A-Za-z0-9][A-Za-z0-9_-]*"  # of a site and of a receiver: both become parts of Zenoh keys, channels and columns
_PORT = "([1-9][0-9]{0,3}|[1-5][0-9]{4}|6[0-4][0-9]{3}|65[0-4][0-9]{2}|655[0-2][0-9]|6553[0-5])"
_HOST = r"(\[[0-9A-Fa-f:.]+\]|[^\s:/@?#]+)"
ENDPOINT_PATTERN = rf"(tcp|udp|ws|tls|quic)/(\[[0-9A-Fa-f:.%]+\]|[^\s:/?#]+):{_PORT}([?#]\S*)?|unixsock-stream/\S+"  # of Zenoh
_LATITUDE = r"-?(?:90(?:\.0*)?|[0-8]?[0-9](?:\.[0-9]*)?)"
_LONGITUDE = r"-?(?:180(?:\.0*)?|(?:1[0-7][0-9]|[0-9]?[0-9])(?:\.[0-9]*)?)"
_GGA = rf"gga={_LATITUDE},{_LONGITUDE},-?[0-9]{{1,4}}(?:\.[0-9]*)?"
_CA = r"ca=[^\s&?#@]+"
_MOUNT = rf"//((?P<credentials>\S*)@)?(?P<host>{_HOST}):(?P<port>{_PORT})/(?P<mount>[^\s/?#]+)"
SIGMA_TEXT = "a standard deviation in metres, above 0 (from 1e-6) and at most 1000"  # squares and ratios then stay finite
FREQUENCIES_TEXT = "1 (of every satellite one signal) or 2 (pairs of signals that the ionosphere does not delay)"

Name = Annotated[str, Field(pattern=f"^{NAME_PATTERN}$", description='a name of letters, digits, "-" and "_", such as "north-1"')]
Text = Annotated[str, Field(min_length=1, description="text in quotes, not empty")]
OptionalText = Annotated[str | None, Field(min_length=1, description="text in quotes, not empty")]
OptionalProtocol = Annotated[Protocol | None, Field(description='"ubx" or "rtcm3"')]
Sigma = Annotated[float, Field(ge=1e-6, le=1000, description=SIGMA_TEXT)]
OptionalSigma = Annotated[float | None, Field(ge=1e-6, le=1000, description=SIGMA_TEXT)]
Frequencies = Annotated[int, Field(ge=1, le=2, description=FREQUENCIES_TEXT)]
PerYear = Annotated[float, Field(gt=0, le=1000, description="a number per year, above 0 and at most 1000")]
Correlation = Annotated[float, Field(gt=0, le=1e6, description="a correlation time in seconds, above 0 and at most 1000000")]
MonitoredSystem = Literal["GPS", "Galileo", "BeiDou", "QZSS", "GLONASS"]
Systems = Annotated[
    tuple[MonitoredSystem, ...],
    Field(strict=False, min_length=1, description='a list of "GPS", "Galileo", "BeiDou", "QZSS", "GLONASS", at least one'),
]
Endpoints = Annotated[
    tuple[Annotated[str, Field(pattern=f"^({ENDPOINT_PATTERN})$")], ...],
    Field(strict=False, description='a list of Zenoh endpoints, PROTOCOL/HOST:PORT, such as ["tcp/0.0.0.0:7447"]'),
]
CommonNames = Annotated[
    tuple[Annotated[str, Field(min_length=1, max_length=64)], ...],
    Field(strict=False, description='a list of common names of certificates, such as ["r291", "router-east"]'),
]
Hashes = Annotated[
    tuple[Annotated[str, Field(pattern="^[0-9a-f]{64}$")], ...],
    Field(strict=False, description="a list of SHA-256 of track maps, 64 hex digits each, as `wayside map check` shows them"),
]
Ecef = Annotated[
    tuple[float, float, float] | None,
    Field(strict=False, description="three finite numbers in metres, [x, y, z]"),
]
LatLonHeight = Annotated[
    tuple[Annotated[float, Field(ge=-90, le=90)], Annotated[float, Field(ge=-180, le=180)], float] | None,
    Field(strict=False, description="[latitude, longitude, ellipsoidal height]: -90 to 90 deg, -180 to 180 deg, metres"),
]


class Section(BaseModel):
    """A table of the file. TOML types are taken literally: no number in quotes, no 0 for false."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class SiteSection(Section):
    """`[site]`: what the station calls itself, and the frame of its coordinates."""

    id: Name
    frame: Text = "unstated"
    epoch: Annotated[float | None, Field(ge=1980, le=2100, description="a decimal year from 1980 to 2100, such as 2011.40")] = None
    epoch_interval_s: Annotated[float, Field(ge=0.05, le=300, description="seconds, from 0.05 to 300")] = 1.0
    host_clock: HostClock = "none"


class ReceiverSection(Section):
    """`[receivers.NAME]`: where its bytes come from, where its antenna stands, and what it may share with the others."""

    source: OptionalText = None
    protocol: OptionalProtocol = None
    position_ecef_m: Ecef = None
    position_llh_deg_m: LatLonHeight = None
    model: OptionalText = None
    supply: OptionalText = None
    mast: OptionalText = None
    switch: OptionalText = None


class IntegritySection(Section):
    """`[integrity]`: promises and error models, see `integrity.config`.

    Sigmas left out are those of the `frequencies` (`SIGMAS_OF_SIGNALS_M`, `SIGMAS_OF_PAIRS_M`), vertical ones twice the horizontal.
    """

    rule: Rule = IntegrityConfig.rule
    on_satellite_fault: SatelliteFaultPolicy = IntegrityConfig.on_satellite_fault
    false_stops_per_year: PerYear = IntegrityConfig.false_stops_per_year
    false_exclusions_per_year: PerYear = IntegrityConfig.false_exclusions_per_year
    missed_detection: Annotated[float, Field(gt=0, le=0.1, description="a probability, above 0 and at most 0.1")] = (
        IntegrityConfig.missed_detection
    )
    tolerance_m: Annotated[float | None, Field(gt=0, le=1e5, description="metres, above 0 and at most 100000")] = None
    sigma_common_m: OptionalSigma = None
    sigma_differential_m: OptionalSigma = None
    sigma_common_up_m: OptionalSigma = None
    sigma_differential_up_m: OptionalSigma = None
    sigma_range_m: OptionalSigma = None
    sigma_range_low_m: OptionalSigma = None
    sigma_range_differential_m: OptionalSigma = None
    sigma_range_differential_low_m: OptionalSigma = None
    correlation_common_s: Correlation = IntegrityConfig.correlation_common_s
    correlation_differential_s: Correlation = IntegrityConfig.correlation_differential_s
    systems: Systems = ("GPS", "Galileo", "BeiDou", "QZSS")
    frequencies: Frequencies = IntegrityConfig.frequencies
    elevation_mask_deg: Annotated[float, Field(ge=0, le=45, description="degrees, from 0 to 45")] = IntegrityConfig.elevation_mask_deg
    recover_after_s: Annotated[float, Field(ge=0, le=1e6, description="seconds, from 0 to 1000000")] = IntegrityConfig.recover_after_s


class PublishSection(Section):
    """`[publish]`: Zenoh endpoints, the signing key (by default `keys/ID.pem`), how long a message counts, and with TLS who may read.

    `map_sha256`: the editions of the track map on which the station vouches, two while trains change; without it whichever.
    """

    listen: Endpoints = ("tcp/0.0.0.0:7447",)
    connect: Endpoints = ()
    key: Text = ""
    valid_for_ms: Annotated[int, Field(ge=100, le=60_000, description="whole milliseconds, from 100 to 60000")] = 3000
    readers: CommonNames = ()
    map_sha256: Hashes = ()


class TlsSection(Section):
    """`[publish.tls]`: certificates for endpoints `tls/HOST:PORT`; relative paths count from where the file lies."""

    root_ca: Text
    certificate: Text
    private_key: Text


class RecordSection(Section):
    """`[record]`: where recordings are kept."""

    directory: Text = "/var/lib/wayside"


class PageSection(Section):
    """`[page]`: where the live page listens."""

    listen: Annotated[str, Field(pattern=rf"^{_HOST}:(0|{_PORT})$", description='"HOST:PORT", such as "127.0.0.1:8080"')] = "127.0.0.1:8080"


SECTIONS: dict[str, type[Section]] = {
    "site": SiteSection,
    "receivers": ReceiverSection,
    "integrity": IntegritySection,
    "publish": PublishSection,
    "publish.tls": TlsSection,
    "record": RecordSection,
    "page": PageSection,
}
S = TypeVar("S", bound=Section)

SOURCE_FORMS = {  # scheme: the form as a person writes it, and what follows the scheme's colon
    "serial": ("serial:///dev/ttyACM0?baud=460800", re.compile(r"//[^\s?]+(\?baud=[1-9][0-9]{2,7})?")),
    "tcp": ("tcp://host:port", re.compile(f"//{_HOST}:{_PORT}/?")),
    "udp": ("udp://:port", re.compile(f"//{_HOST}?:{_PORT}/?")),
    "file": ("file:path", re.compile(r".*[^/\s].*")),
    "ntrip": ("ntrip://user:pass@host:port/MOUNT", re.compile(rf"{_MOUNT}(\?(?P<options>{_GGA}))?")),
    "ntrips": (
        "ntrips://user:pass@host:port/MOUNT?ca=FILE",
        re.compile(rf"{_MOUNT}(\?(?P<options>{_GGA}|{_CA}|{_GGA}&{_CA}|{_CA}&{_GGA}))?"),
    ),
}


def read_section(
    document: TomlDocument, parts: Parts, model: type[S], sections: Mapping[str, type[Section]] = SECTIONS
) -> tuple[S, list[Problem]]:
    """The table at `parts`, absent as an empty one. With problems, the section holds the sound keys, and defaults or "" for the rest.

    `sections` are all that the file may have: a key that stands in the wrong one is sent to where it belongs, and a table in a table that
    is a section of its own (`publish.tls`) is read on its own.
    """
    table: Any = document.values
    for part in parts:
        table = table.get(part, {})
    required: dict[str, Any] = {key: "" for key, field in model.model_fields.items() if field.is_required()}
    if not isinstance(table, dict):
        return model.model_construct(**required), [
            document.problem(parts, f"expected a table: write [{dotted(parts)}] and its keys below it")
        ]
    table = {key: value for key, value in table.items() if dotted((*parts, key)) not in sections}
    try:
        return model.model_validate(table), []
    except ValidationError as error:
        bad = {str(found["loc"][0]) for found in error.errors()}
        problems = [document.problem((*parts, key), _expectation(model, key, table, sections)) for key in sorted(bad)]
        sound = {key: value for key, value in table.items() if key not in bad}
        return model.model_construct(**required | sound), problems


def _expectation(model: type[Section], key: str, table: dict[str, Any], sections: Mapping[str, type[Section]]) -> str:
    if key not in model.model_fields:
        return unknown_key(key, model.model_fields, sections)
    field = model.model_fields[key]
    if get_origin(field.annotation) is Literal:
        options = get_args(field.annotation)
        return "expected " + " or ".join(f'"{option}"' for option in options) + did_you_mean(str(table[key]), options)
    return f"expected {field.description}" if key in table else f"missing: add {key}, {field.description}"


def read_tls(document: TomlDocument, sections: Mapping[str, type[Section]] = SECTIONS) -> tuple[TlsSection | None, list[Problem]]:
    """`[publish.tls]`, None where the file has no such table."""
    publish = document.values.get("publish")
    if not isinstance(publish, dict) or "tls" not in publish:
        return None, []
    return read_section(document, ("publish", "tls"), TlsSection, sections)


def is_secured(endpoint: str) -> bool:
    """Whether both ends of it show certificates."""
    return endpoint.startswith(("tls/", "quic/"))


def without_certificates(document: TomlDocument, endpoints: Mapping[str, tuple[str, ...]]) -> list[Problem]:
    """Endpoints of `[publish]`, by key, that need a table `[publish.tls]` that is not there."""
    message = "tls and quic need certificates: add [publish.tls] with root_ca, certificate and private_key"
    return [document.problem(("publish", key), message) for key, given in endpoints.items() if any(map(is_secured, given))]


def unknown_key(key: str, known: Collection[str], sections: Mapping[str, type[Section]] = SECTIONS) -> str:
    """What to write instead of a key that no one reads."""
    shown = {"receivers": "[receivers.NAME]", "antenna": "[[antenna]]"}
    homes = [shown.get(name, f"[{name}]") for name, model in sections.items() if key in model.model_fields]
    if homes:
        return f"no such key here: it belongs in {' or '.join(homes)}"
    return "no such key" + (did_you_mean(key, known) or f": expected one of {', '.join(known)}")


def source_problem(source: str) -> str | None:
    """What is wrong with the address of a receiver's bytes; None if it is well formed. Whether it can be opened is not asked."""
    scheme, colon, rest = source.partition(":")
    if scheme not in SOURCE_FORMS or not colon:
        hint = did_you_mean(scheme, SOURCE_FORMS) or f": expected one of {', '.join(form for form, _ in SOURCE_FORMS.values())}"
        return f"no such kind of source{hint}"
    form, pattern = SOURCE_FORMS[scheme]
    return None if pattern.fullmatch(rest) else f"expected {form}" + ", the port from 1 to 65535" * ("port" in form)


def protocol_of(stated: Protocol | None, source: str | None) -> Protocol:
    """What a receiver's bytes hold: as its table says, or else RTCM 3 from a caster and UBX from anything else."""
    return stated or ("rtcm3" if (source or "").startswith(("ntrip:", "ntrips:")) else "ubx")
