"""Our RINEX reading against georinex, number by number, on recordings of eight receivers and on four navigation files.

Both take the same decimals from the same columns: no tolerance, but of a millisecond in the epochs.
"""

import gzip
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from integrity.gnss.gps_time import GPS_EPOCH_UNIX_S, NS_PER_S, WEEK_S
from recordings.rinex.navigation import read_navigation
from recordings.rinex.observation import read_observations

# xarray's announcements, which georinex meets hundreds of times, and numpy's of satellites without any number.
pytestmark = pytest.mark.filterwarnings("ignore:In a future version of xarray:FutureWarning", "ignore:genfromtxt:UserWarning")

georinex = pytest.importorskip("georinex")

RINEX2 = ("C1", "L1", "D1", "S1")
RINEX3 = ("C1C", "L1C", "D1C", "S1C")
ORBIT = {  # ours, and the same in georinex
    "af0": "SVclockBias", "af1": "SVclockDrift", "af2": "SVclockDriftRate", "sqrt_a": "sqrtA", "e": "Eccentricity", "i0": "Io",
    "omega0": "Omega0", "omega": "omega", "m0": "M0", "delta_n": "DeltaN", "i_dot": "IDOT", "omega_dot": "OmegaDot", "cuc": "Cuc",
    "cus": "Cus", "crc": "Crc", "crs": "Crs", "cic": "Cic", "cis": "Cis",
}  # fmt: skip
FIELDS = {
    "G": ORBIT | {"issue": "IODE", "group_delay_s": "TGD"},
    "E": ORBIT | {"issue": "IODnav", "group_delay_s": "BGDe5b"},
}


def first_epochs(source: Path, target: Path, epochs: int) -> Path:
    """A plain copy of a RINEX 3 observation file up to a number of epochs: georinex needs a second for twenty."""
    head, *blocks = gzip.decompress(source.read_bytes()).decode("ascii").split("\n>")
    target.write_text("\n>".join([head, *blocks[:epochs]]) + "\n")
    return target


def datetime_ns(gps_ns: int) -> np.datetime64:
    return np.datetime64(gps_ns + GPS_EPOCH_UNIX_S * NS_PER_S, "ns")


def compare(path: Path, theirs: Any, names: tuple[str, ...]) -> int:
    """Compare every number of either side, all of code 1C; returns how many pseudoranges there are."""
    file = read_observations(path, "A")
    times = np.array([datetime_ns(row.receive_time_ns) for row in file.rows])
    assert len(times) == len(theirs.time)
    assert (np.abs(times - theirs.time.values) <= np.timedelta64(1, "ms")).all()  # it has 30.0020000 s as 30.001 s
    ours = {
        (row.receive_time_ns, signal): (row.pseudorange_m[k], row.carrier_cycles[k], row.doppler_hz[k], row.cn0_dbhz[k])
        for row in file.rows
        for k, signal in enumerate(row.signals)
    }
    missing = np.full((len(theirs.time), len(theirs.sv)), np.nan)
    expected = np.stack([theirs[name].transpose("time", "sv").values if name in theirs else missing for name in names], axis=-1)
    expected[expected == 0.0] = np.nan  # 0.0 is "not measured" (RINEX 2.11, 5.3), which georinex leaves as it stands
    places = [(t, s) for t, s in np.argwhere(np.isfinite(expected[..., 0])).tolist() if theirs.sv.values[s][0] in "GE"]
    keys = [(file.rows[t].receive_time_ns, f"{theirs.sv.values[s]}.1C") for t, s in places]
    assert set(keys) == ours.keys()
    np.testing.assert_array_equal([ours[key] for key in keys], [expected[place] for place in places])
    return len(keys)


@pytest.mark.parametrize(
    "name",
    [
        "catalonia_2010/CREU0770_00-12h.10o.gz",
        "catalonia_2010/EBRE0770_00-12h.10o.gz",
        "catalonia_2010/GARR0770_00-12h.10o.gz",
        "catalonia_2010/MATA0770_00-12h.10o.gz",
        "gsi_2005/07590920.05o.gz",
    ],
)
def test_rinex2_observations(shared_data: Path, name: str) -> None:
    path = shared_data / name
    assert compare(path, georinex.load(path, use="G", meas=list(RINEX2)), RINEX2) > 900


@pytest.mark.parametrize(
    "name", ["spp_truth/SEPT078M.21O.gz", "nagoya_static/base.obs.gz", "rosalia_2025/ROSR01TUW_R_20250010600_15M_05S_AA.rnx.gz"]
)
def test_rinex3_observations(shared_data: Path, tmp_path: Path, name: str) -> None:
    path = first_epochs(shared_data / name, tmp_path / "first.rnx", epochs=20)
    assert compare(path, georinex.load(path, use={"G", "E"}, meas=list(RINEX3)), RINEX3) > 300


@pytest.mark.parametrize(
    "name", ["catalonia_2010/brdc0770.10n.gz", "gsi_2005/07590920.05n.gz", "spp_truth/SEPT078M.21P.gz", "nagoya_static/base.nav.gz"]
)
def test_navigation(shared_data: Path, name: str) -> None:
    path = shared_data / name
    ours = {
        (
            eph.satellite,
            datetime_ns(eph.toc_ns),
            eph.toe_ns // NS_PER_S % WEEK_S,
            *(getattr(eph, field) for field in FIELDS[eph.satellite[0]]),
        )
        for eph in read_navigation(path).ephemerides
    }
    data = georinex.load(path, use={"G", "E"})
    column = {name: data[name].transpose("time", "sv").values for name in data.data_vars}
    theirs = set()
    for t, s in np.argwhere(np.isfinite(column["sqrtA"])).tolist():
        satellite = str(data.sv.values[s])[:3]  # a second set of the same time is G05_1 there
        fnav = satellite[0] == "E" and not int(column["DataSrc"][t, s]) & 0b101
        if not fnav and column["Eccentricity"][t, s] < 0.1:  # not the two Galileo satellites in wrong orbits
            numbers = (float(column[name][t, s]) for name in ("Toe", *FIELDS[satellite[0]].values()))
            theirs.add((satellite, data.time.values[t].astype("datetime64[ns]"), *numbers))
    assert ours == theirs


@pytest.mark.parametrize("name", ["catalonia_2010/brdc0770.10n.gz", "spp_truth/SEPT078M.21P.gz"])
def test_klobuchar(shared_data: Path, name: str) -> None:
    path = shared_data / name
    ours = read_navigation(path).klobuchar
    assert ours is not None
    np.testing.assert_array_equal([*ours.alpha, *ours.beta], georinex.load(path, use={"G"}).attrs["ionospheric_corr_GPS"])
