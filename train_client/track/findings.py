"""What a check of a map found."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from integrity.gnss.observations import Bools, Floats


@dataclass(frozen=True)
class Finding:
    """`place` is the id of an edge or a node, `s_m` where on the edge; `value` was held against `threshold`, both in `unit`.

    An error forbids to run trains on the map, a warning does not. `message` says what was found, what would be right, what to do.
    """

    error: bool
    check: str
    place: str
    s_m: float | None
    value: float | None
    threshold: float | None
    unit: str
    message: str

    def __str__(self) -> str:
        where = self.place if self.s_m is None else f"{self.place} at {self.s_m:.1f} m"
        return f"{where}: {self.check}: {self.message}"


class Run(NamedTuple):
    """Neighbouring elements that are all bad: the worst of them, the first, the last."""

    worst: int
    first: int
    last: int

    @property
    def more(self) -> str:
        """How many there are, where it is more than one."""
        n = self.last - self.first + 1
        return f" (the worst of {n} in a row)" if n > 1 else ""


def runs(bad: Bools, severity: Floats) -> Iterator[Run]:
    """The runs of bad elements (n,), each with its most severe one: a curve that is wrong is one finding, not a hundred."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], bad, [False])).astype(np.int8)))
    for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        yield Run(first + int(np.argmax(severity[first:end])), first, end - 1)
