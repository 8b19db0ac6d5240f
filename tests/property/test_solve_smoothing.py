"""Smoothing of a recording: however it is cut into blocks, ranges and what is left of their noise are the same to the bit."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import ObservationBlock
from integrity.gnss.range_errors import Quality
from recordings.solve.smoothing import Smoother
from tests.unit.gnss.carrier.phases import SIGNALS, edited, part, phases, slipped

EPOCHS = 30
ALL = list(range(len(SIGNALS)))


@st.composite
def streams(draw: st.DrawFn) -> ObservationBlock:
    """One receiver with slips, missing phases and ranges, gaps in time, signals that come and go, a clock that jumps in the code alone."""
    block = phases(EPOCHS, seed=draw(st.integers(0, 1000)))
    for _ in range(draw(st.integers(0, 3))):
        block = slipped(block, draw(st.integers(1, EPOCHS - 1)), draw(st.sampled_from(ALL)), draw(st.sampled_from([-3.0, 1.0, 200.0])))
    rng = np.random.default_rng(draw(st.integers(0, 1000)))
    shape = block.pseudorange_m.shape
    away = np.zeros(shape, dtype=np.bool_)
    for k in draw(st.lists(st.sampled_from(ALL), max_size=4)):
        begin = draw(st.integers(0, EPOCHS))
        away[begin : begin + draw(st.integers(1, 12)), :, k] = True
    jump_ns = np.cumsum(NS_PER_S * rng.choice([0, 0, 0, 0, 3, 90], EPOCHS))[:, None]
    block = edited(block, "receive_time_ns", ..., block.receive_time_ns + jump_ns)
    block = edited(block, "carrier_cycles", (rng.random(shape) < 0.1) | away, np.nan)
    block = edited(block, "pseudorange_m", (rng.random(shape) < 0.1) | away, np.nan)
    if draw(st.booleans()):
        later = slice(draw(st.integers(1, EPOCHS - 1)), None)
        block = edited(block, "pseudorange_m", later, block.pseudorange_m[later] + 299_792.458)
    return edited(block, "slip", (rng.random(shape) < 0.02) & ~away, True)


def smoothed(blocks: Sequence[ObservationBlock], pairs: bool) -> list[tuple[ObservationBlock, Quality]]:
    smoother = Smoother(10.0, pairs, ())
    return [smoother.smoothed(block) for block in blocks]


@given(streams(), st.lists(st.integers(1, EPOCHS - 1), unique=True, min_size=3), st.booleans(), st.booleans())
@settings(max_examples=150, deadline=None)
def test_cutting_changes_nothing(block: ObservationBlock, cuts: list[int], drop_unseen: bool, pairs: bool) -> None:
    """Also where a part has no columns for signals that are not in it."""
    ((whole, whole_quality),) = smoothed([block], pairs)
    pieces = [slice(a, b) for a, b in pairwise([0, *sorted(cuts), EPOCHS])]
    seen = np.isfinite(block.carrier_cycles) | np.isfinite(block.pseudorange_m) | block.slip
    columns = [[k for k in ALL if not drop_unseen or seen[piece, :, k].any()] for piece in pieces]
    found = smoothed([part(block, piece, mine) for piece, mine in zip(pieces, columns, strict=True)], pairs)
    for piece, (got, quality) in zip(pieces, found, strict=True):
        mine = [whole.signals.index(signal) for signal in got.signals]
        assert got.pseudorange_m.tobytes() == whole.pseudorange_m[piece][..., mine].tobytes()
        for name in Quality._fields:
            assert getattr(quality, name).tobytes() == getattr(whole_quality, name)[piece][..., mine].tobytes(), name


@given(streams(), st.booleans())
@settings(max_examples=100, deadline=None)
def test_a_range_stays_where_there_was_one_and_near_it(block: ObservationBlock, pairs: bool) -> None:
    """Within the 30 m that begin another filter."""
    ((after, _),) = smoothed([block], pairs)
    ((before, _),) = smoothed([edited(block, "carrier_cycles", ..., np.nan)], pairs)
    np.testing.assert_array_equal(np.isfinite(after.pseudorange_m), np.isfinite(before.pseudorange_m))
    assert np.nanmax(np.abs(after.pseudorange_m - before.pseudorange_m), initial=0.0) <= 30.0


@given(streams(), st.booleans())
@settings(max_examples=100, deadline=None)
def test_smoothing_never_adds_noise(block: ObservationBlock, pairs: bool) -> None:
    ((_, quality),) = smoothed([block], pairs)
    assert ((quality.noise_share > 0.0) & (quality.noise_share <= 1.0)).all()
