"""Our RINEX reading against georinex, number by number and signal by signal, on recordings of nine receivers and on navigation files.

Both take the same decimals from the same columns: no tolerance, but of a millisecond in the epochs.
"""

import gzip
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from integrity.gnss.ephemeris.broadcast import Ephemeris, KeplerEphemeris
from integrity.gnss.gps_time import BDT_BEHIND_GPS_NS, GPS_EPOCH_UNIX_S, NS_PER_S, utc_from_gps
from recordings.rinex.navigation import read_navigation
from recordings.rinex.observation import read_observations

# xarray's announcements, which georinex meets hundreds of times, and numpy's of satellites without any number.
pytestmark = pytest.mark.filterwarnings("ignore:In a future version of xarray:FutureWarning", "ignore:genfromtxt:UserWarning")

georinex = pytest.importorskip("georinex")

RINEX2 = {"1C": ("C1", "L1", "D1", "S1"), "2W": ("P2", "L2", "D2", "S2")}
RINEX3 = {code: tuple(kind + code for kind in "CLDS") for code in ("1C", "2W", "2L", "5Q", "7Q", "2I", "7I", "6I", "2C", "3Q", "5I")}
SYSTEMS = "GECRJS"
ORBIT = {  # ours, and the same in georinex
    "af0": "SVclockBias", "af1": "SVclockDrift", "af2": "SVclockDriftRate", "sqrt_a": "sqrtA", "e": "Eccentricity", "i0": "Io",
    "omega0": "Omega0", "omega": "omega", "m0": "M0", "delta_n": "DeltaN", "i_dot": "IDOT", "omega_dot": "OmegaDot", "cuc": "Cuc",
    "cus": "Cus", "crc": "Crc", "crs": "Crs", "cic": "Cic", "cis": "Cis",
}  # fmt: skip
VECTORS = {
    "x_m": "X", "y_m": "Y", "z_m": "Z", "vx_mps": "dX", "vy_mps": "dY", "vz_mps": "dZ",
    "ax_mps2": "dX2", "ay_mps2": "dY2", "az_mps2": "dZ2",
}  # fmt: skip
FIELDS = {  # by message
    "LNAV": ORBIT | {"issue": "IODE", "group_delay_s": "TGD"},
    "INAV": ORBIT | {"issue": "IODnav", "group_delay_s": "BGDe5b", "group_delay_2_s": "BGDe5a"},
    "FNAV": ORBIT | {"issue": "IODnav", "group_delay_s": "BGDe5a"},
    "D1": ORBIT | {"issue": "AODE", "group_delay_s": "TGD1", "group_delay_2_s": "TGD2"},
    "R": VECTORS | {"channel": "FreqNum", "gamma_n": "SVrelFreqBias"},
    "S": VECTORS | {"issue": "IODN", "af0": "SVclockBias", "af1": "SVrelFreqBias"},
}


def first_epochs(source: Path, target: Path, epochs: int) -> Path:
    """A plain copy of a RINEX 3 observation file up to a number of epochs: georinex needs a second for twenty."""
    head, *blocks = gzip.decompress(source.read_bytes()).decode("ascii").split("\n>")
    target.write_text("\n>".join([head, *blocks[:epochs]]) + "\n")
    return target


def datetime_ns(gps_ns: int) -> np.datetime64:
    return np.datetime64(gps_ns + GPS_EPOCH_UNIX_S * NS_PER_S, "ns")


def compare(path: Path, theirs: Any, signals: Mapping[str, tuple[str, ...]]) -> int:
    """Compare every number of either side; returns how many pseudoranges there are."""
    file = read_observations(path, "A")
    times = np.array([datetime_ns(row.receive_time_ns) for row in file.rows])
    assert len(times) == len(theirs.time)
    assert (np.abs(times - theirs.time.values) <= np.timedelta64(1, "ms")).all()  # it has 30.0020000 s as 30.001 s
    ours = {
        (row.receive_time_ns, signal): (row.pseudorange_m[k], row.carrier_cycles[k], row.doppler_hz[k], row.cn0_dbhz[k])
        for row in file.rows
        for k, signal in enumerate(row.signals)
        if signal.partition(".")[2] in signals
    }
    missing = np.full((len(theirs.time), len(theirs.sv)), np.nan)
    keys: list[tuple[int, str]] = []
    numbers: list[Any] = []
    for code, names in signals.items():
        expected = np.stack([theirs[name].transpose("time", "sv").values if name in theirs else missing for name in names], axis=-1)
        expected[expected == 0.0] = np.nan  # 0.0 is "not measured" (RINEX 2.11, 5.3), which georinex leaves as it stands
        places = [(t, s) for t, s in np.argwhere(np.isfinite(expected[..., 0])).tolist() if theirs.sv.values[s][0] in SYSTEMS]
        keys += [(file.rows[t].receive_time_ns, f"{theirs.sv.values[s]}.{code}") for t, s in places]
        numbers += [expected[place] for place in places]
    assert set(keys) == ours.keys()
    np.testing.assert_array_equal([ours[key] for key in keys], numbers)
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
    assert compare(path, georinex.load(path, use="G", meas=[name for names in RINEX2.values() for name in names]), RINEX2) > 1800


@pytest.mark.parametrize(
    "name", ["spp_truth/SEPT078M.21O.gz", "nagoya_static/base.obs.gz", "rosalia_2025/ROSR01TUW_R_20250010600_15M_05S_AA.rnx.gz"]
)
def test_rinex3_observations(shared_data: Path, tmp_path: Path, name: str) -> None:
    path = first_epochs(shared_data / name, tmp_path / "first.rnx", epochs=20)
    theirs = georinex.load(path, use=set(SYSTEMS), meas=[name for names in RINEX3.values() for name in names])
    assert compare(path, theirs, RINEX3) > 1000


def message_of(satellite: str, data_sources: float) -> str:
    """Key of `FIELDS`."""
    if satellite[0] == "E":
        return "INAV" if int(data_sources) & 0b101 else "FNAV"
    return {"G": "LNAV", "J": "LNAV", "C": "D1"}.get(satellite[0], satellite[0])


def written_ns(eph: Ephemeris) -> int:
    """The epoch of a set as the file writes it, by its system's own time."""
    at_ns = eph.toc_ns if isinstance(eph, KeplerEphemeris) else eph.toe_ns
    if eph.satellite[0] == "R":
        return utc_from_gps(at_ns) - GPS_EPOCH_UNIX_S * NS_PER_S
    return at_ns - (BDT_BEHIND_GPS_NS if eph.satellite[0] == "C" else 0)


@pytest.mark.parametrize(
    "name",
    [
        "catalonia_2010/brdc0770.10n.gz",
        "gsi_2005/07590920.05n.gz",
        "nagoya_static/base.nav.gz",
        "rosalia_2025/rref001g00.25p.gz",
        "spp_truth/SEPT078M.21P.gz",
        "tokyo_sbas_2008/oemv_200911218.nav.gz",
    ],
)
def test_navigation(shared_data: Path, name: str) -> None:
    file = read_navigation(shared_data / name)
    ours = set()
    for eph in (*file.ephemerides, *file.fnav_ephemerides):
        of_fnav = isinstance(eph, KeplerEphemeris) and eph.message == "FNAV"
        message = message_of(eph.satellite, 0b010 if of_fnav else 0b101)
        ours.add((eph.satellite, message, datetime_ns(written_ns(eph)), *(getattr(eph, field) for field in FIELDS[message])))
    data = georinex.load(shared_data / name)
    column = {name: data[name].transpose("time", "sv").values for name in data.data_vars}
    theirs = set()
    for t, s in np.argwhere(np.isfinite(column["SVclockBias"])).tolist():
        satellite = str(data.sv.values[s])[:3]  # a second set of the same time is G05_1 there
        message = message_of(satellite, column["DataSrc"][t, s] if "DataSrc" in column and satellite[0] == "E" else 0.0)
        numbers = (float(column[field][t, s]) for field in FIELDS[message].values())
        theirs.add((satellite, message, data.time.values[t].astype("datetime64[ns]"), *numbers))
    assert ours == theirs


@pytest.mark.parametrize("name", ["catalonia_2010/brdc0770.10n.gz", "spp_truth/SEPT078M.21P.gz"])
def test_klobuchar(shared_data: Path, name: str) -> None:
    path = shared_data / name
    ours = read_navigation(path).klobuchar
    assert ours is not None
    np.testing.assert_array_equal([*ours.alpha, *ours.beta], georinex.load(path, use={"G"}).attrs["ionospheric_corr_GPS"])
