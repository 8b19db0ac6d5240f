"""Exclusion in real ranges: a day of one station and a quarter of an hour of another, single frequency, a fault on the highest satellite.

The sigmas are those of the site defaults; every epoch is 30 s (ESBC00DNK) or 1 s (SEPT078M) from the next.
"""

from pathlib import Path

import numpy as np
import pytest

from integrity.gnss.detection import Finding
from tests.benchmarks.exclusion import check_all, highest_of
from tests.benchmarks.solve import SETS, Problem, problem_of, unpacked


@pytest.fixture(scope="module", params=sorted(SETS))
def problem(shared_data: Path, request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Problem:
    of = SETS[request.param]
    return problem_of(*unpacked(of, tmp_path_factory.mktemp("rinex")), of.truth_ecef_m)


def test_without_a_fault_every_epoch_passes(problem: Problem) -> None:
    assert all((checked.finding == Finding.PASSED).all() for _, checked in check_all(problem, 0.0))


@pytest.mark.parametrize("fault_m", [100.0, 30.0, -30.0])
def test_the_faulty_satellite_goes_in_every_epoch_and_no_other(problem: Problem, fault_m: float) -> None:
    for sky, checked in check_all(problem, fault_m):
        np.testing.assert_array_equal(checked.excluded, highest_of(sky))
