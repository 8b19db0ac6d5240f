"""Single receivers of others at known points, all constellations: `recordings.solve.track`, as far as broadcast data can be right."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import pytest

from integrity.gnss.combination import ionosphere_free
from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.frames import ecef_from_geodetic, enu_axes, geodetic_from_ecef
from integrity.gnss.observations import Floats, ObservationBlock
from integrity.gnss.signals import FIRST_CODES, MONITORED_CODES, SECOND_CODES, Codes
from recordings.rinex.navigation import NavigationFile, read_navigation
from recordings.rinex.observation import read_blocks
from recordings.solve.sky import Sky, Weights
from recordings.solve.track import solved

WEIGHTS = Weights(0.9, 0.4, float(np.deg2rad(5.0)))  # of a site file that says nothing else
PAIRS: Codes = {s: tuple(f"{a}+{b}" for a in FIRST_CODES[s] for b in SECOND_CODES[s]) for s in "GECJ"}


def errors_enu_m(observations: Iterable[Path], navigation: Iterable[NavigationFile], truth_ecef_m: Floats, codes: Codes) -> Floats:
    """(E, 3); every epoch must be solved."""
    files = list(navigation)
    ephemerides: list[Ephemeris] = [eph for file in files for eph in file.ephemerides]
    sky = Sky(ephemerides, next((file.klobuchar for file in files if file.klobuchar is not None), None))
    tracks = [t for path in observations for t in solved(_blocks(path, codes), sky, WEIGHTS, truth_ecef_m.tolist(), codes)]
    lat, lon, _ = geodetic_from_ecef(truth_ecef_m[None])
    errors: Floats = np.einsum("ij,ej->ei", enu_axes(lat, lon)[0], np.concatenate([t.pos_ecef_m for t in tracks]) - truth_ecef_m)
    return errors


def _blocks(path: Path, codes: Codes) -> Iterator[ObservationBlock]:
    for block in read_blocks(path, "A").blocks:
        yield ionosphere_free(block) if codes is PAIRS else block


def p95_3d_m(errors: Floats) -> float:
    return float(np.percentile(np.linalg.norm(errors, axis=1), 95.0))


@pytest.fixture(scope="module")
def rosalia(shared_data: Path) -> Floats:
    """Two hours at 5 s, free of the ionosphere; the coordinates of the header are good to a metre."""
    files = sorted((shared_data / "rosalia_2025").glob("ROSR*.rnx.gz"))
    header_ecef_m = np.array(read_blocks(files[0], "A").header.approx_position_ecef_m)
    navigation = map(read_navigation, sorted((shared_data / "rosalia_2025").glob("*.25p.gz")))
    return errors_enu_m(files, navigation, header_ecef_m, PAIRS)


def test_free_of_the_ionosphere_every_epoch_is_solved(rosalia: Floats) -> None:
    assert np.isfinite(rosalia).all()


def test_free_of_the_ionosphere_positions_scatter_by_a_metre(rosalia: Floats) -> None:
    assert np.sqrt(((rosalia - rosalia.mean(axis=0)) ** 2).sum(axis=1).mean()) <= 1.0


def test_free_of_the_ionosphere_the_mean_is_within_1_5_m_of_the_header(rosalia: Floats) -> None:
    assert np.linalg.norm(rosalia.mean(axis=0)) <= 1.5


@pytest.mark.parametrize("codes", [MONITORED_CODES, PAIRS, {"C": FIRST_CODES["C"]}, {"R": FIRST_CODES["R"]}], ids=["L1", "free", "C", "R"])
@pytest.mark.parametrize("name", ["base", "rover"])
def test_two_antennas_under_all_constellations(shared_data: Path, name: str, codes: Codes) -> None:
    """Broadcast orbits and clocks and a broadcast ionosphere that removes half: 5 m in 95 % of epochs."""
    directory = shared_data / "nagoya_static"
    lat_deg, lon_deg, height_m = (float(x) for x in (directory / f"{name}_position.txt").read_text().split())
    truth_ecef_m = ecef_from_geodetic(np.deg2rad(lat_deg), np.deg2rad(lon_deg), height_m)
    errors = errors_enu_m([directory / f"{name}.obs.gz"], [read_navigation(directory / "base.nav.gz")], truth_ecef_m, codes)
    assert p95_3d_m(errors) <= 5.0


@pytest.mark.parametrize("station", ["0759", "3040"])
def test_rinex_2_of_two_fixed_stations(shared_data: Path, station: str) -> None:
    observations = shared_data / "gsi_2005" / f"{station}0920.05o.gz"
    header_ecef_m = np.array(read_blocks(observations, "A").header.approx_position_ecef_m)
    navigation = [read_navigation(shared_data / "gsi_2005" / f"{station}0920.05n.gz")]
    assert p95_3d_m(errors_enu_m([observations], navigation, header_ecef_m, MONITORED_CODES)) <= 5.0
