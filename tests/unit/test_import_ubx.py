"""Logs of three receivers become one stream: every byte is kept, what lines up is decided, and nothing is known before it was received."""

import gzip
import struct
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from integrity.errors import DecodeError
from integrity.events import Event, RawBytes, Tick
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS
from integrity.gnss.ubx.framing import Framer, frame_bytes
from integrity.gnss.ubx.rawx import RAWX_HEADER
from integrity.gnss.ubx.sfrbx import RXM_SFRBX
from integrity.states import State
from recordings.importer import Imported, import_files, read_files
from recordings.simulate.observations import antennas_of
from recordings.simulate.receiver import as_bytes
from recordings.ubx_files import CHUNK_BYTES, UbxLog
from tests.rinex_text import observation_text, rows_of
from tests.unit.streams import SITE, health, new_monitor, reports, rows_changed, stream

EPOCHS = 12
NAMES = SITE.receiver_names
EVENTS = stream(EPOCHS)
AT = [row.receive_time_ns for row in rows_of(EVENTS, "A")]
NMEA = b"$GNGGA,030000.00,3541.0,N,13928.5,E,1,12,0.7,80.1,M,39.0,M,,*5B\r\n"

Bursts = Mapping[str, Sequence[bytes]]


def bursts_of(events: Sequence[Event]) -> dict[str, list[bytes]]:
    """What each receiver sent, epoch by epoch; the measurements stand last."""
    sent = [event for event in as_bytes(events, antennas_of(SITE)) if isinstance(event, RawBytes)]
    return {name: [event.data for event in sent if event.receiver == name] for name in NAMES}


BURSTS = bursts_of(EVENTS)
LOG = {name: b"".join(bursts) for name, bursts in BURSTS.items()}


def written(directory: Path, name: str, data: bytes) -> Path:
    path = directory / name
    path.write_bytes(data)
    return path


def imported(directory: Path, changed: Mapping[str, bytes | Sequence[bytes]] | None = None, start: int | None = None) -> Imported:
    """The logs, with other files for some receivers, from an epoch on."""
    files: dict[str, list[Path]] = {}
    for name, data in (LOG | dict(changed or {})).items():
        parts = [data] if isinstance(data, bytes) else data
        files[name] = [written(directory, f"{name}{i}.bin", part) for i, part in enumerate(parts)]
    return import_files(SITE, {n: read_files(paths, n) for n, paths in files.items()}, [], None if start is None else AT[start])


def bytes_of(result: Imported, receiver: str) -> bytes:
    return b"".join(e.data for e in result.events if isinstance(e, RawBytes) and e.receiver == receiver)


def ticks_ns(result: Imported) -> list[int]:
    return [event.mono_ns for event in result.events if isinstance(event, Tick)]


def solved_epochs(result: Imported) -> list[int]:
    """Numbers of the epochs at which all receivers have a position."""
    found = reports(new_monitor().feed(result.events))
    return [(r.gps_time_ns - AT[0]) // NS_PER_S for r in found if np.isfinite(r.e_enu_m).all()]


def with_words(bursts: Sequence[bytes], keep: bool) -> list[bytes]:
    """Of each burst the navigation words, or everything else."""
    frames = [[f for f in Framer().feed(burst) if (f[:2] == RXM_SFRBX) == keep] for burst in bursts]
    return [b"".join(frame_bytes(*f) for f in burst) for burst in frames]


def without_time(burst: bytes) -> bytes:
    """A burst of a receiver that does not know the week yet."""
    *others, measured = Framer().feed(burst)
    tow_s, _, *rest = RAWX_HEADER.unpack_from(measured.payload)
    payload = RAWX_HEADER.pack(tow_s, 0, *rest) + measured.payload[RAWX_HEADER.size :]
    return b"".join(frame_bytes(*f) for f in [*others, measured._replace(payload=payload)])


# Sound logs


@pytest.mark.parametrize("receiver", NAMES)
def test_every_byte_is_kept_in_order(tmp_path: Path, receiver: str) -> None:
    log = NMEA + LOG[receiver] + NMEA + b"\xb5\x62"
    assert bytes_of(imported(tmp_path, {receiver: log}), receiver) == log


def test_an_import_is_decided_as_the_bytes_of_a_live_station(tmp_path: Path) -> None:
    live, decided = (
        [(r.gps_time_ns, r.verdict, r.e_enu_m.tolist()) for r in reports(new_monitor().feed(events))]
        for events in (as_bytes(EVENTS, antennas_of(SITE)), imported(tmp_path).events)
    )
    assert decided == live


def test_nothing_of_sound_logs_is_left_out(tmp_path: Path) -> None:
    result = imported(tmp_path)
    assert (result.dropped, result.passed_over) == ({name: {} for name in NAMES}, {name: {} for name in NAMES})


def test_a_log_is_known_by_its_content_and_may_be_gzipped(tmp_path: Path) -> None:
    members = gzip.compress(LOG["B"][:5000], mtime=0) + gzip.compress(LOG["B"][5000:], mtime=0)
    assert imported(tmp_path, {"B": members}).events == imported(tmp_path).events


def test_a_log_longer_than_what_is_read_at_a_time_is_the_same(tmp_path: Path) -> None:
    filler = NMEA * (CHUNK_BYTES // len(NMEA) + 1)
    log = b"".join(burst + filler for burst in BURSTS["A"][:3]) + b"".join(BURSTS["A"][3:])
    result = imported(tmp_path, {"A": log})
    assert (result.epochs, bytes_of(result, "A") == log) == (EPOCHS, True)


def test_text_between_the_frames_is_counted_by_its_bytes(tmp_path: Path) -> None:
    result = imported(tmp_path, {"A": NMEA.join(BURSTS["A"])})
    assert result.passed_over["A"] == {"bytes that are not UBX": (EPOCHS - 1) * len(NMEA)}


def test_a_log_of_an_older_generation_is_cut_at_its_measurements(tmp_path: Path) -> None:
    def measured(tow_ms: int, week: int, times: int = 1) -> bytes:
        satellite = struct.pack("<ddfBbbB", 1.1e8, 2.2e7, 0.0, 5, 7, 45, 0)
        return frame_bytes(0x02, 0x10, struct.pack("<ihBx", tow_ms, week, times) + times * satellite)

    words = frame_bytes(0x02, 0x11, bytes(42))
    log = measured(999, 0) + words + measured(1999, 1481) + NMEA + words + measured(2999, 1481) + measured(3999, 1481, 2) + words
    (read,) = read_files([written(tmp_path, "old.ubx", log)], "A")
    assert isinstance(read, UbxLog)
    assert [piece.receive_time_ns - 1481 * WEEK_NS for piece in read.pieces] == [1_999_000_000, 2_999_000_000]
    assert ([piece.data for piece in read.pieces], read.tail, read.words) == (
        [measured(999, 0) + words + measured(1999, 1481), NMEA + words + measured(2999, 1481)],
        measured(3999, 1481, 2) + words,
        3,
    )
    reasons = "measured before the time was known", "measurements not readable"
    assert [read.passed_over[reason] for reason in reasons] == [1, 1]


def test_receivers_that_log_and_receivers_with_rinex_meet(tmp_path: Path) -> None:
    result = imported(tmp_path, {"B": observation_text(rows_of(EVENTS, "B")).encode("ascii")})
    assert (result.epochs, solved_epochs(result)) == (EPOCHS, list(range(EPOCHS)))


# Time


@pytest.mark.parametrize("off_ns", [-3_000_000, -200, 3_000_000], ids=["3 ms early", "0.2 us early", "3 ms late"])
def test_tags_beside_the_second_line_up_and_the_tick_follows_the_last(tmp_path: Path, off_ns: int) -> None:
    events = rows_changed(EVENTS, lambda row: replace(row, receive_time_ns=row.receive_time_ns + (row.receiver == "B") * off_ns))
    result = imported(tmp_path, {"B": b"".join(bursts_of(events)["B"])})
    assert ticks_ns(result) == [t + max(off_ns, 0) for t in AT]


def test_a_window_takes_whole_epochs_where_one_tag_lies_before_its_start(tmp_path: Path) -> None:
    events = rows_changed(EVENTS, lambda row: replace(row, receive_time_ns=row.receive_time_ns - (row.receiver == "B") * 3_000_000))
    assert imported(tmp_path, {"B": b"".join(bursts_of(events)["B"])}, start=4).epochs == EPOCHS - 4


def test_words_are_not_known_before_they_were_received(tmp_path: Path) -> None:
    def late(name: str) -> bytes:
        silent = with_words(BURSTS[name], keep=False)
        return b"".join([*silent[:6], *with_words(BURSTS[name], keep=True), *silent[6:]])

    assert solved_epochs(imported(tmp_path, {name: late(name) for name in NAMES})) == list(range(6, EPOCHS))


def test_words_after_the_last_measurements_change_no_decision(tmp_path: Path) -> None:
    logs = {name: b"".join([*with_words(b, keep=False), *with_words(b, keep=True)]) for name, b in BURSTS.items()}
    assert solved_epochs(imported(tmp_path, logs)) == []


def test_words_received_before_the_start_are_known_at_the_start(tmp_path: Path) -> None:
    assert solved_epochs(imported(tmp_path, start=5)) == list(range(5, EPOCHS))


def test_of_what_came_before_the_start_only_words_are_kept(tmp_path: Path) -> None:
    kept = bytes_of(imported(tmp_path, start=5), "A")
    assert kept == b"".join([*with_words(BURSTS["A"][:5], keep=True), *BURSTS["A"][5:]])


def test_measurements_without_a_time_are_passed_over_and_their_words_serve(tmp_path: Path) -> None:
    result = imported(tmp_path, {n: b"".join([without_time(b[0]), *b[1:]]) for n, b in BURSTS.items()})
    assert (result.passed_over["A"], solved_epochs(result)) == ({"measured before the time was known": 1}, list(range(1, EPOCHS)))


def test_what_was_measured_before_the_week_jumped_is_dropped(tmp_path: Path) -> None:
    def early(k: int) -> int:
        return -2 * WEEK_NS if k < 4 else 0

    events = rows_changed(
        EVENTS,
        lambda row: replace(row, receive_time_ns=row.receive_time_ns + (row.receiver == "C") * early(AT.index(row.receive_time_ns))),
    )
    result = imported(tmp_path, {"C": b"".join(bursts_of(events)["C"])})
    assert (result.dropped["C"], result.epochs) == ({"before the receiver's time jumped": 4}, EPOCHS - 4)


# Several files, gaps and damage


def test_parts_cut_within_a_frame_and_given_in_any_order_are_one_log(tmp_path: Path) -> None:
    at = len(LOG["A"]) // 2
    assert imported(tmp_path, {"A": [LOG["A"][at:], LOG["A"][:at]]}).events == imported(tmp_path).events


def test_what_two_parts_share_is_kept_once_and_counted(tmp_path: Path) -> None:
    result = imported(tmp_path, {"A": [b"".join(BURSTS["A"][:8]), b"".join(BURSTS["A"][5:])]})
    assert (bytes_of(result, "A") == LOG["A"], result.dropped["A"]) == (True, {"epoch repeated": 3})


def test_two_receivers_in_one_log_are_left_to_the_decision(tmp_path: Path) -> None:
    both = b"".join(a + b for a, b in zip(BURSTS["A"], BURSTS["B"], strict=True))
    published = health(new_monitor().feed(imported(tmp_path, {"A": both}).events))
    told = [h for h in published if h.state is State.NOT_CONFIRMABLE and "two receivers on one link" in " ".join(h.reasons)]
    assert len(told) == EPOCHS


def test_what_lines_up_with_nothing_is_counted_as_the_decision_counts_it(tmp_path: Path) -> None:
    result = imported(tmp_path, {"C": b"".join(BURSTS["C"][:3] + BURSTS["C"][8:])})
    monitor = new_monitor()
    monitor.feed(result.events)
    assert {n: sum(reasons.values()) for n, reasons in result.passed_over.items()} == monitor.dropped == {"A": 5, "B": 5, "C": 0}


def test_in_a_gap_of_one_receiver_silence_is_noticed_once(tmp_path: Path) -> None:
    result = imported(tmp_path, {"C": b"".join(BURSTS["C"][:3] + BURSTS["C"][8:])})
    assert ticks_ns(result) == [*AT[:3], AT[2] + 2 * NS_PER_S + 1, *AT[8:]]


def test_damage_costs_the_epoch_that_it_hits(tmp_path: Path) -> None:
    damaged = bytearray(LOG["B"])
    damaged[sum(map(len, BURSTS["B"][:7])) - 40] ^= 0x10  # in the last measurement of the seventh epoch
    result = imported(tmp_path, {"B": bytes(damaged)})
    assert (result.epochs, result.passed_over["B"]["bad frames"]) == (EPOCHS - 1, 1)


def test_a_gzipped_log_that_was_cut_off_gives_what_is_there(tmp_path: Path) -> None:
    cut = gzip.compress(LOG["B"], compresslevel=0, mtime=0)[: len(LOG["B"]) - 200]
    result = imported(tmp_path, {"B": cut})
    assert (result.epochs, result.dropped["B"]) == (EPOCHS - 1, {"file cut off": 1})


# What cannot be used

OLD = frame_bytes(0x02, 0x10, bytes(8)) + 2 * frame_bytes(0x02, 0x11, bytes(42))
UNUSABLE: dict[str, tuple[bytes, str]] = {
    "text": (b"hello\nworld\n", r"A0\.bin, line 1: found 'hello' and no sound UBX frame in 12 bytes; expected RINEX .*; give a RINEX file"),
    "empty": (b"", r"A0\.bin, line 1: found an empty file"),
    "positions only": (frame_bytes(0x01, 0x07, bytes(92)), r"A0\.bin: found NAV-PVT x 1; expected RXM-RAWX, .*switch both on"),
    "words only": (frame_bytes(0x02, 0x11, bytes(42)), r"A0\.bin: found RXM-SFRB x 1; expected .*before generation 8: RXM-RAW and"),
    "a receiver without time": (without_time(BURSTS["A"][0]), r"A0\.bin: found .*RXM-RAWX x 1.*; expected .* the GPS time"),
    "an older one": (OLD, r"A0\.bin: found RXM-RAW x 1, RXM-SFRB x 2; expected .* the GPS time"),
}


@pytest.mark.parametrize("case", UNUSABLE)
def test_a_file_that_cannot_be_used_is_refused_with_what_was_found(tmp_path: Path, case: str) -> None:
    data, message = UNUSABLE[case]
    with pytest.raises(DecodeError, match=message):
        imported(tmp_path, {"A": data})


def test_logs_that_never_met_are_refused_with_the_span_of_each(tmp_path: Path) -> None:
    events = rows_changed(EVENTS, lambda row: replace(row, receive_time_ns=row.receive_time_ns + 3600 * NS_PER_S))
    with pytest.raises(DecodeError, match=r"no epoch is common to all .*A has 12 from .*03:00:00Z to .*C has 12 from .*04:00:00Z"):
        imported(tmp_path, {"C": b"".join(bursts_of(events)["C"])})


def test_logs_without_words_need_a_navigation_file(tmp_path: Path) -> None:
    with pytest.raises(DecodeError, match=r"no ephemeris serves .*the logs hold no navigation words \(RXM-SFRBX\); give .* --nav"):
        imported(tmp_path, {name: b"".join(with_words(bursts, keep=False)) for name, bursts in BURSTS.items()})
