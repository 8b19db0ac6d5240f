"""Decides a train's recording again: the same events, the same localiser; and compares with what was recorded."""

import csv
import hashlib
import json
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from integrity.errors import ConfigError, DecodeError, RecordingError
from integrity.events import RawBytes
from integrity.gnss.gps_time import format_utc
from integrity.messages import wayside_pb2 as pb
from recordings.channels import is_input, receiver_of
from recordings.reader import Contents
from train_client.events import TrainEvent
from train_client.localisation.localiser import TrainLocaliser
from train_client.localisation.memory import LocaliserMemory
from train_client.messages import decode_event, encode_position
from train_client.outputs import PositionReport, TrustChange
from train_client.snapshots import decode_snapshot
from train_client.track.checks import load_map
from train_client.track.track_map import TrackMap
from train_client.train_file import TrainFile, parse_train


@dataclass(frozen=True)
class Replayed:
    """What was decided again: `positions` in order, and changes of trust."""

    train: TrainFile
    track: TrackMap
    positions: tuple[pb.TrainPosition, ...]
    changes: tuple[TrustChange, ...]
    recorded: tuple[pb.TrainPosition, ...]


def started(contents: Contents) -> pb.TrainStarted:
    """The first message of a train's recording."""
    first = contents.entries[0].message
    if not isinstance(first, pb.TrainStarted):
        raise RecordingError(
            f"{contents.path}: begins with {contents.entries[0].topic}, expected /train_started: a train's recording is needed here "
            "(`wayside replay` decides those of stations)"
        )
    return first


def replay(contents: Contents, train: TrainFile | None, track: TrackMap | None) -> Replayed:
    """Decide again, with another train file or map where they are given; the keys trusted are those recorded.

    With other ones it starts from nothing: what was remembered was of another train, or of another line.
    """
    head = started(contents)
    chosen = train or parse_train(head.train_toml, f"{contents.path}: recorded train file")
    on = track or load_map(head.map_json, f"{contents.path}: recorded map")
    keys = {site: [key.public_key for key in head.trusted_keys if key.site == site] for site in chosen.config.stations}
    if unknown := [site for site, of in keys.items() if not of]:
        sites = ", ".join(sorted({key.site for key in head.trusted_keys})) or "none"
        raise ConfigError(f"{contents.path}: no key of station {unknown[0]} was trusted then, only of {sites}")
    same = chosen.config.config_sha256 == head.config_sha256 and on.sha256 == load_map(head.map_json, "recorded map").sha256
    localiser = TrainLocaliser(chosen.config, on, keys, _memory(contents, on) if same else None)
    positions, changes = [], []
    for output in localiser.feed(_events(contents)):
        if isinstance(output, PositionReport):
            positions.append(encode_position(output, chosen.config, on))
        elif isinstance(output, TrustChange):
            changes.append(output)
    recorded = tuple(entry.message for entry in contents.entries if isinstance(entry.message, pb.TrainPosition))
    return Replayed(chosen, on, tuple(positions), tuple(changes), recorded)


def _memory(contents: Contents, track: TrackMap) -> LocaliserMemory | None:
    """What the train remembered when the recording began."""
    snapshot = contents.entries[1].message if len(contents.entries) > 1 else None
    if not isinstance(snapshot, pb.TrainSnapshot):
        return None
    try:
        return decode_snapshot(snapshot, track)
    except DecodeError as error:
        raise RecordingError(f"{contents.path}: {error}; expected what a train of Wayside wrote") from None


def _events(contents: Contents) -> Iterator[TrainEvent]:
    """Inputs in order; bytes of receivers arrived at their log time."""
    offset_ns = contents.entries[0].log_ns - started(contents).mono_ns
    for entry in contents.entries:
        receiver = receiver_of(entry.topic)
        if not is_input(entry.topic):
            continue
        if isinstance(entry.message, bytes) and receiver is not None:
            yield RawBytes(entry.log_ns - offset_ns, receiver, entry.message)
        elif not isinstance(entry.message, bytes):
            try:
                yield decode_event(entry.message)
            except DecodeError as error:
                raise RecordingError(f"{contents.path}: {error}; expected what a train of Wayside wrote") from None


def differences(recorded: Sequence[pb.TrainPosition], decided: Sequence[pb.TrainPosition]) -> list[str]:
    """One line per position that is decided otherwise; `software` alone may differ. An end that a cut took away is no difference."""
    lines = []
    for then, now in zip(recorded, decided, strict=False):
        a, b = pb.TrainPosition(), pb.TrainPosition()
        a.CopyFrom(then)
        b.CopyFrom(now)
        a.software = b.software = ""
        if a != b:
            names = sorted({field.name for field in a.DESCRIPTOR.fields if getattr(a, field.name) != getattr(b, field.name)})
            lines.append(f"position {then.sequence} ({_when(then)}): {', '.join(names)} differ")
    if len(decided) < len(recorded):
        lines.append(f"{len(recorded)} positions were recorded, {len(decided)} are decided now")
    return lines


def positions_sha256(positions: Iterable[pb.TrainPosition]) -> str:
    """SHA-256 over one JSON line per position: epoch, status, trust, edge, and offset in whole millimetres."""
    digest = hashlib.sha256()
    for p in positions:
        place = [p.front.edge, round(1000 * p.front.offset_m)] if p.HasField("front") else []
        row = [p.gps_time_ns, pb.PositionStatus.Name(p.status), pb.TrustState.Name(p.trust), *place]
        digest.update(json.dumps(row, separators=(",", ":")).encode() + b"\n")
    return digest.hexdigest()


def summary(name: str, done: Replayed) -> dict[str, Any]:
    """What `--json` prints."""
    return {
        "recording": name,
        "train": done.train.config.train_id,
        "map": done.track.id,
        "map_sha256": done.track.sha256,
        "config_sha256": done.train.config.config_sha256,
        "positions": len(done.positions),
        "statuses": dict(sorted(Counter(word(pb.PositionStatus.Name(p.status)) for p in done.positions).items())),
        "trust": [{"mono_ns": c.mono_ns, "site": c.site, "state": c.state.value, "reasons": list(c.reasons)} for c in done.changes],
        "refused_messages": done.positions[-1].refused_messages if done.positions else 0,
        "positions_sha256": positions_sha256(done.positions),
    }


def render(name: str, done: Replayed) -> str:
    """The same for people: a line per change of trust, and what became of the positions."""
    told = summary(name, done)
    counts = ", ".join(f"{n} {status}" for status, n in told["statuses"].items())
    lines = [f"train {told['train']} on map {told['map']}: {told['positions']} positions ({counts})"]
    first_ns = done.positions[0].mono_ns if done.positions else 0
    lines += [f"  {(c.mono_ns - first_ns) / 1e9:8.2f} s  {c.site}  {c.state.value:<17}  {'; '.join(c.reasons)}" for c in done.changes]
    return "\n".join([*lines, f"positions_sha256 {told['positions_sha256']}"]) + "\n"


def write_epochs_csv(path: Path, positions: Sequence[pb.TrainPosition]) -> None:
    """A row per position."""
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(("gps_time_ns", "utc", "status", "trust", "edge", "front_m", "rear_m", "sigma_m", "distance_m", "reasons"))
        for p in positions:
            known = p.HasField("front")
            rows.writerow(
                (
                    p.gps_time_ns if p.HasField("gps_time_ns") else "",
                    _when(p) if p.HasField("gps_time_ns") else "",
                    word(pb.PositionStatus.Name(p.status)),
                    word(pb.TrustState.Name(p.trust)),
                    p.front.edge if known else "",
                    f"{p.front.offset_m:.3f}" if known else "",
                    f"{p.rear.offset_m:.3f}" if known else "",
                    f"{p.sigma_m:.3f}" if known else "",
                    f"{p.distance_m:.3f}" if p.HasField("distance_m") else "",
                    "; ".join(p.reasons),
                )
            )


def word(name: str) -> str:
    """`VALID` of `POSITION_VALID`, `NO_COMMS` of `TRUST_NO_COMMS`."""
    return name.partition("_")[2]


def _when(position: pb.TrainPosition) -> str:
    return format_utc(position.gps_time_ns) if position.HasField("gps_time_ns") else "no epoch"
