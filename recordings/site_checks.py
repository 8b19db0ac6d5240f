"""What the keys of a site file must mean together: three antennas on the Earth, apart from each other, that share little.

Errors are what the collapse test and the circles cannot live with; warnings name what weakens the independence of the receivers.
"""

import math
import re
from collections.abc import Iterator, Mapping
from itertools import combinations

import numpy as np

from integrity.config import SIGMAS_OF_PAIRS_M, SIGMAS_OF_SIGNALS_M, IntegrityConfig
from integrity.gnss.frames import ecef_from_geodetic, geodetic_from_ecef
from recordings.site_schema import PublishSection, ReceiverSection, SiteSection, TlsSection, is_secured, source_problem
from recordings.toml_file import Problem, TomlDocument

EcefPoint = tuple[float, float, float]

POSITION_KEYS = ("position_ecef_m", "position_llh_deg_m")
HEIGHT_RANGE_M = (-500.0, 9000.0)  # ellipsoidal, of any railway and then some: the Dead Sea shore to above Tanggula
RADIUS_RANGE_M = (6.35e6, 6.39e6)  # from the Earth's centre, wider than HEIGHT_RANGE_M from pole to equator
SAME_POINT_M = 0.05  # two antennas do not fit in less
COLLAPSE_SIGMAS = 12.0  # sqrt(Lambda) for 1e-9 false and 1e-9 missed: section 2.6 of the notes on ground integrity
PAIR_SIGMAS = 17.0  # the same for two receivers alone: Lambda = L^2 / (2 sigma^2), so 12 sqrt(2)
LONG_SIDE_M = 10_000.0  # the atmosphere then differs by more than sigma_differential_m allows


def surveyed_point(document: TomlDocument, name: str, receiver: ReceiverSection) -> tuple[EcefPoint | None, list[Problem]]:
    """The antenna of a receiver in ECEF, or None: with a problem, unless the schema found one in the coordinates already."""
    given = [key for key in POSITION_KEYS if key in document.values["receivers"][name]]
    if not given:
        forms = "position_ecef_m = [x, y, z] or position_llh_deg_m = [latitude, longitude, ellipsoidal height]"
        message = f"missing coordinates: add {forms}, the surveyed point of the antenna; there is no default"
        return None, [document.problem(("receivers", name, POSITION_KEYS[0]), message)]
    parts = ("receivers", name, given[-1])
    if len(given) > 1:
        return None, [document.problem(parts, "the point is given twice: keep either position_ecef_m or position_llh_deg_m")]
    if receiver.position_ecef_m is not None:
        x, y, z = receiver.position_ecef_m
        point, wrong = (float(x), float(y), float(z)), _off_the_earth(x, y, z)
    elif receiver.position_llh_deg_m is not None:
        lat_deg, lon_deg, height_m = receiver.position_llh_deg_m
        wrong = _wrong_height(height_m)
        x, y, z = ecef_from_geodetic(math.radians(lat_deg), math.radians(lon_deg), height_m)
        # Rounded so that the last bit of a machine's sine does not change the hash of the configuration.
        point = round(float(x), 6), round(float(y), 6), round(float(z), 6)
    else:
        return None, []
    return (None, [document.problem(parts, wrong)]) if wrong else (point, [])


def _off_the_earth(x: float, y: float, z: float) -> str | None:
    radius_m = math.hypot(x, y, z)
    if RADIUS_RANGE_M[0] <= radius_m <= RADIUS_RANGE_M[1]:
        return _wrong_height(float(geodetic_from_ecef(np.array([x, y, z]))[2]))
    if radius_m > 0 and abs(x) <= 90 and abs(y) <= 180:
        hint = "latitude, longitude and height belong in position_llh_deg_m"
    elif RADIUS_RANGE_M[0] <= radius_m * 1000 <= RADIUS_RANGE_M[1]:
        hint = "these look like kilometres"
    else:
        hint = "enter the surveyed antenna position"
    return f"{radius_m:.0f} m from the centre of the Earth, not on its surface: expected ECEF metres; {hint}"


def _wrong_height(height_m: float) -> str | None:
    low, high = HEIGHT_RANGE_M
    if low <= height_m <= high:
        return None
    return f"ellipsoidal height {height_m:.1f} m: expected {low:.0f} to {high:.0f} m; enter the surveyed antenna position"


def coinciding(document: TomlDocument, points: Mapping[str, EcefPoint]) -> Iterator[Problem]:
    """Receivers at one point: a copied line, or one antenna for two receivers."""
    for (a, b), side_m in sides_m(points).items():
        if not side_m >= SAME_POINT_M:
            message = f"{side_m:.3f} m from receiver {a}: each receiver needs an antenna of its own at its own surveyed point"
            yield document.problem(_position_parts(document, b), message)


def collapse_impossible(document: TomlDocument, points: Mapping[str, EcefPoint], promises: IntegrityConfig) -> Iterator[Problem]:
    """A triangle too small for the promised test whether all receivers hear one transmitter."""
    sigma_differential_m = promises.sigma_differential_m
    root_mean_square_m = math.hypot(*sides_m(points).values()) / math.sqrt(3.0)
    separation = root_mean_square_m / sigma_differential_m
    if len(points) == 3 and not separation >= COLLAPSE_SIGMAS:
        needed_m = math.ceil(round(COLLAPSE_SIGMAS * sigma_differential_m * 10.0, 6)) / 10.0
        proven_m = math.floor(root_mean_square_m / COLLAPSE_SIGMAS * 1000.0) / 1000.0
        message = (
            f"too small a triangle for the promised collapse test (spoofing): sqrt(Lambda) is {separation:.2f}, expected 12 or more. "
            f"What would do: sides of {needed_m:.1f} m (root mean square; now {root_mean_square_m:.2f} m), "
            f"or a measured sigma_differential_m of at most {proven_m:.3f} (now {sigma_differential_m:g}"
            f"{', that of pairs: frequencies = 2' if promises.frequencies == 2 else ''})"
        )
        yield document.problem(("receivers",), message)


def source_problems(document: TomlDocument, receivers: Mapping[str, ReceiverSection]) -> Iterator[Problem]:
    """Malformed sources, and two receivers fed from one."""
    first_with: dict[str, str] = {}
    for name, receiver in receivers.items():
        if receiver.source is None:
            continue
        parts = ("receivers", name, "source")
        wrong = source_problem(receiver.source)
        other = first_with.setdefault(receiver.source.partition("?")[0], name)
        if wrong:
            yield document.problem(parts, wrong)
        elif other != name:
            yield document.problem(parts, f"receiver {other} has the same source: expected three receivers, each with its own")


def spacing_warnings(document: TomlDocument, points: Mapping[str, EcefPoint], sigma_differential_m: float) -> Iterator[Problem]:
    """Sides too short for independence, or so long that the errors of their ends differ."""
    shortest_m = PAIR_SIGMAS * sigma_differential_m
    for (a, b), side_m in sides_m(points).items():
        parts = _position_parts(document, b)
        if side_m < shortest_m:
            message = f"{side_m:.1f} m from receiver {a}, under 17 sigma_differential_m = {shortest_m:.1f} m: this pair alone cannot tell"
            yield document.problem(parts, f"{message} one transmitter from two antennas, and shares multipath; move them apart")
        if side_m > LONG_SIDE_M:
            message = f"{side_m / 1000.0:.1f} km from receiver {a}, over 10 km: the atmosphere differs at the two ends"
            yield document.problem(parts, f"{message}; make sure that sigma_differential_m was measured at this site")


def pair_warnings(document: TomlDocument, promises: IntegrityConfig) -> Iterator[Problem]:
    """Sigmas stated for pairs that look as if they were those of single signals."""
    stated = document.values.get("integrity", {}) if promises.frequencies == 2 else {}
    for name, sigma_m in SIGMAS_OF_PAIRS_M.items():
        usual_m = SIGMAS_OF_SIGNALS_M[name]
        if usual_m < sigma_m and name in stated and stated[name] <= usual_m:
            message = f"no more than is usual of one signal ({usual_m:g}), and the noise of pairs (frequencies = 2) is about three times"
            message += f" as much; make sure that it was measured on pairs, or leave it out ({sigma_m:g})"
            yield document.problem(("integrity", name), message)


def sharing_warnings(document: TomlDocument, receivers: Mapping[str, ReceiverSection]) -> Iterator[Problem]:
    """What several receivers have in common can fail for all of them at once."""
    if len({receiver.model for receiver in receivers.values()}) == 1 and len(receivers) > 1:
        first, receiver = next(iter(receivers.items()))
        if receiver.model is not None:
            message = (
                "all receivers are of one model: a fault of its firmware or correlator moves them alike, and the shape test is blind to it"
            )
            yield document.problem(("receivers", first, "model"), f"{message}; use a second model if you can")
    for key, spoiled in (
        ("supply", "one failure silences them together"),
        ("mast", "multipath, jamming and movement strike them together"),
        ("switch", "one failure silences them together"),
    ):
        names_of: dict[str, list[str]] = {}
        for name, receiver in receivers.items():
            value = getattr(receiver, key)
            if value is not None:
                names_of.setdefault(value, []).append(name)
        for names in names_of.values():
            if len(names) > 1:
                message = f"shared by receivers {', '.join(names)}: {spoiled}, which spoils their independence; separate them if you can"
                yield document.problem(("receivers", names[-1], key), message)


def site_warnings(document: TomlDocument, site: SiteSection) -> Iterator[Problem]:
    """What the site leaves unsaid or unwatched."""
    if site.frame == "unstated":
        message = "not stated: mixed frames move the circles by 0.5 to 1 m; state the frame of the surveyed coordinates, such as"
        yield document.problem(("site", "frame"), f'{message} frame = "JGD2011" (and its epoch)')
    if site.host_clock in ("none", "gnss"):
        why = "there is no independent clock" if site.host_clock == "none" else "the clock follows the satellites that it should judge"
        message = f"time spoofing is not monitored: {why}; if the host's clock is kept by NTP or PTP, write host_clock = "
        yield document.problem(("site", "host_clock"), f'{message}"ntp" or "ptp"')


def readers_without_tls(document: TomlDocument, publish: PublishSection) -> Iterator[Problem]:
    """Names that nobody can show."""
    if publish.readers:
        message = "names are shown by certificates: add [publish.tls], and listen at tls/HOST:PORT"
        yield document.problem(("publish", "readers"), message)


def open_endpoints(document: TomlDocument, publish: PublishSection, tls: TlsSection | None) -> Iterator[Problem]:
    """Warnings of who may come, and who may not: an endpoint that anybody can reach, or at which nobody is let in."""
    at = ("publish", "listen")
    for endpoint in publish.listen:
        if tls is None and not is_secured(endpoint) and not is_local(endpoint):
            message = f"{endpoint} is open: whoever reaches it may read, and put anything at any key (only what is signed counts);"
            yield document.problem(at, f"{message} listen at tls/HOST:PORT with [publish.tls] and readers, or at 127.0.0.1")
        if tls is not None and not is_secured(endpoint):
            message = f"{endpoint} serves nobody: with [publish.tls] only those are let in whose certificate has a name in readers"
            yield document.problem(at, message)
    if tls is not None and not publish.readers:
        message = 'nobody may read: name the certificates of trains, and of a router that is dialled, as readers = ["r291"]'
        yield document.problem(("publish", "readers"), message)


def is_local(endpoint: str) -> bool:
    """Whether only this machine reaches it."""
    return re.match(r"unixsock-stream/|[a-z]+/(127\.[0-9.]+|localhost|\[::1\]):", endpoint) is not None


def sides_m(points: Mapping[str, EcefPoint]) -> dict[tuple[str, str], float]:
    """Length of each side by the names of its ends."""
    return {(a, b): math.dist(points[a], points[b]) for a, b in combinations(points, 2)}


def _position_parts(document: TomlDocument, name: str) -> tuple[str, str, str]:
    return "receivers", name, next(key for key in POSITION_KEYS if key in document.values["receivers"][name])
