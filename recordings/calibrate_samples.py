"""What a recording offers for measuring sigmas: displacements and satellite residuals of sound epochs, in the site's own model.

The recording is decided as ever; of every block what is needed of what it was decided on is kept, of every epoch whether it was sound.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from integrity.config import SiteConfig
from integrity.deciding import Decided
from integrity.events import Event
from integrity.gnss.observations import Bools, Floats, Ints
from integrity.gnss.positioning import range_sigma_m
from integrity.monitors.residuals import b_values_m, clock_design, normalised_b_values, without_clocks
from integrity.outputs import EpochReport
from integrity.states import Cause, State
from integrity.station_monitor import Snapshot, StationMonitor


@dataclass(frozen=True, eq=False)
class Samples:
    """On a regular grid of epochs (K,) `interval_s` apart, NaN where nothing sound was seen: `e_enu_m` (K, R, 3); per signal, (K, R, N),
    `range_m` and `range_differential_m`, scaled so that their standard deviations are sqrt(a^2 + (b / sin el)^2); `el_rad` (K, N).

    `taken` epochs are in it; `left_out` counts others by reason.
    """

    start_ns: int
    interval_s: float
    receivers: tuple[str, ...]
    signals: tuple[str, ...]
    e_enu_m: Floats
    range_m: Floats
    range_differential_m: Floats
    el_rad: Floats
    taken: int
    left_out: dict[str, int]


@dataclass(frozen=True, eq=False)
class _Seen:
    """Of a block: times (E,), displacements (E, R, 3), scaled residuals (E, R, S) of the signals, NaN where not used, elevation (E, S)."""

    epoch_ns: Ints
    e_enu_m: Floats
    signals: tuple[str, ...]
    range_m: Floats
    range_differential_m: Floats
    el_rad: Floats


def _seen(decided: Decided, site: SiteConfig) -> _Seen:
    """Residuals in units of their own model, times the model of a satellite that promises 2.4 m."""
    block, satellites, used = decided.sight.block, decided.sight.satellites, decided.full.used
    promises = site.integrity
    el_rad = decided.sight.sky.expected.el_rad.mean(axis=1)
    clocks = clock_design(satellites.sigma_m, used, satellites.system_of, satellites.n_systems)
    known = without_clocks(clocks, satellites.prefit_m)
    kept = clocks.scale_m / satellites.sigma_m[:, None]  # sqrt(1 - h): what the clocks leave of a range's error
    of_b = normalised_b_values(b_values_m(known.residual_m), satellites.sigma_differential_m) / kept
    model_m = range_sigma_m(el_rad, promises.sigma_range_m, promises.sigma_range_low_m)[:, None]
    model_d_m = range_sigma_m(el_rad, promises.sigma_range_differential_m, promises.sigma_range_differential_low_m)[:, None]
    taken = used[:, None]
    return _Seen(
        block.epoch_ns,
        np.array(decided.full.solution.e_enu_m),
        block.signals,
        np.where(taken, known.normalised * model_m, np.nan),
        np.where(taken, of_b * model_d_m, np.nan),
        np.where(used, el_rad, np.nan),
    )


def samples(
    site: SiteConfig, events: Sequence[Event], snapshot: Snapshot | None, start_ns: int | None, end_ns: int | None
) -> Samples | None:
    """Sound epochs of a recording in [start, end) of GPS time; None where there is none at all."""
    monitor = StationMonitor(site, snapshot)
    seen: list[_Seen] = []
    why: dict[int, str] = {}
    for decided, outputs in monitor.blocks(events):
        if decided is not None:
            seen.append(_seen(decided, site))
        why |= {o.gps_time_ns: _unsound(o) for o in outputs if isinstance(o, EpochReport)}
    inside = {t: reason for t, reason in why.items() if (start_ns is None or t >= start_ns) and (end_ns is None or t < end_ns)}
    sound = np.array(sorted(t for t, reason in inside.items() if not reason), dtype=np.int64)
    if not len(sound):
        return None
    left_out = dict(Counter(reason for reason in inside.values() if reason))
    return _on_a_grid(seen, sound, left_out, site)


def _unsound(report: EpochReport) -> str:
    """Why an epoch is left out; empty for a sound one."""
    if report.cause is Cause.NOT_READY and report.verdict.state is State.NORMAL:
        return "starting up"
    if report.state is not State.NORMAL:
        return f"{report.state}, {report.cause}"
    if report.exclusions:
        return "a satellite excluded"
    return "a satellite left out at one receiver" if report.channels else ""


def _on_a_grid(seen: Sequence[_Seen], sound: Ints, left_out: dict[str, int], site: SiteConfig) -> Samples:
    interval_ns = site.epoch_interval_ns
    start_ns = int(sound[0])
    n_epochs = int((sound[-1] - start_ns) // interval_ns) + 1
    signals = tuple(sorted({s for part in seen for s in part.signals}))
    n_receivers = len(site.receivers)
    e_enu_m = np.full((n_epochs, n_receivers, 3), np.nan)
    range_m = np.full((n_epochs, n_receivers, len(signals)), np.nan)
    range_differential_m = np.full(range_m.shape, np.nan)
    el_rad = np.full((n_epochs, len(signals)), np.nan)
    place = {s: i for i, s in enumerate(signals)}
    for part in seen:
        taken: Bools = np.isin(part.epoch_ns, sound)
        rows = (part.epoch_ns[taken] - start_ns) // interval_ns
        columns = np.array([place[s] for s in part.signals], dtype=np.int64)
        e_enu_m[rows] = part.e_enu_m[taken]
        range_m[rows[:, None, None], np.arange(n_receivers)[:, None], columns] = part.range_m[taken]
        range_differential_m[rows[:, None, None], np.arange(n_receivers)[:, None], columns] = part.range_differential_m[taken]
        el_rad[rows[:, None], columns] = part.el_rad[taken]
    return Samples(
        start_ns,
        interval_ns / 1e9,
        site.receiver_names,
        signals,
        e_enu_m,
        range_m,
        range_differential_m,
        el_rad,
        len(sound),
        left_out,
    )
