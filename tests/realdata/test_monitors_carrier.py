"""Carrier monitors on real receivers: quiet where nothing is wrong, and faults of a satellite put into their measurements are found."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from integrity.carrier_thresholds import ERRORS
from integrity.gnss.ephemeris.states import Ephemerides, satellite_states, usable
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.frames import ecef_from_geodetic
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Floats, Ints, ObservationBlock, build_block, layout_of
from integrity.gnss.positioning import compared, expected, points_at, state_time_ns
from integrity.gnss.signals import time_scale_index
from integrity.gnss.velocity import wavelengths_m
from integrity.monitors import carrier_motion, divergence
from integrity.monitors.carrier_motion import MotionInputs, MotionMemory
from integrity.monitors.carrier_residuals import TrackingMemory, carrier_residual_m, code_minus_carrier_m, continuing, nature
from integrity.monitors.divergence import DivergenceInputs, DivergenceMemory
from integrity.monitors.residuals import seen_by_all
from recordings.rinex.navigation import read_navigation
from recordings.rinex.observation import read_observations
from tests.realdata.catalonia import FILES, NAVIGATION
from tests.unit.carriers import CLOSE, moving

THRESHOLD = 6.5  # of a satellite among sixty, one false alarm a year
MASK_RAD = float(np.deg2rad(5.0))
Found = dict[str, Floats]  # what all receivers see of each statistic, (E, S), in sigmas


class Station(NamedTuple):
    """Receivers with a common sky, some of their epochs lined up."""

    block: ObservationBlock
    pos_ecef_m: Floats
    ephemerides: Ephemerides
    serving: Ints  # (E, S), indices into the ephemerides

    def column(self, satellite: str) -> int:
        return self.block.satellites.index(satellite)


def station(files: dict[str, Path], navigation: Path, pos_ecef_m: Floats | None = None) -> Station:
    """All epochs that all receivers have, to the nearest second."""
    read = [read_observations(path, name) for name, path in files.items()]
    rows = [{round(row.receive_time_ns / NS_PER_S) * NS_PER_S: row for row in file.rows} for file in read]
    epochs = sorted(set.intersection(*(set(mine) for mine in rows)))
    lined_up = [[mine[t] for mine in rows] for t in epochs]
    block = build_block(list(files), epochs, lined_up, layout_of(row for epoch in lined_up for row in epoch))
    store = EphemerisStore(sorted(read_navigation(navigation).ephemerides, key=lambda eph: eph.transmission_ns))
    sent_ns = np.array([eph.transmission_ns for eph in store.ephemerides])
    index = store.choose(block.satellites, block.epoch_ns, np.maximum(np.searchsorted(sent_ns, block.epoch_ns, "right"), 1))
    pos = np.array([file.approx_position_ecef_m for file in read]) if pos_ecef_m is None else pos_ecef_m
    return Station(block, pos, store.ephemerides, index)


def found_by(of: Station, block: ObservationBlock) -> Found:
    """What the monitors say of a block of the station."""
    states = satellite_states(of.ephemerides, of.serving, state_time_ns(block.epoch_ns), block.signals)
    sight = expected(states, block.epoch_ns, points_at(of.pos_ecef_m), None)
    older = np.concatenate((of.serving[:1], of.serving[:-1]))
    as_before = expected(
        satellite_states(of.ephemerides, older, state_time_ns(block.epoch_ns), block.signals),
        block.epoch_ns,
        points_at(of.pos_ecef_m),
        None,
    )
    jump_m = np.where(older == of.serving, 0.0, (sight.range_m - as_before.range_m).mean(axis=1))
    wavelength_m = wavelengths_m(block.signals, of.ephemerides.channel[of.serving])
    continues = continuing(TrackingMemory.empty(len(block.receivers)), block, 1.0)[1]
    natural = nature(sight.los_enu[2], block.cn0_dbhz, states.ionosphere, np.ones(len(block.signals)), ERRORS)
    seen = (usable(of.ephemerides, of.serving) & (sight.el_rad >= MASK_RAD).all(axis=1))[:, None]
    c_m = np.where(seen, code_minus_carrier_m(block, wavelength_m), np.nan)
    residual_m = carrier_residual_m(compared(block, sight).residual_m, c_m, sight.ionosphere_m)
    interval_s = float(np.median(np.diff(block.epoch_ns))) / NS_PER_S
    h = max(1, round(30.0 / interval_s))
    system_of = np.array([time_scale_index(s) for s in block.satellites], dtype=np.int64)
    inputs = MotionInputs(block.signals, block.epoch_ns, residual_m, continues, jump_m, natural, system_of)
    n = len(block.receivers)
    _, moved = carrier_motion.advance(MotionMemory.empty(n, h), inputs, moving(h))
    of_code = DivergenceInputs(block.signals, block.epoch_ns, c_m, continues, natural, system_of)
    _, apart = divergence.advance(DivergenceMemory.empty(n), of_code, CLOSE)
    statistics = (moved.step, moved.ramp, moved.acceleration, apart.innovation, apart.divergence)
    return dict(zip(("step", "ramp", "acceleration", "innovation", "divergence"), map(seen_by_all, statistics), strict=True))


def catalonia(data: Path, names: Sequence[str]) -> Station:
    folder = data / "catalonia_2010"
    return station({name: folder / FILES[name] for name in names}, folder / NAVIGATION)


def nagoya(data: Path) -> Station:
    folder = data / "nagoya_static"
    files = {name: folder / f"{name}.obs.gz" for name in ("base", "rover")}
    points = np.array([(folder / f"{name}_position.txt").read_text().split() for name in files], dtype=np.float64)
    there = [ecef_from_geodetic(np.deg2rad(lat_deg), np.deg2rad(lon_deg), height_m) for lat_deg, lon_deg, height_m in points]
    return station(files, folder / "base.nav.gz", np.array(there))


def gsi(data: Path) -> Station:
    folder = data / "gsi_2005"
    return station({"A": folder / "07590920.05o.gz", "B": folder / "30400920.05o.gz"}, folder / "07590920.05n.gz")


@pytest.fixture(scope="module")
def upc(shared_data: Path) -> Station:
    """Two receivers at 1 Hz for an hour."""
    return catalonia(shared_data, ("UPC1", "UPC2"))


@pytest.fixture(scope="module")
def triple(shared_data: Path) -> Station:
    """Three at 30 s for twelve hours."""
    return catalonia(shared_data, ("CREU", "EBRE", "GARR"))


QUIET = ["CREU EBRE GARR", "CREU MATA GARR", "MATA EBRE GARR", "UPC1 UPC2 GARR", "UPC1 UPC2", "nagoya", "gsi"]


@pytest.mark.parametrize("names", QUIET)
def test_without_a_fault_all_is_quiet(shared_data: Path, names: str) -> None:
    of = {"nagoya": nagoya, "gsi": gsi}[names](shared_data) if names in ("nagoya", "gsi") else catalonia(shared_data, names.split())
    found = found_by(of, of.block)
    assert max(np.nanmax(statistic) for statistic in found.values()) <= 4.0
    assert min(np.isfinite(statistic).sum() for statistic in found.values()) > 500


def with_fault(of: Station, satellite: str, code_m: Floats, carrier_m: Floats) -> ObservationBlock:
    """Code and carrier of a satellite off by so much at all receivers, (E,)."""
    s = of.column(satellite)
    pseudorange_m, carrier_cycles = np.array(of.block.pseudorange_m), np.array(of.block.carrier_cycles)
    wavelength_m = wavelengths_m(of.block.signals[s : s + 1], np.zeros((1, 1), dtype=np.int64)).item()
    pseudorange_m[..., s] += code_m[:, None]
    carrier_cycles[..., s] += carrier_m[:, None] / wavelength_m
    return replace(of.block, pseudorange_m=pseudorange_m, carrier_cycles=carrier_cycles)


def after(of: Station, epoch: int) -> Floats:
    """Seconds since an epoch, 0 before."""
    result: Floats = np.maximum((of.block.epoch_ns - of.block.epoch_ns[epoch]) / NS_PER_S, 0.0)
    return result


def first_alarm(of: Station, found: Found, names: Sequence[str], begin: int) -> tuple[str, float]:
    """The first satellite named from an epoch on (the worst, where several are), and seconds since."""
    worst = np.nan_to_num(np.stack([found[name] for name in names])).max(axis=0)[begin:]
    e = int(np.argmax(worst.max(axis=1) > THRESHOLD))
    assert worst[e].max() > THRESHOLD
    return of.block.satellites[int(np.argmax(worst[e]))], float(of.block.epoch_ns[begin + e] - of.block.epoch_ns[begin]) / NS_PER_S


def seen_throughout(of: Station, begin: int, end: int) -> list[str]:
    """Satellites whose carrier all receivers measure between two epochs, not too low."""
    there = np.isfinite(found_by(of, of.block)["step"][begin:end]).sum(axis=0) == end - begin
    return [satellite for satellite, is_there in zip(of.block.satellites, there, strict=True) if is_there]


@pytest.mark.parametrize("begin", [200, 700, 1200])
def test_at_30_s_a_step_of_a_metre_is_found_in_its_epoch(triple: Station, begin: int) -> None:
    satellites = seen_throughout(triple, begin - 1, begin + 2)
    assert len(satellites) >= 6
    for satellite in satellites:
        step_m = np.where(after(triple, begin - 1) > 0.0, 1.0, 0.0)
        found = found_by(triple, with_fault(triple, satellite, step_m, step_m))
        assert first_alarm(triple, found, ("step",), begin) == (satellite, 0.0)


def test_at_1_s_a_step_of_two_decimetres_is_found_although_doppler_calls_it_a_slip(shared_data: Path) -> None:
    """Receivers that measure Doppler; 0.5 m is what `find_slips` takes for a slip of theirs."""
    of = nagoya(shared_data)
    for satellite in ("G05", "E19", "C28"):
        for size_m in (0.2, 0.5, 5.0):
            step_m = np.where(after(of, 149) > 0.0, size_m, 0.0)
            assert first_alarm(of, found_by(of, with_fault(of, satellite, step_m, step_m)), ("step",), 150) == (satellite, 0.0)


@pytest.mark.parametrize(
    ("rate_mps", "acceleration_mps2", "soon_s"),
    [(0.03, 0.0, 60.0), (0.05, 0.0, 30.0), (0.2, 0.0, 1.0), (0.0, 0.002, 60.0), (0.0, 0.01, 20.0)],
)
def test_ramps_and_accelerations_are_found_soon(upc: Station, rate_mps: float, acceleration_mps2: float, soon_s: float) -> None:
    begin = 1500
    for satellite in ("G06", "G18", "G22"):
        t_s = after(upc, begin - 1)
        fault_m = rate_mps * t_s + 0.5 * acceleration_mps2 * t_s**2
        found = found_by(upc, with_fault(upc, satellite, fault_m, fault_m))
        named, after_s = first_alarm(upc, found, ("step", "ramp", "acceleration"), begin)
        assert named == satellite
        assert after_s <= soon_s


def test_code_that_leaves_its_carrier_is_found(upc: Station) -> None:
    """5 cm/s: 7 m between code and carrier until then. Noise and multipath of the code do not allow for less."""
    begin = 1500
    for satellite in ("G06", "G18", "G22"):
        drift_m = 0.05 * after(upc, begin)
        found = found_by(upc, with_fault(upc, satellite, drift_m, 0.0 * drift_m))
        named, after_s = first_alarm(upc, found, ("divergence", "innovation"), begin)
        assert named == satellite
        assert after_s <= 150.0


def test_a_jump_of_the_code_alone_is_found_in_its_epoch(upc: Station) -> None:
    begin = 1500
    for satellite in ("G06", "G18", "G22"):
        jump_m = np.where(after(upc, begin - 1) > 0.0, 8.0, 0.0)
        found = found_by(upc, with_fault(upc, satellite, jump_m, 0.0 * jump_m))
        assert first_alarm(upc, found, ("innovation",), begin) == (satellite, 0.0)


@pytest.mark.parametrize("carrier_too", [True, False], ids=["code and carrier", "code alone"])
def test_a_millisecond_of_a_receiver_clock_goes_unnoticed(triple: Station, carrier_too: bool) -> None:
    """As receivers steer their clocks: ranges and time tags jump together, phases of some makes as well."""
    ms_m = 299_792.458
    pseudorange_m, carrier_cycles = np.array(triple.block.pseudorange_m), np.array(triple.block.carrier_cycles)
    receive_time_ns = np.array(triple.block.receive_time_ns)
    pseudorange_m[700:, 1] += ms_m
    carrier_cycles[700:, 1] += carrier_too * ms_m / 299_792_458.0 * 1_575.42e6
    receive_time_ns[700:, 1] += NS_PER_S // 1000
    jumped = replace(triple.block, pseudorange_m=pseudorange_m, carrier_cycles=carrier_cycles, receive_time_ns=receive_time_ns)
    found = found_by(triple, jumped)
    assert max(np.nanmax(statistic) for statistic in found.values()) <= 4.0


def test_a_receiver_that_restarts_unmarked_goes_unnoticed(triple: Station) -> None:
    """All its ambiguities are other numbers afterwards."""
    carrier_cycles = np.array(triple.block.carrier_cycles)
    carrier_cycles[700:, 2] += np.random.default_rng(1).integers(-(10**7), 10**7, carrier_cycles.shape[2])
    found = found_by(triple, replace(triple.block, carrier_cycles=carrier_cycles))
    assert max(np.nanmax(statistic) for statistic in found.values()) <= 4.0
