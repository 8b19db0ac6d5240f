"""A recording of bytes of receivers, as a station makes it, is decided again as it was, to the byte and the nanosecond."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from integrity.events import Event, RawBytes
from integrity.gnss.gps_time import utc_from_gps
from integrity.messages import wayside_pb2 as pb
from integrity.states import Cause
from recordings.diff import differences, recorded_reports
from recordings.reader import read_recording
from recordings.replay import Boot, _batches, decide_and_record, first_epoch_ns, recover, replayable, started
from recordings.simulate.observations import antennas_of
from recordings.simulate.receiver import as_bytes
from recordings.summary import decisions_sha256
from tests.unit.recording.replayed import EVENTS, SITE, Recorded, cut, replayed
from tests.unit.streams import START_NS, reports

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
