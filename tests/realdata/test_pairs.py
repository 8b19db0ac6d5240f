"""Four real triangles decided on L1 and L2 together, without any terms of the ionosphere and with the sigmas that a site has by default.

GPS alone, semi-codeless P(Y) on L2 (2W), 2010.
"""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from integrity.events import IonosphereReceived
from integrity.outputs import EpochReport
from integrity.states import State
from recordings.replay import decide
from recordings.summary import decisions_sha256, receivers
from tests.realdata.catalonia import TRIPLES, imported, site

# Horizontal and vertical rms of each receiver against the header, good to 0.2 m: on L1 1.2 and 2.6 m at the roof, a half of it noise, of
# which pairs have three times as much.
H_RMS_M, V_RMS_M = 3.0, 3.5


@cache
def decided(data: Path, name: str, block_epochs: int = 1000, frequencies: int = 2) -> list[EpochReport]:
    triple = TRIPLES[name]
    sigma_differential_m = 1.5 if frequencies == 2 else 0.5  # their defaults; the sites of the other tests state one
    site_file = site(data, triple, frequencies=frequencies, sigma_differential_m=sigma_differential_m)
    events = [event for event in imported(data, triple, site_file).events if not isinstance(event, IonosphereReceived)]
    outputs, _ = decide(site_file, events, block_epochs=block_epochs)
    return [o for o in outputs if isinstance(o, EpochReport)]


def up_m(reports: list[EpochReport]) -> float:
    """Mean of all receivers and epochs."""
    return float(np.nanmean([r.e_enu_m[:, 2] for r in reports]))


@pytest.mark.parametrize("name", TRIPLES)
def test_every_epoch_after_start_up_is_normal(shared_data: Path, name: str) -> None:
    reports = decided(shared_data, name)
    assert len(reports) == TRIPLES[name].epochs
    assert {r.state for r in reports[1:]} == {State.NORMAL}


@pytest.mark.parametrize("name", TRIPLES)
def test_errors_of_each_receiver(shared_data: Path, name: str) -> None:
    for result in receivers(decided(shared_data, name), "ABC").values():
        assert result["solved"] >= 0.995 * TRIPLES[name].epochs
        assert result["h_rms_m"] <= H_RMS_M
        assert result["v_rms_m"] <= V_RMS_M


@pytest.mark.parametrize("name", ["ceg", "cmg", "meg"])
def test_the_ionosphere_lifts_one_frequency_and_not_pairs(shared_data: Path, name: str) -> None:
    """Twelve hours of a year of little sun; headers are good to 0.2 m, zenith delays of the troposphere to 0.1 m, 0.3 m of height."""
    of_pairs, of_l1 = up_m(decided(shared_data, name)), up_m(decided(shared_data, name, frequencies=1))
    assert abs(of_pairs) <= 0.6
    assert of_l1 >= of_pairs + 1.0


@pytest.mark.parametrize("name", TRIPLES)
def test_decisions_do_not_depend_on_how_the_stream_is_cut(shared_data: Path, name: str) -> None:
    assert len({decisions_sha256(decided(shared_data, name, block_epochs)) for block_epochs in (1, 7, 1000)}) == 1
