"""Status from hand-made payloads of each message."""

import math
import struct

import pytest

from integrity.gnss.receiver_status import Antenna, Jamming, ReceiverStatus, Spoofing
from integrity.gnss.ubx.framing import Frame
from integrity.gnss.ubx.status import MON_HW, MON_RF, MON_VER, NAV_PVT, NAV_STATUS, SEC_SIG, STATUS_MESSAGES, decode_status


def said(message: tuple[int, int], payload: bytes) -> ReceiverStatus | None:
    return decode_status(Frame(*message, payload))


def pvt(
    fix_type: int = 3, flags: int = 1, lon: int = 1_000_000_000, lat: int = -450_000_000, height_mm: int = 45_678, flags3: int = 0
) -> bytes:
    head = struct.pack("<IH6BIi4B", 1000, 2026, 3, 2, 3, 0, 0, 7, 20, 0, fix_type, flags, 0, 12)
    place = struct.pack("<iiiiII", lon, lat, height_mm, 0, 1000, 1500)
    return head + place + bytes(30) + struct.pack("<H", flags3) + bytes(12)


def rf(*blocks: tuple[int, int, int, int]) -> bytes:
    """Blocks of id, jamming state, antenna status, AGC count."""
    parts = [struct.pack("<4BIIHHB4b3x", i, jam, ant, 1, 0, 0, 80, agc, 10, 0, 0, 0, 0) for i, jam, ant, agc in blocks]
    return bytes([0, len(blocks), 0, 0]) + b"".join(parts)


def hw(agc: int = 4095, antenna: int = 2, jamming: int = 1) -> bytes:
    return bytes(16) + struct.pack("<HHBBB", 80, agc, antenna, 1, jamming << 2) + bytes(37)


def version(*extensions: bytes) -> bytes:
    return b"EXT CORE 1.00 (94e56e)".ljust(30, b"\0") + b"00190000".ljust(10, b"\0") + b"".join(e.ljust(30, b"\0") for e in extensions)


def test_position_of_a_fix() -> None:
    assert said(NAV_PVT, pvt()) == ReceiverStatus(fix_ok=True, lat_rad=math.radians(-45.0), lon_rad=math.radians(100.0), height_m=45.678)


def test_the_shorter_nav_pvt_of_generation_7() -> None:
    assert said(NAV_PVT, pvt()[:84]) == said(NAV_PVT, pvt())


@pytest.mark.parametrize(
    ("payload", "fix_ok"),
    [
        (pvt(fix_type=0), False),
        (pvt(flags=0), False),
        (pvt(fix_type=5), True),
        (pvt(fix_type=2), True),
        (pvt(flags3=1), True),
        (pvt(lat=900_000_001), True),
        (pvt(lon=-1_800_000_001), True),
        (pvt(height_mm=80_000_001), True),
        (pvt(height_mm=-1_000_001), True),
    ],
    ids=["no_fix", "not_ok", "time_only", "two_dimensions", "invalid_llh", "latitude", "longitude", "too_high", "too_low"],
)
def test_no_position_without_a_sound_one(payload: bytes, fix_ok: bool) -> None:
    assert said(NAV_PVT, payload) == ReceiverStatus(fix_ok=fix_ok)


@pytest.mark.parametrize(
    ("state", "spoofing"), [(0, None), (1, Spoofing.NONE_SEEN), (2, Spoofing.INDICATED), (3, Spoofing.INDICATED_AGAIN)]
)
def test_nav_status(state: int, spoofing: Spoofing | None) -> None:
    payload = struct.pack("<I4BII", 1000, 3, 1, 0, state << 3, 0, 0)
    assert said(NAV_STATUS, payload) == ReceiverStatus(fix_ok=True, spoofing=spoofing)


def test_of_several_blocks_the_worst_counts_and_agc_is_that_of_l1() -> None:
    status = said(MON_RF, rf((1, 2, 2, 8191), (0, 1, 4, 4095)))
    assert status == ReceiverStatus(jamming=Jamming.WARNING, antenna=Antenna.OPEN, agc=4095 / 8191)


@pytest.mark.parametrize("jamming", [0, 1, 2, 3])
def test_mon_rf_and_mon_hw_say_the_same(jamming: int) -> None:
    expected = ReceiverStatus(jamming=[None, *Jamming][jamming], antenna=Antenna.SHORT_CIRCUIT, agc=1.0)
    assert [said(MON_RF, rf((0, jamming, 3, 8191))), said(MON_HW, hw(8191, 3, jamming))] == [expected] * 2


@pytest.mark.parametrize("antenna", [0, 1, 5, 255])
def test_an_antenna_status_that_is_not_known_is_not_passed_on(antenna: int) -> None:
    assert said(MON_HW, hw(antenna=antenna)) == ReceiverStatus(jamming=Jamming.NONE_SEEN, agc=4095 / 8191)


def test_an_agc_count_out_of_range_is_not_passed_on() -> None:
    assert said(MON_RF, rf((0, 1, 2, 8192))) == ReceiverStatus(jamming=Jamming.NONE_SEEN, antenna=Antenna.IN_ORDER)


@pytest.mark.parametrize(
    ("payload", "jamming", "spoofing"),
    [
        (bytes.fromhex("01000000 05000000 07000000"), Jamming.WARNING, Spoofing.INDICATED_AGAIN),
        (bytes.fromhex("01000000 06000000 05000000"), None, Spoofing.INDICATED),  # jamming: critical, but detection is off
        (bytes.fromhex("02 1f 00 00"), Jamming.CRITICAL, Spoofing.NONE_SEEN),  # 001 1 11 1: state 1, on; state 3, on
        (bytes.fromhex("02 25 00 01 d7091800"), Jamming.WARNING, None),  # spoofing detection off
    ],
    ids=["v1", "v1_jamming_off", "v2", "v2_spoofing_off"],
)
def test_sec_sig(payload: bytes, jamming: Jamming | None, spoofing: Spoofing | None) -> None:
    assert said(SEC_SIG, payload) == ReceiverStatus(jamming=jamming, spoofing=spoofing)


@pytest.mark.parametrize(
    ("extensions", "model"),
    [
        ((b"ROM BASE 0x118B2060", b"FWVER=HPG 1.51", b"PROTVER=27.50", b"MOD=ZED-F9P"), "ZED-F9P HPG 1.51"),
        ((b"FWVER=TIM 2.20",), "TIM 2.20"),
        ((b"MOD=ZED\x07F9P", b"FWVER=HPG 1.51"), "HPG 1.51"),
    ],
    ids=["both", "firmware_only", "unprintable"],
)
def test_model(extensions: tuple[bytes, ...], model: str) -> None:
    assert said(MON_VER, version(*extensions)) == ReceiverStatus(model=model)


@pytest.mark.parametrize(
    ("message", "payload"),
    [
        (NAV_PVT, pvt()[:-1]),
        (NAV_PVT, pvt(fix_type=6)),
        (NAV_STATUS, bytes(15)),
        (NAV_STATUS, b"\0\0\0\0\6\1" + bytes(10)),
        (MON_RF, rf((0, 1, 2, 1))[:-1]),
        (MON_RF, b"\1" + rf((0, 1, 2, 1))[1:]),
        (MON_RF, rf()),
        (MON_HW, hw() + b"\0"),
        (SEC_SIG, bytes.fromhex("0300 0000")),
        (SEC_SIG, bytes.fromhex("021f 0001")),
        (MON_VER, version(b"MOD=ZED-F9P")[:-1]),
        (MON_VER, version(b"MOD=\xff\xfe")),
        (MON_VER, version()),
        ((0x02, 0x15), bytes(16)),
    ],
)
def test_what_is_damaged_unknown_or_says_nothing_is_none(message: tuple[int, int], payload: bytes) -> None:
    assert said(message, payload) is None


@pytest.mark.parametrize("message", sorted(STATUS_MESSAGES))
def test_an_empty_payload_is_none(message: tuple[int, int]) -> None:
    assert said(message, b"") is None
