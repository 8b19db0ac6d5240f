"""Carrier work: however a stream is cut into blocks, slips and smoothed ranges are the same to the bit."""

from collections.abc import Sequence
from dataclasses import fields, replace
from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.gnss.carrier.slips import Arcs, CarrierMemory, find_slips
from integrity.gnss.carrier.smoothing import Smoothed, SmoothingMemory, smooth
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import ObservationBlock
from tests.unit.gnss.carrier.phases import LIMITS, SIGNALS, part, phases, slipped, wavelengths

EPOCHS = 30
ALL = list(range(len(SIGNALS)))


@st.composite
def streams(draw: st.DrawFn) -> ObservationBlock:
    """Two receivers with slips, flags, missing phases and ranges, gaps in time, signals that come and go."""
    block = phases(EPOCHS, receivers=2, seed=draw(st.integers(0, 1000)))
    for _ in range(draw(st.integers(0, 3))):
        block = slipped(block, draw(st.integers(1, EPOCHS - 1)), draw(st.sampled_from(ALL)), draw(st.sampled_from([-3.0, 1.0, 20.0])))
    rng = np.random.default_rng(draw(st.integers(0, 1000)))
    shape = block.pseudorange_m.shape
    gone = rng.random(shape) < 0.1
    away = np.zeros(shape, dtype=np.bool_)
    for k in draw(st.lists(st.sampled_from(ALL), max_size=4)):
        begin = draw(st.integers(0, EPOCHS))
        away[begin : begin + draw(st.integers(1, 12)), :, k] = True
    jump_ns = np.cumsum(NS_PER_S * rng.choice([0, 0, 0, 0, 3, 20], EPOCHS))[:, None]
    return replace(
        block,
        receive_time_ns=block.receive_time_ns + jump_ns,
        carrier_cycles=np.where(gone | away, np.nan, block.carrier_cycles),
        pseudorange_m=np.where((rng.random(shape) < 0.1) | away, np.nan, block.pseudorange_m),
        slip=(rng.random(shape) < 0.02) & ~away,
    )


def worked(blocks: Sequence[ObservationBlock]) -> tuple[list[Arcs], list[Smoothed]]:
    memory, filters = CarrierMemory.empty(2), SmoothingMemory.empty(2)
    arcs, ranges = [], []
    for block in blocks:
        found, memory = find_slips(block, wavelengths(block), memory, LIMITS)
        phase_m = wavelengths(block)[:, None] * block.carrier_cycles
        smoothed, filters = smooth(block, phase_m, found, np.array([[[0.5]]]), 0.003, 10.0, filters)
        arcs.append(found)
        ranges.append(smoothed)
    return arcs, ranges


@given(streams(), st.lists(st.integers(1, EPOCHS - 1), unique=True, min_size=3), st.booleans())
@settings(max_examples=150, deadline=None)
def test_cutting_changes_nothing(block: ObservationBlock, cuts: list[int], drop_unseen: bool) -> None:
    """Also where a part has no columns for signals that are not in it."""
    (whole_arcs,), (whole_ranges,) = worked([block])
    edges = [0, *sorted(cuts), EPOCHS]
    pieces = [slice(a, b) for a, b in pairwise(edges)]
    seen = np.isfinite(block.carrier_cycles) | np.isfinite(block.pseudorange_m) | block.slip
    columns = [[k for k in ALL if not drop_unseen or seen[piece, :, k].any()] for piece in pieces]
    arcs, ranges = worked([part(block, piece, mine) for piece, mine in zip(pieces, columns, strict=True)])
    for piece, mine, found, smoothed in zip(pieces, columns, arcs, ranges, strict=True):
        for got, want in ((found, whole_arcs), (smoothed, whole_ranges)):
            for name in (f.name for f in fields(got)):
                assert getattr(got, name).tobytes() == getattr(want, name)[piece][..., mine].tobytes(), name
