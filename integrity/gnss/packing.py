"""A block with little in it, packed: over a day a receiver sees three times the satellites that it sees at once.

The columns of a packed block are places: which signal of the whole block stands in one differs from epoch to epoch, its system and code
do not. Satellite states, residuals and solutions are computed for it as for any other block, with the ephemerides of the signals that
stand in the places.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from integrity.gnss.observations import ROW_ARRAYS, ROW_FLAGS, Bools, Ints, ObservationBlock


class Packed(NamedTuple):
    """`block` has as many columns of each system and code as its fullest epoch has signals, each named like one of these signals;
    `column` (E, M): where in the whole block its signals stand, -1 for none."""

    block: ObservationBlock
    column: Ints

    def taken(self, index: Ints) -> Ints:
        """Indices into ephemerides (E, S) of the whole block, -1 for none, for the places (E, M)."""
        result: Ints = np.where(self.column >= 0, np.take_along_axis(index, self.column, axis=1), -1)
        return result


def packed(block: ObservationBlock) -> Packed:
    """The block without what no receiver measured, in as few columns as will do; signals keep their order in each epoch."""
    kinds: dict[str, list[int]] = {}
    for k, signal in enumerate(block.signals):
        kinds.setdefault(signal[0] + signal.partition(".")[2], []).append(k)
    seen: Bools = np.any(np.isfinite(block.pseudorange_m), axis=1)
    placed = [_placed(seen, np.array(columns, dtype=np.int64)) for columns in kinds.values()]
    named = [k for columns, places in zip(kinds.values(), placed, strict=True) for k in columns[: places.shape[1]]]
    column = np.concatenate(placed, axis=1) if placed else np.zeros((len(seen), 0), dtype=np.int64)
    return Packed(_laid_out(block, column, named), column)


def _placed(seen: Bools, columns: Ints) -> Ints:
    """Which of these columns were seen (E, M), each epoch's side by side; -1 for none."""
    here = seen[:, columns]
    count = here.sum(axis=1)
    placed = np.full((len(seen), int(count.max(initial=0))), -1)
    placed[np.arange(placed.shape[1]) < count[:, None]] = np.broadcast_to(columns, here.shape)[here]
    return placed


def _laid_out(block: ObservationBlock, column: Ints, named: list[int]) -> ObservationBlock:
    """The block in places; what is in none reads as not measured: as what is put behind the last measurement."""
    n_epochs, n_receivers, n_signals = block.pseudorange_m.shape
    row = np.arange(n_epochs * n_receivers).reshape(n_epochs, n_receivers, 1) * n_signals
    at = np.where(column[:, None] < 0, block.pseudorange_m.size, row + column[:, None])
    arrays: dict[str, Any] = {name: np.append(getattr(block, name), False if name in ROW_FLAGS else np.nan).take(at) for name in ROW_ARRAYS}
    return replace(
        block,
        signals=tuple(block.signals[k] for k in named),
        satellites=tuple(block.satellites[k] for k in named),
        **arrays,
    )
