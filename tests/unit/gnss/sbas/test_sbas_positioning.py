"""Positions with SBAS from ranges that this file makes: satellites, times of flight and delays worked out one by one, the way the words of
DO-229 go, for a receiver that is not at the point of linearisation. What gLAB makes of real ranges is in the crosschecks."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from integrity.gnss.atmosphere import troposphere_mapping
from integrity.gnss.constants import EARTH_ROTATION_RADPS, SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris.states import satellite_states
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.least_squares import Unsolved
from integrity.gnss.observations import Floats, ObservationBlock
from integrity.gnss.positioning import points_at
from integrity.gnss.sbas.corrections import Corrections, Reason
from integrity.gnss.sbas.positioning import NEAR_M, Positions, corrected, positions
from integrity.gnss.sbas.protection import K_H, along_track_m, protection
from integrity.gnss.sbas.store import NPA, PA
from integrity.gnss.sbas.troposphere import zenith_delay_m
from tests.unit.gnss.sbas import service as made
from tests.unit.gnss.sbas.sent import SITE

POINTS = points_at(np.array([SITE]))
STORE = EphemerisStore(made.gps())
SECONDS = (2.0, 3.0, 4.0)
E_ENU_M = np.array([12.0, -7.0, 20.0])
CLOCK_M = 30.0


@lru_cache(maxsize=1)
def sky() -> Corrections:
    return made.corrected(made.service(), SECONDS)


def range_m(c: Corrections, epoch: int, k: int, pos_ecef_m: Floats) -> float:
    """Pseudorange of one satellite: sent when, from where, by what clock, with the delays of SBAS and DO-229; NaN if it is refused."""
    if not c.used[epoch, k]:
        return float("nan")
    flight_s = 0.075
    for _ in range(4):
        sent_ns = c.t_ns[epoch : epoch + 1] - round(flight_s * NS_PER_S)
        states = satellite_states(STORE.ephemerides, c.index[epoch : epoch + 1, k : k + 1], sent_ns, (f"{c.satellites[k]}.1C",))
        x, y, z = states.pos_ecef_m[:, 0, 0] + c.d_pos_ecef_m[:, epoch, k]
        angle = EARTH_ROTATION_RADPS * flight_s
        turned = np.array([x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle), z])
        distance_m = float(np.linalg.norm(turned - pos_ecef_m))
        flight_s = distance_m / SPEED_OF_LIGHT_MPS
    clock_s = states.clock_s[0, 0] + c.d_clock_s[epoch, k]
    zenith_m = zenith_delay_m(c.t_ns[epoch], POINTS.lat_rad[0, 0], POINTS.height_m[0, 0])
    air_m = zenith_m * troposphere_mapping(c.el_rad[epoch, k]) + c.iono_m[epoch, k]
    return float(distance_m - SPEED_OF_LIGHT_MPS * clock_s + air_m - c.range_m[epoch, k] + CLOCK_M)


def block_of(c: Corrections, signals: tuple[str, ...], pseudorange_m: Floats) -> ObservationBlock:
    """Of ranges (E, R, S)."""
    none, no = np.full(pseudorange_m.shape, np.nan), np.zeros(pseudorange_m.shape, dtype=np.bool_)
    receivers = tuple("ABC"[: pseudorange_m.shape[1]])
    receive_time_ns = np.repeat(c.t_ns[:, None], len(receivers), axis=1)
    satellites = tuple(signal.partition(".")[0] for signal in signals)
    return ObservationBlock(receivers, signals, satellites, c.t_ns, receive_time_ns, pseudorange_m, none, none, none, none, no, no)


def measured(c: Corrections, e_enu_m: Floats = E_ENU_M) -> ObservationBlock:
    """Of a receiver that is displaced from its point; columns in another order than the satellites of the corrections."""
    pos = POINTS.pos_ecef_m[0, 0] + POINTS.enu[0, 0].T @ e_enu_m
    order = range(len(c.satellites))[::-1]
    ranges = np.array([[[range_m(c, epoch, k, pos) for k in order]] for epoch in range(len(c.t_ns))])
    return block_of(c, tuple(f"{c.satellites[k]}.1C" for k in order), ranges)


def solved(block: ObservationBlock, c: Corrections | None = None, mode: int = PA) -> Positions:
    return positions(block, STORE, POINTS, sky() if c is None else c, mode)


def with_ranges(block: ObservationBlock, ranges: Floats) -> ObservationBlock:
    return replace(block, pseudorange_m=ranges)


@pytest.fixture(scope="module")
def block() -> ObservationBlock:
    return measured(sky())


def test_a_position_is_where_the_receiver_was(block: ObservationBlock) -> None:
    assert np.abs(solved(block).solution.e_enu_m - E_ENU_M).max() <= 1e-3


def test_a_clock_is_that_of_the_receiver(block: ObservationBlock) -> None:
    assert np.abs(solved(block).solution.clock_m[..., 0] - CLOCK_M).max() <= 1e-3


@pytest.mark.parametrize(
    ("field", "more", "residual_m"),
    [
        ("range_m", 1.0, 1.0),  # A.4.4.3: a fast correction is added to the pseudorange
        ("iono_m", 1.0, -1.0),  # A.4.4.10.4: the slant delay is subtracted from it
        ("d_clock_s", 1e-9, 0.299792458),  # A.4.4.7: a clock further ahead makes it shorter
    ],
)
def test_signs_are_those_of_do_229(block: ObservationBlock, field: str, more: float, residual_m: float) -> None:
    before, after = (corrected(block, STORE, POINTS, c) for c in (sky(), replace(sky(), **{field: getattr(sky(), field) + more})))
    moved_m = (after.prefit.residual_m - before.prefit.residual_m)[before.used]
    assert np.abs(moved_m - residual_m).max() <= 1e-5


def test_a_satellite_further_away_makes_its_residual_smaller(block: ObservationBlock) -> None:
    up_ecef = POINTS.enu[0, 0, 2]
    c = replace(sky(), d_pos_ecef_m=sky().d_pos_ecef_m + 10.0 * up_ecef[:, None, None])
    before, after = corrected(block, STORE, POINTS, sky()), corrected(block, STORE, POINTS, c)
    moved_m = after.prefit.residual_m + 10.0 * before.prefit.los_enu[2] - before.prefit.residual_m
    assert np.abs(moved_m[before.used]).max() <= 1e-3


def test_the_satellites_used_are_those_that_sbas_accepts(block: ObservationBlock) -> None:
    assert (solved(block).solution.n_used[:, 0] == sky().used.sum(axis=1)).all()


def test_levels_are_of_the_covariance_of_the_solution(block: ObservationBlock) -> None:
    found = solved(block)
    major = np.sqrt(np.linalg.eigvalsh(found.solution.cov_enu_m2[:, 0, :2, :2])[:, -1])
    assert found.levels[0].hpl_m == pytest.approx(K_H[PA] * major, rel=1e-5)


@pytest.mark.parametrize("mode", [PA, NPA])
def test_levels_are_of_exactly_the_satellites_that_were_measured(block: ObservationBlock, mode: int) -> None:
    gone = int(np.flatnonzero(corrected(block, STORE, POINTS, sky()).used[1, 0])[2])
    ranges = np.array(block.pseudorange_m)
    ranges[1, 0, gone] = np.nan
    why = np.array(sky().why)
    why[1, sky().satellites.index(block.satellites[gone])] = Reason.NO_ORBIT
    found, expected = solved(with_ranges(block, ranges), mode=mode).levels[0], protection(replace(sky(), why=why), mode)
    north = np.array([0.0, 1.0, 0.0])
    assert along_track_m(found, north, mode) == pytest.approx(along_track_m(expected, north, mode), rel=1e-12)


def test_each_receiver_has_its_own(block: ObservationBlock) -> None:
    """The second one does not see one of the satellites."""
    gone = int(np.flatnonzero(corrected(block, STORE, POINTS, sky()).used[0, 0])[0])
    ranges = np.repeat(block.pseudorange_m, 2, axis=1)
    ranges[:, 1, gone] = np.nan
    found = positions(block_of(sky(), block.signals, ranges), STORE, points_at(np.array([SITE, SITE])), sky(), PA)
    assert [int(level.n_used[0]) for level in found.levels] == [int(sky().used[0].sum()), int(sky().used[0].sum()) - 1]


def test_with_three_satellites_there_is_no_position_and_no_level(block: ObservationBlock) -> None:
    kept = np.flatnonzero(corrected(block, STORE, POINTS, sky()).used[0, 0])[:3]
    ranges = np.full(block.pseudorange_m.shape, np.nan)
    ranges[..., kept] = block.pseudorange_m[..., kept]
    found = solved(with_ranges(block, ranges))
    reasons = set(found.solution.why.ravel().tolist())
    assert (reasons, bool(np.isnan(found.levels[0].hpl_m).all())) == ({Unsolved.TOO_FEW_SATELLITES}, True)


@pytest.mark.parametrize(("up_m", "known"), [(NEAR_M - 1.0, True), (NEAR_M + 1.0, False)])
def test_a_position_far_from_its_point_has_no_level(up_m: float, known: bool) -> None:
    found = solved(measured(sky(), np.array([0.0, 0.0, up_m])))
    assert (bool(found.solution.solved.all()), bool(np.isfinite(found.levels[0].vpl_m).all())) == (True, known)


def test_signals_that_sbas_does_not_correct_change_nothing(block: ObservationBlock) -> None:
    others = ("E01.1C", *(signal.replace(".1C", ".2W") for signal in block.signals), "S29.1C")
    ranges = np.concatenate((block.pseudorange_m, np.full((*block.pseudorange_m.shape[:2], len(others)), 2.2e7)), axis=2)
    with_others = solved(block_of(sky(), block.signals + others, ranges))
    assert np.abs(with_others.solution.e_enu_m - solved(block).solution.e_enu_m).max() <= 1e-9


def test_without_any_corrected_satellite_there_is_no_position(block: ObservationBlock) -> None:
    found = solved(block_of(sky(), ("E01.1C", "E02.1C"), block.pseudorange_m[..., :2].copy()))
    assert not found.solution.solved.any()


def test_an_epoch_alone_gives_the_same_bits(block: ObservationBlock) -> None:
    together = solved(block)
    c = made.corrected(made.service(), SECONDS[1:2])
    alone = solved(block_of(c, block.signals, block.pseudorange_m[1:2]), c)
    assert np.concatenate((alone.solution.e_enu_m[0, 0], alone.levels[0].hpl_m)).tobytes() == (
        np.append(together.solution.e_enu_m[1, 0], together.levels[0].hpl_m[1]).tobytes()
    )


def test_corrections_of_other_epochs_are_refused(block: ObservationBlock) -> None:
    with pytest.raises(ValueError, match="the same epochs"):
        solved(block, made.corrected(made.service(), (2.0, 3.0, 5.0)))
