"""RTCM 3 in a live station, and pyrtcm's time on the same bytes in the same run: `python -m tests.benchmarks.rtcm`.

An epoch is one MSM7 of each of six systems, about 35 signals in all (synthetic), or an epoch of a reference station's log. Ours ends
with an `ObservationRow` for the epoch, pyrtcm's with its parsed messages. Times are processor time, the best of several repeats; ours and
pyrtcm's take turns, so that a busy machine slows both. `cells` compares three ways to fetch the bits of the same messages' cells.
"""

import io
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from pyrtcm import RTCMMessage, RTCMReader

from integrity.gnss.crc import crc24q
from integrity.gnss.gps_time import NS_PER_S, gps_from_week
from integrity.gnss.observations import ObservationRow
from integrity.gnss.rtcm.decoder import RtcmDecoder
from integrity.gnss.rtcm.framing import RtcmFramer, frame_bytes, message_number
from integrity.gnss.rtcm.measurements import measured
from integrity.gnss.rtcm.msm import CELL_FIELDS, MSM_NUMBERS, begins_of, header_of
from integrity.gnss.rtcm.msm_writer import encode_row

LOG = Path(__file__).resolve().parents[2].parent / "shared" / "data" / "tokyo_sbas_2008" / "GMSD7_20121014.rtcm3"
START_NS = gps_from_week(2310, 345_600.0)
LOG_NS = gps_from_week(1709, 604_784.0)
REPEATS = 12
EPOCHS = 60
SIGNALS = (
    *(f"G{n:02d}.{code}" for n in (2, 5, 7, 13, 15, 21, 30) for code in ("1C", "2L")),
    *(f"E{n:02d}.{code}" for n in (3, 8, 15, 26) for code in ("1C", "7Q")),
    *(f"R{n:02d}.1C" for n in (1, 9, 24)),
    *(f"C{n:02d}.2I" for n in (6, 9, 21, 34)),
    *("J02.1C", "J02.2L", "J03.1C", "J03.2L"),
    *("S29.1C", "S37.1C"),
)


def best_s(repeats: int, *works: Callable[[], object]) -> list[float]:
    """Best processor time of each piece of work; they take turns."""
    best = [np.inf] * len(works)
    for _ in range(repeats):
        for i, work in enumerate(works):
            began = time.process_time()
            work()
            best[i] = min(best[i], time.process_time() - began)
    return best


def synthetic_epochs() -> list[list[bytes]]:
    """Messages by epoch."""
    rng = np.random.default_rng(1)
    n = len(SIGNALS)
    range_m = {signal[:3]: rng.uniform(2.0e7, 2.6e7) for signal in SIGNALS}
    ranges_m = np.array([range_m[signal[:3]] for signal in SIGNALS])
    epochs = []
    for k in range(EPOCHS):
        row = ObservationRow(
            "A",
            START_NS + k * NS_PER_S,
            SIGNALS,
            pseudorange_m=ranges_m + rng.uniform(-5.0, 5.0, n),
            carrier_cycles=ranges_m * 5.255,
            doppler_hz=rng.uniform(-4e3, 4e3, n),
            cn0_dbhz=rng.uniform(20.0, 50.0, n),
            lock_s=np.full(n, 9.0 + k),
            slip=np.zeros(n, dtype=np.bool_),
            half_cycle=np.zeros(n, dtype=np.bool_),
        )
        epochs.append(encode_row(row, 7, channels={"R01": 1, "R09": -2, "R24": 2}))
    return epochs


def decoded(messages: list[bytes], near_ns: int) -> int:
    """Rows."""
    decoder = RtcmDecoder("A")
    return sum(isinstance(told, ObservationRow) for message in messages for told in decoder.take(message, near_ns))


def framed_and_decoded(frames: list[bytes], near_ns: int) -> int:
    """Rows; each frame comes by itself, as from a socket."""
    framer, decoder = RtcmFramer(), RtcmDecoder("A")
    return sum(len(decoder.take(message, near_ns)) for frame in frames for message in framer.feed(frame))


def epochs_us(messages: list[bytes], near_ns: int, repeats: int) -> dict[str, Any]:
    """Microseconds an epoch."""
    frames = [frame_bytes(message) for message in messages]
    rows = decoded(messages, near_ns)
    decode_s, live_s, peer_s = best_s(
        repeats,
        lambda: decoded(messages, near_ns),
        lambda: framed_and_decoded(frames, near_ns),
        lambda: [RTCMMessage(message) for message in messages],
    )
    us = 1e6 / rows
    return {
        "messages": round(len(messages) / rows, 1),
        "bytes": round(sum(map(len, frames)) / rows),
        "decode_us": round(decode_s * us, 1),
        "frame_and_decode_us": round(live_s * us, 1),
        "pyrtcm_us": round(peer_s * us, 1),
        "ratio": round(peer_s / decode_s, 1),
    }


def unpacked(messages: list[bytes]) -> list[Any]:
    """Cells by `numpy.unpackbits` and a sum of powers of two, field by field."""
    found = []
    for message in messages:
        bits = np.unpackbits(np.frombuffer(message, np.uint8)).astype(np.int64)
        for begin, width, n in fields_of(message):
            found.append((bits[begin : begin + n * width].reshape(n, width) << np.arange(width - 1, -1, -1)).sum(axis=1))
    return found


def shifted(messages: list[bytes]) -> list[Any]:
    """Cells by shifts of one whole number."""
    found = []
    for message in messages:
        whole, size = int.from_bytes(message, "big"), 8 * len(message)
        for begin, width, n in fields_of(message):
            found.append([whole >> size - begin - width * (i + 1) & (1 << width) - 1 for i in range(n)])
    return found


PLACES: dict[bytes, list[tuple[int, int, int]]] = {}


def fields_of(message: bytes) -> list[tuple[int, int, int]]:
    """First bit, width and number of each field of the cells; known for the messages that are timed."""
    if message not in PLACES:
        header = header_of(message)
        assert header is not None
        masks = header.masks
        n = masks.cells.bit_count()
        begins = begins_of(7, masks.satellites.bit_count(), masks.signals.bit_count(), n)
        PLACES[message] = [(begins.first[name], field.bits, n) for name, field in CELL_FIELDS[7]]
    return PLACES[message]


def cells(epoch: list[bytes], repeats: int) -> dict[str, float]:
    """Microseconds an epoch, of which ours ends with ranges, carriers, Doppler and all else in their units."""
    headers = [header_of(message) for message in epoch]
    masks = tuple(header.masks for header in headers if header is not None)
    channels = np.full(25, np.nan)
    ours_s, unpacked_s, shifted_s = best_s(
        repeats,
        lambda: [measured(epoch, masks, channels) for _ in range(200)],
        lambda: [unpacked(epoch) for _ in range(200)],
        lambda: [shifted(epoch) for _ in range(200)],
    )
    names = ("ours_us", "unpackbits_us", "whole_number_us")
    return {name: round(s * 5e3, 1) for name, s in zip(names, (ours_s, unpacked_s, shifted_s), strict=True)}


def run(repeats: int = REPEATS) -> dict[str, Any]:
    """All of it; the log only where the data sets are."""
    epochs = synthetic_epochs()
    result: dict[str, Any] = {
        "signals": len(SIGNALS),
        "synthetic": epochs_us([message for epoch in epochs for message in epoch], START_NS, repeats),
        "cells": cells(epochs[0], repeats),
    }
    body = bytes(range(256)) * 2
    (crc_s,) = best_s(repeats, lambda: [crc24q(body) for _ in range(1000)])
    result["crc_of_512_bytes_us"] = round(crc_s * 1e3, 2)
    if LOG.exists():
        stream = LOG.read_bytes()
        messages = [message for message in RtcmFramer().feed(stream) if message_number(message) in MSM_NUMBERS]
        result["log"] = epochs_us(messages[: 4 * EPOCHS], LOG_NS, repeats)
        whole = b"".join(frame_bytes(message) for message in messages[:200])
        ours_s, row_s, peer_s = best_s(
            repeats,
            lambda: RtcmFramer().feed(stream),
            lambda: decoded(RtcmFramer().feed(whole), LOG_NS),
            lambda: list(RTCMReader(io.BytesIO(whole), quitonerror=0)),
        )
        result["framing_mb_per_s"] = round(len(stream) / ours_s / 1e6, 1)
        result["framing_and_decoding_mb_per_s"] = round(len(whole) / row_s / 1e6, 2)
        result["pyrtcm_framing_and_parsing_mb_per_s"] = round(len(whole) / peer_s / 1e6, 2)
    return result


if __name__ == "__main__":
    print(json.dumps(run(), indent=2))
