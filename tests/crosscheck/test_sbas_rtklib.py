"""SBAS messages against RTKLIB: what both know at the end of an hour, satellite by satellite and grid point by grid point."""

from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import pytest

from integrity.gnss.gps_time import NS_PER_S, WEEK_NS
from integrity.gnss.sbas.grid import GOOD, NEVER, node_of
from integrity.gnss.sbas.store import SATELLITES, SbasStore, State
from recordings.sbas_files import read_sbas

MESSAGE_BYTES = 29
NO_GIVE, NO_DELAY_M = 0, 63.875  # of RTKLIB: not monitored, do not use


class Known(NamedTuple):
    """RTKLIB's corrections, and ours."""

    nav: Any
    state: State


@pytest.fixture(scope="module")
def known(rtklib: ModuleType, shared_data: Path) -> Known:
    nav, theirs = rtklib.nav_t(), rtklib.sbsmsg_t()
    messages = read_sbas(shared_data / "sbas_2025" / "msas137.sbs.gz").messages
    store = SbasStore(137)
    for message in messages:
        week, tow_ns = divmod(message.sent_ns, WEEK_NS)
        theirs.week, theirs.tow, theirs.prn = week, tow_ns // NS_PER_S, message.prn
        for k, byte in enumerate((message.bits << 6).to_bytes(MESSAGE_BYTES, "big")):
            theirs.msg[k] = byte
        rtklib.sbsupdatecorr(theirs, nav)
        store.add(message)
    return Known(nav, store.at(messages[-1].received_ns, range(len(SATELLITES))))


def satellites(known: Known) -> list[tuple[Any, Any]]:
    """Theirs and ours, of each satellite in the mask. Their number of a GPS satellite is its PRN."""
    table = known.nav.sbssat
    of_gps = [table.sat[k] for k in range(table.nsat) if 1 <= table.sat[k].sat <= 32]
    return [(one, known.state.rows[SATELLITES.index(f"G{one.sat:02d}")]) for one in of_gps]


def test_the_mask_is_the_same(known: Known) -> None:
    ours = {s for s, row in zip(SATELLITES, known.state.rows, strict=True) if row["mask_ns"] != NEVER and s[0] == "G"}
    assert ours == {f"G{theirs.sat:02d}" for theirs, _ in satellites(known)}


def test_fast_corrections_are_the_same(known: Known) -> None:
    """RTKLIB counts UDRE indicators from one."""
    different = [
        theirs.sat
        for theirs, ours in satellites(known)
        if (theirs.fcorr.prc, theirs.fcorr.udre - 1, theirs.fcorr.ai) != (ours["prc_m"], ours["udrei"], ours["factor"])
    ]
    assert different == []


def test_long_term_corrections_are_the_same(known: Known) -> None:
    different = [
        theirs.sat
        for theirs, ours in satellites(known)
        if ours["lt_ns"][0] != NEVER
        and (theirs.lcorr.iode, theirs.lcorr.daf0, [theirs.lcorr.dpos[k] for k in range(3)])
        != (ours["iod"][0], ours["daf0"][0], ours["d_pos"][0].tolist())
    ]
    assert different == []


def test_long_term_corrections_are_there_for_the_same_satellites(known: Known) -> None:
    assert [theirs.sat for theirs, ours in satellites(known) if (theirs.lcorr.t0.time != 0) != (ours["lt_ns"][0] != NEVER)] == []


def test_the_grid_is_the_same(known: Known) -> None:
    different, monitored = [], 0
    for band in range(11):
        theirs = known.nav.sbsion[band]
        for igp in (theirs.igp[k] for k in range(theirs.nigp)):
            node = int(node_of(np.array(igp.lat), np.array(igp.lon)))
            grid = known.state.grid
            good = igp.t0.time != 0 and igp.give != NO_GIVE and igp.delay != NO_DELAY_M
            monitored += good
            same = grid.delay_m[node] == pytest.approx(igp.delay) if good else True
            if good != (grid.status[node] == GOOD) or not same or grid.mask_ns[node] == NEVER:
                different.append((band, igp.lat, igp.lon))
    assert (different, monitored > 50) == ([], True)
