"""The rows of the table in `exclusion` that are not of residuals: what monitors watch of satellites, and constellations by themselves."""

from dataclasses import replace

import numpy as np
import pytest

from integrity.exclusion import Exclusion, Table, Walk, walk
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats
from integrity.satellites import SatelliteInputs, Watched
from tests.unit.gnss.skies import made_sky
from tests.unit.test_exclusion import LIMITS, RECEIVERS, SATELLITES, SYSTEM_OF, N, inputs_of, sky, with_fault

OF_SATELLITES = made_sky(7, (8, 4), epochs=1, receivers=1).los_enu
FRAME_M = np.array([15.0, -20.0, 30.0])
LIMIT = 5.0


def of(inputs: SatelliteInputs, table: Table | None = None, start_s: int = 0) -> Walk:
    epoch_ns = NS_PER_S * (start_s + np.arange(len(inputs.prefit_m)))
    return walk(table or {}, inputs, inputs.statistics(inputs.screened), RECEIVERS, SATELLITES, epoch_ns, LIMITS)


def watched(check: str, statistics: dict[str, float], epochs: int = 1, on: slice = slice(None)) -> SatelliteInputs:
    """Sound ranges, of which a monitor says this in some epochs, and nothing of the other satellites."""
    statistic = np.full((epochs, N), np.nan)
    for satellite, value in statistics.items():
        statistic[on, SATELLITES.index(satellite)] = value
    return inputs_of(sky(epochs))._replace(watched=(Watched(check, statistic, LIMIT),))


def test_what_is_watched_takes_its_satellite_out() -> None:
    out = of(watched("step", {"G03": 7.0})).table["G03"]
    assert (out.check, out.statistic, out.threshold) == ("step", 7.0, LIMIT)


def test_where_everything_may_have_moved_nobody_is_named() -> None:
    inputs = watched("step", {"G03": 7.0})
    of_step = inputs.watched[0]._replace(names=np.array([False]), everything=np.array([True]))
    assert not of(inputs._replace(watched=(of_step,))).table


def test_where_nothing_else_explains_it_satellites_are_named() -> None:
    inputs = watched("step", {"G03": 7.0})
    of_step = inputs.watched[0]._replace(names=np.array([True]), everything=np.array([False]))
    assert "G03" in of(inputs._replace(watched=(of_step,))).table


@pytest.mark.parametrize("receiver", range(3))
def test_a_satellite_that_receivers_measure_differently_is_not_named(receiver: int) -> None:
    inputs = watched("step", {"G03": 7.0})
    assert not of(inputs._replace(prefit_m=with_fault("G03", 30.0, (receiver,)))).table


def test_at_its_threshold_it_passes() -> None:
    assert not of(watched("step", {"G03": LIMIT})).table


def test_what_says_nothing_takes_nobody_out() -> None:
    assert not of(watched("step", {})).table


def test_the_one_that_fails_by_most_is_the_reason() -> None:
    inputs = watched("step", {"G03": 6.0})
    inputs = inputs._replace(watched=(*inputs.watched, *watched("ephemeris", {"G03": 60.0}).watched))
    assert of(inputs).table["G03"].check == "ephemeris"


def test_too_many_at_once_are_no_fault_of_satellites() -> None:
    many = dict.fromkeys(SATELLITES[: LIMITS.max_exclusions_per_epoch + 1], 9.0)
    assert not of(watched("step", many)).table


def test_nothing_goes_out_where_too_few_would_remain() -> None:
    inputs = watched("step", {"G03": 9.0})
    few = np.isin(SATELLITES, SATELLITES[: LIMITS.min_common_satellites])[None]
    assert not of(inputs._replace(screened=few)).table


def test_a_range_that_fails_too_goes_out_with_it() -> None:
    inputs = watched("step", {"G03": 9.0})._replace(prefit_m=with_fault("E02", 30.0))
    assert {x.check for x in of(inputs).table.values()} == {"step", "residual"}


def test_it_is_not_clean_while_what_is_watched_fails() -> None:
    out = of(watched("ephemeris", {"G03": 9.0})).table
    assert set(of(watched("ephemeris", {"G03": 9.0}, epochs=20), out, start_s=1).table) == {"G03"}


def test_it_comes_back_once_what_is_watched_has_passed_for_long_enough() -> None:
    out = of(watched("ephemeris", {"G03": 9.0})).table
    assert not of(watched("ephemeris", {"G03": 1.0}, epochs=20), out, start_s=1).table


def test_cutting_a_block_changes_nothing() -> None:
    whole = watched("step", {"G03": 9.0}, epochs=12, on=slice(3, 5))
    table: Table = {}
    for e in range(12):
        table = of(whole.epoch(e), table, start_s=e).table
    assert table == of(whole).table


def frame(system: int, size: float = 1.0, epochs: int = 1) -> SatelliteInputs:
    """All orbits of a constellation off by one vector."""
    towards = np.broadcast_to(OF_SATELLITES, (3, epochs, len(RECEIVERS), N))
    along_m: Floats = size * (np.ascontiguousarray(towards) * FRAME_M[:, None, None, None]).sum(axis=0)
    prefit_m = sky(epochs) + np.where(system == SYSTEM_OF, along_m, 0.0)
    return inputs_of(prefit_m)._replace(los_enu=np.ascontiguousarray(towards), common_m2=np.ones(3), mean_m2=np.ones(3))


@pytest.mark.parametrize("system", [0, 1])
def test_a_displaced_constellation_goes_out_as_a_whole(system: int) -> None:
    mine = {s for s, k in zip(SATELLITES, SYSTEM_OF.tolist(), strict=True) if k == system}
    enough = replace(LIMITS, min_common_satellites=4)
    inputs = frame(system)
    walked = walk({}, inputs, inputs.statistics(inputs.screened), RECEIVERS, SATELLITES, np.array([0]), enough)
    assert set(walked.table) == mine


def test_it_goes_out_by_the_check_of_constellations() -> None:
    assert {x.check for x in of(frame(1)).table.values()} == {"constellation"}


def test_a_constellation_is_not_taken_out_where_too_few_would_remain() -> None:
    assert not of(frame(0)).table  # four of the other one


def test_it_stays_out_while_its_frame_is_off() -> None:
    out = of(frame(1)).table
    assert len(of(frame(1, epochs=20), out, start_s=1).table) == 4


def test_it_comes_back_once_its_frame_is_right() -> None:
    out = of(frame(1)).table
    assert not of(frame(1, size=0.0, epochs=20), out, start_s=1).table


def test_a_fault_of_one_satellite_is_not_one_of_its_constellation() -> None:
    inputs = frame(1, size=0.0)._replace(prefit_m=with_fault("E02", 60.0))
    assert {s: x.check for s, x in of(inputs).table.items()} == {"E02": "residual"}


@pytest.mark.parametrize("receiver", range(3))
def test_a_constellation_that_one_receiver_measures_differently_is_not_at_fault(receiver: int) -> None:
    sound, displaced = frame(1, size=0.0), frame(1, size=3.0)
    prefit_m = np.array(sound.prefit_m)
    prefit_m[:, receiver] = displaced.prefit_m[:, receiver]
    assert not of(displaced._replace(prefit_m=prefit_m)).table


# ---- how long a satellite that moved stays out

OUT_BY_STEP: Table = {"G03": Exclusion("G03", 0, "step", 2000.0, 6.6)}
CLEAN_EPOCHS = LIMITS.recover_after_ns // NS_PER_S + 2  # as long as any other one is out


def after_clean_epochs(table: Table, screened: Bools, epochs: int = CLEAN_EPOCHS) -> Table:
    inputs = inputs_of(sky(epochs))._replace(screened=np.broadcast_to(screened, (epochs, N)))
    return of(inputs, table, start_s=1).table


def test_it_stays_out_where_many_others_are_there() -> None:
    assert "G03" in after_clean_epochs(OUT_BY_STEP, np.ones((1, N), dtype=np.bool_))


def test_any_other_one_is_back_by_then() -> None:
    by_residual = {"G03": replace(OUT_BY_STEP["G03"], check="residual")}
    assert not after_clean_epochs(by_residual, np.ones((1, N), dtype=np.bool_))


FEW = np.isin(SATELLITES, ["G03", "G05", "G06", "G07", "G08"])[None]


def test_where_positions_are_much_weaker_without_it_it_comes_back_like_any_other_one() -> None:
    assert not after_clean_epochs(OUT_BY_STEP, FEW)


def test_there_too_not_before() -> None:
    assert "G03" in after_clean_epochs(OUT_BY_STEP, FEW, CLEAN_EPOCHS - 2)


@pytest.mark.parametrize("screened", [np.ones((1, N), dtype=np.bool_), FEW])
def test_epoch_by_epoch_it_is_the_same(screened: Bools) -> None:
    table = OUT_BY_STEP
    for e in range(CLEAN_EPOCHS):
        inputs = inputs_of(sky(1))._replace(screened=screened)
        table = of(inputs, table, start_s=1 + e).table
    assert table == after_clean_epochs(OUT_BY_STEP, screened)
