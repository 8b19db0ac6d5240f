"""Clocks and single differences of real receivers that nobody deceived: pairs on one roof, and triples of a network."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from integrity.assembler import nominal_epoch_ns
from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris.states import accuracy_m, satellite_states, usable
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.frames import ecef_from_geodetic
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats, Ints, ObservationRow, build_block, layout_of
from integrity.gnss.positioning import compared, expected, points_at, range_sigma_m, state_time_ns
from integrity.gnss.signals import BAND_HZ, MONITORED_CODES, TIME_SCALES, time_scale_index
from integrity.monitors.clocks import ClockMemory, ClockStatistics, advance
from integrity.monitors.residuals import clock_design, without_clocks, without_lone_satellites
from integrity.monitors.single_differences import PairStatistics, capture, captured, pair_design, pair_statistics, phase_agreement
from recordings.rinex.navigation import read_navigation
from recordings.rinex.observation import read_observations

K, LEAST, MISSED, MOST_SIGMAS = 5.6, 9.9, 1e-5, 6.0


@dataclass(frozen=True, eq=False)
class Seen:
    """What receivers saw at their surveyed points (E, R, S), and which satellites count (E, S)."""

    epoch_ns: Ints
    prefit_m: Floats
    carrier_ahead_m: Floats
    wavelength_m: Floats
    range_m: Floats
    sigma_m: Floats
    sigma_differential_m: Floats
    used: Bools
    system_of: Ints


CATALONIA = {"roof": ("UPC1", "UPC2"), "ceg": ("CREU", "EBRE", "GARR"), "cmg": ("CREU", "MATA", "GARR"), "meg": ("MATA", "EBRE", "GARR")}
SETS = (*CATALONIA, "gsi", "nagoya")


def files(data: Path, name: str) -> tuple[list[Path], list[Path], float]:
    """Observations, navigation, and the interval in seconds."""
    if name == "nagoya":
        return [data / "nagoya_static" / f"{x}.obs.gz" for x in ("base", "rover")], [data / "nagoya_static" / "base.nav.gz"], 1.0
    if name == "gsi":
        return sorted((data / "gsi_2005").glob("*o.gz")), sorted((data / "gsi_2005").glob("*n.gz")), 30.0
    folder, stations = data / "catalonia_2010", CATALONIA[name]
    pattern, interval_s = ("{}0770_00-12h.10o.gz", 30.0) if len(stations) > 2 else ("{}0770.11o.gz", 1.0)
    return [folder / pattern.format(station) for station in stations], [folder / "brdc0770.10n.gz"], interval_s


def point(path: Path, header_ecef_m: tuple[float, float, float] | None) -> tuple[float, float, float]:
    """Surveyed where a file says so, otherwise of the header."""
    surveyed = path.with_name(path.name.replace(".obs.gz", "_position.txt"))
    if surveyed.suffix == ".txt" and surveyed.exists():
        lat_deg, lon_deg, height_m = (float(x) for x in surveyed.read_text().split()[:3])
        x, y, z = ecef_from_geodetic(np.deg2rad(lat_deg), np.deg2rad(lon_deg), height_m)
        return float(x), float(y), float(z)
    assert header_ecef_m is not None
    return header_ecef_m


@cache
def seen(data: Path, name: str) -> Seen:
    observed, told, interval_s = files(data, name)
    opened = [read_observations(path, "ABC"[i]) for i, path in enumerate(observed)]
    navigation = [read_navigation(path) for path in told]
    points = points_at(np.array([point(path, of.approx_position_ecef_m) for path, of in zip(observed, opened, strict=True)]))
    by_epoch: list[dict[int, ObservationRow]] = [
        {nominal_epoch_ns(row.receive_time_ns, round(interval_s * NS_PER_S)): row for row in of.rows} for of in opened
    ]
    epochs = sorted(set.intersection(*(set(x) for x in by_epoch)))
    rows = [[of[t] for of in by_epoch] for t in epochs]
    block = build_block("ABC"[: len(opened)], epochs, rows, layout_of([r for x in rows for r in x], codes=MONITORED_CODES))
    store = EphemerisStore(eph for of in navigation for eph in of.ephemerides if eph.implausibility() is None)
    index = store.choose(block.satellites, block.epoch_ns, np.full(len(epochs), len(store)))
    states = satellite_states(store.ephemerides, index, state_time_ns(block.epoch_ns), block.signals)
    sight = expected(states, block.epoch_ns, points, navigation[0].klobuchar)
    at_points = compared(block, sight)
    system_of = np.array([time_scale_index(s) for s in block.satellites])
    good = np.isfinite(at_points.residual_m).all(axis=1) & (sight.el_rad >= np.deg2rad(5.0)).all(axis=1) & usable(store.ephemerides, index)
    el_rad = sight.el_rad.mean(axis=1)
    wavelength_m = np.array([SPEED_OF_LIGHT_MPS / BAND_HZ[s[0] + s[4]] for s in block.signals])
    return Seen(
        block.epoch_ns,
        at_points.residual_m,
        np.where(block.half_cycle, np.nan, wavelength_m * block.carrier_cycles - block.pseudorange_m),
        wavelength_m,
        sight.range_m,
        range_sigma_m(el_rad, 0.9, 0.4, accuracy_m(store.ephemerides, index)),
        range_sigma_m(el_rad, 0.25, 0.2),
        without_lone_satellites(good, system_of, len(TIME_SCALES)),
        system_of,
    )


def clocks(of: Seen) -> ClockStatistics:
    design = clock_design(of.sigma_m, of.used, of.system_of, len(TIME_SCALES))
    clock_m = without_clocks(design, of.prefit_m).clock_m
    return advance(ClockMemory.empty(of.prefit_m.shape[1]), of.epoch_ns, clock_m, 1.0 / np.sqrt(design.weight[..., 0].T))[1]


def pairs(of: Seen, prefit_m: Floats) -> PairStatistics:
    return pair_statistics(pair_design(of.range_m, of.sigma_differential_m, of.used, of.system_of, len(TIME_SCALES)), prefit_m)


def largest(values: Floats) -> float:
    return float(np.where(np.isfinite(values), np.abs(values), 0.0).max())


@pytest.mark.parametrize("name", SETS)
def test_no_receiver_clock_leaves_its_prediction(shared_data: Path, name: str) -> None:
    assert largest(clocks(seen(shared_data, name)).innovation) < MOST_SIGMAS / 2.0


def test_a_clock_that_was_set_by_5_ms(shared_data: Path) -> None:
    jumps = clocks(seen(shared_data, "roof")).jump_ms
    assert [(r, ms) for e, r in np.argwhere(np.abs(jumps) >= 1.0).tolist() for ms in [jumps[e, r]]] == [(1, 5.0)]


@pytest.mark.parametrize("name", SETS)
def test_gnss_time_does_not_step(shared_data: Path, name: str) -> None:
    assert largest(clocks(seen(shared_data, name)).all_alike) < 1.0


def test_no_constellation_steps(shared_data: Path) -> None:
    assert largest(clocks(seen(shared_data, "nagoya")).constellation) < 1.0


@pytest.mark.parametrize("name", SETS)
def test_under_the_sky_no_pair_hears_one_transmitter(shared_data: Path, name: str) -> None:
    of = seen(shared_data, name)
    assert largest(pairs(of, of.prefit_m).collapse) < 0.7 * K


@pytest.mark.parametrize("name", [name for name in SETS if name != "nagoya"])  # a metre apart they cannot tell
def test_a_pair_that_hears_what_one_hears(shared_data: Path, name: str) -> None:
    # The second receiver gets the ranges of the first with the noise of its own: its residual differs by what the points differ in.
    of = seen(shared_data, name)
    heard = np.array(of.prefit_m)
    noise = np.random.default_rng(1).normal(size=heard[:, 0].shape) * of.sigma_differential_m
    heard[:, 1] = of.prefit_m[:, 0] + of.range_m[:, 0] - of.range_m[:, 1] + noise
    found = captured(pairs(of, heard), K, LEAST, MISSED)
    assert (found == (np.arange(found.shape[1]) == 0)).all()


def test_a_metre_apart_nothing_is_said(shared_data: Path) -> None:
    of = seen(shared_data, "nagoya")
    assert np.isnan(capture(pairs(of, of.prefit_m), K, LEAST)).all()


def test_a_metre_apart_phases_tell(shared_data: Path) -> None:
    # Sixty satellites of four constellations: under the sky their fractions are of every size, over one path they would reach 117.
    of = seen(shared_data, "nagoya")
    design = pair_design(of.range_m, of.sigma_differential_m, of.used, of.system_of, len(TIME_SCALES))
    statistic, threshold = phase_agreement(design, of.prefit_m, of.carrier_ahead_m, of.wavelength_m, 1e-9)
    assert (statistic < threshold / 4.0).all()


@pytest.mark.parametrize("name", ["nagoya", "roof"])
def test_phases_of_one_path_agree(shared_data: Path, name: str) -> None:
    of = seen(shared_data, name)
    rng, heard, ahead = np.random.default_rng(1), np.array(of.prefit_m), np.array(of.carrier_ahead_m)
    moved_m = of.range_m[:, 0] - of.range_m[:, 1]
    heard[:, 1] = of.prefit_m[:, 0] + moved_m + rng.normal(size=moved_m.shape) * of.sigma_differential_m
    cycles = rng.integers(-1000, 1000, moved_m.shape)
    path_m = of.prefit_m[:, 0] + of.carrier_ahead_m[:, 0] + moved_m + 0.005 * rng.normal(size=moved_m.shape)
    ahead[:, 1] = path_m + of.wavelength_m * cycles - heard[:, 1]
    design = pair_design(of.range_m, of.sigma_differential_m, of.used, of.system_of, len(TIME_SCALES))
    statistic, threshold = phase_agreement(design, heard, ahead, of.wavelength_m, 1.2e-3)
    assert (statistic > threshold).all()
