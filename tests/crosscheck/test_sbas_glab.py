"""SBAS protection levels against gLAB 6, which printed every sigma of every satellite.

`sbas_2025`: everything is the same, from the first message on. `tokyo_sbas_2008`: so are the satellites that SBAS accepts and their sigmas;
which of them are in its solution gLAB decides by its own residuals (real ranges, a position off by 20 m), so levels are compared for those.
It used PRN 137 of the two that are in the air; of both together, ours too takes 137, whose type 9 comes first, and holds it.
"""

import gzip
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from integrity.gnss.gps_time import DAY_S, NS_PER_S
from integrity.gnss.sbas.corrections import Corrections, Reason
from integrity.gnss.sbas.protection import protection
from integrity.gnss.sbas.store import PA
from recordings.sbas_levels import levels, request_of

NO_SBAS = "100"  # "SBAS corrections unavailable"
ROUNDED_M = 0.00052  # a sum of four printed sigmas
KAMAKURA, TOKYO = "-3962108.6836,3381309.5672,3668678.6720", "-3869289.6106,3436520.3368,3717323.1536"


class Printed(NamedTuple):
    """gLAB's numbers by time of day, s: HPL, VPL and the satellites of a solution; sigmas of each satellite that SBAS accepts:
    elevation and azimuth, deg; total, flt, UIRE, tropo, air, m; and a reason code for those it does not."""

    levels: dict[int, tuple[float, float, frozenset[str]]]
    sigmas: dict[tuple[int, str], tuple[float, ...]]
    refused: dict[tuple[int, str], int]


class Ours(NamedTuple):
    """One epoch of ours."""

    second: int
    corrections: Corrections
    epoch: int

    def used(self) -> frozenset[str]:
        return frozenset(s for s, used in zip(self.corrections.satellites, self.corrections.used[self.epoch], strict=True) if used)

    def sigmas(self, satellite: str) -> tuple[float, ...]:
        c, at = self.corrections, (self.epoch, self.corrections.satellites.index(satellite))
        variances = (c.flt_variance_m2, c.uire_variance_m2, c.tropo_variance_m2, c.air_variance_m2)
        roots = (float(np.sqrt(variance[at])) for variance in variances)
        return float(np.degrees(c.el_rad[at])), float(np.degrees(c.az_rad[at])), float(c.sigma_m[at]), *roots

    def levels(self, satellites: frozenset[str]) -> tuple[float, float]:
        c = self.corrections
        wanted = np.array([s in satellites for s in c.satellites])
        p = protection(replace(c, why=np.where(c.used & wanted, Reason.USED, Reason.NOT_MONITORED)), PA)
        return float(p.hpl_m[self.epoch]), float(p.vpl_m[self.epoch])


class Compared(NamedTuple):
    printed: Printed
    ours: dict[int, Ours]


def printed(path: Path) -> Printed:
    read = Printed({}, {}, {})
    with gzip.open(path, "rt") as lines:
        for f in (line.split() for line in lines):
            second = round(float(f[3]))
            match f[0].rstrip("*"):
                case "SBASOUT":
                    used = frozenset(name[1:] for name in f[20:] if name.startswith("+G"))
                    read.levels[second] = float(f[15]), float(f[18]), used
                case "SBASVAR":
                    read.sigmas[second, f"G{int(f[6]):02d}"] = tuple(float(f[k]) for k in (11, 12, 15, 16, 25, 26, 27))
                case "SBASUNSEL":
                    read.refused[second, f"G{int(f[6]):02d}"] = int(f[9])
                case "SATSEL" if f[7] == NO_SBAS:
                    read.refused[second, f"G{int(f[6]):02d}"] = int(NO_SBAS)
    return read


def ours(nav: Path, messages: Path, position: str, end: str | None = None) -> dict[int, Ours]:
    request = request_of([nav], messages, position, None, end, 1.0, "pa", 5.0)
    found = {}
    for corrected, _ in levels(request):
        for epoch, t_ns in enumerate(corrected.t_ns.tolist()):
            second = t_ns // NS_PER_S % DAY_S
            found[second] = Ours(second, corrected, epoch)
    return found


@pytest.fixture(scope="module")
def kamakura(shared_data: Path) -> Compared:
    folder = shared_data / "sbas_2025"
    nav, messages = folder / "gps_046r_v303.nav.gz", folder / "msas137_046r.ems.gz"
    return Compared(printed(folder / "glab_kama_PA.out.gz"), ours(nav, messages, KAMAKURA))


@pytest.fixture(scope="module")
def tokyo(shared_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Compared:
    """Of the messages of both satellites."""
    folder = shared_data / "tokyo_sbas_2008"
    messages = tmp_path_factory.mktemp("ems") / "a.ems"
    messages.write_bytes(b"".join(gzip.decompress((folder / f"msas{prn}_20080526.ems.gz").read_bytes()) for prn in (129, 137)))
    return Compared(
        printed(folder / "glab_cres_PA.out.gz"), ours(folder / "merged_20080526.nav.gz", messages, TOKYO, "2008-05-26T06:06:45")
    )


@pytest.fixture(params=["kamakura", "tokyo"])
def place(request: pytest.FixtureRequest) -> Compared:
    both: Compared = request.getfixturevalue(request.param)
    return both


def pairs(both: Compared) -> Iterator[tuple[tuple[float, ...], tuple[float, ...]]]:
    """Numbers of theirs and ours, of satellites that they accept."""
    for (second, satellite), theirs in both.printed.sigmas.items():
        yield theirs, both.ours[second].sigmas(satellite)


def test_every_level_is_the_same(kamakura: Compared) -> None:
    theirs = np.array([level[:2] for level in kamakura.printed.levels.values()])
    mine = np.array([kamakura.ours[t].levels(kamakura.ours[t].used()) for t in kamakura.printed.levels])
    assert np.abs(mine - theirs).max() <= 0.001


def test_every_epoch_uses_the_same_satellites(kamakura: Compared) -> None:
    assert [t for t, level in kamakura.printed.levels.items() if kamakura.ours[t].used() != level[2]] == []


def test_there_is_a_level_in_no_other_epoch(kamakura: Compared) -> None:
    mine = {t for t, one in kamakura.ours.items() if np.isfinite(one.levels(one.used())[0])}
    assert mine == set(kamakura.printed.levels)


def test_every_refusal_has_the_same_reason(kamakura: Compared) -> None:
    """By gLAB's code: 14, 16, 17, 20, 27, 32, and 37 or 40. 3 is that it does not know yet which GEO stands highest."""
    same = {
        14: Reason.NOT_MONITORED,
        16: Reason.UDREI_TOO_HIGH,
        17: Reason.NO_FACTOR,
        20: Reason.ONE_FAST,
        27: Reason.NO_DELTA_UDRE,
        32: Reason.NO_LONG_TERM,
        37: Reason.NO_IONO_MASK,
        40: Reason.NO_IONO_MASK,
    }
    different = set()
    for (t, satellite), code in kamakura.printed.refused.items():
        one = kamakura.ours.get(t)
        if code in same and one is not None:
            why = Reason(int(one.corrections.why[one.epoch, one.corrections.satellites.index(satellite)]))
            if why not in (same[code], Reason.BELOW_MASK):
                different.add((code, why))
    assert different == set()


def test_every_sigma_is_the_same(place: Compared) -> None:
    theirs, mine = (np.array(side)[:, 2:] for side in zip(*pairs(place), strict=True))
    assert np.abs(mine - theirs).max() <= ROUNDED_M


def test_every_direction_is_the_same(place: Compared) -> None:
    theirs, mine = (np.array(side)[:, :2] for side in zip(*pairs(place), strict=True))
    assert np.abs(mine - theirs).max() <= 0.00051


def test_in_tokyo_sbas_accepts_what_it_accepts(tokyo: Compared) -> None:
    assert [(t, s) for t, s in tokyo.printed.sigmas if s not in tokyo.ours[t].used()] == []


def test_in_tokyo_sbas_accepts_nothing_that_it_refuses(tokyo: Compared) -> None:
    assert [(t, s) for t, s in tokyo.printed.refused if t in tokyo.ours and s in tokyo.ours[t].used()] == []


def test_in_tokyo_levels_of_the_satellites_in_its_solution_are_the_same(tokyo: Compared) -> None:
    theirs = np.array([level[:2] for level in tokyo.printed.levels.values()])
    mine = np.array([tokyo.ours[t].levels(level[2]) for t, level in tokyo.printed.levels.items()])
    assert np.abs(mine - theirs).max() <= 0.005
