"""Every row of the table in `exclusion`, on ranges without noise: faults of known size at known places."""

from dataclasses import replace

import numpy as np
import pytest

from integrity.exclusion import Exclusion, Table, Walk, walk, without_channels
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats
from integrity.satellites import SatelliteInputs, Watched
from tests.unit.gnss.skies import made_sky
from tests.unit.streams import LIMITS as SITE_LIMITS

LIMITS = replace(SITE_LIMITS, recover_epochs=3, recover_after_ns=4 * NS_PER_S)
SATELLITES = ("G01", "G02", "G03", "G04", "G05", "G06", "G07", "G08", "E01", "E02", "E03", "E04")
SYSTEM_OF = np.array([0] * 8 + [1] * 4)
N = len(SATELLITES)
RECEIVERS = ("A", "B", "C")
SIGMA_M, SIGMA_DIFFERENTIAL_M = 1.0, 0.4
STEP_M = 30.0
TOWARDS = made_sky(7, (8, 4), epochs=1, receivers=1).los_enu[:, 0, 0]
LITTLE_M2 = 1e12
ALL, NOBODY = (0, 1, 2), ()


def sky(epochs: int = 1) -> Floats:
    """Prefit residuals (E, R, S) of receivers whose clocks are 1 km ahead."""
    return np.full((epochs, len(RECEIVERS), N), 1000.0)


def with_fault(
    satellite: str, size_m: float, receivers: tuple[int, ...] = ALL, epochs: slice = slice(None), on: Floats | None = None
) -> Floats:
    faulty = sky() if on is None else np.array(on)
    for r in receivers:
        faulty[epochs, r, SATELLITES.index(satellite)] += size_m
    return faulty


def made(prefit_m: Floats, screened: Bools, watched: tuple[Watched, ...] = ()) -> SatelliteInputs:
    """With directions, by which nothing but the satellites explains their faults; a site that promises so little of its position that no
    constellation puts the triangle elsewhere."""
    shape = (len(prefit_m), N)
    return SatelliteInputs(
        prefit_m,
        np.broadcast_to(TOWARDS[:, None, None], (3, *prefit_m.shape)),
        np.full(shape, SIGMA_M),
        np.full(shape, SIGMA_DIFFERENTIAL_M),
        screened,
        SYSTEM_OF,
        2,
        np.full(3, LITTLE_M2),
        np.full(3, LITTLE_M2),
        watched,
    )


def decided(prefit_m: Floats, table: Table | None = None, screened: Bools | None = None, start_s: int = 0) -> Walk:
    """The walk through epochs a second apart."""
    shape = (len(prefit_m), N)
    sees = np.ones(shape, dtype=np.bool_) if screened is None else np.broadcast_to(screened, shape)
    inputs = made(prefit_m, sees)
    epoch_ns = NS_PER_S * (start_s + np.arange(len(prefit_m)))
    return walk(table or {}, inputs, inputs.statistics(sees), RECEIVERS, SATELLITES, epoch_ns, LIMITS)


def used(walked: Walk, e: int = -1) -> set[str]:
    return {s for s, u in zip(SATELLITES, walked.used[e], strict=True) if u}


EVERY = set(SATELLITES)
OUT: Table = {"G03": Exclusion("G03", 0, "residual", 20.0, 5.9)}


@pytest.mark.parametrize(("clean_s", "epochs", "acute"), [(None, 0, True), (3, 3, True), (4, 2, True), (4, 3, False), (900, 900, False)])
def test_what_is_out_is_acute_until_it_has_been_clean_for_as_long_as_anything_must_be(
    clean_s: int | None, epochs: int, acute: bool
) -> None:
    since_ns = None if clean_s is None else (1000 - clean_s) * NS_PER_S
    assert Exclusion("G03", 0, "step", 20.0, 6.6, since_ns, epochs).is_acute(1000 * NS_PER_S, LIMITS) is acute


# ---- IN


def test_in_and_passing_stays_in() -> None:
    walked = decided(sky())
    assert (used(walked), walked.table) == (EVERY, {})


@pytest.mark.parametrize("size_m", [STEP_M, -STEP_M])
@pytest.mark.parametrize("satellite", ["G01", "G08", "E01", "E04"])
def test_in_and_failing_on_all_goes_out(satellite: str, size_m: float) -> None:
    walked = decided(with_fault(satellite, size_m))
    assert (used(walked), set(walked.table)) == (EVERY - {satellite}, {satellite})


def test_an_exclusion_says_since_when_and_why() -> None:
    out = decided(with_fault("G03", STEP_M), start_s=7).table["G03"]
    assert (out.since_ns, out.check, out.threshold, out.clean_epochs) == (7 * NS_PER_S, "residual", LIMITS["residual"], 0)


def test_an_exclusion_carries_its_statistic() -> None:
    # One of eight equal weights: (7/8) 30 m over 1 m sqrt(7/8).
    assert decided(with_fault("G03", STEP_M)).table["G03"].statistic == pytest.approx(STEP_M * np.sqrt(7.0 / 8.0))


@pytest.mark.parametrize(("factor", "out"), [(1.0 - 1e-9, False), (1.0 + 1e-9, True)])
def test_out_only_beyond_the_threshold(factor: float, out: bool) -> None:
    size_m = factor * LIMITS["residual"] / np.sqrt(7.0 / 8.0)
    assert ("G03" in decided(with_fault("G03", size_m)).table) == out


def test_a_step_that_lifts_an_innocent_satellite_over_its_limit_excludes_only_the_faulty_one() -> None:
    # The weighted-mean clock moves by STEP / 8 against all others; G05 stands near its limit already, on the other side.
    near_limit_m = -0.7 * LIMITS["residual"]
    ranges = with_fault("G05", near_limit_m, on=with_fault("G03", STEP_M))
    statistic = inputs_of(ranges).statistics(np.ones((1, N), dtype=np.bool_)).residual_sigmas
    assert (statistic[0, SATELLITES.index("G05")] > LIMITS["residual"], set(decided(ranges).table)) == (True, {"G03"})


def inputs_of(prefit_m: Floats) -> SatelliteInputs:
    return made(prefit_m, np.ones((len(prefit_m), N), dtype=np.bool_))


@pytest.mark.parametrize("satellites", [("G01", "G06"), ("G02", "E02"), ("G01", "G04", "E03")])
def test_several_satellites_go_out_together(satellites: tuple[str, ...]) -> None:
    ranges = sky()
    for k, satellite in enumerate(satellites):
        ranges = with_fault(satellite, STEP_M * (k + 1), on=ranges)
    assert set(decided(ranges).table) == set(satellites)


def test_more_failing_satellites_than_may_go_at_once_exclude_none() -> None:
    ranges = sky()
    for k, satellite in enumerate(("G01", "G02", "E01", "E02")):
        ranges = with_fault(satellite, STEP_M * 3.0**k, on=ranges)
    assert decided(ranges).table == {}


def test_nothing_is_excluded_where_too_few_would_remain() -> None:
    five = np.arange(N) < LIMITS.min_common_satellites
    assert decided(with_fault("G03", STEP_M), screened=five).table == {}


def test_the_last_that_can_be_spared_goes() -> None:
    six = np.arange(N) < LIMITS.min_common_satellites + 1
    assert set(decided(with_fault("G03", STEP_M), screened=six).table) == {"G03"}


@pytest.mark.parametrize("receivers", [(0,), (1,), (0, 2)])
def test_a_satellite_off_at_some_receivers_only_is_not_blamed(receivers: tuple[int, ...]) -> None:
    assert decided(with_fault("G03", STEP_M, receivers)).table == {}


def test_a_satellite_whose_b_values_fail_is_not_blamed() -> None:
    # 30 m at two receivers, 40 m at the third: all see it, but not alike.
    ranges = with_fault("G03", 10.0, (2,), on=with_fault("G03", STEP_M))
    assert decided(ranges).table == {}


def test_a_clock_step_of_a_receiver_excludes_nothing() -> None:
    ranges = sky()
    ranges[0, 1] += 1e5
    walked = decided(ranges)
    assert (used(walked), walked.table, walked.channels) == (EVERY, {}, [()])


def test_a_clock_step_of_a_constellation_excludes_nothing() -> None:
    ranges = sky()
    ranges[..., SYSTEM_OF == 1] += 1e5
    assert decided(ranges).table == {}


def test_a_satellite_that_is_not_screened_is_not_judged() -> None:
    walked = decided(with_fault("G03", STEP_M), screened=np.array([s != "G03" for s in SATELLITES]))
    assert (used(walked), walked.table) == (EVERY - {"G03"}, {})


# ---- OUT


def test_out_and_not_seen_stays_out_as_it_was() -> None:
    unseen = sky()
    unseen[..., 2] = np.nan
    walked = decided(unseen, OUT, np.array([s != "G03" for s in SATELLITES]))
    assert walked.table == OUT


def test_out_and_failing_stays_out() -> None:
    walked = decided(with_fault("G03", STEP_M), OUT)
    assert (used(walked), set(walked.table)) == (EVERY - {"G03"}, {"G03"})


def test_out_and_failing_counts_from_the_beginning() -> None:
    half_way: Table = {"G03": replace(OUT["G03"], clean_since_ns=1, clean_epochs=2)}
    out = decided(with_fault("G03", STEP_M), half_way).table["G03"]
    assert (out.clean_since_ns, out.clean_epochs) == (None, 0)


def test_out_and_passing_is_counted() -> None:
    out = decided(sky(2), OUT, start_s=10).table["G03"]
    assert (out.clean_since_ns, out.clean_epochs) == (10 * NS_PER_S, 2)


def test_out_and_passing_is_not_used_yet() -> None:
    assert used(decided(sky(), OUT)) == EVERY - {"G03"}


def test_comes_back_after_the_time_and_the_count() -> None:
    # 4 s of clean epochs: the fifth makes the count.
    assert ["G03" in table for table in decided(sky(7), OUT, start_s=10).tables] == [True, True, True, True, False, False, False]


def test_is_used_from_the_epoch_after_it_came_back() -> None:
    assert decided(sky(7), OUT, start_s=10).used[:, SATELLITES.index("G03")].tolist() == [False] * 5 + [True] * 2


def test_time_alone_does_not_bring_it_back() -> None:
    # Two clean epochs 10 s apart, three are needed.
    inputs = inputs_of(sky(2))
    walked = walk(OUT, inputs, inputs.statistics(inputs.screened), RECEIVERS, SATELLITES, NS_PER_S * np.array([10, 20]), LIMITS)
    assert set(walked.table) == {"G03"}


def test_a_failure_in_between_starts_the_count_again() -> None:
    ranges = with_fault("G03", STEP_M, epochs=slice(2, 3), on=sky(9))
    back_at = [e for e, table in enumerate(decided(ranges, OUT).tables) if "G03" not in table]
    assert back_at[0] == 7


def test_another_satellite_may_go_out_meanwhile() -> None:
    assert set(decided(with_fault("G07", STEP_M), OUT).table) == {"G03", "G07"}


def test_a_satellite_left_alone_in_its_constellation_is_left_out_too() -> None:
    # Of Galileo only E01 and E02 are seen, and E01 is out: E02 determines a clock and is checked by nothing, as in `sight.screen`.
    seen = np.array([s[0] == "G" or s in ("E01", "E02") for s in SATELLITES])
    out: Table = {"E01": Exclusion("E01", 0, "residual", 20.0, 5.9)}
    assert "E02" not in used(decided(with_fault("E01", STEP_M), out, seen))


# ---- channels


def channels(walked: Walk, e: int = -1) -> set[tuple[str, str]]:
    return {(c.receiver, c.satellite) for c in walked.channels[e]}


@pytest.mark.parametrize("receiver", ALL)
def test_one_channel_could_be_left_out_without_blame(receiver: int) -> None:
    walked = decided(with_fault("G03", 10.0, (receiver,)))
    assert (walked.table, channels(walked)) == ({}, {(RECEIVERS[receiver], "G03")})


def test_a_channel_is_in_use_until_it_is_known_to_help() -> None:
    assert used(decided(with_fault("G03", 10.0, (1,)))) == EVERY


def test_a_channel_that_helps_is_not_used() -> None:
    walked = without_channels(decided(with_fault("G03", 10.0, (1,))), SATELLITES, np.array([True]))
    assert (used(walked), channels(walked)) == (EVERY - {"G03"}, {("B", "G03")})


def test_a_channel_that_does_not_help_is_used_and_forgotten() -> None:
    walked = without_channels(decided(with_fault("G03", 10.0, (1,))), SATELLITES, np.array([False]))
    assert (used(walked), channels(walked)) == (EVERY, set())


def test_a_channel_that_helps_brings_no_excluded_satellite_back() -> None:
    walked = without_channels(decided(with_fault("G05", 10.0, (1,)), OUT), SATELLITES, np.array([True]))
    assert used(walked) == EVERY - {"G03", "G05"}


def test_a_channel_has_no_memory() -> None:
    assert channels(decided(with_fault("G03", 10.0, (1,), slice(0, 1), on=sky(2))), 1) == set()


def test_one_channel_of_each_receiver_could_be_left_out() -> None:
    ranges = with_fault("G03", 10.0, (0,), on=with_fault("G05", 12.0, (1,), on=with_fault("E02", -14.0, (2,))))
    assert channels(decided(ranges)) == {("A", "G03"), ("B", "G05"), ("C", "E02")}


def test_two_channels_of_one_receiver_are_a_fault_of_the_receiver() -> None:
    ranges = with_fault("G03", 10.0, (0,), on=with_fault("G05", 15.0, (0,)))
    assert channels(decided(ranges)) == set()


def test_no_channel_could_be_left_out_where_too_few_would_remain() -> None:
    five = np.arange(N) < LIMITS.min_common_satellites
    assert decided(with_fault("G03", 10.0, (0,)), screened=five).channels == [()]


def test_a_channel_and_a_faulty_satellite_at_once() -> None:
    walked = decided(with_fault("G03", 10.0, (0,), on=with_fault("G06", STEP_M)))
    assert (set(walked.table), channels(walked)) == ({"G06"}, {("A", "G03")})


# ---- the walk itself


def test_cutting_a_block_changes_nothing() -> None:
    rng = np.random.default_rng(1)
    ranges = sky(60) + rng.normal(0.0, 0.1, (60, 3, N))
    ranges = with_fault("G03", STEP_M, epochs=slice(10, 25), on=with_fault("E02", 10.0, (1,), slice(20, 40), on=ranges))
    whole = decided(ranges)
    table: Table = {}
    tables = []
    for e in range(60):
        part = decided(ranges[e : e + 1], table, start_s=e)
        table = part.table
        tables.append(table)
    assert tables == whole.tables


@pytest.mark.parametrize("order", [(1, 0, 2), (2, 1, 0), (1, 2, 0)])
def test_order_of_receivers_changes_no_exclusion(order: tuple[int, ...]) -> None:
    ranges = with_fault("G03", STEP_M, on=with_fault("E02", 10.0, (1,)))
    assert decided(ranges[:, list(order)]).table == decided(ranges).table
