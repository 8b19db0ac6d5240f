"""Four real triangles, decided: NORMAL throughout, every receiver solved, errors as small as the acceptance checks ask."""

from pathlib import Path

import pytest

from integrity.outputs import EpochReport
from integrity.states import Cause, State
from recordings.replay import decide
from recordings.summary import decisions_sha256, receivers
from tests.realdata.catalonia import TRIPLES, imported, site


def decided(data: Path, name: str, block_epochs: int = 1000, **integrity: object) -> list[EpochReport]:
    triple = TRIPLES[name]
    site_file = site(data, triple, **integrity)
    outputs, _ = decide(site_file, imported(data, triple, site_file).events, block_epochs=block_epochs)
    return [o for o in outputs if isinstance(o, EpochReport)]


@pytest.mark.parametrize("name", TRIPLES)
def test_every_epoch_after_start_up_is_normal(shared_data: Path, name: str) -> None:
    reports = decided(shared_data, name)
    assert len(reports) == TRIPLES[name].epochs
    assert reports[0].cause is Cause.NOT_READY
    assert {r.state for r in reports[1:]} == {State.NORMAL}


@pytest.mark.parametrize("name", TRIPLES)
def test_errors_of_each_receiver(shared_data: Path, name: str) -> None:
    triple = TRIPLES[name]
    for result in receivers(decided(shared_data, name), "ABC").values():
        assert result["solved"] >= 0.995 * triple.epochs
        assert result["h_rms_m"] <= triple.h_rms_m
        assert result["v_rms_m"] <= triple.v_rms_m


@pytest.mark.parametrize("name", TRIPLES)
def test_decisions_do_not_depend_on_how_the_stream_is_cut(shared_data: Path, name: str) -> None:
    assert len({decisions_sha256(decided(shared_data, name, block_epochs)) for block_epochs in (1, 7, 1000)}) == 1


@pytest.mark.parametrize("name", TRIPLES)
def test_the_triangle_alone_would_have_said_the_same(shared_data: Path, name: str) -> None:
    assert {r.state for r in decided(shared_data, name, rule="triangle")[1:]} == {State.NORMAL}
