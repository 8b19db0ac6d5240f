"""Faults of reception: signals drowned by jamming, a receiver that freezes, a receiver that falls silent."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from integrity.config import SiteConfig
from integrity.events import Event, Tick
from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import ROW_ARRAYS, Floats, ObservationRow
from recordings.faults.kinds import Jamming
from recordings.faults.ranges import Rows
from recordings.faults.scenario import Fault
from recordings.faults.truth import RecordedRow, Truth, elevations_rad, runs

NOMINAL_CN0_DBHZ = 45.0  # own choice, overhead, where a receiver does not say
NOMINAL_CN0_LOSS_DB = 10.0  # own choice: so much less at the horizon
LOST_BELOW_DBHZ = 28.0  # tracking threshold of a common receiver
MOST_JAMMED_WAVELENGTH_M = SPEED_OF_LIGHT_MPS / 1_559.0e6  # the band around L1, E1, B1, G1: L2, L5 and theirs are as they were
CODE_NOISE_M = 0.3  # at 45 dB-Hz, see code_noise_m


def code_noise_m(cn0_dbhz: Floats) -> Floats:
    """Standard deviation of the code noise: 0.3 m at 45 dB-Hz, growing as the thermal noise of a delay lock loop, tenfold in 20 dB."""
    sigma_m: Floats = CODE_NOISE_M * 10.0 ** ((45.0 - cn0_dbhz) / 20.0)
    return sigma_m


def jammed(
    fault: Fault, effect: Jamming, truth: Truth, hit: Sequence[RecordedRow], rows: Rows, seed: tuple[int, int]
) -> Iterator[tuple[int, ObservationRow]]:
    """The rows that jamming around L1 changes, by place: weaker, noisier by what the drop adds, without the signals that are lost.

    The noise of a row depends on the seed, the receiver and the time only. An unknown C/N0 stays unknown; its physics go by a nominal one.
    """
    names = truth.site.receiver_names
    for run in runs(hit):
        for seen, el_rad in zip(run, elevations_rad(truth, run), strict=True):
            elapsed_s = (seen.epoch_ns - fault.start_ns) / NS_PER_S
            drop_db = effect.drop_db if elapsed_s >= effect.ramp_s else effect.drop_db * elapsed_s / effect.ramp_s
            row = rows[seen.place]
            if drop_db > 0.0 and row.signals:
                el_of = dict(zip(seen.row.signals, el_rad, strict=True))
                chance = np.random.Generator(np.random.PCG64([*seed, names.index(row.receiver), row.receive_time_ns]))
                drops_db = np.where(truth.wavelengths_m(row.signals) <= MOST_JAMMED_WAVELENGTH_M, drop_db, 0.0)
                yield seen.place, _weakened(row, np.array([el_of[signal] for signal in row.signals]), drops_db, chance)


def _weakened(row: ObservationRow, el_rad: Floats, drop_db: Floats, chance: np.random.Generator) -> ObservationRow:
    nominal_dbhz = NOMINAL_CN0_DBHZ - NOMINAL_CN0_LOSS_DB * (1.0 - np.sin(np.where(np.isfinite(el_rad), el_rad, np.pi / 2.0)))
    before_dbhz = np.where(np.isfinite(row.cn0_dbhz), row.cn0_dbhz, nominal_dbhz)
    after_dbhz = before_dbhz - drop_db
    added_m = np.sqrt(code_noise_m(after_dbhz) ** 2 - code_noise_m(before_dbhz) ** 2)  # what was measured has its own noise already
    noisy = replace(
        row,
        pseudorange_m=row.pseudorange_m + added_m * chance.standard_normal(len(row.signals)),
        cn0_dbhz=row.cn0_dbhz - drop_db,
    )
    kept = (after_dbhz >= LOST_BELOW_DBHZ) | (drop_db == 0.0)
    return replace(
        noisy,
        signals=tuple(signal for signal, keep in zip(row.signals, kept, strict=True) if keep),
        **{name: getattr(noisy, name)[kept] for name in ROW_ARRAYS},
    )


def last_before(truth: Truth, hit: Sequence[RecordedRow]) -> int | None:
    """Place of the last row of a receiver before the rows that are hit; None where there is none."""
    receiver, start = hit[0].row.receiver, hit[0].place
    return max((seen.place for seen in truth.rows if seen.row.receiver == receiver and seen.place < start), default=None)


def frozen(hit: Sequence[RecordedRow], last: ObservationRow) -> Iterator[tuple[int, ObservationRow]]:
    """The rows of a receiver that repeats one, with times that go on, by place."""
    for seen in hit:
        yield seen.place, replace(last, receive_time_ns=seen.row.receive_time_ns)


def with_deadline_ticks(events: Sequence[Event], heard: Mapping[int, str], receivers: Sequence[str], site: SiteConfig) -> list[Event]:
    """The ticks that a station's shell sends when a receiver's silence passes its deadline, where the events have none at that time.

    `heard`: with which events, by their place, measurements of which receiver are complete. Ticks after each epoch alone would show
    the silence of a receiver up to an epoch late.
    """
    limit_ns = max(2 * site.epoch_interval_ns, 2 * NS_PER_S)
    out: list[Event] = []
    heard_ns = dict.fromkeys(receivers, events[0].mono_ns)
    clock: Tick | None = None
    for place, event in enumerate(events):
        for deadline_ns in sorted({since_ns + limit_ns + 1 for since_ns in heard_ns.values()}):
            noticed = isinstance(event, Tick) and event.mono_ns == deadline_ns
            if event.mono_ns >= deadline_ns and clock is not None and clock.mono_ns < deadline_ns and not noticed:
                clock = replace(clock, mono_ns=deadline_ns, utc_ns=clock.utc_ns + deadline_ns - clock.mono_ns)
                out.append(clock)
        if isinstance(event, Tick):
            clock = event
        if heard.get(place) in heard_ns:
            heard_ns[heard[place]] = event.mono_ns
        out.append(event)
    return out
