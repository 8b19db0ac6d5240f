"""What receivers say of themselves, and what they were told, in words for people: among the reasons, never a check."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from integrity.assembler import Statuses
from integrity.gnss.frames import ecef_from_geodetic
from integrity.gnss.observations import Floats
from integrity.gnss.receiver_status import Antenna, Jamming, ReceiverStatus, Spoofing
from integrity.monitors.told import Dispute
from integrity.triangle import ReferenceTriangle

STATED_APART_M = 5.0  # beyond what frames and their epochs differ by (some 2 m), and the antenna from its reference point (0.3 m)
FAR_M = 1000.0  # beyond every error of a fix: another site's receiver, another city, or a spoofer

OF_JAMMING = {Jamming.WARNING: "interference", Jamming.CRITICAL: "interference that leaves it no fix"}
OF_SPOOFING = {Spoofing.INDICATED: "spoofing", Spoofing.INDICATED_AGAIN: "spoofing, by several of its detectors"}
OF_ANTENNA = {Antenna.SHORT_CIRCUIT: "a short circuit at its antenna", Antenna.OPEN: "no antenna"}


@lru_cache(maxsize=4)
def remarks(statuses: Statuses, triangle: ReferenceTriangle) -> tuple[str, ...]:
    """One sentence per receiver and complaint, in the order of receivers."""
    place = dict(zip(triangle.names, triangle.pos_ecef_m, strict=True))
    return tuple(remark for receiver, status in statuses for remark in _of(receiver, status, place[receiver]))


def _of(receiver: str, status: ReceiverStatus, surveyed_ecef_m: Floats) -> list[str]:
    said = (
        OF_JAMMING.get(status.jamming or Jamming.NONE_SEEN),
        OF_SPOOFING.get(status.spoofing or Spoofing.NONE_SEEN),
        OF_ANTENNA.get(status.antenna or Antenna.IN_ORDER),
    )
    found = [f"{receiver} reports {words}" for words in said if words]
    if status.virtual:
        found.append(f"{receiver} sends what was computed for a virtual station: there is no antenna")
    if status.stated_ecef_m is not None:
        apart_m = float(np.linalg.norm(np.array(status.stated_ecef_m) - surveyed_ecef_m))
        if not apart_m <= STATED_APART_M:
            found.append(f"{receiver} is said to have its antenna {_far(apart_m)} from its surveyed point")
    if status.fix_ok is False:
        found.append(f"{receiver} reports no fix of its own")
    elif status.fix_ok and status.lat_rad is not None and status.lon_rad is not None and status.height_m is not None:
        distance_m = float(np.linalg.norm(_ecef_m(status.lat_rad, status.lon_rad, status.height_m) - surveyed_ecef_m))
        if not distance_m <= FAR_M:
            found.append(f"{receiver} reports a fix of its own {_far(distance_m)} from its surveyed point")
    return found


def told_apart(disputes: Sequence[Dispute], epoch_ns: int) -> tuple[str, ...]:
    """One sentence on each receiver that was told of satellites otherwise than the others, and on those of whom nobody can be named."""
    alike: dict[tuple[str | None, tuple[str, ...]], list[Dispute]] = {}
    for of in disputes:
        if of.from_ns <= epoch_ns <= of.until_ns:
            alike.setdefault((of.odd, of.receivers), []).append(of)
    return tuple(_apart(of) for of in alike.values())


def _apart(disputes: Sequence[Dispute]) -> str:
    """Of disputes among the same receivers; the widest one is described."""
    widest, satellites = max(disputes, key=lambda of: of.size_m), len({of.satellite for of in disputes})
    size = f"{_far(widest.size_m)} apart, issue{'s' * (len(widest.issues) > 1)} {_and([str(issue) for issue in widest.issues])}"
    if satellites > 1:
        size = f"of {widest.satellite} most: {size}"
    of_what, join = (f"of {widest.satellite}", ":") if satellites == 1 else (f"of {satellites} satellites", ",")
    if widest.odd is None:
        return f"{_and(widest.receivers)} were told different {widest.quantity}s {of_what}{join} {size}"
    another = f"another {widest.quantity}" if satellites == 1 else f"other {widest.quantity}s"
    return f"{widest.odd} was told {another} {of_what} than {_and([r for r in widest.receivers if r != widest.odd])}{join} {size}"


def _and(names: Sequence[str]) -> str:
    return " and ".join(part for part in (", ".join(names[:-1]), names[-1]) if part)


@lru_cache(maxsize=16)
def _ecef_m(lat_rad: float, lon_rad: float, height_m: float) -> Floats:
    """A fix, once: receivers' other words are read ten times as often."""
    pos_ecef_m = ecef_from_geodetic(lat_rad, lon_rad, height_m)
    pos_ecef_m.setflags(write=False)
    return pos_ecef_m


def _far(distance_m: float) -> str:
    if distance_m >= FAR_M:
        return f"{distance_m / 1000.0:.1f} km"
    return f"{distance_m:.1f} m" if distance_m >= 1.0 else f"{distance_m:.2f} m"
