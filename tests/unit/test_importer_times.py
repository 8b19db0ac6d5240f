"""What lines up is kept in order; rates, offsets, gaps and wrong times are dropped and counted, or refused."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from integrity.errors import DecodeError
from integrity.events import Tick
from integrity.gnss.gps_time import DAY_S, NS_PER_S, format_utc
from integrity.gnss.observations import ObservationRow
from integrity.states import Cause, State
from integrity.station_monitor import StationMonitor
from tests.rinex_text import rows_of
from tests.unit.imported import AT, EPOCHS, ROWS, epochs_of, imported, without
from tests.unit.streams import LIMITS, SITE, a_site, health, reports, with_values

YEAR_NS = 365 * DAY_S * NS_PER_S


def shifted(rows: Sequence[ObservationRow], by_ns: int) -> list[ObservationRow]:
    return [replace(row, receive_time_ns=row.receive_time_ns + by_ns) for row in rows]


# Rates and offsets


def test_receivers_of_different_rates_meet_at_the_slower_one(tmp_path: Path) -> None:
    assert epochs_of(imported(tmp_path, {"B": ROWS["B"][::5]})) == AT[::5]


def test_what_has_no_partner_is_counted_at_the_faster_ones(tmp_path: Path) -> None:
    result = imported(tmp_path, {"B": ROWS["B"][::5]})
    alone = {"no partner in the other receivers": 16}
    assert result.dropped == {"A": alone, "B": {}, "C": alone}


def test_rows_between_the_epochs_of_a_slower_site_are_counted(tmp_path: Path) -> None:
    result = imported(tmp_path, site=a_site(5.0))
    assert (epochs_of(result), result.dropped["A"]) == (AT[2::5], {"between the site's epochs": 16})  # GPS time ends in 18 s


@pytest.mark.parametrize("sign", [1, -1])
def test_a_receiver_off_by_the_tolerance_is_aligned(tmp_path: Path, sign: int) -> None:
    late = shifted(ROWS["B"], sign * LIMITS.alignment_tolerance_ns)
    assert imported(tmp_path, {"B": late}).epochs == EPOCHS


@pytest.mark.parametrize("sign", [1, -1])
def test_a_receiver_off_by_the_tolerance_and_a_tenth_of_a_microsecond_is_not(tmp_path: Path, sign: int) -> None:
    late = shifted(ROWS["B"], sign * (LIMITS.alignment_tolerance_ns + 100))  # the resolution of the format
    mixed = [*ROWS["B"][:10], *late[10:]]
    result = imported(tmp_path, {"B": mixed})
    assert (result.epochs, result.dropped["B"]) == (10, {"between the site's epochs": 10})


def test_a_receiver_that_is_never_near_an_epoch_is_refused_with_what_each_has(tmp_path: Path) -> None:
    with pytest.raises(DecodeError, match=r"no epoch is common .* at the site's interval of 1 s: .*B has 20 from .*every 1 s"):
        imported(tmp_path, {"B": shifted(ROWS["B"], NS_PER_S // 2)})


# Gaps


def test_a_gap_no_longer_than_silence_has_no_tick_of_its_own(tmp_path: Path) -> None:
    result = imported(tmp_path, {"B": without(ROWS["B"], 6)})
    assert sum(isinstance(e, Tick) for e in result.events) == EPOCHS - 1


def test_a_longer_gap_has_one_tick_at_the_moment_silence_is_noticed(tmp_path: Path) -> None:
    result = imported(tmp_path, {"B": without(ROWS["B"], *range(6, 12))})
    ticks = [e.mono_ns for e in result.events if isinstance(e, Tick) and e.mono_ns not in AT]
    assert ticks == [AT[5] + LIMITS.silence_ns + 1]


def test_the_silence_of_a_gap_is_published_as_missing_data(tmp_path: Path) -> None:
    result = imported(tmp_path, {"B": without(ROWS["B"], *range(6, 12))})
    said = [h for h in health(StationMonitor(SITE).feed(result.events)) if h.mono_ns == AT[5] + LIMITS.silence_ns + 1]
    assert [(h.state, h.cause) for h in said] == [(State.NOT_CONFIRMABLE, Cause.DATA)]


# Repeated and wrong times


def test_a_repeated_epoch_is_dropped_and_counted(tmp_path: Path) -> None:
    result = imported(tmp_path, {"B": [*ROWS["B"][:5], ROWS["B"][4], *ROWS["B"][5:]]})
    assert (epochs_of(result), result.dropped["B"]) == (AT, {"epoch repeated": 1})


def test_of_a_repeated_epoch_the_first_counts(tmp_path: Path) -> None:
    other = with_values(ROWS["B"][4], "pseudorange_m", 2.5e7)
    result = imported(tmp_path, {"B": [*ROWS["B"][:5], other, *ROWS["B"][5:]]})
    assert rows_of(result.events, "B")[4].pseudorange_m == pytest.approx(ROWS["B"][4].pseudorange_m, abs=1e-3)


def test_time_that_jumps_back_gives_each_epoch_once_and_in_order(tmp_path: Path) -> None:
    result = imported(tmp_path, {"B": [*ROWS["B"][:10], *ROWS["B"][3:]]})
    assert (epochs_of(result), result.dropped["B"]) == (AT, {"epoch repeated": 7})


@pytest.mark.parametrize("years", [-16, 5])
def test_time_that_jumps_by_years_in_one_file_finds_no_partner(tmp_path: Path, years: int) -> None:
    result = imported(tmp_path, {"B": [*ROWS["B"][:10], *shifted(ROWS["B"][10:15], years * YEAR_NS), *ROWS["B"][15:]]})
    lost = {"no partner in the other receivers": 5}
    assert (epochs_of(result), result.dropped) == (AT[:10] + AT[15:], {"A": lost, "B": lost, "C": lost})


def test_a_jump_of_years_in_all_files_is_never_vouched_for(tmp_path: Path) -> None:
    jumped = {name: [*rows[:10], *shifted(rows[10:], 5 * YEAR_NS)] for name, rows in ROWS.items()}
    decided = reports(StationMonitor(SITE).feed(imported(tmp_path, jumped).events))
    assert [r.state for r in decided[10:]] == [State.NOT_CONFIRMABLE] * 10


def test_receivers_that_never_met_are_refused_with_the_span_of_each(tmp_path: Path) -> None:
    apart = {"B": shifted(ROWS["B"], YEAR_NS)}
    message = f"A has 20 from {format_utc(AT[0])}.*B has 20 from {format_utc(AT[0] + YEAR_NS)}"
    with pytest.raises(DecodeError, match=message):
        imported(tmp_path, apart)


def test_observations_of_another_year_than_the_navigation_are_refused_with_both_spans_and_the_remedy(tmp_path: Path) -> None:
    other_year = {name: shifted(rows, -YEAR_NS) for name, rows in ROWS.items()}
    with pytest.raises(DecodeError, match=r"no ephemeris serves the epochs 2025-03-02T.* cover 2026-03-02T.*with --nav"):
        imported(tmp_path, other_year)


def test_a_file_without_an_epoch_is_refused_by_the_name_of_its_receiver(tmp_path: Path) -> None:
    with pytest.raises(DecodeError, match=r"receiver C: no epoch .* C has no epochs"):
        imported(tmp_path, {"C": []})


# Everything dropped is counted


def test_every_row_is_either_an_epoch_or_counted(tmp_path: Path) -> None:
    rows = ROWS["B"]
    spoiled = [*rows[:4], rows[2], *shifted(rows[4:6], NS_PER_S // 3), *shifted(rows[6:8], YEAR_NS), *rows[8:], rows[19]]
    result = imported(tmp_path, {"B": spoiled, "C": ROWS["C"][:15]})
    read = {"A": EPOCHS, "B": len(spoiled), "C": 15}
    assert {name: result.epochs + sum(counts.values()) for name, counts in result.dropped.items()} == read
