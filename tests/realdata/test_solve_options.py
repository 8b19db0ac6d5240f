"""`wayside solve` with tests, velocities and smoothing on receivers of others: numbers that hold for open sky, and for a walk under trees.

Bounds are what the ranges of such receivers are worth, not what these files gave: a quarter and more above that.
"""

import csv
import gzip
import json
from collections.abc import Callable
from datetime import datetime
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from integrity.gnss.observations import Floats
from tests.benchmarks.solve import SETS
from tests.e2e.commands import wayside

FILES: dict[str, Callable[[Path], list[object]]] = {
    "SEPT078M": lambda d: [d / "spp_truth/SEPT078M.21O.gz", "--nav", d / "spp_truth/SEPT078M.21P.gz", *at("SEPT078M")],
    "ESBC00DNK": lambda d: [
        d / "spp_truth/ESBC00DNK_2020177.crx.gz",
        "--nav",
        d / "spp_truth/ESBC00DNK_2020177_nav.rnx.gz",
        *at("ESBC00DNK"),
    ],
    "nagoya": lambda d: [d / "nagoya_static/base.obs.gz", "--nav", d / "nagoya_static/base.nav.gz"],
    "rosalia": lambda d: [
        *sorted((d / "rosalia_2025").glob("ROSR*.rnx.gz")),
        *(argument for path in sorted((d / "rosalia_2025").glob("*.25p.gz")) for argument in ("--nav", path)),
    ],
    "gsi": lambda d: [d / "gsi_2005/07590920.05o.gz", "--nav", d / "gsi_2005/07590920.05n.gz"],
    "UPC1": lambda d: [d / "catalonia_2010/UPC10770.11o.gz", "--nav", d / "catalonia_2010/brdc0770.10n.gz"],
    "MATA": lambda d: [d / "catalonia_2010/MATA0770_00-12h.10o.gz", "--nav", d / "catalonia_2010/brdc0770.10n.gz"],
    "walk": lambda d: [d / "drive_imu/walk_gnss_1730.ubx.gz"],
}
OPEN = ("SEPT078M", "ESBC00DNK", "nagoya", "rosalia", "gsi", "UPC1", "MATA")


def at(name: str) -> list[object]:
    return ["--position", ",".join(map(str, SETS[name].truth_ecef_m))]


@cache
def solved(shared_data: Path, name: str, *arguments: object) -> dict[str, Any]:
    ran = wayside("solve", *FILES[name](shared_data), *arguments, "--json")
    assert ran.code == 0, ran.err
    found: dict[str, Any] = json.loads(ran.out)
    return found


# Tests and exclusion


@pytest.mark.parametrize("ionosphere", ["klobuchar", "free"])
@pytest.mark.parametrize("name", OPEN)
def test_in_the_open_every_epoch_passes_and_nothing_is_excluded(shared_data: Path, name: str, ionosphere: str) -> None:
    if name == "rosalia" and ionosphere == "klobuchar":
        pytest.skip("its navigation files have no Klobuchar terms")
    found = solved(shared_data, name, "--ionosphere", ionosphere)
    assert (found["tests"]["passed"], found["tests"]["excluded"]) == (found["epochs"], {})


@pytest.mark.parametrize("window_s", [100, 1800])
@pytest.mark.parametrize("name", ["SEPT078M", "ESBC00DNK"])
def test_smoothed_pairs_fit_together_too(shared_data: Path, name: str, window_s: int) -> None:
    found = solved(shared_data, name, "--ionosphere", "free", "--smooth", window_s)
    assert found["tests"]["passed"] == found["epochs"]


def test_without_a_model_of_the_ionosphere_it_is_no_fault(shared_data: Path) -> None:
    """Nor is any satellite low down to blame for it."""
    found = solved(shared_data, "nagoya", "--ionosphere", "none")
    assert (found["tests"]["passed"], found["tests"]["excluded"]) == (301, {})


# Velocity


@pytest.mark.parametrize("name", ["ESBC00DNK", "nagoya", "rosalia"])
def test_a_receiver_at_rest_has_no_velocity(shared_data: Path, name: str) -> None:
    """Doppler of geodetic receivers, of epochs on their own: a centimetre a second across, two up."""
    velocity = solved(shared_data, name)["velocity"]
    assert (np.array(velocity["rms_enu_mps"]) < [0.01, 0.01, 0.02]).all()
    assert np.linalg.norm(velocity["mean_enu_mps"]) < 2e-3


@pytest.mark.parametrize("ionosphere", ["klobuchar", "free"])
def test_every_epoch_has_one_where_there_is_doppler(shared_data: Path, ionosphere: str) -> None:
    assert solved(shared_data, "ESBC00DNK", "--ionosphere", ionosphere)["velocity"]["epochs"] == 2880


class Walked(NamedTuple):
    """A walk under trees, by a small receiver: its own positions and velocities, with corrections; ours, of Doppler of single epochs."""

    off_mps: Floats  # (n, 3), ours less the change of its positions over half a second
    epochs: int


def walked(shared_data: Path, table: Path, *arguments: object) -> Walked:
    text = gzip.decompress((shared_data / "drive_imu/walk_gnss_1730_sf.pos.gz").read_bytes()).decode()
    rows = [line.split() for line in text.splitlines() if not line.startswith("%")]
    times_s = np.array([datetime.fromisoformat(f"{row[0].replace('/', '-')}T{row[1]}").timestamp() for row in rows])
    lat_deg, lon_deg, height_m = (np.array([float(row[k]) for row in rows]) for k in (2, 3, 4))
    enu_m = np.stack((np.radians(lon_deg - lon_deg[0]) * EAST_M, np.radians(lat_deg - lat_deg[0]) * NORTH_M, height_m), axis=1)
    solved(shared_data, "walk", "-o", table, *arguments)
    off_mps = []
    with table.open(newline="") as file:
        for row in csv.DictReader(file):
            k = int(np.abs(times_s - datetime.fromisoformat(row["gps_time"]).timestamp()).argmin())
            if row["ve_mps"] and 0 < k < len(rows) - 1 and times_s[k + 1] - times_s[k - 1] < 0.6:
                change_mps = (enu_m[k + 1] - enu_m[k - 1]) / (times_s[k + 1] - times_s[k - 1])
                off_mps.append([float(row[name]) for name in ("ve_mps", "vn_mps", "vu_mps")] - change_mps)
    return Walked(np.array(off_mps), len(rows))


EAST_M, NORTH_M = 4_887_600.0, 6_363_600.0  # a radian of longitude, of latitude, at 40.097 degrees and 1,580 m


@pytest.fixture(scope="module")
def walk(shared_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Walked:
    return walked(shared_data, tmp_path_factory.mktemp("walk") / "t.csv")


def test_a_walk_has_the_velocity_that_its_positions_change_by(walk: Walked) -> None:
    """A quarter of a metre a second in half of the epochs, a metre in 95 %: under trees, with nothing but Doppler of each."""
    off_mps = np.linalg.norm(walk.off_mps, axis=1)
    assert np.median(off_mps) < 0.4
    assert np.percentile(off_mps, 95.0) < 1.0


def test_velocities_of_a_walk_have_no_bias(walk: Walked) -> None:
    assert np.abs(walk.off_mps.mean(axis=0)).max() < 0.05


def test_nearly_every_epoch_of_a_walk_has_a_velocity(walk: Walked) -> None:
    assert len(walk.off_mps) > 0.9 * walk.epochs


def test_of_a_walk_exclusion_takes_the_worst(shared_data: Path, tmp_path: Path, walk: Walked) -> None:
    everything = walked(shared_data, tmp_path / "t.csv", "--no-exclude")
    assert np.linalg.norm(walk.off_mps, axis=1).max() < 0.5 * np.linalg.norm(everything.off_mps, axis=1).max()


# Smoothing


@pytest.mark.parametrize(
    ("name", "ionosphere", "share"),
    [("SEPT078M", "free", 0.7), ("SEPT078M", "klobuchar", 0.95), ("ESBC00DNK", "free", 0.97), ("ESBC00DNK", "klobuchar", 1.0)],
)
def test_smoothing_makes_positions_better(shared_data: Path, name: str, ionosphere: str, share: float) -> None:
    """3-D below in 95 %: of pairs their noise goes, and stays what lasts for minutes; of one frequency most was never noise."""
    p95_m = [solved(shared_data, name, "--ionosphere", ionosphere, *asked)["errors"]["p95_3d_m"] for asked in ([], ["--smooth", "100"])]
    assert p95_m[1] <= share * p95_m[0]


def test_one_frequency_smoothed_for_long_is_worse(shared_data: Path) -> None:
    """What the help says of the ionosphere: half an hour pulls ranges by metres."""
    p95_m = [solved(shared_data, "ESBC00DNK", *asked)["errors"]["p95_3d_m"] for asked in ([], ["--smooth", "1800"])]
    assert p95_m[1] > 1.2 * p95_m[0]


@pytest.mark.parametrize("name", ["nagoya", "rosalia", "gsi", "UPC1", "MATA", "walk"])
@pytest.mark.parametrize("ionosphere", ["free", "klobuchar"])
def test_smoothed_positions_scatter_less(shared_data: Path, name: str, ionosphere: str) -> None:
    """RINEX 2 and 3, with and without lock marks and Doppler, at 1 s and 30 s, and a walk whose scatter is its way."""
    if name in ("rosalia", "walk") and ionosphere == "klobuchar":
        pytest.skip("its navigation data have no Klobuchar terms")
    scatter_m = [
        solved(shared_data, name, "--ionosphere", ionosphere, *asked)["scatter"]["p95_3d_m"] for asked in ([], ["--smooth", "100"])
    ]
    assert scatter_m[1] < scatter_m[0]


def test_channels_of_glonass_are_smoothed_with_their_own_wavelengths(shared_data: Path) -> None:
    scatter_m = [
        solved(shared_data, "nagoya", "--systems", "GLONASS", *asked)["scatter"]["p95_3d_m"] for asked in ([], ["--smooth", "100"])
    ]
    assert scatter_m[1] < 0.5 * scatter_m[0]
