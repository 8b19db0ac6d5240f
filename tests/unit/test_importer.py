"""Sound files of three receivers become one stream in the order of time, whole or in a window, from one file or several."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from integrity.errors import DecodeError
from integrity.events import EphemerisReceived, Event, IonosphereReceived, ObservationsReceived, Tick
from integrity.gnss.gps_time import NS_PER_S, format_utc, utc_from_gps
from integrity.states import State
from integrity.station_monitor import StationMonitor
from recordings.importer import import_files
from tests.unit.imported import AT, EPHEMERIDES, EPOCHS, EVENTS, ROWS, epochs_of, imported, navigation_file, observation_file, without
from tests.unit.streams import SITE, START_NS, reports

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
