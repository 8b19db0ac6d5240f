"""The log of a u-blox 5 of 2008, with NMEA in between, against what RTKLIB's converter made of it. And the parity that such a receiver
leaves out, against newer ones that send it.
"""

import gzip
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from struct import unpack_from

import numpy as np
import pytest

from integrity.events import EphemerisReceived, ObservationsReceived, RawBytes
from integrity.gnss.crc import crc24q
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.gps_time import gps_from_calendar
from integrity.gnss.navigation.collector import NavigationCollector
from integrity.gnss.navigation.lnav import subframe_of
from integrity.gnss.ubx.framing import Frame, Framer
from integrity.gnss.ubx.rxm_raw import RXM_RAW, decode_raw
from integrity.gnss.ubx.rxm_sfrb import RXM_SFRB, decode_sfrb
from integrity.gnss.ubx.sfrbx import RXM_SFRBX, NavigationWords, decode_sfrbx
from integrity.reception import Reception
from recordings.rinex.navigation import read_navigation
from recordings.ubx_files import read_ubx

NEWER = ("ubx_security_2025/16dBatt_no_interference_coldstart.ubx.gz", "drive_imu/walk_gnss_1730.ubx.gz")
FIRST_OF_RTKLIB = 5  # its file begins with the sixth epoch


@pytest.fixture(scope="module")
def directory(shared_data: Path) -> Path:
    return shared_data / "tokyo_sbas_2008"


@pytest.fixture(scope="module")
def frames(directory: Path) -> list[Frame]:
    return Framer().feed((directory / "ubx_20080526.ubx").read_bytes())


def words_of(frames: list[Frame], systems: str) -> list[NavigationWords]:
    found = [decode_sfrb(frame.payload) for frame in frames if frame[:2] == RXM_SFRB]
    return [words for words in found if words is not None and words.satellite[0] in systems]


def rinex_epochs(path: Path) -> Iterator[tuple[int, dict[str, list[float | None]]]]:
    """GPS time; by satellite C1C, L1C, D1C, S1C, of 16 columns each."""
    lines = gzip.decompress(path.read_bytes()).decode("ascii").split("END OF HEADER       \n")[1].splitlines()
    at = 0
    while at < len(lines):
        year, month, day, hour, minute, seconds, _, n = lines[at][1:].split()
        whole, fraction = seconds.split(".")
        time_ns = gps_from_calendar(int(year), int(month), int(day), int(hour), int(minute), int(whole), int(fraction.ljust(9, "0")))
        satellites = {}
        for line in lines[at + 1 : at + 1 + int(n)]:
            fields = [line[3 + 16 * i : 17 + 16 * i].strip() for i in range(4)]
            satellites[line[:3]] = [float(field) if field else None for field in fields]
        yield time_ns, satellites
        at += 1 + int(n)


def test_measurements_are_those_of_the_converter(directory: Path, frames: list[Frame]) -> None:
    rows = [decode_raw(frame.payload, "A") for frame in frames if frame[:2] == RXM_RAW][FIRST_OF_RTKLIB:]
    theirs = list(rinex_epochs(directory / "ubx_20080526.obs.gz"))
    assert len(rows) == len(theirs) == 237
    for row, (time_ns, satellites) in zip(rows, theirs, strict=True):
        assert row is not None and (row.receive_time_ns, row.signals) == (time_ns, tuple(f"{name}.1C" for name in satellites))
        expected = np.array([[np.nan if x is None else x for x in values] for values in satellites.values()]).T
        ours = np.array([row.pseudorange_m, row.carrier_cycles, row.doppler_hz, row.cn0_dbhz])
        np.testing.assert_allclose(ours, expected, rtol=0.0, atol=0.0005001)  # three decimals


def test_ephemerides_are_those_of_the_converter(directory: Path, frames: list[Frame]) -> None:
    collector = NavigationCollector()
    first = decode_raw(next(frame.payload for frame in frames if frame[:2] == RXM_RAW), "A")
    assert first is not None
    ours = [told for words in words_of(frames, "G") for told in collector.take(words, first.receive_time_ns)]
    theirs = [eph for eph in read_navigation(directory / "ubx_20080526.nav.gz").ephemerides if isinstance(eph, KeplerEphemeris)]
    assert len(ours) == len(theirs) == 18
    by_issue = {(eph.satellite, eph.issue): eph for eph in theirs}
    for eph in ours:
        assert isinstance(eph, KeplerEphemeris)
        expected = asdict(by_issue[eph.satellite, eph.issue])
        mine = asdict(eph)
        del expected["transmission_ns"], mine["transmission_ns"]  # the converter writes that of another subframe
        assert {name: value for name, value in mine.items() if not isinstance(value, float)} == {
            name: value for name, value in expected.items() if not isinstance(value, float)
        }
        floats = [name for name, value in mine.items() if isinstance(value, float)]
        # 12 decimals of a number between 0.1 and 1
        np.testing.assert_allclose([mine[n] for n in floats], [expected[n] for n in floats], rtol=5e-12, atol=0.0, err_msg=eph.satellite)


def test_sbas_messages_are_those_of_the_converter(directory: Path, frames: list[Frame]) -> None:
    """Whole messages, by their 226 bits without CRC."""
    ours = [b"".join(word.to_bytes(4, "big") for word in words.words) for words in words_of(frames, "S")]
    lines = gzip.decompress((directory / "ubx_20080526.sbs.gz").read_bytes()).decode("ascii").splitlines()
    theirs = [bytes.fromhex(line.split(":")[1].strip())[:28] for line in lines]
    found = {block[:28] for block in ours}
    assert [message for message in theirs if message not in found] == []


def test_every_sbas_message_has_its_crc(frames: list[Frame]) -> None:
    blocks = [int.from_bytes(b"".join(word.to_bytes(4, "big") for word in words.words), "big") >> 6 for words in words_of(frames, "S")]
    assert (len(blocks), {crc24q(block.to_bytes(32, "big")) for block in blocks}) == (482, {0})


def test_every_subframe_is_one(frames: list[Frame]) -> None:
    subframes = [subframe_of(words.words) for words in words_of(frames, "G")]
    assert (len(subframes), None in subframes) == (360, False)


@pytest.mark.parametrize("path", NEWER)
def test_words_without_parity_become_those_that_newer_receivers_send(shared_data: Path, path: str) -> None:
    compared = 0
    for frame in Framer().feed(gzip.decompress((shared_data / path).read_bytes())):
        words = decode_sfrbx(frame.payload) if frame[:2] == RXM_SFRBX else None
        if words is not None and words.satellite[0] == "G" and subframe_of(words.words) is not None:
            without = b"".join((word >> 6 & 0xFFFFFF).to_bytes(4, "little") for word in words.words)
            assert decode_sfrb(bytes((0, int(words.satellite[1:]))) + without) == words
            compared += 1
    assert compared > 75


def test_the_log_is_imported_with_every_epoch_and_byte(directory: Path) -> None:
    path = directory / "ubx_20080526.ubx"
    log = read_ubx([path], "A")
    times = [piece.receive_time_ns for piece in log.pieces]
    raw = path.read_bytes()
    assert b"".join(piece.data for piece in log.pieces) + log.tail == raw
    assert (len(times), log.words, times == sorted(times), log.warnings) == (242, 842, True, ())
    assert log.passed_over == {"bad frames": 0, "bytes that are not UBX": 152_266, "bytes of a frame that does not end": 18}
    assert all(unpack_from("<H", piece.measured, 2)[0] == 0x1002 for piece in log.pieces)


def test_a_station_hears_such_a_receiver(directory: Path) -> None:
    data = (directory / "ubx_20080526.ubx").read_bytes()
    reception = Reception(("A",))
    heard = [h for at in range(0, len(data), 997) for h in reception.take(RawBytes(at, "A", data[at : at + 997]))]
    told = {h.ephemeris.satellite for h in heard if isinstance(h, EphemerisReceived)}
    of_rtklib = {eph.satellite for eph in read_navigation(directory / "ubx_20080526.nav.gz").ephemerides}
    assert sum(isinstance(h, ObservationsReceived) for h in heard) == 242
    assert told == {satellite for satellite in of_rtklib if satellite[0] == "G"}
