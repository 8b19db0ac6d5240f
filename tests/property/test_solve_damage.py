"""Whatever stands in an observation file, solving it with everything asked for says what it found or why not, and never fails."""

from dataclasses import replace
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.gnss.detection import criteria
from integrity.gnss.observations import ROW_FLOATS, ObservationBlock, build_block, layout_of
from recordings.solve.results import Why
from recordings.solve.sky import Sky, Weights
from recordings.solve.smoothing import Smoother
from recordings.solve.track import Wanted, solved
from tests.unit.imported import EPHEMERIDES, KLOBUCHAR, ROWS

LIMITS = criteria(false_alarm=1e-5, most_excluded=3, confusable=0.85, confusion=1e-3)
WEIGHTS = Weights(a_m=0.9, b_m=0.4, mask_rad=0.17)
SOUND = build_block(("A",), [row.receive_time_ns for row in ROWS["A"]], [[row] for row in ROWS["A"]], layout_of(ROWS["A"]))
SHAPE = SOUND.pseudorange_m.shape
VALUES = st.sampled_from([np.nan, 0.0, -0.0, 1e-300, -1.0, 1e6, 2.5e7, 1e11, -1e11])  # what `build_block` and the readers let through


@st.composite
def damaged(draw: st.DrawFn) -> ObservationBlock:
    arrays: dict[str, Any] = {name: np.array(getattr(SOUND, name)) for name in ROW_FLOATS}
    for _ in range(draw(st.integers(1, 6))):
        name = draw(st.sampled_from(ROW_FLOATS))
        first, last = draw(st.integers(0, SHAPE[0] - 1)), draw(st.integers(1, SHAPE[0]))
        columns = draw(st.lists(st.integers(0, SHAPE[2] - 1), min_size=1, max_size=SHAPE[2]))
        arrays[name][first:last, 0, columns] = draw(VALUES)
    times_ns = SOUND.epoch_ns + draw(st.sampled_from([0, 1, 3 * 3600 * 10**9])) * (np.arange(SHAPE[0]) % draw(st.integers(1, 5)))
    return replace(SOUND, epoch_ns=times_ns, receive_time_ns=times_ns[:, None], **arrays)


@given(damaged(), st.booleans(), st.booleans())
@settings(max_examples=150, deadline=None)
def test_every_epoch_has_a_position_or_a_reason(block: ObservationBlock, tests: bool, smooth: bool) -> None:
    smoother = Smoother(100.0, False, ()) if smooth else None
    wanted = Wanted(LIMITS if tests else None, velocity=True, smoother=smoother, ranges=True)
    (found,) = solved([block], Sky(EPHEMERIDES, KLOBUCHAR), WEIGHTS, None, wanted=wanted)
    np.testing.assert_array_equal(np.isfinite(found.pos_ecef_m).all(axis=1), found.why == Why.SOLVED)
