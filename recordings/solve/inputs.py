"""The observation files of one receiver as blocks, whatever of RINEX and u-blox logs they are.

A file that cannot be read, or only in part, is counted as long as another one gives epochs.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import NamedTuple

from integrity.errors import DecodeError
from integrity.events import EphemerisReceived, IonosphereReceived, ObservationsReceived, RawBytes
from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.observations import ObservationBlock, ObservationRow, build_block, layout_of
from integrity.reception import Reception
from recordings.rinex.observation import read_blocks
from recordings.ubx_files import is_ubx, read_ubx

RECEIVER = "A"  # blocks name their receiver; there is one
EPOCHS_PER_BLOCK = 1024  # of logs, as of RINEX


class Heard(NamedTuple):
    """What the logs hold."""

    rows: tuple[ObservationRow, ...] = ()
    ephemerides: tuple[Ephemeris, ...] = ()
    klobuchar: Klobuchar | None = None


class ObservationFiles:
    """Counts as it reads: `dropped` is complete, and so are the `warnings` for people, once all blocks were taken."""

    def __init__(self) -> None:
        self.dropped: Counter[str] = Counter()
        self.warnings: list[str] = []
        self._unread: list[DecodeError] = []

    def by_kind(self, paths: Sequence[Path]) -> tuple[list[Path], list[Path]]:
        """RINEX files, and u-blox logs."""
        rinex: list[Path] = []
        logs: list[Path] = []
        for path in paths:
            try:
                (logs if is_ubx(path) else rinex).append(path)
            except DecodeError as error:
                self._give_up(error)
        return rinex, logs

    def blocks(self, rinex: Sequence[Path], rows: Sequence[ObservationRow]) -> Iterator[ObservationBlock]:
        """Rows of logs, then RINEX a few megabytes at a time. DecodeError where no file has an epoch; OSError as `open` does."""
        epochs = len(rows)
        markers: dict[str, None] = {}
        for first in range(0, len(rows), EPOCHS_PER_BLOCK):
            few = rows[first : first + EPOCHS_PER_BLOCK]
            times_ns = [row.receive_time_ns for row in few]
            yield build_block((RECEIVER,), times_ns, [[row] for row in few], layout_of(few, codes=None))
        for path in rinex:
            problems: Counter[str] = Counter()
            before = epochs
            try:
                header, blocks, problems = read_blocks(path, RECEIVER)
                if header.marker:
                    markers[header.marker] = None
                for block in blocks:
                    epochs += len(block.epoch_ns)
                    yield block
                self.dropped["file without epochs"] += epochs == before
            except DecodeError as error:
                self._give_up(error)
            self.dropped.update(problems)
        if len(markers) > 1:
            self.warnings.append(f"the files name {len(markers)} markers ({', '.join(map(repr, markers))}): give the files of one receiver")
        if not epochs:
            raise self._unread[0] if self._unread else _no_epochs(rinex)

    def heard(self, logs: Sequence[Path]) -> Heard:
        """Measurements, ephemerides and ionosphere of logs, through the same functions as a station hears them."""
        if not logs:
            return Heard()
        try:
            log = read_ubx(logs, RECEIVER)
        except DecodeError as error:
            self._give_up(error)
            return Heard()
        self.dropped.update(log.dropped)
        self.dropped.update(log.passed_over)
        self.warnings += log.warnings
        reception = Reception((RECEIVER,))
        last_ns = log.pieces[-1].receive_time_ns
        pieces = chain(((piece.receive_time_ns, piece.data) for piece in log.pieces), [(last_ns, log.tail)])
        events = [event for t_ns, data in pieces for event in reception.take(RawBytes(t_ns, RECEIVER, data))]
        return Heard(
            tuple(event.row for event in events if isinstance(event, ObservationsReceived)),
            tuple(event.ephemeris for event in events if isinstance(event, EphemerisReceived)),
            first_plausible(event.klobuchar for event in events if isinstance(event, IonosphereReceived)),
        )

    def _give_up(self, error: DecodeError) -> None:
        self._unread.append(error)
        self.dropped["file not readable, or not to its end"] += 1
        self.warnings.append(str(error))


def first_plausible(told: Iterable[Klobuchar | None]) -> Klobuchar | None:
    """The first that a satellite can have sent."""
    return next((terms for terms in told if terms is not None and terms.plausible()), None)


def _no_epochs(paths: Sequence[Path]) -> DecodeError:
    return DecodeError(f"{', '.join(map(str, paths))}: no epoch of measurements; give an observation file that was recorded to its end")
