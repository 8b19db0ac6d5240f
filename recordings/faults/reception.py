"""Faults of reception: signals drowned by jamming or sent too weakly, a receiver that is noisy, freezes, or falls silent."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from integrity.config import SiteConfig
from integrity.events import Event, Tick
from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Floats, ObservationRow
from integrity.gnss.signals import satellite_of
from recordings.faults.changes import Change, Rows, moved, only
from recordings.faults.kinds import Jamming, LowPower, ReceiverNoise
from recordings.faults.scenario import Fault
from recordings.faults.truth import RecordedRow, Truth, elevations_rad, runs

NOMINAL_CN0_DBHZ = 45.0  # own choice, overhead, where a receiver does not say
NOMINAL_CN0_LOSS_DB = 10.0  # own choice: so much less at the horizon
LOST_BELOW_DBHZ = 28.0  # tracking threshold of a common receiver
MOST_JAMMED_WAVELENGTH_M = SPEED_OF_LIGHT_MPS / 1_559.0e6  # the band around L1, E1, B1, G1: L2, L5 and theirs are as they were
CODE_NOISE_M = 0.3  # at 45 dB-Hz, as those below, see `thermal`
CARRIER_NOISE_M, RATE_NOISE_MPS = 0.002, 0.02  # own choice: of a common receiver


def code_noise_m(cn0_dbhz: Floats) -> Floats:
    """Standard deviation of the code noise: 0.3 m at 45 dB-Hz, growing as the thermal noise of a delay lock loop, tenfold in 20 dB."""
    return CODE_NOISE_M * thermal(cn0_dbhz)


def thermal(cn0_dbhz: Floats) -> Floats:
    """Thermal noise in units of that at 45 dB-Hz."""
    ratio: Floats = 10.0 ** ((45.0 - cn0_dbhz) / 20.0)
    return ratio


def jammed(
    fault: Fault, effect: Jamming, truth: Truth, hit: Sequence[RecordedRow], rows: Rows, seed: tuple[int, int]
) -> Iterator[tuple[int, ObservationRow]]:
    """The rows that jamming around L1 changes, by place: weaker, noisier by what the drop adds, without the signals that are lost.

    The noise of a row depends on the seed, the receiver, the time and the names of its signals only. An unknown C/N0 stays unknown; its
    physics go by a nominal one.
    """
    for seen, before_dbhz, chance in _with_strength(truth, hit, rows, seed):
        row = rows[seen.place]
        drop_db = _dropped_db(effect, fault.elapsed_s(seen.epoch_ns))
        if drop_db > 0.0 and row.signals:
            around_l1 = truth.wavelengths_m(row.signals) <= MOST_JAMMED_WAVELENGTH_M
            yield seen.place, _weakened(row, before_dbhz, np.where(around_l1, drop_db, 0.0), chance)


def weakened(
    fault: Fault, effect: LowPower, truth: Truth, hit: Sequence[RecordedRow], rows: Rows, seed: tuple[int, int]
) -> Iterator[tuple[int, ObservationRow]]:
    """The rows in which a satellite is weaker, by place; noise and loss as in `jammed`, on all its signals."""
    for seen, before_dbhz, chance in _with_strength(truth, hit, rows, seed):
        row = rows[seen.place]
        struck = np.array([satellite_of(signal) == effect.satellite for signal in row.signals], dtype=np.bool_)
        drop_db = _dropped_db(effect, fault.elapsed_s(seen.epoch_ns))
        if drop_db > 0.0 and struck.any():
            yield seen.place, _weakened(row, before_dbhz, np.where(struck, drop_db, 0.0), chance)


def noisier(
    effect: ReceiverNoise, truth: Truth, hit: Sequence[RecordedRow], rows: Rows, seed: tuple[int, int]
) -> Iterator[tuple[int, ObservationRow]]:
    """The rows of a receiver whose noise has grown, by place: what was measured has the noise of a common receiver already."""
    more = np.sqrt(effect.factor**2 - 1.0)
    for seen, before_dbhz, chance in _with_strength(truth, hit, rows, seed):
        row = rows[seen.place]
        code_m, carrier_m, rate_mps = (
            more * sigma * thermal(before_dbhz) * _drawn(chance, row) for sigma in (CODE_NOISE_M, CARRIER_NOISE_M, RATE_NOISE_MPS)
        )
        if row.signals:
            yield seen.place, moved(row, row.signals, Change(code_m, carrier_m, rate_mps), truth.wavelengths_m(row.signals))


def _dropped_db(effect: Jamming | LowPower, elapsed_s: float) -> float:
    """So long after the start."""
    return effect.drop_db if elapsed_s >= effect.ramp_s else effect.drop_db * elapsed_s / effect.ramp_s


def _with_strength(
    truth: Truth, hit: Sequence[RecordedRow], rows: Rows, seed: tuple[int, int]
) -> Iterator[tuple[RecordedRow, Floats, np.random.Generator]]:
    """Each row with the C/N0 of its signals as they are now (nominal where not known), and a generator of its own."""
    names = truth.site.receiver_names
    for run in runs(hit):
        for seen, el_rad in zip(run, elevations_rad(truth, run), strict=True):
            row = rows[seen.place]
            el_of = dict(zip(seen.row.signals, el_rad.tolist(), strict=True))
            mine_rad = np.array([el_of[signal] for signal in row.signals], dtype=np.float64)
            sin_el = np.sin(np.where(np.isfinite(mine_rad), mine_rad, np.pi / 2.0))
            nominal_dbhz = NOMINAL_CN0_DBHZ - NOMINAL_CN0_LOSS_DB * (1.0 - sin_el)
            before_dbhz = np.where(np.isfinite(row.cn0_dbhz), row.cn0_dbhz, nominal_dbhz)
            yield seen, before_dbhz, np.random.Generator(np.random.PCG64([*seed, names.index(row.receiver), row.receive_time_ns]))


def _weakened(row: ObservationRow, before_dbhz: Floats, drop_db: Floats, chance: np.random.Generator) -> ObservationRow:
    after_dbhz = before_dbhz - drop_db
    added_m = np.sqrt(code_noise_m(after_dbhz) ** 2 - code_noise_m(before_dbhz) ** 2)  # what was measured has its own noise already
    noisy = replace(
        row,
        pseudorange_m=row.pseudorange_m + added_m * _drawn(chance, row),
        cn0_dbhz=row.cn0_dbhz - drop_db,
    )
    return only(noisy, (after_dbhz >= LOST_BELOW_DBHZ) | (drop_db == 0.0))


def _drawn(chance: np.random.Generator, row: ObservationRow) -> Floats:
    """White noise (n,), the same for a signal wherever it stands in the row: bytes and messages have orders of their own."""
    noise = np.empty(len(row.signals))
    noise[sorted(range(len(row.signals)), key=row.signals.__getitem__)] = chance.standard_normal(len(row.signals))
    return noise


def last_before(truth: Truth, hit: Sequence[RecordedRow]) -> int | None:
    """Place of the last row of a receiver before the rows that are hit; None where there is none."""
    receiver, start = hit[0].row.receiver, hit[0].place
    return max((seen.place for seen in truth.rows if seen.row.receiver == receiver and seen.place < start), default=None)


def frozen(hit: Sequence[RecordedRow], last: ObservationRow, rows: Rows) -> Iterator[tuple[int, ObservationRow]]:
    """The rows of a receiver that repeats one, with times that go on, by place."""
    for seen in hit:
        yield seen.place, replace(last, receive_time_ns=rows[seen.place].receive_time_ns)


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
