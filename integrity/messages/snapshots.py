"""The whole memory of a monitor to a message and back."""

from collections.abc import Sequence

import numpy as np

from integrity.assembler import AssemblerState
from integrity.errors import DecodeError
from integrity.exclusion import Exclusion
from integrity.gnss.observations import Floats, Ints
from integrity.health import Health
from integrity.lateness import Fastest
from integrity.messages import wayside_pb2 as pb
from integrity.messages.ephemerides import decode_ephemeris, encode_ephemeris
from integrity.messages.inputs import (
    decode_ionosphere,
    decode_row,
    decode_tick,
    encode_ionosphere,
    encode_row,
)
from integrity.messages.monitors import decode_monitors, encode_monitors, encode_tick
from integrity.messages.outputs import CAUSES, STATES, encode_exclusion
from integrity.messages.receptions import decode_reception, decode_status, encode_reception, encode_status
from integrity.naming import LastClean
from integrity.station_monitor import Snapshot
from integrity.stream_memory import StreamMemory

_STATE_OF = {number: state for state, number in STATES.items()}
_CAUSE_OF = {number: cause for cause, number in CAUSES.items()}


def encode_snapshot(snapshot: Snapshot, receivers: tuple[str, ...], mono_ns: int) -> pb.Snapshot:
    """A snapshot taken at `mono_ns`; rows of the stream memory in the order of `receivers`."""
    assembler, streams, health, last = snapshot.assembler, snapshot.streams, snapshot.health, snapshot.last_clean
    return pb.Snapshot(
        mono_ns=mono_ns,
        receiver=receivers,
        signal=streams.signals,
        streams_epoch_ns=streams.epoch_ns,
        streams=[
            pb.StreamMemory(last_seen_ns=seen.tolist(), pseudorange_m=rho.tolist(), cn0_baseline_dbhz=cn0.tolist())
            for seen, rho, cn0 in zip(streams.last_seen_ns, streams.pseudorange_m, streams.cn0_baseline_dbhz, strict=True)
        ],
        pending=[pb.PendingEpoch(epoch_ns=epoch_ns, rows=[encode_row(row, 0) for row in rows]) for epoch_ns, rows in assembler.pending],
        last_epoch_ns=assembler.last_epoch_ns,
        heard_ns=dict(assembler.heard_ns),
        aligned_ns=assembler.aligned_ns,
        silence_told=assembler.silence_told,
        dropped=dict(assembler.dropped),
        refused_ephemerides=assembler.refused_ephemerides,
        ionosphere=None if assembler.klobuchar is None else encode_ionosphere(assembler.klobuchar, 0),
        ephemerides=[encode_ephemeris(eph, 0) for eph in snapshot.ephemerides],
        exclusions=[encode_exclusion(x) for x in snapshot.exclusions],
        last_clean=None if last is None else pb.LastClean(gps_ns=last.gps_ns, e_enu_m=last.e_enu_m.ravel().tolist()),
        state=STATES[health.state],
        cause=CAUSES[health.cause],
        subjects=health.subjects,
        clean_since_ns=health.clean_since_ns,
        clean_epochs=health.clean_epochs,
        started=health.started,
        sequence=snapshot.sequence,
        reception=[encode_reception(m) for m in snapshot.reception],
        status={receiver: encode_status(status) for receiver, status in assembler.statuses},
        last_rows=[encode_row(row, 0) for row in assembler.last_rows],
        monitors=None if snapshot.monitors is None else encode_monitors(snapshot.monitors),
        tick=encode_tick(assembler.tick),
        fastest=None if assembler.fastest is None else pb.Fastest(**assembler.fastest._asdict()),
        silent=snapshot.silent,
    )


def decode_snapshot(message: pb.Snapshot) -> Snapshot:
    """The memory that a message records; DecodeError where its parts do not fit each other."""
    try:
        health = Health(
            _STATE_OF[message.state],
            _CAUSE_OF[message.cause],
            tuple(message.subjects),
            message.clean_since_ns if message.HasField("clean_since_ns") else None,
            message.clean_epochs,
            message.started,
        )
    except (KeyError, ValueError) as error:
        raise DecodeError(f"snapshot: state {message.state} with cause {message.cause}: {error}") from None
    if len(set(message.signal)) != len(message.signal):
        raise DecodeError("snapshot: a signal stands twice")
    shape = (len(message.receiver), len(message.signal))
    streams = StreamMemory(
        tuple(message.signal),
        message.streams_epoch_ns,
        _integers([s.last_seen_ns for s in message.streams], shape),
        _rows([s.pseudorange_m for s in message.streams], shape),
        _rows([s.cn0_baseline_dbhz for s in message.streams], shape),
    )
    fastest = message.fastest
    assembler = AssemblerState(
        pending=tuple((p.epoch_ns, tuple(decode_row(row) for row in p.rows)) for p in message.pending),
        last_epoch_ns=message.last_epoch_ns if message.HasField("last_epoch_ns") else None,
        heard_ns=tuple(sorted(message.heard_ns.items())),
        aligned_ns=message.aligned_ns if message.HasField("aligned_ns") else None,
        silence_told=message.silence_told,
        klobuchar=decode_ionosphere(message.ionosphere) if message.HasField("ionosphere") else None,
        dropped=tuple(sorted(message.dropped.items())),
        refused_ephemerides=message.refused_ephemerides,
        last_rows=tuple(decode_row(row) for row in message.last_rows),
        statuses=tuple(sorted((receiver, decode_status(status)) for receiver, status in message.status.items())),
        tick=decode_tick(message.tick) if message.HasField("tick") else None,
        fastest=Fastest(fastest.since_gps_ns, fastest.offset_ns, fastest.offset_before_ns) if message.HasField("fastest") else None,
    )
    last = message.last_clean
    n = len(message.receiver)
    if message.HasField("last_clean") and len(last.e_enu_m) != 3 * n:
        raise DecodeError(f"snapshot: {len(last.e_enu_m)} components of the last clean epoch, expected {3 * n}")
    return Snapshot(
        streams=streams,
        reception=tuple(decode_reception(m) for m in message.reception),
        assembler=assembler,
        ephemerides=tuple(decode_ephemeris(e) for e in message.ephemerides),
        exclusions=tuple(_exclusion(x) for x in message.exclusions),
        last_clean=LastClean(last.gps_ns, np.array(last.e_enu_m).reshape(n, 3)) if message.HasField("last_clean") else None,
        health=health,
        sequence=message.sequence,
        monitors=decode_monitors(message.monitors, n, assembler.last_epoch_ns) if message.HasField("monitors") else None,
        silent=tuple(message.silent),
    )


def _rows(rows: Sequence[Sequence[float]], shape: tuple[int, int]) -> Floats:
    lengths = {len(row) for row in rows}
    if len(rows) != shape[0] or lengths - {shape[1]}:
        raise DecodeError(f"snapshot: stream memory of {len(rows)} rows of {sorted(lengths)}, expected {shape[0]} of {shape[1]}")
    return np.array([list(row) for row in rows], dtype=np.float64).reshape(shape)


def _integers(rows: Sequence[Sequence[int]], shape: tuple[int, int]) -> Ints:
    _rows(rows, shape)
    return np.array([list(row) for row in rows], dtype=np.int64).reshape(shape)


def _exclusion(message: pb.Exclusion) -> Exclusion:
    return Exclusion(
        message.satellite,
        message.since_ns,
        message.check,
        message.statistic,
        message.threshold,
        message.clean_since_ns if message.HasField("clean_since_ns") else None,
        message.clean_epochs,
    )
