"""What carriers show of satellites, through the station's own sight of real receivers, with the broadcast ionosphere: nothing."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from integrity.carrier_thresholds import CARRIER_CHECKS
from integrity.gnss.gps_time import NS_PER_S
from integrity.sight import Sight
from tests.realdata.catalonia import TRIPLES, imported, site
from tests.unit.watched_carriers import Shown, sights_of, watched

MOST_SIGMAS = 4.0  # thresholds are above 6


@cache
def seen(data: Path, name: str) -> tuple[list[Sight], Shown]:
    of = site(data, TRIPLES[name])
    sights = sights_of(of.config, imported(data, TRIPLES[name], of).events)
    return sights, watched(of.config, sights)


@pytest.mark.parametrize("name", TRIPLES)
@pytest.mark.parametrize("check", CARRIER_CHECKS)
def test_without_a_fault_all_is_quiet(shared_data: Path, name: str, check: str) -> None:
    _, shown = seen(shared_data, name)
    assert sum(np.isfinite(of).sum() for of in shown.signals[check].values()) > 900
    assert shown.worst(check) <= MOST_SIGMAS


def test_new_sets_begin_to_serve_meanwhile(shared_data: Path) -> None:
    """What is quiet has seen them change, on satellites in view: every two hours."""
    sights, _ = seen(shared_data, "ceg")
    changed = [(sight.sky.index[1:] != sight.sky.index[:-1]) & sight.sky.in_view[1:] & sight.sky.in_view[:-1] for sight in sights]
    assert sum(int(of.sum()) for of in changed) > 20


def test_cutting_at_every_hour_changes_no_bit(shared_data: Path) -> None:
    of = site(shared_data, TRIPLES["ceg"])
    hourly = sights_of(
        of.config, imported(shared_data, TRIPLES["ceg"], of).events, range(0, 1440, 3600 * NS_PER_S // of.config.epoch_interval_ns)
    )
    whole, cut = seen(shared_data, "ceg")[1].signals, watched(of.config, hourly).signals
    for check in CARRIER_CHECKS:
        for signal, statistic in whole[check].items():
            np.testing.assert_array_equal(cut[check][signal], statistic)
