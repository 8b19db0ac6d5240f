"""Packed blocks: every measurement is there once, in a place of its system and code."""

from collections.abc import Iterable

import numpy as np
import pytest

from integrity.gnss.observations import ROW_ARRAYS, Bools, ObservationBlock, ObservationRow, build_block, layout_of
from integrity.gnss.packing import packed

N_EPOCHS = 50
SIGNALS = tuple(f"{s}{k:02d}.{code}" for s, code in (("E", "1C"), ("E", "7Q"), ("G", "1C")) for k in range(1, 13))


def row(receiver: str, e: int, signals: Iterable[str], rng: np.random.Generator) -> ObservationRow:
    names = tuple(signals)
    a, b, c, d, f = rng.uniform(2e7, 3e7, (5, len(names)))
    return ObservationRow(receiver, e, names, a, b, c, d, f, rng.random(len(names)) < 0.5, rng.random(len(names)) < 0.5)


def sparse(seed: int = 1) -> ObservationBlock:
    """Two receivers that see a third of the signals at a time, each a few that the other does not."""
    rng = np.random.default_rng(seed)
    seen = np.random.default_rng(seed + 1).random((N_EPOCHS, len(SIGNALS))) < 0.3
    rows = [
        [row(r, e, (s for s, here in zip(SIGNALS, seen[e], strict=True) if here and rng.random() < 0.9), rng) for r in "AB"]
        for e in range(N_EPOCHS)
    ]
    codes = {"E": ("1C", "7Q"), "G": ("1C",)}
    return build_block("AB", list(range(N_EPOCHS)), rows, layout_of((r for epoch in rows for r in epoch), codes=codes))


BLOCK = sparse()
PACKED = packed(BLOCK)
SEEN: Bools = np.any(np.isfinite(BLOCK.pseudorange_m), axis=1)


@pytest.mark.parametrize("name", ROW_ARRAYS)
def test_every_signal_stands_in_its_place(name: str) -> None:
    whole, placed = getattr(BLOCK, name), getattr(PACKED.block, name)
    for e, r, m in np.argwhere(np.broadcast_to((PACKED.column >= 0)[:, None], placed.shape)):
        np.testing.assert_array_equal(placed[e, r, m], whole[e, r, PACKED.column[e, m]])


def test_nothing_that_was_measured_is_left_out() -> None:
    assert [sorted(c[c >= 0]) for c in PACKED.column] == [list(np.flatnonzero(here)) for here in SEEN]


def test_places_are_of_one_system_and_code() -> None:
    kind = np.array([s[0] + s[4:] for s in BLOCK.signals])
    place = np.array([s[0] + s[4:] for s in PACKED.block.signals])
    for c in PACKED.column:
        np.testing.assert_array_equal(kind[c[c >= 0]], place[c >= 0])


def test_there_are_no_more_places_than_the_fullest_epoch_needs() -> None:
    kind = np.array([s[0] + s[4:] for s in BLOCK.signals])
    assert PACKED.column.shape[1] == sum(int(SEEN[:, kind == k].sum(axis=1).max()) for k in np.unique(kind))


def test_what_is_empty_was_not_measured() -> None:
    assert np.isnan(PACKED.block.pseudorange_m[np.broadcast_to((PACKED.column < 0)[:, None], PACKED.block.pseudorange_m.shape)]).all()


def test_indices_go_with_their_signals_and_empty_places_have_none() -> None:
    index = np.arange(N_EPOCHS * len(BLOCK.signals)).reshape(N_EPOCHS, -1)
    expected = np.where(PACKED.column >= 0, np.arange(N_EPOCHS)[:, None] * len(BLOCK.signals) + PACKED.column, -1)
    np.testing.assert_array_equal(PACKED.taken(index), expected)
