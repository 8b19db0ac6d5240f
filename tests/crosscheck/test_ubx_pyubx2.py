"""Our framing and decoding against pyubx2's, number by number, on recordings of a ZED-F9P, of two timing receivers, and of a u-blox 5."""

import gzip
import io
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyubx2 import UBX_PROTOCOL, UBXReader
from pyubx2.ubxtypes_decodes import SIGID

from integrity.gnss.gps_time import gps_from_week
from integrity.gnss.observations import ROW_ARRAYS, ObservationRow
from integrity.gnss.receiver_status import Antenna, Jamming, ReceiverStatus, Spoofing
from integrity.gnss.ubx.framing import Frame, Framer, frame_bytes
from integrity.gnss.ubx.located import locate
from integrity.gnss.ubx.rawx import RXM_RAWX, decode_rawx
from integrity.gnss.ubx.rawx_log import rawx_blocks
from integrity.gnss.ubx.rxm_raw import RXM_RAW, decode_raw
from integrity.gnss.ubx.rxm_sfrb import RXM_SFRB, decode_sfrb
from integrity.gnss.ubx.sfrbx import RXM_SFRBX, decode_sfrbx
from integrity.gnss.ubx.status import MON_HW, MON_RF, NAV_PVT, NAV_STATUS, SEC_SIG, STATUS_MESSAGES, decode_status

SYSTEMS = "GSEC?JR?"  # by gnssId
# RINEX codes of what pyubx2 calls the signals of each system.
CODES = {
    "G": {"L1_C/A": "1C", "L2_CL": "2L", "L2_CM": "2S", "L5_I": "5I", "L5_Q": "5Q"},
    "S": {"L1_C/A": "1C"},
    "E": {"E1_C": "1C", "E1_B": "1B", "E5_al": "5I", "E5_aQ": "5Q", "E5_bI": "7I", "E5_bQ": "7Q", "E6_B": "6B", "E6_C": "6C"},
    "C": {"B1_ID1": "2I", "B1I_D2": "2I", "B2I_D1": "7I", "B2I_D2": "7I", "B3I_D1": "6I", "B3I_D2": "6I",
          "B1_Cp": "1P", "B1_Cd": "1D", "B2_ap": "5P", "B2_ad": "5D"},
    "J": {"L1_C/A": "1C", "L1_S": "1Z", "L2_CM": "2S", "L2_CL": "2L", "L5_I": "5I", "L5_Q": "5Q", "L1_CB": "1E"},
    "R": {"L1_OF": "1C", "L2_OF": "2C"},
}  # fmt: skip
WORDS = {"G1C": 10, "J1C": 10, "E1B": 8, "E7I": 8, "E5I": 8, "C2I": 10, "C7I": 10, "C6I": 10, "R1C": 4, "R2C": 4, "S1C": 8}
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


def named(gnss_id: int, sv_id: int, sig_id: int) -> str | None:
    """Of the satellites in these recordings."""
    system = SYSTEMS[gnss_id]
    code = CODES.get(system, {}).get(SIGID.get((gnss_id, sig_id), ""))
    return None if code is None else f"{system}{sv_id - (100 if system == 'S' else 0):02d}.{code}"


def measurements(message: Any) -> dict[str, list[Any]]:
    """What pyubx2 found, in the order of a row: NaN where it is not valid."""
    taken = {}
    for i in range(1, message.numMeas + 1):

        def of(name: str, i: int = i) -> Any:
            return numbered(message, name, i)

        signal = named(of("gnssId"), of("svId"), of("sigId"))
        if signal is not None and (of("prValid") or of("cpValid")):
            taken[signal] = [
                of("prMes") if of("prValid") else math.nan,
                of("cpMes") if of("cpValid") else math.nan,
                of("doMes"),
                of("cno"),
                of("locktime") / 1000,
                of("locktime") == 0,
                bool(of("cpValid") and not of("halfCyc")),
            ]
    return taken


def assert_measured(row: ObservationRow, expected: dict[str, list[Any]]) -> None:
    """To the last bit; NaN equals NaN."""
    assert row.signals == tuple(expected)
    ours = [getattr(row, name) for name in ROW_ARRAYS]
    np.testing.assert_array_equal(np.array(ours, dtype=np.float64), np.array(list(expected.values()), dtype=np.float64).T)


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
        assert row.receive_time_ns == gps_from_week(message.week, message.rcvTow)
        assert_measured(row, measurements(message))


def test_the_blocks_of_the_log_hold_what_the_rows_hold(stream: bytes, frames: list[Frame]) -> None:
    rows = [row for row in decode_rawx([frame.payload for frame in frames if frame[:2] == RXM_RAWX], "A") if row is not None]
    log = np.frombuffer(stream, np.uint8)
    (block,) = rawx_blocks(log, locate(log), "A")
    column = {signal: i for i, signal in enumerate(block.signals)}
    assert block.receive_time_ns[:, 0].tolist() == [row.receive_time_ns for row in rows]
    for e, row in enumerate(rows):
        mine = [column[signal] for signal in row.signals]
        for name in ROW_ARRAYS:
            np.testing.assert_array_equal(getattr(block, name)[e, 0, mine], getattr(row, name))
    assert np.count_nonzero(np.isfinite(block.cn0_dbhz)) == sum(len(row.signals) for row in rows)


def test_every_navigation_word(frames: list[Frame]) -> None:
    for frame in frames:
        if frame[:2] == RXM_SFRBX:
            message, words = parsed(frame), decode_sfrbx(frame.payload)
            signal = named(message.gnssId, message.svId, message.sigId)
            if signal is None or WORDS.get(signal[0] + signal[4:]) != message.numWords:
                assert words is None
            else:
                assert words is not None
                assert (words.satellite, words.signal, len(words.words)) == (signal[:3], signal[4:], message.numWords)
                assert list(words.words) == [numbered(message, "dwrd", i) for i in range(1, message.numWords + 1)]


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


@pytest.fixture(scope="module")
def old_frames(shared_data: Path) -> list[Frame]:
    return Framer().feed((shared_data / "tokyo_sbas_2008" / "ubx_20080526.ubx").read_bytes())


def measurements_before_8(message: Any) -> dict[str, list[Any]]:
    """What pyubx2 found, in the order of a row; a carrier of zero is none."""
    taken = {}
    for i in range(1, message.numSV + 1):
        quality, sv = numbered(message, "mesQI", i), numbered(message, "sv", i)
        assert quality >= 5
        taken[f"S{sv - 100}.1C" if sv > 100 else f"G{sv:02d}.1C"] = [
            numbered(message, "prMes", i),
            numbered(message, "cpMes", i) or math.nan,
            numbered(message, "doMes", i),
            numbered(message, "cno", i),
            math.nan,
            bool(numbered(message, "lli", i) & 1),
            bool(numbered(message, "lli", i) & 2 and numbered(message, "cpMes", i)),
        ]
    return taken


def test_every_field_of_an_older_receiver(old_frames: list[Frame]) -> None:
    found = [frame for frame in old_frames if frame[:2] == RXM_RAW]
    assert len(found) == 242
    for frame in found:
        message, row = parsed(frame), decode_raw(frame.payload, "A")
        assert row is not None and row.receive_time_ns == gps_from_week(message.week, 0.0) + message.iTOW * 1_000_000
        assert_measured(row, measurements_before_8(message))


def test_every_data_bit_of_an_older_receiver(old_frames: list[Frame]) -> None:
    found = [frame for frame in old_frames if frame[:2] == RXM_SFRB]
    assert len(found) == 842
    for frame in found:
        message, words = parsed(frame), decode_sfrb(frame.payload)
        assert words is not None
        theirs = [int.from_bytes(numbered(message, "dwrd", i), "little") for i in range(1, 11)]
        if message.svid > 100:
            assert (words.satellite, [*words.words[:7], words.words[7] >> 6]) == (
                f"S{message.svid - 100}",
                [*theirs[:7], theirs[7] % 2**26],
            )
        else:
            assert [word >> 6 & 0xFFFFFF for word in words.words] == [word & 0xFFFFFF for word in theirs]
