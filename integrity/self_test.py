"""Shadow faults: do the monitors still see what they are there for? Asked once a minute, of copies of an epoch that is otherwise sound.

Theory of operation. A fault that a monitor promises to catch (`shadows`) is put into a copy of the epoch, one copy for each check: into
residuals of receivers and satellites, strength and presence of signals, ephemerides, ticks. All copies stand one below the other in one
block, which goes through the very functions and limits that decide. The check in question must fail in its copy; others may. One that does
not is silent.

Nothing is remembered, and nothing taken from what was remembered: monitors with memory are shown a past of their own. So live and replay
decide the same. A check that says nothing of the sound epoch is not asked, but for those that only speak when a satellite changes its set.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import nan

import numpy as np

from integrity.assembler import AlignedEpoch
from integrity.carrier_shadows import Seen, carriers_shown
from integrity.carrier_thresholds import CARRIER_CHECKS
from integrity.checks import Surroundings, check, geometry_of
from integrity.config import SiteConfig
from integrity.copies import copies_of, repeated_block
from integrity.deciding import Decided, Place
from integrity.gnss.ephemeris.states import Ephemerides
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools
from integrity.limits import Limits
from integrity.monitors import navigation, slow, told
from integrity.receiver_watch import Heard, ReceiverMemory, heard_with
from integrity.satellites import Watched
from integrity.shadows import SLOW_STEP_NS, Shadow, Turn, false_sets, faults_of, of_ranges, of_receivers, slow_shift_m, told_falsely
from integrity.states import Outcome
from integrity.stream_memory import StreamMemory, StreamStatistics, advance
from integrity.verdict import Checks, passed_over

EVERY_NS = 60 * NS_PER_S
FEW_SATELLITES = 3
CN0_DROP_DB = 9.0  # 1.5 times a jammer's
KEEP_EACH = 4  # of the signals that a receiver loses: three quarters are gone, 1.5 times a jammer's share
LEAST_SIGNALS = 4  # `streams.lost_share` says nothing of fewer
HOST_TIME_S = 4.5  # from one end of what delays explain to beyond the other one: `clocks.HALF_WIDTH_S`
OF_CHANGES = ("ephemeris", "reissued")  # say nothing until a satellite changes its set
ONLY_ALONE = ("slow",)  # looks only where nothing else fails


def is_due(gps_ns: int, interval_ns: int) -> bool:
    """Whether an epoch is the first of its minute."""
    return gps_ns % EVERY_NS < interval_ns


def silent_families(decided: Decided, e: int, place: Place) -> tuple[str, ...]:
    """The checks that stay silent in their copies of epoch e of a block, which has no failing check, by name."""
    sight, full, around, epoch = decided.sight, decided.full, decided.around, decided.epochs[e]
    site, triangle, limits, points, _ = place
    turn = Turn(sight, full, e, int(sight.block.epoch_ns[e]) // EVERY_NS, faults_of(site, triangle), triangle)
    shadows = [*of_receivers(turn), *of_ranges(turn), *_of_the_rest(turn)]
    row = {shadow.check: f for f, shadow in enumerate(shadows)}
    copies = copies_of(sight, e, np.array([shadow.more_m for shadow in shadows]))
    geometry = geometry_of(copies.sky, np.array([shadow.used for shadow in shadows]), site.integrity, triangle)
    seen = [*_false_sets(turn, limits), *carriers_shown(turn, around.watched, points, limits)]
    past = Surroundings(
        streams=_disturbed(turn, around.streams, row, limits),
        heard=_beside(turn, around.heard, row, epoch, site, limits),
        watched=_told(around.watched, e, row, seen),
        receivers=_standing_off(turn, limits),
    )
    shown = copies.satellites.statistics_by(geometry.clocks, geometry.of_each)
    checks = check(copies, geometry, shown, past, points, triangle, site, limits).checks
    asked = (full.checks.outcome[e] != Outcome.NOT_MONITORED) | np.isin(checks.names, OF_CHANGES)
    asked &= ~passed_over(checks.names, site.integrity.rule)
    silent = _silent(checks, shadows)
    return tuple(name for c, name in enumerate(checks.names) if asked[c] and name in silent)


def _silent(checks: Checks, shadows: list[Shadow]) -> set[str]:
    """Checks that do not fail in their copies, by as much as they should; one that looks only where nothing else fails is not asked where
    something does."""
    silent = set()
    for shadow, outcome, statistic in zip(shadows, checks.outcome, checks.statistic, strict=True):
        fails = outcome == Outcome.FAIL
        c = checks.names.index(shadow.check)
        seen = fails[c] and statistic[c] >= shadow.reaches
        if not seen and not (shadow.check in ONLY_ALONE and fails.any()):
            silent.add(shadow.check)
    return silent


def _of_the_rest(turn: Turn) -> list[Shadow]:
    """Copies whose residuals are sound: what is wrong with them stands elsewhere."""
    sound, used = np.zeros(turn.sight.at_points.residual_m.shape[1:]), turn.full.used[turn.e]
    few = used & (np.cumsum(used) <= FEW_SATELLITES)
    names = ["ephemeris", "reissued", "orbit", *CARRIER_CHECKS, "host_time", "told", "repeat"]
    names += ["cn0"] * (len(_pair_of(turn, _heard(turn))) == 2) + ["loss"] * (len(_pair_of(turn, _tracking(turn))) == 2)
    return [Shadow("data", sound, few), *(Shadow(name, sound, used) for name in names)]


def _standing_off(turn: Turn, limits: Limits) -> ReceiverMemory:
    """A past in which one receiver has stood off for hours, up to one step before the epoch, and all else was right."""
    n, steps = len(turn.triangle.names), turn.faults.slow_steps
    epoch_ns = int(turn.sight.block.epoch_ns[turn.e]) - SLOW_STEP_NS * np.arange(steps, 0, -1)
    e_enu_m = np.zeros((steps, n, 3))
    e_enu_m[:, turn.receiver], _ = slow_shift_m(turn)
    memory = ReceiverMemory.empty(n)
    after, _ = slow.advance(memory.slow, epoch_ns, e_enu_m, np.tile(turn.full.var.differential[turn.e], (steps, 1)), limits.slow)
    return memory._replace(slow=after)


def _beside(turn: Turn, heard: Heard, row: dict[str, int], epoch: AlignedEpoch, site: SiteConfig, limits: Limits) -> Heard:
    """What came with the copies: with that for host time, a tick of an hour that cannot be; with another, false sets at one receiver."""
    n, e = len(row), turn.e
    host_s = np.repeat(heard.host_s[e : e + 1], n)
    tick = epoch.tick
    if tick is not None and tick.utc_uncertainty_ns is not None:
        later = replace(tick, utc_ns=tick.utc_ns + round(HOST_TIME_S * NS_PER_S) + 2 * tick.utc_uncertainty_ns)
        at_ns = turn.sight.block.epoch_ns[e : e + 1]
        host_s[row["host_time"]] = heard_with([replace(epoch, tick=later)], at_ns, site.receiver_names, site.host_clock).host_s[0]
    fed = np.repeat(heard.fed[e : e + 1], n, axis=0)
    disputes = told_falsely(turn, limits["ephemeris"])
    fed[row["told"]] = told.fed(disputes, site.receiver_names, max([of.from_ns for of in disputes], default=0))
    return Heard(np.repeat(heard.gain[e : e + 1], n, axis=0), host_s, fed)


def _pair_of(turn: Turn, receivers: Bools) -> list[int]:
    """Two of some receivers (R,), of three in turn; fewer where there are not two."""
    several = np.flatnonzero(receivers).tolist()
    return [r for r in several if r != turn.receiver] if len(several) > 2 else several


def _heard(turn: Turn) -> Bools:
    """Receivers (R,) that say something of C/N0."""
    said = np.isfinite(turn.sight.heard.cn0_dbhz[turn.e])
    found: Bools = np.any(said, axis=-1)
    return found


def _tracking(turn: Turn) -> Bools:
    """Receivers (R,) with enough high signals in some band to lose them."""
    seen = np.isfinite(turn.sight.heard.pseudorange_m[turn.e]) & turn.sight.heard_high[turn.e]
    enough = np.array([seen[:, band].sum(axis=-1) >= LEAST_SIGNALS for band in turn.sight.bands])
    found: Bools = np.logical_or.reduce(enough, axis=0)
    return found


def _disturbed(turn: Turn, streams: StreamStatistics, row: dict[str, int], limits: Limits) -> StreamStatistics:
    """What streams show that are sound at first, then weak at two receivers and repeated by one, then lost at two: of the copies."""
    e, heard = turn.e, turn.sight.heard
    block = repeated_block(heard, e, 3)
    rho, cn0 = np.array(block.pseudorange_m), np.array(block.cn0_dbhz)
    rho[1, list(turn.others)] += 1.0
    cn0[1, _pair_of(turn, _heard(turn))] -= CN0_DROP_DB
    high = turn.sight.heard_high[e]
    for r in _pair_of(turn, _tracking(turn)):
        for band in turn.sight.bands:
            columns = np.arange(len(heard.signals))[band]
            tracked = columns[(np.isfinite(rho[2, r]) & high[r])[band]]
            rho[2, r, [s for i, s in enumerate(tracked.tolist()) if i % KEEP_EACH != KEEP_EACH - 1]] = nan
    later = replace(block, epoch_ns=block.epoch_ns + np.arange(3) * NS_PER_S, pseudorange_m=rho, cn0_dbhz=cn0)
    empty = StreamMemory.empty(len(turn.triangle.names))
    _, shown = advance(empty, later, np.repeat(high[None], 3, axis=0), turn.sight.bands, limits)
    found = StreamStatistics(*(np.array([of[e]] * len(row)) for of in streams))
    found.repeating[row["repeat"]] = shown.repeating[1]
    if "cn0" in row:
        found.cn0_drop_db[row["cn0"]] = shown.cn0_drop_db[1]
    if "loss" in row:
        found.lost_share[row["loss"]] = shown.lost_share[2]
    return found


def _false_sets(turn: Turn, limits: Limits) -> list[Seen]:
    """What is watched of sets, after one satellite's has been followed by a set that puts it elsewhere, another's by one that differs in
    its last bit under the same issue, a third one's by one that its system does not fly."""
    e = turn.e
    usable = np.flatnonzero(turn.full.used[e]).tolist()
    displaced, altered, astray = columns = [turn.among(usable, more) for more in range(3)]
    before, after = false_sets(turn, columns)
    table = {eph.satellite: navigation.Served(eph.satellite, eph, eph, nan, nan, nan, nan, 0.0) for eph in before}
    sets = Ephemerides(after)
    _, shown = navigation.advance(
        table,
        [eph.satellite for eph in sets],
        sets,
        np.array([[0, 1, 2]]),
        turn.sight.block.epoch_ns[e : e + 1],
        turn.triangle.pos_ecef_m.mean(axis=0),
        limits["ephemeris"],
        limits["orbit"],
    )
    return [
        Seen("ephemeris", displaced, shown.change[0, 0]),
        Seen("reissued", altered, shown.reissued_m[0, 1]),
        Seen("orbit", astray, shown.orbit[0, 2]),
    ]


def _told(watched: tuple[Watched, ...], e: int, row: dict[str, int], seen: Sequence[Seen]) -> tuple[Watched, ...]:
    """What is watched of satellites in all copies: what the epoch shows, and in the copy of a check what was seen of its fault."""
    copies = {of.check: of._replace(statistic=np.repeat(of.statistic[e : e + 1], len(row), axis=0)) for of in watched}
    for name, column, statistic in seen:
        copies[name].statistic[row[name], column] = statistic
    return tuple(copies.values())
