"""Our RTCM 3 against RTKLIB's decoder: what becomes of the numbers: times, ranges, carriers, signs, channels, orbits.

RTKLIB takes few signals of a satellite; those that it has are compared. It multiplies by powers of two written with 14 to 16 digits, and
keeps Doppler and C/N0 in single precision.
"""

import math
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from integrity.gnss.ephemeris.broadcast import Ephemeris, GlonassEphemeris, KeplerEphemeris, KeplerMessage
from integrity.gnss.gps_time import GPS_EPOCH_UNIX_S, NS_PER_S, gps_from_week
from integrity.gnss.observations import ObservationRow
from integrity.gnss.rtcm.decoder import RtcmDecoder
from integrity.gnss.rtcm.framing import RtcmFramer, frame_bytes, message_number
from integrity.gnss.rtcm.msm import MSM_NUMBERS, header_of
from integrity.gnss.rtcm.msm_writer import encode_row
from integrity.gnss.rtcm.navigation import encode_ephemeris
from integrity.gnss.signals import carrier_hz

LOG_STARTS_NS = gps_from_week(1709, 604_784.0)  # the file's name and its ephemerides say so
MORE_BIT = 54  # DF393, from the beginning of a message
NEW_OBSERVATIONS, NEW_EPHEMERIS = 1, 2  # what RTKLIB returns
SYSTEMS = {0x01: "G", 0x02: "S", 0x04: "R", 0x08: "E", 0x10: "J", 0x20: "C"}
FIRST_PRN = {"S": 100, "J": 192}


@pytest.fixture(scope="module")
def messages(shared_data: Path) -> list[bytes]:
    return RtcmFramer().feed((shared_data / "tokyo_sbas_2008/GMSD7_20121014.rtcm3").read_bytes())


class Rtklib:
    """RTKLIB's decoder, at a time."""

    def __init__(self, rtklib: ModuleType, time_ns: int) -> None:
        self.rtklib = rtklib
        self.rtcm = rtklib.rtcm_t()
        assert rtklib.init_rtcm(self.rtcm)
        self.rtcm.time = rtklib.gpst2time(0, 0.0)
        self.rtcm.time.time = time_ns // NS_PER_S + GPS_EPOCH_UNIX_S

    def take(self, message: bytes) -> int:
        """What the last byte of its frame brought."""
        return int([self.rtklib.input_rtcm3(self.rtcm, byte) for byte in frame_bytes(message)][-1])

    def satellite(self, number: int) -> str:
        prn = self.rtklib.Arr1Dint(1)
        system = SYSTEMS[self.rtklib.satsys(number, prn)]
        return f"{system}{prn[0] - FIRST_PRN.get(system, 0):02d}"

    def observations(self) -> Iterator[tuple[int, str, list[float]]]:
        """Time, signal, and range, carrier, Doppler, C/N0, half cycle; zero is none."""
        for i in range(self.rtcm.obs.n):
            obs = self.rtcm.obs.data[i]
            time_ns = (obs.time.time - GPS_EPOCH_UNIX_S) * NS_PER_S + round(obs.time.sec * 1e3) * 1_000_000
            for k in range(5):
                if obs.code[k]:
                    signal = f"{self.satellite(obs.sat)}.{self.rtklib.code2obs(obs.code[k])}"
                    yield time_ns, signal, [obs.P[k], obs.L[k], obs.D[k], obs.SNR[k], bool(obs.LLI[k] & 2)]


def alone(message: bytes) -> bytes:
    """The message as one after which no more follow."""
    number = int.from_bytes(message, "big") & ~(1 << 8 * len(message) - 1 - MORE_BIT)
    return number.to_bytes(len(message), "big")


def row_of(messages: list[bytes], near_ns: int) -> ObservationRow:
    decoder = RtcmDecoder("A")
    (row,) = [told for message in messages for told in decoder.take(message, near_ns)]
    assert isinstance(row, ObservationRow)
    return row


def assert_same(row: ObservationRow, theirs: Rtklib) -> int:
    """Signals compared."""
    found = list(theirs.observations())
    for time_ns, signal, (pseudorange_m, carrier, doppler_hz, cn0, half) in found:
        assert time_ns == row.receive_time_ns
        if signal not in row.signals:
            assert pseudorange_m == carrier == 0.0
            continue
        i = row.signals.index(signal)
        np.testing.assert_allclose(np.nan_to_num(row.pseudorange_m[i]), pseudorange_m, rtol=3e-15)
        np.testing.assert_allclose(np.nan_to_num(row.carrier_cycles[i]), carrier, rtol=3e-15)
        np.testing.assert_allclose(np.nan_to_num(row.doppler_hz[i]), doppler_hz, rtol=1e-6)
        np.testing.assert_allclose(np.nan_to_num(row.cn0_dbhz[i]), cn0, atol=1e-3)
        assert row.half_cycle[i] == half
    return len(found)


def test_every_message_of_the_log(messages: list[bytes], rtklib: ModuleType) -> None:
    theirs = Rtklib(rtklib, LOG_STARTS_NS)
    compared = 0
    for message in messages:
        if message_number(message) in MSM_NUMBERS:
            assert theirs.take(alone(message)) == NEW_OBSERVATIONS
            compared += assert_same(row_of([alone(message)], LOG_STARTS_NS), theirs)
    assert compared > 10_000


def a_row(time_ns: int, signals: list[str], seed: int) -> ObservationRow:
    """Plausible measurements, some missing; carriers near the ranges."""
    rng = np.random.default_rng(seed)
    n = len(signals)
    satellites = {signal[:3]: rng.uniform(2.0e7, 4.0e7) for signal in signals}
    ranges_m = np.array([satellites[signal[:3]] for signal in signals]) + rng.uniform(-50.0, 50.0, n)
    cycles = [range_m / 299_792_458.0 * hertz(signal) for range_m, signal in zip(ranges_m, signals, strict=True)]
    holes = rng.random((3, n)) < 0.15
    return ObservationRow(
        "A",
        time_ns,
        tuple(signals),
        np.where(holes[0], np.nan, ranges_m),
        np.where(holes[1], np.nan, np.array(cycles)),
        np.where(holes[2], np.nan, rng.uniform(-5000.0, 5000.0, n)),
        rng.uniform(1.0, 60.0, n),
        rng.uniform(0.0, 1000.0, n),
        np.zeros(n, dtype=np.bool_),
        rng.random(n) < 0.3,
    )


def hertz(signal: str) -> float:
    first_hz, step_hz = carrier_hz(signal[0], signal[4]) or (math.nan, 0.0)
    return first_hz + step_hz * CHANNELS.get(signal[:3], 0)


SIGNALS = {
    "G": [f"G{n:02d}.{code}" for n in (1, 7, 19, 32) for code in ("1C", "2W", "5Q")],
    "R": [f"R{n:02d}.{code}" for n in (1, 9, 24) for code in ("1C", "2C")],
    "E": [f"E{n:02d}.{code}" for n in (1, 11, 36) for code in ("1C", "7Q", "5Q")],
    "S": ["S20.1C", "S29.1C", "S37.1C"],
    "J": [f"J{n:02d}.{code}" for n in (1, 3) for code in ("1C", "2L", "5Q")],
    "C": [f"C{n:02d}.{code}" for n in (1, 6, 46) for code in ("2I", "7I", "6I")],
}
CHANNELS = {"R01": 1, "R09": -7, "R24": 6}
TIMES_NS = [
    gps_from_week(2200, 0.0),
    gps_from_week(2200, 604_799.5),
    gps_from_week(2200, 86_400.0 * 3 - 10_782.0),  # 00:00:00 in Moscow
    gps_from_week(2200, 86_400.0 * 3 - 10_783.0),
]


@pytest.mark.parametrize("system", SIGNALS)
@pytest.mark.parametrize("kind", [4, 5, 6, 7])
@pytest.mark.parametrize("time_ns", TIMES_NS)
def test_rows_that_we_encode(time_ns: int, kind: int, system: str, rtklib: ModuleType) -> None:
    (message,) = encode_row(a_row(time_ns, SIGNALS[system], kind), kind, channels=CHANNELS)
    theirs = Rtklib(rtklib, time_ns)
    assert theirs.take(message) == NEW_OBSERVATIONS
    assert assert_same(row_of([message], time_ns), theirs) > len(SIGNALS[system]) * 0.5
    header = header_of(message)
    assert header is not None
    assert set(header.signals) == set(SIGNALS[system])


QUANTITIES = {
    "e": "e",
    "i0": "i0",
    "omega0": "OMG0",
    "omega": "omg",
    "m0": "M0",
    "delta_n": "deln",
    "i_dot": "idot",
    "omega_dot": "OMGd",
    **{name: name for name in ("cuc", "cus", "crc", "crs", "cic", "cis")},
    **{f"af{k}": f"f{k}" for k in range(3)},
}
GLONASS_QUANTITIES = {"gamma_n": "gamn", "tau_n_s": "taun", "delta_tau_n_s": "dtaun"}
TOE_NS = gps_from_week(2200, 43_200.0)


def a_kepler_set(satellite: str, message: KeplerMessage, seed: int) -> KeplerEphemeris:
    rng = np.random.default_rng(seed)
    angles = dict(zip(("i0", "omega0", "omega", "m0"), rng.uniform(-3.1, 3.1, 4).tolist(), strict=True))
    harmonics = dict(zip(("cuc", "cus", "cic", "cis"), rng.uniform(-2e-5, 2e-5, 4).tolist(), strict=True))
    behind_ns = 14 * NS_PER_S if satellite[0] == "C" else 0
    return KeplerEphemeris(
        satellite=satellite,
        message=message,
        issue=int(rng.integers(1, 31)),
        healthy=bool(rng.random() < 0.5),
        accuracy_m=3.4 if satellite[0] != "E" else 3.12,
        transmission_ns=TOE_NS,
        toe_ns=TOE_NS + behind_ns,
        toc_ns=TOE_NS + behind_ns - 240 * NS_PER_S,
        fit_half_s={"G": 7200.0, "J": 5400.0, "E": 14_400.0, "C": 7200.0}[satellite[0]],
        sqrt_a=float(rng.uniform(5100.0, 5500.0) if satellite[0] in "GE" else rng.uniform(6480.0, 6500.0)),
        e=float(rng.uniform(0.0, 0.08)),
        delta_n=float(rng.uniform(-8e-9, 8e-9)),
        i_dot=float(rng.uniform(-9e-10, 9e-10)),
        omega_dot=float(rng.uniform(-9e-9, 9e-9)),
        crc=float(rng.uniform(-900.0, 900.0)),
        crs=float(rng.uniform(-900.0, 900.0)),
        af0=float(rng.uniform(-9e-4, 9e-4)),
        af1=float(rng.uniform(-1e-11, 1e-11)),
        af2=float(rng.uniform(-1e-17, 1e-17)),
        group_delay_s=float(rng.uniform(-2e-8, 2e-8)),
        group_delay_2_s=float(rng.uniform(-2e-8, 2e-8)) if message in ("INAV", "D1", "D2") else None,
        **angles,
        **harmonics,
    )


def both(eph: Ephemeris, rtklib: ModuleType) -> tuple[Ephemeris, Rtklib]:
    """What we and RTKLIB make of the message that we encode of a set."""
    assert isinstance(eph, KeplerEphemeris | GlonassEphemeris)
    message = encode_ephemeris(eph)
    (ours,) = RtcmDecoder("A").take(message, TOE_NS + 3600 * NS_PER_S)
    assert isinstance(ours, KeplerEphemeris | GlonassEphemeris)
    theirs = Rtklib(rtklib, TOE_NS + 3600 * NS_PER_S)
    assert theirs.take(message) == NEW_EPHEMERIS
    return ours, theirs


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    ("satellite", "message"), [("G05", "LNAV"), ("J03", "LNAV"), ("E11", "INAV"), ("E24", "FNAV"), ("C12", "D1"), ("C03", "D2")]
)
def test_kepler_sets_that_we_encode(satellite: str, message: KeplerMessage, seed: int, rtklib: ModuleType) -> None:
    sent = a_kepler_set(satellite, message, seed)
    ours, theirs = both(sent, rtklib)
    assert isinstance(ours, KeplerEphemeris)
    eph: Any = theirs.rtcm.nav.eph[theirs.rtcm.ephsat - 1 + (rtklib.MAXSAT if message == "FNAV" else 0)]
    assert theirs.satellite(eph.sat) == ours.satellite == satellite
    for name, their_name in QUANTITIES.items():
        np.testing.assert_allclose(getattr(ours, name), getattr(eph, their_name), rtol=1e-14, err_msg=name)
    np.testing.assert_allclose(ours.sqrt_a**2, eph.A, rtol=1e-14)
    delays = (ours.group_delay_2_s, ours.group_delay_s) if message == "INAV" else (ours.group_delay_s, ours.group_delay_2_s)
    np.testing.assert_allclose([0.0 if delay is None else delay for delay in delays], [eph.tgd[0], eph.tgd[1]], rtol=1e-14)
    assert ours.issue == eph.iode
    assert [ours.toe_ns, ours.toc_ns] == [(t.time - GPS_EPOCH_UNIX_S) * NS_PER_S for t in (eph.toe, eph.toc)]
    assert ours.healthy == sent.healthy == (eph.svh == 0)
    assert (ours.message, ours.accuracy_m, ours.fit_half_s) == (sent.message, sent.accuracy_m, sent.fit_half_s)


@pytest.mark.parametrize("seed", range(5))
def test_glonass_sets_that_we_encode(seed: int, rtklib: ModuleType) -> None:
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=3)
    x_m, y_m, z_m = (25.5e6 * direction / math.sqrt(float(np.sum(direction**2)))).tolist()
    level = np.cross(direction, rng.normal(size=3))  # nearly circular orbits neither rise nor sink
    speeds = (3500.0 * level / math.sqrt(float(np.sum(level**2)))).tolist()
    rates = dict(zip(("vx_mps", "vy_mps", "vz_mps"), speeds, strict=True))
    sent = GlonassEphemeris(
        satellite="R09",
        channel=int(rng.integers(-7, 7)),
        issue=60,
        healthy=bool(rng.random() < 0.5),
        accuracy_m=7.0,
        transmission_ns=TOE_NS,
        toe_ns=TOE_NS + 18 * NS_PER_S,
        fit_half_s=1200.0,
        x_m=x_m,
        y_m=y_m,
        z_m=z_m,
        **rates,
        ax_mps2=float(rng.uniform(-5e-6, 5e-6)),
        ay_mps2=float(rng.uniform(-5e-6, 5e-6)),
        az_mps2=float(rng.uniform(-5e-6, 5e-6)),
        tau_n_s=float(rng.uniform(-1e-3, 1e-3)),
        gamma_n=float(rng.uniform(-9e-10, 9e-10)),
        delta_tau_n_s=float(rng.uniform(-1e-8, 1e-8)),
    )
    ours, theirs = both(sent, rtklib)
    assert isinstance(ours, GlonassEphemeris)
    geph: Any = theirs.rtcm.nav.geph[8]
    vectors = [[getattr(geph, name)[k] for k in range(3)] for name in ("pos", "vel", "acc")]
    mine = [[ours.x_m, ours.y_m, ours.z_m], [ours.vx_mps, ours.vy_mps, ours.vz_mps], [ours.ax_mps2, ours.ay_mps2, ours.az_mps2]]
    np.testing.assert_allclose(mine, vectors, rtol=1e-14)
    for name, their_name in GLONASS_QUANTITIES.items():
        np.testing.assert_allclose(getattr(ours, name), getattr(geph, their_name), rtol=1e-14, err_msg=name)
    assert (ours.channel, ours.issue, ours.healthy) == (geph.frq, geph.iode, geph.svh == 0) == (sent.channel, 60, sent.healthy)
    assert ours.toe_ns == sent.toe_ns == (geph.toe.time - GPS_EPOCH_UNIX_S) * NS_PER_S
    assert ours.accuracy_m == 7.0
