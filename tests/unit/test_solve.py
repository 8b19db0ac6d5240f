"""A recording solved from end to end: where the simulator put the antenna, whatever the order of epochs and wherever it starts from."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from integrity.gnss.least_squares import Unsolved
from integrity.gnss.observations import ROW_ARRAYS, ObservationBlock
from recordings.rinex.observation import read_blocks
from recordings.solve.results import Track
from recordings.solve.sky import Sky, Weights
from recordings.solve.track import solved
from tests.rinex_text import observation_text
from tests.unit.imported import EPHEMERIDES, KLOBUCHAR, ROWS
from tests.unit.streams import SITE

WEIGHTS = Weights(a_m=0.9, b_m=0.4, mask_rad=float(np.deg2rad(5.0)))
POSITION_ECEF_M = np.array(next(r.position_ecef_m for r in SITE.receivers if r.name == "A"))


def block(tmp_path: Path) -> ObservationBlock:
    path = tmp_path / "A.rnx"
    path.write_text(observation_text(ROWS["A"]), "ascii")
    (found,) = read_blocks(path, "A").blocks
    return found


def track(of: ObservationBlock, start: np.ndarray[tuple[int], np.dtype[np.float64]] | None = POSITION_ECEF_M) -> Track:
    (found,) = solved([of], Sky(EPHEMERIDES, KLOBUCHAR), WEIGHTS, None if start is None else start.tolist())
    return found


def test_positions_are_where_the_antenna_is(tmp_path: Path) -> None:
    found = track(block(tmp_path))
    assert (found.why == Unsolved.SOLVED).all()
    # Errors of the simulated ranges: about 0.6 m, twice that in the position.
    assert np.linalg.norm(found.pos_ecef_m - POSITION_ECEF_M, axis=1).max() < 5.0


@pytest.mark.parametrize("start", [None, POSITION_ECEF_M + 3_000.0, POSITION_ECEF_M * 0.995])
def test_the_start_makes_no_difference_but_for_the_mask(tmp_path: Path, start: np.ndarray[tuple[int], np.dtype[np.float64]] | None) -> None:
    of = block(tmp_path)
    np.testing.assert_allclose(track(of, start).pos_ecef_m, track(of).pos_ecef_m, atol=0.05)


def test_epochs_need_not_be_in_the_order_of_time(tmp_path: Path) -> None:
    of = block(tmp_path)
    order = np.random.default_rng(1).permutation(len(of.epoch_ns))
    names = [name for name in of.__dataclass_fields__ if name not in ("receivers", "signals", "satellites")]
    mixed = replace(of, **{name: getattr(of, name)[order] for name in names})
    np.testing.assert_array_equal(track(mixed).pos_ecef_m, track(of).pos_ecef_m[order])
    np.testing.assert_array_equal(track(mixed).time_ns, of.epoch_ns[order])


def test_of_two_codes_of_a_satellite_the_one_measured_more_often_is_used(tmp_path: Path) -> None:
    of = block(tmp_path)
    twice: dict[str, Any] = {name: np.concatenate([getattr(of, name)] * 2, axis=2) for name in ROW_ARRAYS}
    twice["pseudorange_m"][1:, :, : len(of.signals)] = np.nan  # the preferred one: in the first epoch only
    signals = tuple(s.replace("1C", "1X") for s in of.signals) + of.signals
    both = replace(of, signals=signals, satellites=of.satellites * 2, **twice)
    (found,) = solved([both], Sky(EPHEMERIDES, KLOBUCHAR), WEIGHTS, POSITION_ECEF_M.tolist(), {"G": ("1X", "1C"), "E": ("1X", "1C")})
    np.testing.assert_array_equal(found.n_used, track(of).n_used)


def test_a_block_of_nothing_has_no_positions(tmp_path: Path) -> None:
    of = block(tmp_path)
    blind = replace(of, pseudorange_m=np.full(of.pseudorange_m.shape, np.nan))
    assert (track(blind, start=None).why == Unsolved.TOO_FEW_SATELLITES).all()


def test_no_ephemerides_no_positions(tmp_path: Path) -> None:
    (found,) = solved([block(tmp_path)], Sky((), None), WEIGHTS, None)
    assert np.isnan(found.pos_ecef_m).all()


def test_a_later_ephemeris_serves_where_none_had_come(tmp_path: Path) -> None:
    late = [replace(eph, transmission_ns=eph.transmission_ns + 86_400 * 10**9) for eph in EPHEMERIDES]
    (found,) = solved([block(tmp_path)], Sky(late, KLOBUCHAR), WEIGHTS, POSITION_ECEF_M.tolist())
    assert (found.why == Unsolved.SOLVED).all()


def with_ranges(of: ObservationBlock, pseudorange_m: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> ObservationBlock:
    return replace(of, pseudorange_m=pseudorange_m)


def test_a_start_is_found_after_many_epochs_of_nonsense(tmp_path: Path) -> None:
    of = block(tmp_path)
    ranges = of.pseudorange_m.copy()
    ranges[:15] = np.linspace(1e8, 1e7, ranges.shape[2])
    ranges[:15, :, -1] = np.nan
    assert (track(with_ranges(of, ranges), start=None).why == Unsolved.SOLVED).tolist() == [False] * 15 + [True] * 5


def test_a_start_is_found_from_four_satellites(tmp_path: Path) -> None:
    of = block(tmp_path)
    ranges = np.full(of.pseudorange_m.shape, np.nan)
    gps = [s for s, satellite in enumerate(of.satellites) if satellite[0] == "G"][:4]
    ranges[..., gps] = of.pseudorange_m[..., gps]
    found = track(with_ranges(of, ranges), start=None)
    assert np.linalg.norm(found.pos_ecef_m - POSITION_ECEF_M, axis=1).max() < 50.0


def test_where_no_start_is_found_each_epoch_says_why(tmp_path: Path) -> None:
    """Ranges of nowhere in the even epochs, three satellites in the odd ones."""
    of = block(tmp_path)
    ranges = of.pseudorange_m.copy()
    ranges[::2] = np.linspace(1e7, 1e8, ranges.shape[2])[::-1]
    ranges[1::2, :, 3:] = np.nan
    found = track(with_ranges(of, ranges), start=None)
    assert {*found.why[::2].tolist()} <= {Unsolved.DIVERGED, Unsolved.POOR_GEOMETRY}
    assert (found.why[1::2] == Unsolved.TOO_FEW_SATELLITES).all()


def test_of_several_later_ephemerides_the_next_serves(tmp_path: Path) -> None:
    """Not the last that was sent, whose orbit is worse the longer before its time."""
    epoch_ns = block(tmp_path).epoch_ns
    (mine,) = [eph for eph in EPHEMERIDES if eph.satellite == EPHEMERIDES[0].satellite][:1]
    later = [
        replace(mine, issue=k, transmission_ns=int(epoch_ns[-1]) + k * 600 * 10**9, toe_ns=mine.toe_ns + k * 600 * 10**9) for k in (1, 2, 3)
    ]
    sky = Sky(later, None)
    assert {sky.store.ephemerides[k].issue for k in sky.choose((mine.satellite,), epoch_ns)[:, 0].tolist()} == {1}
