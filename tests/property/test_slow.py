"""Slow shifts: however a stream is cut into blocks, what is remembered and shown is the same to the bit."""

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from integrity.gnss.gps_time import NS_PER_S
from integrity.monitors.slow import SlowMemory, advance, slow_design

EPOCHS = 40
DESIGN = slow_design(0.5, 1.0, 0.1, 31_557_600.0, 1.0, 30.0)


@given(st.integers(0, 1000), st.lists(st.integers(1, EPOCHS - 1), max_size=6, unique=True))
def test_cuts_change_nothing(seed: int, cuts: list[int]) -> None:
    rng = np.random.default_rng(seed)
    e_enu_m = np.where(rng.random((EPOCHS, 3, 1)) < 0.05, np.nan, 3.0 * rng.standard_normal((EPOCHS, 3, 3)))
    variances = rng.uniform(0.2, 2.0, (EPOCHS, 3))
    epoch_ns = np.cumsum(rng.choice([1, 1, 1, 2, 30, 700], EPOCHS)) * NS_PER_S
    whole, shown = advance(SlowMemory.empty(3), epoch_ns, e_enu_m, variances, DESIGN)

    memory, own, pair = SlowMemory.empty(3), [], []
    edges = [0, *sorted(cuts), EPOCHS]
    for first, end in pairwise(edges):
        memory, part = advance(memory, epoch_ns[first:end], e_enu_m[first:end], variances[first:end], DESIGN)
        own.append(part.own)
        pair.append(part.pair)
    assert memory.cusum.tobytes() + memory.u.tobytes() == whole.cusum.tobytes() + whole.u.tobytes()
    assert np.concatenate(own).tobytes() + np.concatenate(pair).tobytes() == shown.own.tobytes() + shown.pair.tobytes()
