"""A day at 1 Hz of one receiver as RINEX 3.04, for benchmarks: `python -m tests.benchmarks.synthetic_rinex OBS NAV`.

Synthetic: satellites, ranges and errors come from the project's simulator (`recordings.simulate`), none of it was ever measured.
GPS and Galileo, one signal each with code, carrier, Doppler and C/N0; some satellites are left out, so that there are 17 on average.
The receiver's clock and the noise begin anew every hour; orbits, ionosphere and the ephemerides go on.
"""

import argparse
import json
from pathlib import Path

import numpy as np

from integrity.events import EphemerisReceived, ObservationsReceived
from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.gps_time import gps_from_week
from integrity.gnss.observations import ROW_ARRAYS, ObservationRow
from integrity.gnss.signals import satellite_of
from recordings.simulate.constellation import IONOSPHERE
from recordings.simulate.observations import Antenna, fixed, observed
from tests.rinex_text import epoch_lines, navigation_text, observation_text

POSITION_ECEF_M = (4_061_800.0, 614_290.0, 4_862_940.0)  # 50 N 8.6 E, 200 m above the ellipsoid
START_NS = gps_from_week(2408, 86_400.0)  # Monday, 2 March 2026
SEED = 5
HOUR_S = 3600.0
OUT_OF_SERVICE = frozenset(("G11", "G27", "E09", "E21"))


def in_service(row: ObservationRow) -> ObservationRow:
    kept = np.array([satellite_of(signal) not in OUT_OF_SERVICE for signal in row.signals])
    signals = tuple(signal for signal, keep in zip(row.signals, kept, strict=True) if keep)
    return ObservationRow(row.receiver, row.receive_time_ns, signals, **{name: getattr(row, name)[kept] for name in ROW_ARRAYS})


def write_day(observations: Path, navigation: Path, hours: int = 24) -> dict[str, float]:
    """Write both files; what is in the first, in numbers."""
    ephemerides: dict[Ephemeris, None] = {}
    epochs = records = 0
    with observations.open("w", encoding="ascii") as file:
        for hour in range(hours):
            start_ns = START_NS + hour * 3600 * 1_000_000_000
            events = observed([Antenna("SYNT", fixed(POSITION_ECEF_M))], start_ns, HOUR_S, 1.0, SEED)
            ephemerides.update(dict.fromkeys(event.ephemeris for event in events if isinstance(event, EphemerisReceived)))
            rows = [in_service(event.row) for event in events if isinstance(event, ObservationsReceived)]
            if not hour:
                file.write(observation_text(rows[:0], POSITION_ECEF_M).replace("1980     1     6", "2026     3     2"))
            file.writelines("\n".join(epoch_lines(row)) + "\n" for row in rows)
            epochs, records = epochs + len(rows), records + sum(len(row.signals) for row in rows)
    navigation.write_text(navigation_text(ephemerides, IONOSPHERE), "ascii")
    return {"megabytes": round(observations.stat().st_size / 1e6, 1), "epochs": epochs, "satellites": round(records / epochs, 2)}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="synthetic_rinex", description="Write a synthetic day of RINEX observations and navigation.")
    parser.add_argument("observations", metavar="OBS", type=Path)
    parser.add_argument("navigation", metavar="NAV", type=Path)
    parser.add_argument("--hours", type=int, default=24)
    arguments = parser.parse_args()
    print(json.dumps(write_day(arguments.observations, arguments.navigation, arguments.hours)))
