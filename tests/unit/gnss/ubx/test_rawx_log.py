"""Blocks of whole logs, against the block that is built of the rows of the same payloads."""

import math
from collections.abc import Sequence

import numpy as np
import pytest

from integrity.gnss.observations import ROW_ARRAYS, ObservationBlock, build_block, layout_of
from integrity.gnss.signals import MONITORED_CODES, Codes
from integrity.gnss.ubx.framing import frame_bytes
from integrity.gnss.ubx.identifiers import EVERY_CODE, SIGNALS
from integrity.gnss.ubx.located import locate
from integrity.gnss.ubx.rawx import RXM_RAWX, decode_rawx
from integrity.gnss.ubx.rawx_log import MOST_EPOCHS, rawx_blocks, rawx_epochs
from tests.unit.gnss.ubx.test_rawx import (
    BEIDOU,
    GALILEO,
    GLONASS,
    GPS,
    NAVIC,
    SBAS,
    SIGNALLING_NAN_F4,
    SIGNALLING_NAN_F8,
    measurement,
    rawx,
)

NMEA = b"$GNGGA,042500.00,4533.1,N,07336.9,W,1,12,0.6,45.0,M,-32.0,M,,*5C\r\n"


def blocks_of(payloads: Sequence[bytes], codes: Codes = EVERY_CODE) -> list[ObservationBlock]:
    log = np.frombuffer(NMEA.join(frame_bytes(*RXM_RAWX, payload) for payload in payloads), np.uint8)
    return list(rawx_blocks(log, locate(log), "A", codes))


def assert_same(block: ObservationBlock, expected: ObservationBlock) -> None:
    assert (block.receivers, block.signals, block.satellites) == (expected.receivers, expected.signals, expected.satellites)
    for name in ("epoch_ns", "receive_time_ns", *ROW_ARRAYS):
        np.testing.assert_array_equal(getattr(block, name), getattr(expected, name), err_msg=name, strict=True)


def assert_as_rows(payloads: Sequence[bytes], codes: Codes = EVERY_CODE) -> None:
    """That one block holds what the rows hold."""
    (block,) = blocks_of(payloads, codes)
    rows = [row for row in decode_rawx(payloads, "A") if row is not None]
    assert_same(block, build_block(["A"], [row.receive_time_ns for row in rows], [[row] for row in rows], layout_of(rows, codes=codes)))


EVERY_SIGNAL = [
    measurement(gnss, known.first, sig) for (gnss, sig), known in SIGNALS.items() if (gnss, sig) not in {(3, 1), (3, 3), (3, 10)}
]
WHOLE = measurement()
CASES = {
    "every signal": [rawx(*EVERY_SIGNAL), rawx(*EVERY_SIGNAL[::-1], tow_s=101.0)],
    "satellites coming and going": [rawx(*(measurement(sv=sv) for sv in range(1 + i, 9 + i)), tow_s=i) for i in range(9)],
    "what has no name": [rawx(measurement(NAVIC), measurement(GLONASS, 255), measurement(4), measurement(255, 255, 255),
                              measurement(sig=16), measurement(8), measurement(GPS, 0), WHOLE)],
    "values out of range": [rawx(measurement(pr=4.1e7), measurement(SBAS, 129, pr=4.1e7), measurement(BEIDOU, 3, pr=math.nan),
                                 measurement(sv=6, cp=-1.1e9), measurement(sv=7, do=30_001.0), measurement(sv=8, cno=64),
                                 measurement(sv=9, lock=64_501), measurement(sv=10, pr=math.inf, cp=math.inf))],
    "what the receiver does not vouch for": [rawx(*(measurement(sv=trk + 1, trk=trk, lock=trk % 3) for trk in range(16)))],
    "a satellite that is never measured": [rawx(WHOLE, measurement(GALILEO, 3, trk=0)), rawx(WHOLE, tow_s=101.0)],
    "signalling nans": [rawx(SIGNALLING_NAN_F8 + WHOLE[8:],
                             measurement(sv=6)[:8] + SIGNALLING_NAN_F8 + SIGNALLING_NAN_F4 + b"\0\7" + WHOLE[22:])],
    "epochs that are none": [rawx(WHOLE), b"", rawx(WHOLE, week=0), rawx(WHOLE, version=2), rawx(WHOLE, tow_s=math.nan),
                             rawx(WHOLE, tow_s=604_800.0), rawx(WHOLE, tow_s=102.0)],
    "epochs with a signal twice": [rawx(WHOLE, tow_s=1), rawx(WHOLE, WHOLE, tow_s=2), rawx(WHOLE, measurement(trk=0), tow_s=3),
                                   rawx(measurement(BEIDOU, 3), measurement(BEIDOU, 3, 1), tow_s=4), rawx(measurement(sv=9), tow_s=5)],
    "epochs without measurements": [rawx(tow_s=1), rawx(WHOLE, tow_s=2), rawx(tow_s=3)],
    "nothing measured": [rawx(tow_s=1), rawx(tow_s=2)],
    "times that are no whole nanoseconds": [rawx(WHOLE, tow_s=604_799.9979999999), rawx(WHOLE, tow_s=0.1),
                                            rawx(WHOLE, week=2301, tow_s=1 / 3)],
    "255 measurements": [rawx(*(measurement(BEIDOU, 1 + i % 63, (0, 2, 4, 5, 7)[i // 63]) for i in range(255)))],
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_a_block_holds_what_the_rows_hold(case: str) -> None:
    assert_as_rows(CASES[case])


@pytest.mark.parametrize("case", CASES)
def test_a_block_of_some_codes_holds_no_others(case: str) -> None:
    assert_as_rows(CASES[case], MONITORED_CODES)


@pytest.mark.parametrize("case", CASES)
def test_epochs_are_those_that_have_a_row(case: str) -> None:
    log = np.frombuffer(b"".join(frame_bytes(*RXM_RAWX, payload) for payload in CASES[case]), np.uint8)
    rows = decode_rawx(CASES[case], "A")
    expected = [(i, row.receive_time_ns) for i, row in enumerate(rows) if row is not None]
    found = rawx_epochs(log, locate(log))
    assert list(zip(found.frame.tolist(), found.receive_time_ns.tolist(), strict=True)) == expected


@pytest.mark.parametrize("epochs", [1, MOST_EPOCHS, MOST_EPOCHS + 1, 2 * MOST_EPOCHS + 7])
def test_long_logs_come_in_several_blocks(epochs: int) -> None:
    payloads = [rawx(measurement(sv=1 + i // 300), tow_s=i) for i in range(epochs)]
    blocks = blocks_of(payloads)
    assert [len(block.epoch_ns) for block in blocks] == [min(MOST_EPOCHS, epochs - at) for at in range(0, epochs, MOST_EPOCHS)]
    for at, block in zip(range(0, epochs, MOST_EPOCHS), blocks, strict=True):
        rows = [row for row in decode_rawx(payloads[at : at + MOST_EPOCHS], "A") if row is not None]
        assert_same(
            block, build_block(["A"], [row.receive_time_ns for row in rows], [[row] for row in rows], layout_of(rows, codes=EVERY_CODE))
        )


@pytest.mark.parametrize("log", [b"", NMEA, frame_bytes(0x02, 0x15, b""), frame_bytes(*RXM_RAWX, rawx(WHOLE, WHOLE))])
def test_a_log_without_epochs_has_no_blocks(log: bytes) -> None:
    whole = np.frombuffer(log, np.uint8)
    assert list(rawx_blocks(whole, locate(whole), "A")) == []


def test_what_is_in_a_block_cannot_be_changed() -> None:
    (block,) = blocks_of([rawx(WHOLE)])
    assert not any(getattr(block, name).flags.writeable for name in ("epoch_ns", "receive_time_ns", *ROW_ARRAYS))
