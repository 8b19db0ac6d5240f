"""A recording decided again says the same: from any snapshot, in any blocks, and up to wherever it was cut."""

import random
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from mcap.reader import make_reader

from integrity.errors import ConfigError, RecordingError
from integrity.events import Event, ObservationsReceived, RawBytes, Tick
from integrity.gnss.gps_time import NS_PER_S, format_utc, parse_utc, utc_from_gps
from integrity.gnss.observations import ObservationRow
from integrity.health import Health
from integrity.messages import wayside_pb2 as pb
from integrity.outputs import EpochReport, Output
from integrity.states import Cause, State
from recordings.diff import differences, recorded_reports
from recordings.reader import Contents, read_recording, salvage
from recordings.replay import (
    Boot,
    _batches,
    complaints,
    decide,
    decide_and_record,
    first_epoch_ns,
    recorded_site,
    recover,
    replayable,
    span_utc,
    started,
    window,
)
from recordings.simulate.observations import antennas_of, simulate
from recordings.simulate.receiver import as_bytes
from recordings.site_file import SiteFile, override_site, parse_site
from recordings.summary import decisions_sha256
from tests.unit.sites import SITE as SITE_TEXT
from tests.unit.sites import edited
from tests.unit.streams import START_NS, epoch_of, reports, rows_changed, stream, ticks_only, with_more, with_signals

SECONDS = 40
CUTS = 50
SLOW_EPOCHS, SLOW_INTERVAL_S = 270, 30  # two hours and a quarter: three snapshots, new ephemerides on the way
SITE = parse_site(edited(("recover_after_s = 30.0", "recover_after_s = 5.0"), ('fault = "stop"', 'fault = "exclude"')), "site.toml")
SLOW_SITE = override_site(SITE, [f"epoch_interval_s={SLOW_INTERVAL_S}.0", "recover_after_s=90.0"])


def off(row: ObservationRow, satellite: str, metres: float) -> ObservationRow:
    columns = [i for i, s in enumerate(row.signals) if s.startswith(satellite)]
    return with_more(row, "pseudorange_m", metres, columns)


def spoiled(row: ObservationRow) -> ObservationRow | None:
    """A satellite off, then one receiver off, then the same receiver silent."""
    second = epoch_of(row)
    if 8 <= second < 12:
        return off(row, "G07", 40.0)
    if 16 <= second < 18 and row.receiver == "B":
        return with_more(row, "pseudorange_m", 30.0, slice(0, 6))
    return None if 24 <= second < 29 and row.receiver == "B" else row


EVENTS = rows_changed(stream(SECONDS), spoiled)


def spoiled_around_the_second_snapshot(row: ObservationRow) -> ObservationRow:
    """A satellite off from 55 to 75 minutes: it is out when the snapshot of the first hour is taken. All signals 15 dB down from 62 to 64
    minutes, which only shows against what C/N0 was before the snapshot."""
    minute = epoch_of(row) / 60
    row = with_more(row, "cn0_dbhz", -15.0) if 62 <= minute < 64 else row
    return off(row, "G07", 40.0) if 55 <= minute < 75 else row


@dataclass(frozen=True)
class Recorded:
    """A recording, and what was decided while it was made."""

    path: Path
    contents: Contents
    outputs: Sequence[Output]


def recorded(path: Path, site: SiteFile, events: Sequence[Event]) -> Recorded:
    outputs, _ = decide_and_record(path, site, events, {"truth": {"faults": "as in the test\n"}})
    return Recorded(path, read_recording(path), outputs)


@pytest.fixture(scope="module")
def fast(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    return recorded(tmp_path_factory.mktemp("fast") / "fast.mcap", SITE, EVENTS)


@pytest.fixture(scope="module")
def slow(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    events = simulate(SLOW_SITE.config, START_NS, SLOW_EPOCHS * SLOW_INTERVAL_S, 1.0 / SLOW_INTERVAL_S, seed=1)
    path = tmp_path_factory.mktemp("slow") / "slow.mcap"
    return recorded(path, SLOW_SITE, rows_changed(events, spoiled_around_the_second_snapshot))


def replayed(contents: Contents, block_epochs: int = 1000, start_ns: int | None = None, end_ns: int | None = None) -> list[EpochReport]:
    todo = replayable(contents, None, start_ns, end_ns)
    outputs, _ = decide(todo.site, todo.events, todo.snapshot, block_epochs)
    return reports(outputs)


# Replay equals record


def test_the_stream_of_these_tests_meets_every_kind_of_decision(fast: Recorded) -> None:
    causes = {r.cause for r in reports(fast.outputs)}
    assert {Cause.NOT_READY, Cause.NONE} < causes
    assert any(r.excluded for r in reports(fast.outputs))
    assert {h.cause for h in fast.outputs if not isinstance(h, EpochReport)} >= {Cause.DATA}


@pytest.mark.parametrize("block_epochs", [1, 7, 60, 1000])
def test_a_replay_publishes_what_was_published_silences_and_alerts_included(fast: Recorded, block_epochs: int) -> None:
    todo = replayable(fast.contents)
    outputs, _ = decide(todo.site, todo.events, todo.snapshot, block_epochs)
    assert len(outputs) == len(fast.outputs)
    assert [type(o) for o in outputs] == [type(o) for o in fast.outputs]
    assert [(o.state, o.cause, o.subjects, o.mono_ns) for o in outputs] == [(o.state, o.cause, o.subjects, o.mono_ns) for o in fast.outputs]


@pytest.mark.parametrize("which", ["fast", "slow"])
def test_blocks_of_1_7_and_1000_epochs_twice_each_give_one_hash(which: str, request: pytest.FixtureRequest) -> None:
    contents = request.getfixturevalue(which).contents
    assert len({decisions_sha256(replayed(contents, block_epochs)) for block_epochs in (1, 7, 1000) * 2}) == 1


@pytest.mark.parametrize("which", ["fast", "slow"])
@pytest.mark.parametrize("block_epochs", [1, 7, 1000])
def test_no_epoch_differs_from_the_record(which: str, block_epochs: int, request: pytest.FixtureRequest) -> None:
    contents = request.getfixturevalue(which).contents
    assert differences(recorded_reports(contents, None, None), replayed(contents, block_epochs)) == []


def test_the_hash_of_a_replay_is_that_of_what_was_decided_live(fast: Recorded) -> None:
    assert decisions_sha256(replayed(fast.contents)) == decisions_sha256(reports(fast.outputs))


def test_a_replay_recorded_again_has_the_same_bytes(fast: Recorded, tmp_path: Path) -> None:
    todo = replayable(fast.contents)
    decide_and_record(tmp_path / "again.mcap", todo.site, todo.events, fast.contents.metadata, todo.snapshot)
    assert (tmp_path / "again.mcap").read_bytes() == fast.path.read_bytes()


def test_a_changed_decision_is_a_difference(fast: Recorded) -> None:
    decided = replayed(fast.contents)
    decided[9] = replace(decided[9], state=State.NOT_CONFIRMABLE, cause=Cause.DATA)
    (line,) = differences(recorded_reports(fast.contents, None, None), decided)
    assert line == f"{format_utc(decided[9].gps_time_ns)}: state NORMAL -> NOT_CONFIRMABLE; cause CAUSE_UNSPECIFIED -> DATA"


def test_an_epoch_that_is_not_decided_any_more_is_a_difference(fast: Recorded) -> None:
    decided = replayed(fast.contents)
    (line,) = differences(recorded_reports(fast.contents, None, None), [r for k, r in enumerate(decided) if k != 9])
    assert line == f"{format_utc(decided[9].gps_time_ns)}: decided only in the recording"


def test_an_epoch_that_was_not_decided_then_is_a_difference(fast: Recorded) -> None:
    decided, then = replayed(fast.contents), recorded_reports(fast.contents, None, None)
    (line,) = differences(then[:9] + then[10:], decided)
    assert line == f"{format_utc(decided[9].gps_time_ns)}: decided only now"


# Bytes of receivers

UNIT = 7 * 29  # bytes: pieces end anywhere in frames
BOOT = Boot(b"sixteen bytes...", utc_from_gps(0) + 12_345)


def pieces(events: Sequence[Event]) -> list[Event]:
    """Each burst in pieces that arrive one after the other, as a link would hand them over."""
    return [
        replace(event, mono_ns=event.mono_ns + k, data=event.data[k * UNIT : (k + 1) * UNIT]) if isinstance(event, RawBytes) else event
        for event in events
        for k in range(-(-len(event.data) // UNIT) if isinstance(event, RawBytes) else 1)
    ]


def in_order(events: Sequence[Event]) -> list[Event]:
    return sorted(events, key=lambda event: event.mono_ns)


@pytest.fixture(scope="module")
def raw(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    """What `fast` is made of, as UBX bytes; recorded with the clock and the name of a station."""
    events = in_order(pieces(as_bytes(EVENTS, antennas_of(SITE.config))))
    path = tmp_path_factory.mktemp("raw") / "raw.mcap"
    outputs, _ = decide_and_record(path, SITE, events, {}, boot=BOOT)
    return Recorded(path, read_recording(path), outputs)


def test_the_stream_of_bytes_meets_every_kind_of_decision(raw: Recorded) -> None:
    assert {o.cause for o in raw.outputs} >= {Cause.NOT_READY, Cause.NONE, Cause.DATA}
    assert any(r.excluded for r in reports(raw.outputs))


def test_bytes_are_replayed_as_they_were_decided_to_the_byte_and_the_nanosecond(raw: Recorded) -> None:
    events = in_order(pieces(as_bytes(EVENTS, antennas_of(SITE.config))))
    assert replayable(raw.contents).events == tuple(events)


@pytest.mark.parametrize("block_epochs", [1, 7, 1000])
def test_no_epoch_of_bytes_differs_from_the_record(raw: Recorded, block_epochs: int) -> None:
    again = replayed(raw.contents, block_epochs)
    assert differences(recorded_reports(raw.contents, None, None), again) == []
    assert decisions_sha256(again) == decisions_sha256(reports(raw.outputs))


def test_a_recording_of_a_station_recorded_again_has_the_same_bytes(raw: Recorded, tmp_path: Path) -> None:
    todo = replayable(raw.contents)
    decide_and_record(tmp_path / "again.mcap", todo.site, todo.events, {}, todo.snapshot, boot=todo.boot)
    assert (tmp_path / "again.mcap").read_bytes() == raw.path.read_bytes()


def test_a_recording_of_a_station_has_the_times_that_the_station_gave_it(raw: Recorded) -> None:
    assert raw.contents.entries[0].log_ns - started(raw.contents).mono_ns == BOOT.offset_ns
    assert replayable(raw.contents).boot == BOOT


def test_health_of_a_station_recorded_again_is_of_the_same_boot(raw: Recorded) -> None:
    assert {e.message.boot_id for e in raw.contents.entries if isinstance(e.message, pb.Health)} == {BOOT.boot_id}


def test_a_cut_recording_of_bytes_is_recovered_with_its_times(raw: Recorded, tmp_path: Path) -> None:
    recover(cut(raw.path, tmp_path / "cut.mcap", raw.path.stat().st_size * 2 // 3), tmp_path / "saved.mcap")
    saved, whole = replayable(read_recording(tmp_path / "saved.mcap")).events, replayable(raw.contents).events
    assert len(saved) > len(whole) // 3
    assert saved == whole[: len(saved)]


def test_bytes_in_large_blocks_are_decided_a_block_at_a_time(raw: Recorded) -> None:
    """Else a day of bytes would be held at once: each call of `feed` gets as many pieces as rows were asked for, and then ticks."""
    sizes = [sum(isinstance(e, RawBytes) for e in batch) for batch in _batches(replayable(raw.contents).events, 30)]
    assert set(sizes[:-1]) == {30}


def test_the_first_epoch_of_bytes_is_that_of_their_first_row(raw: Recorded) -> None:
    assert first_epoch_ns(replayable(raw.contents)) == START_NS


# From a snapshot


def minutes(after: int) -> int:
    return START_NS + after * 60 * NS_PER_S


def test_there_is_a_snapshot_at_the_head_and_every_hour(slow: Recorded) -> None:
    taken = [e.log_ns for e in slow.contents.entries if e.topic == "/snapshot"]
    assert [(t - taken[0]) // (60 * NS_PER_S) for t in taken] == [0, 60, 120]


def test_a_snapshot_in_the_middle_remembers_a_satellite_that_is_out(slow: Recorded) -> None:
    snapshot = replayable(slow.contents, None, minutes(61)).snapshot
    assert snapshot is not None
    assert [x.satellite for x in snapshot.exclusions] == ["G07"]


def test_a_snapshot_in_the_middle_remembers_how_strong_signals_were(slow: Recorded) -> None:
    part = [r.cause for r in replayed(slow.contents, start_ns=minutes(61)) if minutes(62) <= r.gps_time_ns < minutes(64)]
    assert set(part) == {Cause.JAMMING}


@pytest.mark.parametrize("from_minute", [0, 1, 30, 59, 60, 61, 74, 76, 119, 120, 121, 134])
def test_from_a_time_is_decided_as_in_the_whole(slow: Recorded, from_minute: int) -> None:
    start_ns = minutes(from_minute)
    whole = [r for r in replayed(slow.contents) if r.gps_time_ns >= start_ns]
    part = [r for r in replayed(slow.contents, start_ns=start_ns) if r.gps_time_ns >= start_ns]
    assert whole
    assert decisions_sha256(part) == decisions_sha256(whole)


@pytest.mark.parametrize(("from_minute", "epochs"), [(59, 270), (61, 150), (119, 150), (121, 30), (134, 30)])
def test_from_a_time_only_the_hour_around_it_is_decided(slow: Recorded, from_minute: int, epochs: int) -> None:
    assert len(replayed(slow.contents, start_ns=minutes(from_minute))) == epochs


@pytest.mark.parametrize("block_epochs", [1, 7])
def test_from_a_snapshot_another_block_size_changes_nothing(slow: Recorded, block_epochs: int) -> None:
    start_ns = minutes(61)
    assert decisions_sha256(replayed(slow.contents, block_epochs, start_ns)) == decisions_sha256(replayed(slow.contents, 1000, start_ns))


def test_an_end_is_not_included(slow: Recorded) -> None:
    at = [r.gps_time_ns for r in reports(slow.outputs)]
    assert [r.gps_time_ns for r in replayed(slow.contents, end_ns=at[10])] == at[:10]


def test_a_window_that_ends_before_it_begins_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"ends \(2026-03-02T03:00:00Z\) before it begins \(2026-03-02T04:00:00Z\)"):
        window("2026-03-02T04:00:00Z", "2026-03-02T03:00:00Z")


def test_a_window_in_no_time_is_refused_with_an_example() -> None:
    with pytest.raises(ConfigError, match="'yesterday'; write it like 2010-03-18T05:20:00Z"):
        window("yesterday", None)


def test_a_window_is_utc() -> None:
    assert window("2026-03-02T03:00:00Z", None) == (parse_utc("2026-03-02T03:00:00Z"), None)


# Other promises, other receivers


def test_other_promises_begin_anew_with_what_was_decided(slow: Recorded) -> None:
    other = override_site(SLOW_SITE, ["false_stops_per_year=2.0"])
    snapshot = replayable(slow.contents, other, minutes(61)).snapshot
    assert snapshot is not None
    assert (snapshot.health, snapshot.exclusions, snapshot.last_clean) == (Health(), (), None)


def test_other_promises_keep_what_was_received(slow: Recorded) -> None:
    other = override_site(SLOW_SITE, ["false_stops_per_year=2.0"])
    anew, own = replayable(slow.contents, other, minutes(61)).snapshot, replayable(slow.contents, None, minutes(61)).snapshot
    assert anew is not None
    assert own is not None
    assert anew.ephemerides == own.ephemerides != ()
    assert replace(anew.assembler, last_rows=()) == replace(own.assembler, last_rows=())  # rows hold arrays, which have no truth value


def test_other_promises_are_not_ready_at_first(slow: Recorded) -> None:
    todo = replayable(slow.contents, override_site(SLOW_SITE, ["false_stops_per_year=2.0"]), minutes(121))
    outputs, _ = decide(todo.site, todo.events, todo.snapshot)
    assert reports(outputs)[0].cause is Cause.NOT_READY


def test_other_promises_reach_normal_with_the_ephemerides_of_before(slow: Recorded) -> None:
    todo = replayable(slow.contents, override_site(SLOW_SITE, ["false_stops_per_year=2.0"]), minutes(121))
    outputs, _ = decide(todo.site, todo.events, todo.snapshot)
    assert reports(outputs)[-1].state is State.NORMAL


def test_other_names_of_receivers_are_refused(fast: Recorded) -> None:
    renamed = parse_site(edited(("[receivers.C]", "[receivers.D]")), "other.toml")
    with pytest.raises(ConfigError, match="the site file has receivers A, B, D, the recording A, B, C: name them as recorded"):
        replayable(fast.contents, renamed)


def test_a_recording_whose_head_is_missing_is_refused(fast: Recorded) -> None:
    headless = replace(fast.contents, entries=fast.contents.entries[1:])
    with pytest.raises(RecordingError, match="begins with /snapshot, expected /started"):
        started(headless)


def test_nothing_to_record_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="nothing to record"):
        decide_and_record(tmp_path / "x.mcap", SITE, [], {})


# Repeated, backward and silent streams, as a station may have recorded them


def published(events: Sequence[Event]) -> list[tuple[object, ...]]:
    outputs, _ = decide(SITE, events)
    return [(r.gps_time_ns, r.state, r.cause, r.excluded) for r in reports(outputs)]


def test_epochs_that_come_twice_are_decided_once_and_as_before() -> None:
    twice = [copy for event in stream(SECONDS) for copy in ([event, event] if isinstance(event, ObservationsReceived) else [event])]
    assert published(twice) == published(stream(SECONDS))


def test_time_that_jumps_back_is_not_decided_again() -> None:
    events = stream(SECONDS)
    rows = [e for e in events if isinstance(e, ObservationsReceived)]
    again = [replace(e, mono_ns=rows[-1].mono_ns + NS_PER_S) for e in rows[:30]]
    assert published([*events, *again]) == published(events)


def test_a_stream_in_which_no_receiver_speaks_is_never_normal() -> None:
    silent = [e for e in stream(SECONDS) if isinstance(e, Tick)]
    outputs, _ = decide(SITE, silent)
    assert {(o.state, o.cause) for o in outputs[1:]} == {(State.NOT_CONFIRMABLE, Cause.DATA)}


def test_after_the_last_row_only_silence_is_published() -> None:
    events = stream(SECONDS)
    outputs, _ = decide(SITE, [*events, *ticks_only(events[-1], 10)])
    assert [o.state for o in outputs[-8:]] == [State.NOT_CONFIRMABLE] * 8


def test_receivers_without_a_signal_are_never_normal() -> None:
    events = rows_changed(stream(SECONDS), lambda row: with_signals(row, lambda _: False))
    outputs, _ = decide(SITE, events)
    assert State.NORMAL not in {o.state for o in outputs}


# Recovery


def chunk_seconds(path: Path) -> list[tuple[int, int]]:
    """For each chunk, in order, where it ends in the file and the second of recorded time that it holds; by the MCAP library's index."""
    with path.open("rb") as file:
        indexes = make_reader(file).get_summary().chunk_indexes
    return sorted((i.chunk_start_offset + i.chunk_length, i.message_start_time // NS_PER_S) for i in indexes)


def cut(path: Path, target: Path, size: int) -> Path:
    target.write_bytes(path.read_bytes()[:size])
    return target


def cuts(path: Path) -> list[int]:
    """Places in the head and the first chunk, in the summary at the end, in the chunks between, and around the ends of some."""
    rng = random.Random(50)
    ends = [end for end, _ in chunk_seconds(path)]
    parts = [(0, ends[0])] * 5 + [(ends[-1], path.stat().st_size)] * 5 + [(ends[0], ends[-1])] * (CUTS - 19)
    return [rng.randrange(*part) for part in parts] + [end + by for end in (ends[0], ends[20], ends[-1]) for by in (-1, 0, 1)]


@pytest.fixture(scope="module")
def cut_places(fast: Recorded) -> list[tuple[int, int]]:
    """Sizes of cut files, each with the second of recorded time in which the cut fell."""
    seconds = chunk_seconds(fast.path)
    return [(size, next((s for end, s in seconds if end > size), seconds[-1][1] + 1)) for size in cuts(fast.path)]


def test_cuts_fall_into_the_first_second_and_many_others(cut_places: list[tuple[int, int]]) -> None:
    seconds = {second for _, second in cut_places}
    assert len(cut_places) == CUTS
    assert len(seconds) > 20


def first_second(fast: Recorded) -> int:
    return fast.contents.entries[0].log_ns // NS_PER_S


def test_a_cut_file_is_recovered_up_to_the_second_of_the_cut(fast: Recorded, cut_places: list[tuple[int, int]], tmp_path: Path) -> None:
    for size, second in cut_places:
        if second == first_second(fast):
            continue
        recover(cut(fast.path, tmp_path / "cut.mcap", size), tmp_path / "saved.mcap")
        saved = [(e.topic, e.log_ns, e.data) for e in read_recording(tmp_path / "saved.mcap").entries]
        whole = [(e.topic, e.log_ns, e.data) for e in fast.contents.entries if e.log_ns // NS_PER_S < second]
        assert saved == whole, size


def test_a_recovered_file_is_decided_as_the_original_was_up_to_the_cut(
    fast: Recorded, cut_places: list[tuple[int, int]], tmp_path: Path
) -> None:
    originally = reports(fast.outputs)
    for size, second in cut_places:
        if second == first_second(fast):
            continue
        recover(cut(fast.path, tmp_path / "cut.mcap", size), tmp_path / "saved.mcap")
        again = replayed(read_recording(tmp_path / "saved.mcap"))
        until = [r for r in originally if utc_from_gps(r.gps_time_ns) // NS_PER_S < second]
        assert decisions_sha256(again) == decisions_sha256(until), size


def test_a_recovered_file_differs_nowhere_from_its_own_record(fast: Recorded, tmp_path: Path) -> None:
    size = fast.path.stat().st_size * 2 // 3
    recover(cut(fast.path, tmp_path / "cut.mcap", size), tmp_path / "saved.mcap")
    saved = read_recording(tmp_path / "saved.mcap")
    assert differences(recorded_reports(saved, None, None), replayed(saved)) == []


def test_a_file_cut_in_its_first_second_is_refused_by_name(fast: Recorded, cut_places: list[tuple[int, int]], tmp_path: Path) -> None:
    early = [size for size, second in cut_places if second == first_second(fast)]
    assert early
    for size in early:
        with pytest.raises(RecordingError, match=r"cut\.mcap: .*(nothing to decide|not an MCAP recording)"):
            recover(cut(fast.path, tmp_path / "cut.mcap", size), tmp_path / "saved.mcap")
        assert not (tmp_path / "saved.mcap").exists()


def test_recovering_a_whole_file_gives_the_same_bytes(fast: Recorded, tmp_path: Path) -> None:
    recover(fast.path, tmp_path / "saved.mcap")
    assert (tmp_path / "saved.mcap").read_bytes() == fast.path.read_bytes()


def test_recovering_keeps_the_truth(fast: Recorded, tmp_path: Path) -> None:
    recover(cut(fast.path, tmp_path / "cut.mcap", fast.path.stat().st_size // 2), tmp_path / "saved.mcap")
    assert read_recording(tmp_path / "saved.mcap").metadata == fast.contents.metadata


def test_a_recovery_that_fails_leaves_the_file_that_was_there(fast: Recorded, tmp_path: Path) -> None:
    (tmp_path / "saved.mcap").write_bytes(b"precious")
    with pytest.raises(RecordingError):
        recover(cut(fast.path, tmp_path / "cut.mcap", 5000), tmp_path / "saved.mcap")
    assert (tmp_path / "saved.mcap").read_bytes() == b"precious"


def damaged_in_second_20(fast: Recorded, target: Path) -> Path:
    end, _ = chunk_seconds(fast.path)[20]
    content = bytearray(fast.path.read_bytes())
    content[end - 30] ^= 0xFF
    target.write_bytes(content)
    return target


def test_of_a_file_damaged_in_its_middle_all_but_that_second_is_recovered(fast: Recorded, tmp_path: Path) -> None:
    recover(damaged_in_second_20(fast, tmp_path / "damaged.mcap"), tmp_path / "saved.mcap")
    lost = first_second(fast) + 20
    saved = [(e.topic, e.log_ns) for e in read_recording(tmp_path / "saved.mcap").entries]
    assert saved == [(e.topic, e.log_ns) for e in fast.contents.entries if e.log_ns // NS_PER_S != lost]


def test_before_the_damage_is_decided_as_it_was(fast: Recorded, tmp_path: Path) -> None:
    recover(damaged_in_second_20(fast, tmp_path / "damaged.mcap"), tmp_path / "saved.mcap")
    again = replayed(read_recording(tmp_path / "saved.mcap"))
    assert decisions_sha256(again[:20]) == decisions_sha256(reports(fast.outputs)[:20])


def test_damage_is_told(fast: Recorded, tmp_path: Path) -> None:
    found = complaints(salvage(damaged_in_second_20(fast, tmp_path / "damaged.mcap")))
    assert len(found) == 1
    assert "damaged" in found[0]


def test_of_a_whole_file_there_is_nothing_to_complain(fast: Recorded) -> None:
    assert complaints(fast.contents) == []


def test_a_file_without_its_snapshot_is_a_complaint(fast: Recorded) -> None:
    entries = tuple(e for e in fast.contents.entries if e.topic != "/snapshot")
    assert complaints(replace(fast.contents, entries=entries)) == ["begins with /started and /ionosphere, expected /started and /snapshot"]


def test_log_time_that_steps_back_is_a_complaint(fast: Recorded) -> None:
    entries = fast.contents.entries
    assert complaints(replace(fast.contents, entries=(*entries, entries[1]))) == ["log time steps back"]


def test_the_span_is_that_of_first_and_last_message(fast: Recorded) -> None:
    assert span_utc(fast.contents) == ("2026-03-02T03:00:00Z", "2026-03-02T03:00:39Z")


# Secrets

SOURCES = {
    "plain": "ntrip://user:hunter2@caster.example:2101/MOUNT",
    "password with @": "ntrip://user:x@hunter2@caster.example:2101/MOUNT",
    "password with quote": "ntrip://user:it's-hunter2@caster.example:2101/MOUNT",
    "no user": "ntrip://:hunter2@caster.example:2101/MOUNT",
    "capitals": "NTRIP://user:hunter2@caster.example:2101/MOUNT",
    "percent": "ntrip://user:hunter2%40@caster.example:2101/MOUNT",
}


@pytest.mark.parametrize("kind", SOURCES)
def test_no_password_is_in_a_recording(kind: str, tmp_path: Path) -> None:
    try:
        site = parse_site(SITE_TEXT.replace("ntrip://user:secret@caster.example:2101/MOUNT", SOURCES[kind]), "site.toml")
    except ConfigError:
        return  # refused: then there is nothing to leak
    recorded(tmp_path / "x.mcap", site, stream(2.0))
    everything = b"".join(e.data for e in read_recording(tmp_path / "x.mcap").entries)
    assert b"hunter2" not in everything


def test_the_user_and_the_caster_are_in_a_recording(fast: Recorded) -> None:
    assert recorded_site(fast.contents).sources["C"] == "ntrip://user:***@caster.example:2101/MOUNT"


def test_a_site_without_its_password_decides_as_with_it(fast: Recorded) -> None:
    assert recorded_site(fast.contents).config == SITE.config
