"""What RTKLIB reads in a navigation file and where it then has the satellites; a program of its own, because its two builds exclude each
other in one process: `python rtklib_orbits.py MODULE FILE RESULT SHARES FIT_HALF_S`.

FILE is plain RINEX, SHARES are parts of half the fit interval at which each set is evaluated, FIT_HALF_S has that half by system. RESULT
becomes arrays over sets: name, toe_ns, issue, kind ("", or "INAV" or "FNAV" of Galileo), states (sets, shares, 4): ECEF in m, clock in s.
"""

import importlib
import json
import sys
from typing import Any

import numpy as np

GPS_EPOCH_UNIX_S = 315_964_800
NS_PER_S = 1_000_000_000
KINDS = {0b101: "INAV", 0b010: "FNAV"}  # data sources of Galileo: RINEX 3.04, table A8


def main(module: str, file: str, result: str, shares: list[float], fit_half_s: dict[str, float]) -> None:
    rtklib: Any = importlib.import_module(module)
    obs, nav, station = rtklib.obs_t(), rtklib.nav_t(), rtklib.sta_t()
    if rtklib.readrnx(file, 1, "", obs, nav, station) != 1:
        sys.exit(f"{module} does not read {file}")
    letters = {
        rtklib.SYS_GPS: "G",
        rtklib.SYS_GAL: "E",
        rtklib.SYS_CMP: "C",
        rtklib.SYS_QZS: "J",
        rtklib.SYS_GLO: "R",
        rtklib.SYS_SBS: "S",
    }
    first = {"J": 192, "S": 100}
    prn, position, clock, variance = rtklib.Arr1Dint(1), rtklib.Arr1Ddouble(3), rtklib.Arr1Ddouble(1), rtklib.Arr1Ddouble(1)

    def name(sat: int) -> str:
        letter = letters.get(rtklib.satsys(sat, prn), "?")
        return f"{letter}{prn[0] - first.get(letter, 0):02d}"

    def states(evaluate: Any, eph: Any, reference: Any) -> list[list[float]]:
        rows = []
        for share in shares:
            evaluate(rtklib.timeadd(reference, share * fit_half_s.get(name(eph.sat)[0], 0.0)), eph, position, clock, variance)
            rows.append([position[0], position[1], position[2], clock[0]])
        return rows

    def kind(eph: Any) -> str:
        return next((kind for bits, kind in KINDS.items() if eph.code & bits), "") if name(eph.sat)[0] == "E" else ""

    sets = [(eph, eph.toe, eph.iode, kind(eph), rtklib.eph2pos) for eph in (nav.eph[i] for i in range(nav.n))]
    sets += [(eph, eph.toe, eph.iode, "", rtklib.geph2pos) for eph in (nav.geph[i] for i in range(nav.ng))]
    sets += [(eph, eph.t0, -1, "", rtklib.seph2pos) for eph in (nav.seph[i] for i in range(nav.ns))]
    np.savez(
        result,
        name=np.array([name(eph.sat) for eph, *_ in sets]),
        toe_ns=np.array([(t.time - GPS_EPOCH_UNIX_S) * NS_PER_S + round(t.sec * NS_PER_S) for _, t, *_ in sets], dtype=np.int64),
        issue=np.array([issue for _, _, issue, *_ in sets], dtype=np.int64),
        kind=np.array([kind for *_, kind, _ in sets]),
        states=np.array([states(evaluate, eph, t) for eph, t, _, _, evaluate in sets]).reshape(len(sets), len(shares), 4),
    )


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], sys.argv[3], json.loads(sys.argv[4]), json.loads(sys.argv[5]))
