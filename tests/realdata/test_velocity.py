"""Velocity of receivers that stand still, from their Doppler: two of 2024, all systems."""

from pathlib import Path

import numpy as np
import pytest

from integrity.gnss.ephemeris.states import satellite_states, usable
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.frames import ecef_from_geodetic
from integrity.gnss.observations import build_block, layout_of
from integrity.gnss.positioning import expected, points_at, state_time_ns
from integrity.gnss.signals import FIRST_CODES
from integrity.gnss.velocity import Velocities, rates_mps, velocities, wavelengths_m
from recordings.rinex.navigation import read_navigation
from recordings.rinex.observation import read_observations

MASK_RAD = np.deg2rad(10.0)


@pytest.fixture(scope="module", params=["base", "rover"])
def found(shared_data: Path, request: pytest.FixtureRequest) -> Velocities:
    folder = shared_data / "nagoya_static"
    rows = read_observations(folder / f"{request.param}.obs.gz", "A").rows
    sets = read_navigation(folder / "base.nav.gz").ephemerides
    lat_deg, lon_deg, height_m = (float(x) for x in (folder / f"{request.param}_position.txt").read_text().split()[:3])
    points = points_at(ecef_from_geodetic(np.deg2rad(lat_deg), np.deg2rad(lon_deg), height_m)[None])
    block = build_block(("A",), [row.receive_time_ns for row in rows], [[row] for row in rows], layout_of(rows, codes=FIRST_CODES))
    store = EphemerisStore(sets)
    index = store.choose(block.satellites, block.epoch_ns, np.full(len(rows), len(sets)))
    states = satellite_states(store.ephemerides, index, state_time_ns(block.epoch_ns), block.signals)
    sight = expected(states, block.epoch_ns, points, None)
    rate_mps = rates_mps(block, sight, wavelengths_m(block.signals, store.ephemerides.channel[index]))
    used = (sight.el_rad > MASK_RAD) & usable(store.ephemerides, index)[:, None]
    return velocities(rate_mps, sight.los_enu, 0.05 / np.sin(np.maximum(sight.el_rad, MASK_RAD)), used)


def test_every_epoch_has_a_velocity(found: Velocities) -> None:
    assert np.isfinite(found.v_enu_mps).all()


def test_the_mean_velocity_is_below_2_mm_a_second(found: Velocities) -> None:
    assert np.abs(found.v_enu_mps.mean(axis=(0, 1))).max() < 2e-3


def test_the_scatter_is_that_of_doppler(found: Velocities) -> None:
    """RTKLIB's (demo5, GPS and Galileo) is 6.5, 6.9 and 15.0 mm/s on `base`."""
    rms_mps = np.sqrt((found.v_enu_mps**2).mean(axis=(0, 1)))
    assert (rms_mps < [6.5e-3, 6.9e-3, 15.0e-3]).all()
