"""Files of three receivers become one stream: what lines up is kept in order, everything else is dropped and counted."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from integrity.config import SiteConfig
from integrity.errors import DecodeError
from integrity.events import EphemerisReceived, Event, IonosphereReceived, ObservationsReceived, Tick
from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris import Ephemeris, satellite_states
from integrity.gnss.gps_time import DAY_S, NS_PER_S, format_utc, utc_from_gps
from integrity.gnss.observations import ROW_FLOATS, ObservationRow
from integrity.states import Cause, State
from integrity.station_monitor import StationMonitor
from recordings.importer import Imported, import_files
from recordings.rinex.navigation import NavigationFile, read_navigation
from recordings.rinex.observation import ObservationFile, read_observations
from tests.rinex_text import LEAP_SECONDS, navigation_of, navigation_text, observation_text, rows_of
from tests.unit.streams import LIMITS, SITE, START_NS, a_site, health, reports, stream, with_values

EPOCHS = 20
YEAR_NS = 365 * DAY_S * NS_PER_S
EVENTS = stream(EPOCHS)
EPHEMERIDES, KLOBUCHAR = navigation_of(EVENTS)
ROWS = {name: rows_of(EVENTS, name) for name in SITE.receiver_names}
AT = [row.receive_time_ns for row in ROWS["A"]]

Rows = Mapping[str, Sequence[ObservationRow]]


def observation_file(directory: Path, name: str, rows: Sequence[ObservationRow], leap_seconds: int = LEAP_SECONDS) -> ObservationFile:
    path = directory / f"{name}.rnx"
    path.write_text(observation_text(rows, leap_seconds=leap_seconds), "ascii")
    return read_observations(path, name[0])


def navigation_file(directory: Path, ephemerides: Sequence[Ephemeris] = EPHEMERIDES, leap_seconds: int = LEAP_SECONDS) -> NavigationFile:
    path = directory / "nav.rnx"
    path.write_text(navigation_text(ephemerides, KLOBUCHAR, leap_seconds), "ascii")
    return read_navigation(path)


def imported(
    directory: Path,
    changed: Rows | None = None,
    site: SiteConfig = SITE,
    ephemerides: Sequence[Ephemeris] = EPHEMERIDES,
    start_ns: int | None = None,
    end_ns: int | None = None,
) -> Imported:
    """The stream written as RINEX and read again, with other rows for some receivers."""
    files = {name: [observation_file(directory, name, rows)] for name, rows in (ROWS | dict(changed or {})).items()}
    return import_files(site, files, [navigation_file(directory, ephemerides)], start_ns, end_ns)


def imported_text(directory: Path, text: str) -> Imported:
    """The stream with other text as the file of B."""
    files = {name: [observation_file(directory, name, rows)] for name, rows in ROWS.items()}
    path = directory / "B.rnx"
    path.write_text(text, "ascii")
    return import_files(SITE, files | {"B": [read_observations(path, "B")]}, [navigation_file(directory)])


def epochs_of(result: Imported) -> list[int]:
    """Times of the rows of A; those of the others are checked to be the same."""
    times = {name: [row.receive_time_ns for row in rows_of(result.events, name)] for name in SITE.receiver_names}
    assert times["A"] == times["B"] == times["C"]
    return times["A"]


def shifted(rows: Sequence[ObservationRow], by_ns: int) -> list[ObservationRow]:
    return [replace(row, receive_time_ns=row.receive_time_ns + by_ns) for row in rows]


def without(rows: Sequence[ObservationRow], *numbers: int) -> list[ObservationRow]:
    return [row for k, row in enumerate(rows) if k not in numbers]


# The text that these tests are fed with


@pytest.mark.parametrize("receiver", SITE.receiver_names)
def test_rows_written_as_rinex_are_read_with_the_same_signals_at_the_same_times(tmp_path: Path, receiver: str) -> None:
    read = observation_file(tmp_path, receiver, ROWS[receiver]).rows
    assert [(r.receiver, r.receive_time_ns, r.signals) for r in read] == [
        (r.receiver, r.receive_time_ns, r.signals) for r in ROWS[receiver]
    ]


@pytest.mark.parametrize("quantity", [name for name in ROW_FLOATS if name != "lock_s"])
def test_rows_written_as_rinex_are_read_to_half_a_thousandth(tmp_path: Path, quantity: str) -> None:
    read = observation_file(tmp_path, "A", ROWS["A"]).rows
    for was, now in zip(ROWS["A"], read, strict=True):
        np.testing.assert_allclose(getattr(now, quantity), getattr(was, quantity), rtol=0.0, atol=0.51e-3)  # F14.3


def test_what_is_not_measured_stays_so(tmp_path: Path) -> None:
    (read,) = observation_file(tmp_path, "A", [with_values(ROWS["A"][0], "cn0_dbhz", np.nan, [2])]).rows
    assert np.flatnonzero(np.isnan(read.cn0_dbhz)).tolist() == [2]


def test_a_slip_and_a_half_cycle_go_through_the_loss_of_lock_indicator(tmp_path: Path) -> None:
    row = ROWS["A"][0]
    flags = np.arange(len(row.signals))
    (read,) = observation_file(tmp_path, "A", [replace(row, slip=flags % 2 == 1, half_cycle=flags % 3 == 1)]).rows
    assert (read.slip.tolist(), read.half_cycle.tolist()) == ((flags % 2 == 1).tolist(), (flags % 3 == 1).tolist())


def test_satellites_of_written_ephemerides_stand_where_they_stood_to_a_millimetre(tmp_path: Path) -> None:
    t_ns = START_NS + np.arange(0, 3600, 600) * NS_PER_S
    index = np.tile(np.arange(len(EPHEMERIDES)), (len(t_ns), 1))
    was = satellite_states(EPHEMERIDES, index, t_ns)
    now = satellite_states(navigation_file(tmp_path).ephemerides, index, t_ns)
    moved_m = np.linalg.norm(now.pos_ecef_m - was.pos_ecef_m, axis=0) + SPEED_OF_LIGHT_MPS * np.abs(now.clock_s - was.clock_s)
    assert moved_m.max() < 1e-3


def test_what_ephemerides_say_of_themselves_is_read_exactly(tmp_path: Path) -> None:
    def of_itself(e: Ephemeris) -> tuple[object, ...]:
        return e.satellite, e.issue, e.healthy, e.accuracy_m, e.transmission_ns, e.toe_ns, e.toc_ns, e.fit_half_s

    assert [of_itself(e) for e in navigation_file(tmp_path).ephemerides] == [of_itself(e) for e in EPHEMERIDES]


# Sound files


def test_all_epochs_of_sound_files_are_imported(tmp_path: Path) -> None:
    assert epochs_of(imported(tmp_path)) == AT


def test_nothing_of_sound_files_is_dropped(tmp_path: Path) -> None:
    assert imported(tmp_path).dropped == {"A": {}, "B": {}, "C": {}}


def test_sound_files_need_no_warning(tmp_path: Path) -> None:
    assert imported(tmp_path).warnings == ()


def test_imported_files_are_decided_as_what_they_were_made_from(tmp_path: Path) -> None:
    def decided(events: Sequence[Event]) -> list[tuple[object, ...]]:
        return [(r.gps_time_ns, r.state, r.cause) for r in reports(StationMonitor(SITE).feed(events))]

    assert decided(imported(tmp_path).events) == decided(EVENTS)
    assert State.NORMAL in {state for _, state, _ in decided(EVENTS)}


def test_a_tick_follows_the_three_rows_of_each_epoch(tmp_path: Path) -> None:
    events = [e for e in imported(tmp_path).events if isinstance(e, ObservationsReceived | Tick)]
    kinds = [e.row.receiver if isinstance(e, ObservationsReceived) else "tick" for e in events]
    assert kinds == ["A", "B", "C", "tick"] * EPOCHS


def test_the_tick_of_an_epoch_says_its_time_and_that_nobody_vouches_for_it(tmp_path: Path) -> None:
    ticks = [e for e in imported(tmp_path).events if isinstance(e, Tick)]
    assert ticks == [Tick(t, utc_from_gps(t), None) for t in AT]


# Order of navigation


def test_what_was_sent_before_the_first_epoch_enters_at_the_first_epoch(tmp_path: Path) -> None:
    events = imported(tmp_path).events
    head = events[: 1 + len(EPHEMERIDES)]
    assert isinstance(head[0], IonosphereReceived)
    assert {e.ephemeris.satellite for e in head if isinstance(e, EphemerisReceived)} == {e.satellite for e in EPHEMERIDES}
    assert {e.mono_ns for e in head} == {AT[0]}


@pytest.mark.parametrize(("sent_s", "first_epoch_after"), [(9.5, 10), (10.0, 10), (10.5, 11), (19.0, 19)])
def test_an_ephemeris_enters_before_the_first_epoch_at_or_after_its_transmission(
    tmp_path: Path, sent_s: float, first_epoch_after: int
) -> None:
    # RINEX gives the time of transmission in seconds of the week with 13 digits: half a second is exact.
    late = replace(EPHEMERIDES[0], transmission_ns=START_NS + round(sent_s * NS_PER_S))
    events = imported(tmp_path, ephemerides=[late, *EPHEMERIDES[1:]]).events
    place = next(i for i, e in enumerate(events) if isinstance(e, EphemerisReceived) and e.ephemeris.satellite == late.satellite)
    following = next(e for e in events[place:] if isinstance(e, ObservationsReceived))
    assert following.row.receive_time_ns == AT[first_epoch_after]
    assert events[place].mono_ns == late.transmission_ns


def test_an_ephemeris_sent_after_the_last_epoch_is_left_out(tmp_path: Path) -> None:
    late = replace(EPHEMERIDES[0], transmission_ns=AT[-1] + NS_PER_S)
    events = imported(tmp_path, ephemerides=[late, *EPHEMERIDES[1:]]).events
    assert late.satellite not in {e.ephemeris.satellite for e in events if isinstance(e, EphemerisReceived)}


def test_an_ephemeris_in_two_files_enters_once(tmp_path: Path) -> None:
    files = {name: [observation_file(tmp_path, name, rows)] for name, rows in ROWS.items()}
    result = import_files(SITE, files, [navigation_file(tmp_path), navigation_file(tmp_path)])
    assert sum(isinstance(e, EphemerisReceived) for e in result.events) == len(EPHEMERIDES)


def test_time_never_steps_back_in_the_events_even_where_an_ephemeris_was_sent_during_a_gap(tmp_path: Path) -> None:
    in_the_gap = replace(EPHEMERIDES[0], transmission_ns=AT[5] + NS_PER_S)
    result = imported(tmp_path, {"B": without(ROWS["B"], *range(6, 12))}, ephemerides=[in_the_gap, *EPHEMERIDES[1:]])
    assert all(b.mono_ns >= a.mono_ns for a, b in pairwise(result.events))


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


# Leap seconds


def test_leap_seconds_of_a_header_that_differ_from_the_table_are_told(tmp_path: Path) -> None:
    files = {name: [observation_file(tmp_path, name, rows, 17 if name == "B" else LEAP_SECONDS)] for name, rows in ROWS.items()}
    warnings = import_files(SITE, files, [navigation_file(tmp_path)]).warnings
    assert warnings == (f"{tmp_path / 'B.rnx'}: header says 17 leap seconds, the table says 18; the table is used",)


def test_leap_seconds_of_a_navigation_file_are_checked_too(tmp_path: Path) -> None:
    files = {name: [observation_file(tmp_path, name, rows)] for name, rows in ROWS.items()}
    warnings = import_files(SITE, files, [navigation_file(tmp_path, leap_seconds=16)]).warnings
    assert [w.partition(": ")[0] for w in warnings] == [str(tmp_path / "nav.rnx")]


def test_wrong_leap_seconds_change_no_epoch(tmp_path: Path) -> None:
    files = {name: [observation_file(tmp_path, name, rows, 0)] for name, rows in ROWS.items()}
    assert epochs_of(import_files(SITE, files, [navigation_file(tmp_path)])) == AT


def test_missing_ionosphere_is_told(tmp_path: Path) -> None:
    files = {name: [observation_file(tmp_path, name, rows)] for name, rows in ROWS.items()}
    path = tmp_path / "nav.rnx"
    path.write_text(navigation_text(EPHEMERIDES), "ascii")
    (warning,) = import_files(SITE, files, [read_navigation(path)]).warnings
    assert "Klobuchar" in warning


# Windows and several files


def test_a_window_includes_its_start_and_not_its_end(tmp_path: Path) -> None:
    assert epochs_of(imported(tmp_path, start_ns=AT[3], end_ns=AT[8])) == AT[3:8]


def test_what_is_outside_a_window_is_not_counted_as_dropped(tmp_path: Path) -> None:
    assert imported(tmp_path, start_ns=AT[3], end_ns=AT[8]).dropped == {"A": {}, "B": {}, "C": {}}


def test_a_window_without_an_epoch_is_refused_with_what_there_is(tmp_path: Path) -> None:
    with pytest.raises(DecodeError, match=f"no epoch between the times asked for; A has 20 from {format_utc(AT[0])}"):
        imported(tmp_path, start_ns=AT[-1] + NS_PER_S)


def test_several_files_of_a_receiver_are_read_as_one(tmp_path: Path) -> None:
    parts = [observation_file(tmp_path, "B2", ROWS["B"][12:]), observation_file(tmp_path, "B1", ROWS["B"][:12])]
    files = {name: [observation_file(tmp_path, name, rows)] for name, rows in ROWS.items()} | {"B": parts}
    result = import_files(SITE, files, [navigation_file(tmp_path)])
    assert (epochs_of(result), result.dropped["B"]) == (AT, {})


def test_what_two_files_share_is_counted(tmp_path: Path) -> None:
    parts = [observation_file(tmp_path, "B1", ROWS["B"][:12]), observation_file(tmp_path, "B2", ROWS["B"][9:])]
    files = {name: [observation_file(tmp_path, name, rows)] for name, rows in ROWS.items()} | {"B": parts}
    result = import_files(SITE, files, [navigation_file(tmp_path)])
    assert (epochs_of(result), result.dropped["B"]) == (AT, {"epoch repeated": 3})


# Everything dropped is counted


def test_every_row_is_either_an_epoch_or_counted(tmp_path: Path) -> None:
    rows = ROWS["B"]
    spoiled = [*rows[:4], rows[2], *shifted(rows[4:6], NS_PER_S // 3), *shifted(rows[6:8], YEAR_NS), *rows[8:], rows[19]]
    result = imported(tmp_path, {"B": spoiled, "C": ROWS["C"][:15]})
    read = {"A": EPOCHS, "B": len(spoiled), "C": 15}
    assert {name: result.epochs + sum(counts.values()) for name, counts in result.dropped.items()} == read


@pytest.mark.parametrize(
    ("field", "reason"),
    [
        ("           nan", "field not a number"),
        ("           inf", "field not a number"),
        ("*" * 14, "field not a number"),
        (f"{1.0:14.3f}", "absurd pseudorange"),
        (f"{-2.2e7:14.3f}", "absurd pseudorange"),
        (f"{9.9e8:14.3f}", "absurd pseudorange"),
    ],
)
def test_a_range_that_is_none_is_left_out_and_counted(tmp_path: Path, field: str, reason: str) -> None:
    lines = observation_text(ROWS["B"]).split("\n")
    first = next(k for k, line in enumerate(lines) if line.startswith(">")) + 1
    lines[first] = lines[first][:3] + field + lines[first][17:]
    result = imported_text(tmp_path, "\n".join(lines))
    assert (rows_of(result.events, "B")[0].signals, result.dropped["B"]) == (ROWS["B"][0].signals[1:], {reason: 1})


def test_an_epoch_cut_in_its_middle_is_left_out_and_counted(tmp_path: Path) -> None:
    text = observation_text(ROWS["B"])
    result = imported_text(tmp_path, text[: text.rindex(">") + 400])
    assert (epochs_of(result), result.dropped["B"]) == (AT[:-1], {"epoch cut off": 1})
