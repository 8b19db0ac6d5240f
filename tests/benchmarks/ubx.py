"""Framing and decoding of real UBX recordings, and pyubx2's time on the same frames in the same run: `python -m tests.benchmarks.ubx`.

An epoch is one RXM-RAWX message. Ours ends with an `ObservationRow`, pyubx2's with its parsed message. Times are processor time, the
best of several repeats; ours and pyubx2's take turns, so that a busy machine slows both. `single` decodes one payload a call, as a
live station does, `batch` all payloads of the recording in one call, as replay does. `row` is the part of ours that only builds the rows.

`log` is a whole log, synthetic (`synthetic_ubx`): ours from its bytes to blocks, all checksums verified, NaN where nothing was measured:
range, carrier, Doppler, C/N0, lock time, slip and half cycle of every signal, names and times. What a block has no place for (the
receiver's own standard deviations, the channel of GLONASS, leap seconds) is read past. pyubx2 reads the same bytes once, each epoch
a parsed message.
"""

import gzip
import io
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from pyubx2 import UBXReader

from integrity.gnss.observations import ROW_ARRAYS, ObservationBlock, ObservationRow
from integrity.gnss.ubx.framing import Framer, frame_bytes
from integrity.gnss.ubx.located import locate
from integrity.gnss.ubx.rawx import RXM_RAWX, decode_rawx
from integrity.gnss.ubx.rawx_log import rawx_blocks
from tests.benchmarks import synthetic_ubx

DATA = Path(__file__).resolve().parents[2].parent / "shared" / "data"
RECORDINGS = ("ubx_security_2025/16dBatt_no_interference_coldstart", "ubx_security_2025/F9T-L2-5min", "drive_imu/walk_gnss_1730")
REPEATS = 12
PEER_EPOCHS = 60


def best_s(repeats: int, *works: Callable[[], object]) -> list[float]:
    """Best processor time of each piece of work; they take turns."""
    best = [np.inf] * len(works)
    for _ in range(repeats):
        for i, work in enumerate(works):
            began = time.process_time()
            work()
            best[i] = min(best[i], time.process_time() - began)
    return best


def epochs(payloads: list[bytes], repeats: int) -> dict[str, Any]:
    """Microseconds per epoch, ours and pyubx2's, over the same epochs."""
    frames = [frame_bytes(*RXM_RAWX, payload) for payload in payloads]
    rows = [row for row in decode_rawx(payloads, "A") if row is not None]
    parts = [(row.receive_time_ns, row.signals, *(getattr(row, name) for name in ROW_ARRAYS)) for row in rows]
    batch_s, single_s, row_s, peer_s = best_s(
        repeats,
        lambda: decode_rawx(payloads, "A"),
        lambda: [decode_rawx([payload], "A") for payload in payloads],
        lambda: [ObservationRow("A", *part) for part in parts],
        lambda: [UBXReader.parse(frame) for frame in frames],
    )
    us = 1e6 / len(payloads)
    return {
        "measurements": round(sum(payload[11] for payload in payloads) / len(payloads), 1),
        "signals_taken": round(sum(len(row.signals) for row in rows) / len(rows), 1),
        "ours_batch_us": round(batch_s * us, 2),
        "ours_single_us": round(single_s * us, 2),
        "row_us": round(row_s * us, 2),
        "peer_us": round(peer_s * us, 1),
        "ratio_batch": round(peer_s / batch_s, 1),
        "ratio_single": round(peer_s / single_s, 1),
    }


def framing(stream: bytes, repeats: int) -> float:
    """Megabytes per second of framing, checksums verified."""
    (s,) = best_s(repeats, lambda: Framer().feed(stream))
    return round(len(stream) / s / 1e6, 1)


def blocks_of(log: bytes) -> list[ObservationBlock]:
    whole = np.frombuffer(log, np.uint8)
    return list(rawx_blocks(whole, locate(whole), "A"))


def whole_log(repeats: int) -> dict[str, Any]:
    """Megabytes of the file per second, ours and pyubx2's."""
    log = synthetic_ubx.log()
    blocks, whole = blocks_of(log), np.frombuffer(log, np.uint8)
    ours_s, located_s = best_s(repeats, lambda: blocks_of(log), lambda: locate(whole))
    (peer_s,) = best_s(1, lambda: sum(1 for _ in UBXReader(io.BytesIO(log))))
    return {
        "mb": round(len(log) / 1e6, 1),
        "epochs": sum(len(block.epoch_ns) for block in blocks),
        "measurements": sum(int(np.isfinite(block.cn0_dbhz).sum()) for block in blocks),
        "signals": len({signal for block in blocks for signal in block.signals}),
        "ours_ms": round(ours_s * 1e3, 1),
        "of_that_frames_and_checksums_ms": round(located_s * 1e3, 1),
        "ours_mb_per_s": round(len(log) / ours_s / 1e6),
        "peer_s": round(peer_s, 2),
        "ratio": round(peer_s / ours_s),
    }


def run(repeats: int = REPEATS) -> dict[str, Any]:
    """The synthetic log and all recordings; needs the data sets and pyubx2."""
    result: dict[str, Any] = {"log": whole_log(repeats)}
    for name in RECORDINGS:
        stream = gzip.decompress((DATA / f"{name}.ubx.gz").read_bytes())
        payloads = [frame.payload for frame in Framer().feed(stream) if frame[:2] == RXM_RAWX]
        middle = payloads[len(payloads) // 2 :][:PEER_EPOCHS]
        result[name] = {"framing_mb_per_s": framing(stream, repeats), **epochs(middle, repeats)}
    live = frame_bytes(*RXM_RAWX, bytes(11) + b"\x1e" + bytes(4 + 960))
    framer = Framer()
    (s,) = best_s(repeats, lambda: [framer.feed(live) for _ in range(1000)])
    result["framing_of_one_frame_of_984_bytes_us"] = round(s * 1e3, 2)
    return result


if __name__ == "__main__":
    print(json.dumps(run(), indent=2))
