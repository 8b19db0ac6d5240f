"""Carrier monitors: however a stream is cut into blocks, their statistics are the same to the bit; and what must not matter does not."""

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.gnss.gps_time import NS_PER_S
from integrity.monitors import carrier_motion, divergence
from integrity.monitors.carrier_motion import MotionInputs, MotionMemory
from integrity.monitors.divergence import DivergenceInputs, DivergenceMemory
from tests.unit.carriers import CLOSE, made, moving, part

EPOCHS = 40
H = 4
RECEIVERS = 2


class Story(NamedTuple):
    """What happens in a stream, as few numbers: a failing example is then readable."""

    noise: int
    misfortune: int
    missing: float
    slips: float

    def told(self) -> tuple[MotionInputs, DivergenceInputs]:
        """Slips, missing measurements, gaps, other ephemerides, jumps of clocks and of single signals."""
        motion, apart = made(EPOCHS, RECEIVERS, (4, 3, 2), seed=self.noise)
        rng = np.random.default_rng(self.misfortune)
        shape = motion.residual_m.shape
        gone = rng.random(shape) < self.missing
        continues = rng.random(shape) >= self.slips
        jump_m = np.where(rng.random((EPOCHS, shape[2])) < 0.03, rng.choice([np.nan, 1.5, -0.7], (EPOCHS, shape[2])), 0.0)
        epoch_ns = motion.epoch_ns + np.cumsum(rng.choice([0, 0, 0, 0, 0, 1, 100], EPOCHS)) * NS_PER_S
        off_m = np.cumsum(np.where(rng.random(shape) < 0.01, rng.choice([0.2, -3.0, 1e6], shape), 0.0), axis=0)
        jumped_m = np.cumsum(np.where(rng.random((EPOCHS, RECEIVERS, 1)) < 0.05, 299_792.458, 0.0), axis=0)
        residual_m = np.where(gone, np.nan, motion.residual_m + off_m + jumped_m)
        c_m = np.where(gone, np.nan, apart.code_minus_carrier_m - off_m + jumped_m)
        return (
            motion._replace(residual_m=residual_m, continues=continues, jump_m=jump_m, epoch_ns=epoch_ns),
            apart._replace(code_minus_carrier_m=c_m, continues=continues, epoch_ns=epoch_ns),
        )


seeds = st.integers(0, 1000)
stories = st.builds(Story, seeds, seeds, st.sampled_from([0.0, 0.05]), st.sampled_from([0.0, 0.02]))


def statistics(motion: list[MotionInputs], apart: list[DivergenceInputs]) -> list[tuple[Any, ...]]:
    moved, close = MotionMemory.empty(RECEIVERS, H), DivergenceMemory.empty(RECEIVERS)
    found: list[tuple[Any, ...]] = []
    for a, b in zip(motion, apart, strict=True):
        moved, of_motion = carrier_motion.advance(moved, a, moving(H))
        close, of_divergence = divergence.advance(close, b, CLOSE._replace(warm_up_s=5.0))
        found.append((of_motion.step, of_motion.ramp, of_motion.acceleration, of_divergence.innovation, of_divergence.divergence))
    return found


@given(stories, st.lists(st.integers(1, EPOCHS - 1), unique=True, max_size=8))
@settings(max_examples=150, deadline=None)
def test_cutting_changes_nothing(story: Story, cuts: list[int]) -> None:
    motion, apart = story.told()
    (whole,) = statistics([motion], [apart])
    pieces = [slice(a, b) for a, b in pairwise([0, *sorted(cuts), EPOCHS])]
    found = statistics([part(motion, piece) for piece in pieces], [part(apart, piece) for piece in pieces])
    for piece, got in zip(pieces, found, strict=True):
        for one, all_of_it in zip(got, whole, strict=True):
            assert one.tobytes() == all_of_it[piece].tobytes()


def widened(inputs: Any, after: list[int]) -> Any:
    """The same with signals that are never measured, each after one that is, of its constellation."""
    n = len(inputs.signals)
    order = sorted([*range(n), *(n + i for i in after)], key=lambda i: (i % n, i))
    source = [i % n for i in order]
    arrays = {name: v[..., source] for name, v in inputs._asdict().items() if name not in ("signals", "epoch_ns", "nature")}
    for name in ("residual_m", "code_minus_carrier_m"):
        if name in arrays:
            arrays[name] = np.where(np.array(order) < n, arrays[name], np.nan)
    nature = type(inputs.nature)(*(v[..., source] for v in inputs.nature))
    signals = tuple(inputs.signals[i] if i < n else f"new {i}" for i in order)
    return inputs._replace(signals=signals, nature=nature, **arrays)


@given(stories, st.integers(1, EPOCHS - 1), st.lists(st.integers(0, 8), unique=True))
@settings(max_examples=100, deadline=None)
def test_signals_that_are_not_seen_change_no_bit(story: Story, cut: int, after: list[int]) -> None:
    """Listed from the second block on: a block lists what any of its epochs has."""
    motion, apart = story.told()
    begin, end = slice(0, cut), slice(cut, EPOCHS)
    whole = statistics([part(motion, begin), part(motion, end)], [part(apart, begin), part(apart, end)])
    more = widened(part(motion, end), after), widened(part(apart, end), after)
    found = statistics([part(motion, begin), more[0]], [part(apart, begin), more[1]])
    back = [more[0].signals.index(signal) for signal in motion.signals]
    for want, got in zip(whole[1], found[1], strict=True):
        assert got[..., back].tobytes() == want.tobytes()


@given(stories, st.integers(0, 1000))
@settings(max_examples=50, deadline=None)
def test_clocks_of_receivers_move_nothing(story: Story, seed: int) -> None:
    motion, apart = story.told()
    clock_m = np.random.default_rng(seed).normal(0.0, 1e4, (EPOCHS, RECEIVERS, 1))
    before = statistics([motion], [apart])[0]
    after = statistics([motion._replace(residual_m=motion.residual_m + clock_m)], [apart])[0]
    for name, a, b in zip(("step", "ramp", "acceleration"), before, after, strict=False):
        np.testing.assert_allclose(b, a, rtol=1e-6, atol=1e-5, err_msg=name)
