"""What solving a block of one receiver gives: a position an epoch, and, as far as it was asked for, velocity, tests and every range."""

from collections.abc import Sequence
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from integrity.gnss.gps_time import GPS_EPOCH_UNIX_S, NS_PER_S, format_calendar
from integrity.gnss.least_squares import Unsolved
from integrity.gnss.observations import Bools, Floats, Ints

Names = NDArray[np.str_]
UNCHECKED = 2  # `detection.Finding.UNCHECKED`, whose module takes long to import


class Why(IntEnum):
    """Why there is no position, or SOLVED: the reasons of least squares, and those of the tests."""

    SOLVED = Unsolved.SOLVED
    TOO_FEW_SATELLITES = Unsolved.TOO_FEW_SATELLITES
    POOR_GEOMETRY = Unsolved.POOR_GEOMETRY
    DIVERGED = Unsolved.DIVERGED
    UNEXPLAINED = 4
    AMBIGUOUS = 5
    TOO_MANY = 6
    UNVERIFIED = 7


class Place(IntEnum):
    """What became of a range."""

    USED = 0
    EXCLUDED = 1
    BELOW_MASK = 2
    UNUSABLE = 3  # no ephemeris, or one that says unhealthy or promises nothing; or a group delay that nobody sends


class Motion(NamedTuple):
    """Velocity east, north, up and its standard deviations, (E, 3), and how fast the receiver's clock gains, (E,), m/s; NaN without."""

    v_enu_mps: Floats
    sigma_enu_mps: Floats
    drift_mps: Floats
    drift_sigma_mps: Floats
    n_used: Ints


class Tested(NamedTuple):
    """What the tests of fit said, (E,) each. `finding` holds `detection.Finding`; `excluded` and `suspects` name satellites, with blanks
    between. The statistics are of the last test of the epoch, NaN where there is none, each with its threshold."""

    finding: Ints
    excluded: Names
    suspects: Names
    chi2: Floats
    chi2_limit: Floats
    largest: Floats
    largest_limit: Floats


class Ranges(NamedTuple):
    """Every range of a block: `place` (E, S) holds `Place`, -1 where nothing was measured; the rest is (E, S), NaN where there is none.

    `normalised`: the residual over its standard deviation, of an excluded range over that of its prediction. `moved_enu_m` (3, E, S): the
    position without the satellite less that with it, NaN unless it was used.
    """

    time_ns: Ints
    signals: tuple[str, ...]
    place: Ints
    el_rad: Floats
    az_rad: Floats
    residual_m: Floats
    sigma_m: Floats
    normalised: Floats
    moved_enu_m: Floats


class Track(NamedTuple):
    """Positions in ECEF at the times of the receiver's clock: (E,), (E, 3), (E,), (E,); NaN where `why` says so. What was not asked for
    is None."""

    time_ns: Ints
    pos_ecef_m: Floats
    n_used: Ints
    why: Ints  # `Why`
    motion: Motion | None = None
    tested: Tested | None = None
    ranges: Ranges | None = None  # of one block: never joined

    @property
    def solved(self) -> Bools:
        """Where there is a position, (E,)."""
        result: Bools = self.why == Why.SOLVED
        return result


def joined(tracks: Sequence[Track]) -> Track:
    """Tracks of the same make one after the other, without their ranges."""
    return Track(*map(_joined, zip(*(track[:-1] for track in tracks), strict=True)))


def taken(track: Track, epochs: Ints) -> Track:
    """Some epochs of a track, without its ranges."""
    return Track(*(_taken(part, epochs) for part in track[:-1]))


def _joined(parts: Sequence[Any]) -> Any:
    first = parts[0]
    if isinstance(first, tuple):
        return type(first)(*map(_joined, zip(*parts, strict=True)))
    return None if first is None else np.concatenate(parts)


def _taken(part: Any, epochs: Ints) -> Any:
    if isinstance(part, tuple):
        return type(part)(*(_taken(inner, epochs) for inner in part))
    return None if part is None else part[epochs]


def nothing_found(time_ns: Ints, why: Ints, velocity: bool, tests: bool) -> Track:
    """Epochs without a position."""
    n = len(time_ns)
    none, triple, no_names = np.full(n, np.nan), np.full((n, 3), np.nan), np.full(n, "")
    zero = np.zeros(n, dtype=np.int64)
    motion = Motion(triple, triple, none, none, zero) if velocity else None
    tested = Tested(np.full(n, UNCHECKED), no_names, no_names, none, none, none, none) if tests else None
    return Track(time_ns, triple, zero, why, motion, tested)


def written_time(gps_ns: int) -> str:
    """GPS time on its own scale, so without Z."""
    return format_calendar(gps_ns + GPS_EPOCH_UNIX_S * NS_PER_S)
