"""Positions of whole blocks against RTKLIB's, epoch by epoch: what `python -m tests.benchmarks.solve` measures, without its times."""

from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from tests.benchmarks import solve


@pytest.fixture(scope="module", params=sorted(solve.SETS))
def comparison(shared_data: Path, rtklib: ModuleType, request: pytest.FixtureRequest) -> dict[str, Any]:
    return solve.run(request.param, repeats=1)


def test_both_use_the_same_satellites_in_every_epoch(comparison: dict[str, Any]) -> None:
    assert comparison["epochs_with_the_same_satellites"] == 1.0


def test_the_95_percent_error_is_at_most_a_twentieth_larger(comparison: dict[str, Any]) -> None:
    assert comparison["ours_p95_3d_m"] <= 1.05 * comparison["peer_p95_3d_m"]
