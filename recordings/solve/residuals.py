"""A CSV file of every range of a recording: where its satellite stood, what was left of it, and what it did to the position."""

import csv
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType

import numpy as np

from recordings.solve.results import Place, Ranges, Track, Why, written_time

COLUMNS = (
    "gps_time",
    "satellite",
    "signal",
    "el_deg",
    "az_deg",
    "residual_m",
    "sigma_m",
    "normalised",
    "place",
    "without_e_m",
    "without_n_m",
    "without_u_m",
    "epoch",
)
PLACES = {
    Place.USED: "used",
    Place.EXCLUDED: "excluded",
    Place.BELOW_MASK: "below the mask",
    Place.UNUSABLE: "no usable ephemeris",
}


class ResidualFile:
    """Written block by block beside the name that it gets in the end: a run that fails leaves the old file."""

    def __init__(self, path: Path) -> None:
        if path.is_dir():
            raise IsADirectoryError(21, "Is a directory", str(path))
        self._path = path
        self._part = path.with_name(f"{path.name}.part")
        self._file = self._part.open("w", newline="", encoding="ascii")
        self._writer = csv.writer(self._file)
        self._writer.writerow(COLUMNS)
        self._times_ns: set[int] = set()

    def __enter__(self) -> "ResidualFile":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._file.close()
        if kind is None:
            self._part.replace(self._path)
        else:
            self._part.unlink(missing_ok=True)

    def written(self, track: Track) -> Track:
        """The ranges of a block written, each time once; the track without them."""
        if track.ranges is not None:
            why = dict(zip(track.time_ns.tolist(), track.why.tolist(), strict=True))
            self._writer.writerows(_rows(track.ranges, why, self._times_ns))
        return track._replace(ranges=None)


def _rows(of: Ranges, why: dict[int, int], times_ns: set[int]) -> Iterator[tuple[object, ...]]:
    el_deg, az_deg = np.degrees(of.el_rad), np.degrees(of.az_rad) % 360.0
    for e, t_ns in enumerate(of.time_ns.tolist()):
        if t_ns in times_ns:
            continue
        times_ns.add(t_ns)
        time, epoch = written_time(t_ns), Why(why[t_ns]).name.lower().replace("_", " ")
        here = np.flatnonzero(of.place[e] >= 0).tolist()
        numbers = zip(
            *(_written(values[e, here], form) for values, form in ((el_deg, "%.2f"), (az_deg, "%.2f"))),
            *(_written(values[e, here], form) for values, form in ((of.residual_m, "%.4f"), (of.sigma_m, "%.3f"), (of.normalised, "%.3f"))),
            [PLACES[Place(place)] for place in of.place[e, here].tolist()],
            *(_written(of.moved_enu_m[i, e, here], "%.4f") for i in range(3)),
            strict=True,
        )
        for s, row in zip(here, numbers, strict=True):
            satellite, _, signal = of.signals[s].partition(".")
            yield time, satellite, signal, *row, epoch


def _written(values: "np.typing.NDArray[np.float64]", form: str) -> list[str]:
    """Blank where there is no number."""
    return [form % value if value == value else "" for value in values.tolist()]
