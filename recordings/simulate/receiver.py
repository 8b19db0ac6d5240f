"""Simulated receivers as their links see them: decoded events become the UBX bytes that the receivers would have sent.

Each receiver sends a burst an epoch: RXM-SFRBX of every subframe (GPS L1 C/A) and page (Galileo E1-B) that ended since its epoch before,
NAV-PVT, once a second MON-RF, and RXM-RAWX last: with its last byte the epoch is complete. Its first burst begins with MON-VER and the
words of the 30 s before, so that ephemerides and ionosphere are there from the first epoch on.

Navigation words carry the ephemeris in force, wrong ones included. Two liberties: subframe 4 is always page 18 (ionosphere), and I/NAV
words 0 to 6 follow each other without the others, so that every satellite says everything within 30 s.
Source of all layouts: u-blox F9 HPG 1.51 interface description.
"""

import math
import struct
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from zlib import crc32

import numpy as np

from integrity.errors import ConfigError
from integrity.events import EphemerisReceived, Event, IonosphereReceived, ObservationsReceived, RawBytes
from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.frames import enu_axes, geodetic_from_ecef
from integrity.gnss.gps_time import DAY_S, NS_PER_S, WEEK_NS, civil_from_days, leap_seconds_at_gps, utc_from_gps
from integrity.gnss.observations import Floats, Ints, ObservationRow
from integrity.gnss.signals import satellite_of
from integrity.gnss.ubx.framing import frame_bytes
from integrity.gnss.ubx.rawx import RAWX_DTYPE, RAWX_HEADER, RXM_RAWX
from integrity.gnss.ubx.sfrbx import RXM_SFRBX
from recordings.simulate.navigation_words import inav_words, lnav_words
from recordings.simulate.observations import Antenna

NAV_PVT, MON_VER, MON_RF = (0x01, 0x07), (0x0A, 0x04), (0x0A, 0x38)

WORDS_BEFORE_NS = 30 * NS_PER_S  # of the first burst, and the most that are sent at once after an interruption
GNSS_ID = {"G": 0, "E": 2}
SIGNAL_ID = {("G", "1C"): 0, ("G", "2L"): 3, ("E", "1C"): 0, ("E", "1B"): 1, ("E", "7Q"): 6}
SUBFRAME_NS, SUBFRAMES = 6 * NS_PER_S, 5  # IS-GPS-200, 20.3.3
PAGE_NS, WORD_TYPES = 2 * NS_PER_S, 7  # Galileo OS SIS ICD, 4.3: a nominal page, even and odd part

_MEASUREMENT_VALID, _HALF_CYCLE_KNOWN = 0b011, 0b100  # trkStat: range and carrier; half cycle resolved
_PVT = struct.Struct("<I H5B B I i 4B 4i 2I 5i 2I 2H 4x i h H")
_RF_HEADER, _RF_BLOCK = struct.Struct("<BB2x"), struct.Struct("<4B I 4x 2H B bBbB 3x")


def as_bytes(events: Sequence[Event], antennas: Sequence[Antenna]) -> tuple[Event, ...]:
    """Events of `simulate` or `observed`, with or without faults, as RawBytes: one burst for each row; all other events stay.

    `mono_ns` of ephemerides must be GPS time, as it is there. A row that is not there (`receiver_drop`) is a burst that is not there.
    """
    rows: dict[str, list[ObservationRow]] = {antenna.receiver: [] for antenna in antennas}
    for event in events:
        if isinstance(event, ObservationsReceived):
            rows[event.row.receiver].append(event.row)
    messages = {antenna.receiver: _messages(antenna, rows[antenna.receiver]) for antenna in antennas}
    since_ns: dict[str, int] = {}
    sky = _Broadcast()
    out: list[Event] = []
    for event in events:
        match event:
            case EphemerisReceived():
                sky.begins(event)
            case IonosphereReceived():
                sky.klobuchar = event.klobuchar
            case ObservationsReceived(mono_ns=mono_ns, row=row):
                t_ns = row.receive_time_ns
                words = sky.words(row, max(since_ns.get(row.receiver, 0), t_ns - WORDS_BEFORE_NS))
                since_ns[row.receiver] = t_ns
                version, rest = next(messages[row.receiver])
                out.append(RawBytes(mono_ns, row.receiver, version + words + rest))
            case _:
                out.append(event)
    return tuple(out)


class _Broadcast:
    """What the satellites send, as far as the events have told."""

    def __init__(self) -> None:
        self.klobuchar: Klobuchar | None = None
        self._sets: dict[str, list[tuple[int, KeplerEphemeris]]] = {}

    def begins(self, event: EphemerisReceived) -> None:
        """From here on a satellite sends this set."""
        if isinstance(event.ephemeris, KeplerEphemeris):  # only such are simulated
            self._sets.setdefault(event.ephemeris.satellite, []).append((event.mono_ns, event.ephemeris))

    def words(self, row: ObservationRow, after_ns: int) -> bytes:
        """RXM-SFRBX of the satellites in a row, of everything that ended after a time up to that of the row, in the order of its end."""
        frames: list[tuple[int, str, bytes]] = []
        for satellite in dict.fromkeys(satellite_of(signal) for signal in row.signals):
            period_ns = SUBFRAME_NS if satellite[0] == "G" else PAGE_NS
            first = after_ns // period_ns + 1
            for end_ns in range(first * period_ns, row.receive_time_ns + 1, period_ns):
                ephemeris = self._in_force(satellite, end_ns - period_ns)
                if ephemeris is not None and self.klobuchar is not None:
                    frames.append((end_ns, satellite, _words_frame(ephemeris, self.klobuchar, end_ns - period_ns)))
        return b"".join(frame for _, _, frame in sorted(frames))

    def _in_force(self, satellite: str, gps_ns: int) -> KeplerEphemeris | None:
        """The last set that had begun; the first one for what was sent before the events begin."""
        sets = self._sets.get(satellite, [])
        begun = (ephemeris for from_ns, ephemeris in reversed(sets) if from_ns <= gps_ns)
        return next(begun, sets[0][1] if sets else None)


@lru_cache(maxsize=4096)
def _words_frame(ephemeris: KeplerEphemeris, klobuchar: Klobuchar, start_ns: int) -> bytes:
    """RXM-SFRBX of the subframe or page that begins at a GPS time; the same for all receivers."""
    system, number = ephemeris.satellite[0], int(ephemeris.satellite[1:])
    m0, omega0, omega = (math.remainder(angle, math.tau) for angle in (ephemeris.m0, ephemeris.omega0, ephemeris.omega))
    sent = replace(ephemeris, m0=m0, omega0=omega0, omega=omega)
    try:
        if system == "G":
            words = lnav_words(sent, klobuchar, start_ns // SUBFRAME_NS % SUBFRAMES + 1, start_ns)
            signal_id = SIGNAL_ID["G", "1C"]
        else:
            words = inav_words(sent, klobuchar, start_ns // PAGE_NS % WORD_TYPES, start_ns)
            signal_id = SIGNAL_ID["E", "1B"]
    except ValueError as error:
        raise ConfigError(f"{ephemeris.satellite} cannot send its ephemeris: {error}; make the fault of this ephemeris smaller") from None
    channel, version = 0, 2
    header = bytes((GNSS_ID[system], number, signal_id, 0, len(words), channel, version, 0))
    return frame_bytes(*RXM_SFRBX, header + struct.pack(f"<{len(words)}I", *words))


def _messages(antenna: Antenna, rows: Sequence[ObservationRow]) -> Iterator[tuple[bytes, bytes]]:
    """For each row what stands before the words of its burst, and what stands after them."""
    if not rows:
        return
    before, last_s = _version(), None
    for row, fix in zip(rows, _fixes(antenna, rows), strict=True):
        second = row.receive_time_ns // NS_PER_S
        yield before, fix + (_radio(row) if second != last_s else b"") + _measurements(row)
        before, last_s = b"", second


def _measurements(row: ObservationRow) -> bytes:
    """RXM-RAWX, version 1."""
    t_ns = row.receive_time_ns
    m = np.zeros(len(row.signals), dtype=RAWX_DTYPE)
    identity = [(GNSS_ID[s[0]], int(s[1:3]), SIGNAL_ID[s[0], s.partition(".")[2]]) for s in row.signals]
    m["gnss_id"], m["sv_id"], m["sig_id"] = np.array(identity, dtype=np.uint8).reshape(-1, 3).T
    m["pr_m"], m["cp_cycles"], m["do_hz"] = row.pseudorange_m, row.carrier_cycles, row.doppler_hz
    m["cno_dbhz"] = np.clip(np.round(row.cn0_dbhz), 0.0, 63.0)
    m["locktime_ms"] = np.round(1e3 * row.lock_s)
    m["pr_stdev"], m["cp_stdev"], m["do_stdev"] = 5, 1, 3  # 0.32 m, 0.004 cycles, 0.016 Hz
    m["trk_stat"] = _MEASUREMENT_VALID + np.where(row.half_cycle, 0, _HALF_CYCLE_KNOWN)
    leap_seconds_known, version = 1, 1
    header = RAWX_HEADER.pack(t_ns % WEEK_NS / NS_PER_S, t_ns // WEEK_NS, leap_seconds_at_gps(t_ns), len(m), leap_seconds_known, version)
    return frame_bytes(*RXM_RAWX, header + m.tobytes())


def _fixes(antenna: Antenna, rows: Sequence[ObservationRow]) -> Iterator[bytes]:
    """NAV-PVT of each row: where the antenna truly is, but for a slow error below 1.5 m; faults are not in it. No fix below 4 satellites.

    Mean sea level is not known here: hMSL is the ellipsoidal height.
    """
    gps_ns = np.array([row.receive_time_ns for row in rows])
    pos_ecef_m, vel_ecef_mps = antenna.motion(gps_ns)
    lat_rad, lon_rad, _ = geodetic_from_ecef(pos_ecef_m)
    enu = enu_axes(lat_rad, lon_rad)
    there = pos_ecef_m + np.einsum("eij,ei->ej", enu, _own_error_enu_m(antenna.receiver, gps_ns))
    vel_enu_mps = np.einsum("eij,ej->ei", enu, vel_ecef_mps)
    lat_rad, lon_rad, height_m = geodetic_from_ecef(there)
    places = np.rint(np.stack((np.degrees(lon_rad) * 1e7, np.degrees(lat_rad) * 1e7, height_m * 1e3), axis=1)).astype(np.int64).tolist()
    for row, (lon, lat, height), (east, north, up) in zip(rows, places, vel_enu_mps.tolist(), strict=True):
        yield frame_bytes(*NAV_PVT, _fix(row, lon, lat, height, east, north, up))


def _own_error_enu_m(receiver: str, gps_ns: Ints) -> Floats:
    """A slow error (E, 3) that depends on the receiver's name and the time alone."""
    amplitude_m, period_s = np.array((0.4, 0.5, 1.2)), np.array((600.0, 840.0, 1260.0))
    turns = (gps_ns % WEEK_NS / NS_PER_S)[:, None] / period_s + crc32(receiver.encode()) / 2**32
    error: Floats = amplitude_m * np.sin(math.tau * turns)
    return error


def _fix(row: ObservationRow, lon: int, lat: int, height_mm: int, east_mps: float, north_mps: float, up_mps: float) -> bytes:
    utc_s, ns = divmod(utc_from_gps(row.receive_time_ns), NS_PER_S)
    year, month, day = civil_from_days(utc_s // DAY_S)
    second = utc_s % DAY_S
    satellites = len({satellite_of(signal) for signal in row.signals})
    fixed = satellites >= 4
    north_mm, east_mm, down_mm = (round(1e3 * v) for v in (north_mps, east_mps, -up_mps))
    heading = round(math.degrees(math.atan2(east_mps, north_mps)) % 360.0 * 1e5)
    return _PVT.pack(
        *(row.receive_time_ns % WEEK_NS // 1_000_000, year, month, day, second // 3600, second // 60 % 60, second % 60),
        *(0b111, 20, ns),  # date, time and leap seconds valid; accuracy and fraction in ns
        *(3 if fixed else 0, 1 if fixed else 0, 0b1110_0000, min(satellites, 255)),  # 3-D; gnssFixOK; date and time confirmed
        *(lon, lat, height_mm, height_mm),
        *(900, 1500) if fixed else (2**32 - 1, 2**32 - 1),  # accuracies in mm
        *(north_mm, east_mm, down_mm, round(1e3 * math.hypot(east_mps, north_mps)), heading),
        *(50, 5_000_000, 150, 0 if fixed else 1),  # accuracy of speed, mm/s, and heading, 1e-5 deg; PDOP 1.5; invalidLlh
        *(0, 0, 0),
    )


def _radio(row: ObservationRow) -> bytes:
    """MON-RF: gain falls and the jamming indicator rises with what the signals lack of a mean of 43 dB-Hz."""
    mean_dbhz = float(row.cn0_dbhz.mean()) if row.signals else 0.0
    lack_db = min(max(43.0 - mean_dbhz, 0.0), 20.0)
    jamming = 1 if lack_db < 3.0 else 2 if lack_db < 12.0 else 3  # in order, warning, critical
    antenna_ok, power_on, noise, cw, offset, magnitude = 2, 1, 90 + round(4 * lack_db), 10 + round(8 * lack_db), 5, 130
    gain = 5600 - round(180 * lack_db)
    block = _RF_BLOCK.pack(0, jamming, antenna_ok, power_on, 0, noise, gain, cw, offset, magnitude, offset, magnitude)
    return frame_bytes(*MON_RF, _RF_HEADER.pack(0, 1) + block)


def _version() -> bytes:
    """MON-VER: no firmware that exists."""
    extensions = ("FWVER=SIM 1.00", "PROTVER=27.50", "MOD=WAYSIDE-SIM", "GPS;GAL")
    versions = struct.pack("<30s10s", b"WAYSIDE SIMULATION", b"NONE")
    return frame_bytes(*MON_VER, versions + b"".join(struct.pack("<30s", text.encode()) for text in extensions))
