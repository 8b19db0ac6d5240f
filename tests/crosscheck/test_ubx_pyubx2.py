"""Our framing and decoding against pyubx2's, number by number, on recordings of a ZED-F9P and of two timing receivers."""

import gzip
import io
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyubx2 import UBX_PROTOCOL, UBXReader

from integrity.gnss.gps_time import gps_from_week
from integrity.gnss.receiver_status import Antenna, Jamming, ReceiverStatus, Spoofing
from integrity.gnss.ubx.framing import Frame, Framer, frame_bytes
from integrity.gnss.ubx.rawx import RXM_RAWX, decode_rawx
from integrity.gnss.ubx.sfrbx import RXM_SFRBX, decode_sfrbx
from integrity.gnss.ubx.status import MON_HW, MON_RF, NAV_PVT, NAV_STATUS, SEC_SIG, STATUS_MESSAGES, decode_status

CODES = {(0, 0): ("G", "1C"), (2, 0): ("E", "1C"), (2, 1): ("E", "1B")}
WORDS = {(0, 0): ("G", "1C", 10), (2, 1): ("E", "1B", 8), (2, 5): ("E", "7I", 8)}
JAMMING = [None, Jamming.NONE_SEEN, Jamming.WARNING, Jamming.CRITICAL]
SPOOFING = [None, Spoofing.NONE_SEEN, Spoofing.INDICATED, Spoofing.INDICATED_AGAIN]
ANTENNA = [None, None, Antenna.IN_ORDER, Antenna.SHORT_CIRCUIT, Antenna.OPEN]


@pytest.fixture(
    scope="module",
    params=["ubx_security_2025/16dBatt_no_interference_coldstart", "ubx_security_2025/F9T-L2-5min", "drive_imu/walk_gnss_1730"],
    ids=["coldstart", "timing", "walk"],
)
def stream(request: pytest.FixtureRequest, shared_data: Path) -> bytes:
    return gzip.decompress((shared_data / f"{request.param}.ubx.gz").read_bytes())


@pytest.fixture(scope="module")
def frames(stream: bytes) -> list[Frame]:
    return Framer().feed(stream)


def parsed(frame: Frame) -> Any:
    return UBXReader.parse(frame_bytes(*frame))


def numbered(message: Any, name: str, i: int) -> Any:
    return getattr(message, f"{name}_{i:02d}")


def measurements(message: Any) -> dict[str, list[Any]]:
    """What pyubx2 found of the signals that are taken, in the order of a row: NaN where it is not valid."""
    taken = {}
    for i in range(1, message.numMeas + 1):

        def of(name: str, i: int = i) -> Any:
            return numbered(message, name, i)

        code = CODES.get((of("gnssId"), of("sigId")))
        if code is not None and (of("prValid") or of("cpValid")):
            taken[f"{code[0]}{of('svId'):02d}.{code[1]}"] = [
                of("prMes") if of("prValid") else math.nan,
                of("cpMes") if of("cpValid") else math.nan,
                of("doMes"),
                of("cno"),
                of("locktime") / 1000,
                of("locktime") == 0,
                bool(of("cpValid") and not of("halfCyc")),
            ]
    return taken


def test_the_same_frames(stream: bytes, frames: list[Frame]) -> None:
    theirs = [raw for raw, _ in UBXReader(io.BytesIO(stream), protfilter=UBX_PROTOCOL, parsing=False)]
    assert [frame_bytes(*frame) for frame in frames] == theirs


def test_every_field_of_every_measurement(frames: list[Frame]) -> None:
    found = [frame for frame in frames if frame[:2] == RXM_RAWX]
    rows = decode_rawx([frame.payload for frame in found], "A")
    assert sum(row is not None for row in rows) > 250
    for frame, row in zip(found, rows, strict=True):
        message = parsed(frame)
        if row is None:
            assert (message.week, message.numMeas) == (0, 0)  # the receiver has just been switched on
            continue
        expected = measurements(message)
        assert row.receive_time_ns == gps_from_week(message.week, message.rcvTow)
        assert row.signals == tuple(expected)
        ours = [row.pseudorange_m, row.carrier_cycles, row.doppler_hz, row.cn0_dbhz, row.lock_s, row.slip, row.half_cycle]
        np.testing.assert_array_equal(np.array(ours, dtype=np.float64), np.array(list(expected.values()), dtype=np.float64).T)


def test_every_navigation_word(frames: list[Frame]) -> None:
    for frame in frames:
        if frame[:2] == RXM_SFRBX:
            message, words = parsed(frame), decode_sfrbx(frame.payload)
            known = WORDS.get((message.gnssId, message.sigId))
            if known is None:
                assert words is None
            else:
                assert words is not None
                assert (words.satellite, words.signal, len(words.words)) == (f"{known[0]}{message.svId:02d}", *known[1:])
                assert list(words.words) == [numbered(message, "dwrd", i) for i in range(1, known[2] + 1)]


def expected_status(message: Any) -> ReceiverStatus:
    """What pyubx2 read; in these recordings every fix has its position, and every AGC count is in range."""
    match message.identity:
        case "NAV-PVT" if message.gnssFixOk and message.fixType in (3, 4):
            return ReceiverStatus(
                fix_ok=True, lat_rad=math.radians(message.lat), lon_rad=math.radians(message.lon), height_m=message.height / 1e3
            )
        case "NAV-PVT":
            return ReceiverStatus(fix_ok=bool(message.gnssFixOk and message.fixType))
        case "NAV-STATUS":
            return ReceiverStatus(fix_ok=bool(message.gpsFixOk), spoofing=SPOOFING[message.spoofDetState])
        case "SEC-SIG":
            assert message.jamDetEnabled and message.spfDetEnabled
            return ReceiverStatus(jamming=JAMMING[message.jammingState], spoofing=SPOOFING[message.spoofingState])
        case "MON-HW":
            return ReceiverStatus(jamming=JAMMING[message.jammingState], antenna=ANTENNA[message.aStatus], agc=message.agcCnt / 8191)
    assert (message.identity, message.blockId_01, message.jammingState_01, message.jammingState_02) == ("MON-RF", 0, 0, 0)
    antennas = [a for a in (ANTENNA[message.antStatus_01], ANTENNA[message.antStatus_02]) if a is not None]
    return ReceiverStatus(antenna=max(antennas, default=None), agc=message.agcCnt_01 / 8191)


def test_every_status(frames: list[Frame]) -> None:
    said = [frame for frame in frames if frame[:2] in STATUS_MESSAGES]
    assert {frame[:2] for frame in said} <= {NAV_PVT, NAV_STATUS, MON_RF, MON_HW, SEC_SIG}
    assert len(said) > 250
    assert [decode_status(frame) for frame in said] == [expected_status(parsed(frame)) for frame in said]
