"""What SBAS makes of each satellite: whether it may be used, and if not why; its corrections; and sigma of what remains.

For a block of epochs at once. An epoch gives the same alone as among others. Source: RTCA DO-229D, A.4.4, A.4.5, J.2.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from integrity.gnss.atmosphere import Klobuchar, klobuchar_delay_m, troposphere_mapping
from integrity.gnss.ephemeris.states import usable
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.frames import enu_axes, geodetic_from_ecef
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS
from integrity.gnss.observations import Bools, Floats, Ints, freeze
from integrity.gnss.sbas import degradation as dg
from integrity.gnss.sbas.airborne import NoiseModel
from integrity.gnss.sbas.cells import Points
from integrity.gnss.sbas.geometry import Orbits, Sight, covariance_delta_udre, orbits_of, sight
from integrity.gnss.sbas.grid import NEVER
from integrity.gnss.sbas.heads import Heads, heads_of
from integrity.gnss.sbas.ionosphere import (
    NoDelay,
    Pierce,
    magnetic_latitude_rad,
    pierce_points,
    vertical_delay,
    vertical_sigma_without_grid_m,
)
from integrity.gnss.sbas.store import NOT_MONITORED, PA, ROW_OF, Rows, State

MOST_UDREI_PA = 11  # 12 and 13 are for NPA only: 2.1.4.11, table A-6
TROPOSPHERE_SIGMA_M = 0.12  # of the vertical delay: A.4.2.5
NO_KLOBUCHAR = Klobuchar((0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))  # 5 ns everywhere


class Reason(IntEnum):
    """Why a satellite is not used, or USED."""

    USED = 0
    NO_ORBIT = 1
    BELOW_MASK = 2
    UNHEALTHY = 3
    TEST_MODE = 4
    MESSAGES_MISSED = 5
    NO_MASK = 6
    NOT_IN_MASK = 7
    NO_DEGRADATION = 8
    NO_FAST = 9
    UDREI_TIMED_OUT = 10
    NOT_MONITORED = 11
    DO_NOT_USE = 12
    UDREI_TOO_HIGH = 13
    NO_FACTOR = 14
    FAST_TIMED_OUT = 15
    ONE_FAST = 16
    RATE_TIMED_OUT = 17
    NO_DELTA_UDRE = 18
    NO_LONG_TERM = 19
    NO_SUCH_EPHEMERIS = 20
    NO_IONO_MASK = 21
    IONO_NOT_MONITORED = 22
    IONO_DO_NOT_USE = 23


REASON_TEXT = {
    Reason.USED: "used",
    Reason.NO_ORBIT: "no ephemeris",
    Reason.BELOW_MASK: "below the elevation mask",
    Reason.UNHEALTHY: "unhealthy",
    Reason.TEST_MODE: "SBAS in test mode",
    Reason.MESSAGES_MISSED: "no SBAS message for four seconds",
    Reason.NO_MASK: "no PRN mask",
    Reason.NOT_IN_MASK: "not in the PRN mask",
    Reason.NO_DEGRADATION: "no degradation parameters",
    Reason.NO_FAST: "no fast corrections",
    Reason.UDREI_TIMED_OUT: "UDRE timed out",
    Reason.NOT_MONITORED: "not monitored",
    Reason.DO_NOT_USE: "do not use",
    Reason.UDREI_TOO_HIGH: "UDRE too high",
    Reason.NO_FACTOR: "no fast degradation factor",
    Reason.FAST_TIMED_OUT: "fast corrections timed out",
    Reason.ONE_FAST: "one fast correction only",
    Reason.RATE_TIMED_OUT: "range rate timed out",
    Reason.NO_DELTA_UDRE: "no delta UDRE",
    Reason.NO_LONG_TERM: "no long-term corrections",
    Reason.NO_SUCH_EPHEMERIS: "no ephemeris of that issue",
    Reason.NO_IONO_MASK: "pierce point outside the ionosphere grid",
    Reason.IONO_NOT_MONITORED: "ionosphere not monitored",
    Reason.IONO_DO_NOT_USE: "ionosphere not to be used",
}


@dataclass(frozen=True, eq=False)
class Corrections:
    """Of satellites (S,) at epochs (E,); arrays (E, S), where `why` is USED, else NaN or without meaning.

    To a pseudorange add `range_m` (fast) and subtract `iono_m`; to the satellite's position add `d_pos_ecef_m` (3, E, S), to its clock
    `d_clock_s`, both for the ephemeris `index` in the store. `iono_from_grid`: the delay is of the grid, not of Klobuchar's model.
    Variances of flt, UIRE, tropo and air, m2; `sigma_m` is the root of their sum. Azimuth and elevation, rad; `u_enu` (3, E, S).
    """

    t_ns: Ints
    satellites: tuple[str, ...]
    why: Ints
    index: Ints
    az_rad: Floats
    el_rad: Floats
    u_enu: Floats
    range_m: Floats
    iono_m: Floats
    iono_from_grid: Bools
    d_pos_ecef_m: Floats
    d_clock_s: Floats
    flt_variance_m2: Floats
    uire_variance_m2: Floats
    tropo_variance_m2: Floats
    air_variance_m2: Floats
    sigma_m: Floats

    def __post_init__(self) -> None:
        freeze(self)

    @property
    def used(self) -> Bools:
        """Which satellites may be used, (E, S)."""
        result: Bools = self.why == Reason.USED
        return result


class _Ladder:
    """The first reason that holds stays. `why` (E, S)."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.why = np.zeros(shape, dtype=np.int64)

    def rule_out(self, where: Bools, reason: Reason) -> None:
        """For this reason, where there is none yet."""
        np.copyto(self.why, int(reason), where=where & (self.why == 0))  # USED


def rows_of(satellites: Sequence[str]) -> list[int]:
    """Rows for `SbasStore.at`, of GPS satellites; ValueError for others: corrections of GLONASS name issues in another way, and ranges of
    SBAS satellites are worse than those of GPS."""
    if not all(satellite[:1] == "G" and satellite in ROW_OF for satellite in satellites):
        raise ValueError(f"satellites {list(satellites)!r}: SBAS corrections are applied to GPS only, G01 to G37; leave out the others")
    return [ROW_OF[satellite] for satellite in satellites]


def correct(
    states: Sequence[State],
    satellites: Sequence[str],
    ephemerides: EphemerisStore,
    pos_ecef_m: Floats,
    mode: int,
    mask_rad: float,
    noise: NoiseModel,
    klobuchar: Klobuchar | None,
) -> Corrections:
    """For a point (3,), at the times of the states, whose rows are those of the satellites. `mode` is PA or NPA."""
    t = np.array([state.t_ns for state in states], dtype=np.int64)[:, None]
    rows: Rows = np.empty((len(states), len(satellites)), dtype=states[0].rows.dtype)
    for e, state in enumerate(states):
        rows[e] = state.rows
    lat, lon, _ = geodetic_from_ecef(pos_ecef_m)
    heads = heads_of(states, float(np.degrees(lat)), float(np.degrees(lon)), mode)
    orbits = orbits_of(ephemerides, satellites, rows, t, dg.LONG_TERM_TIMEOUT_S[mode])
    seen = sight(ephemerides, orbits, rows, t, pos_ecef_m, enu_axes(lat, lon))

    ladder = _Ladder(rows.shape)
    ladder.rule_out(orbits.number < 0, Reason.NO_ORBIT)
    ladder.rule_out(~(seen.el_rad >= mask_rad), Reason.BELOW_MASK)
    ladder.rule_out(~usable(ephemerides.ephemerides, orbits.number), Reason.UNHEALTHY)
    _judge_source(ladder, heads, rows, t, mode)
    fast = dg.fast(rows, t, mode, heads.I_fc_s, heads.t_lat_s, np.where(heads.terms.present, heads.terms.B_rrc, 0.0))
    no_fast = _judge_fast(ladder, fast, rows, t, mode)
    delta_udre = _judge_delta_udre(ladder, heads, rows, seen, t, mode)
    if mode == PA:
        ladder.rule_out(~orbits.in_time, Reason.NO_LONG_TERM)
        ladder.rule_out(~orbits.corrected, Reason.NO_SUCH_EPHEMERIS)

    flt = _flt_variance(heads, fast, rows, orbits, delta_udre, t, mode)
    flt = np.where(no_fast | ~orbits.corrected, dg.NO_CORRECTION_VARIANCE_M2, flt)
    iono, uire, of_grid = _ionosphere(ladder, states, seen, t, lat, lon, mode, klobuchar or NO_KLOBUCHAR)
    tropo = (TROPOSPHERE_SIGMA_M * troposphere_mapping(seen.el_rad)) ** 2
    air = noise.variance_m2(seen.el_rad)
    return Corrections(
        t_ns=t[:, 0],
        satellites=tuple(satellites),
        why=ladder.why,
        index=orbits.number,
        az_rad=seen.az_rad,
        el_rad=seen.el_rad,
        u_enu=seen.u_enu,
        range_m=np.where(no_fast, 0.0, fast.range_m),
        iono_m=iono,
        iono_from_grid=of_grid,
        d_pos_ecef_m=seen.d_pos_ecef_m,
        d_clock_s=seen.d_clock_s,
        flt_variance_m2=flt,
        uire_variance_m2=uire,
        tropo_variance_m2=tropo,
        air_variance_m2=air,
        sigma_m=np.sqrt(flt + uire + tropo + air),
    )


def _judge_source(ladder: _Ladder, heads: Heads, rows: Rows, t: Ints, mode: int) -> None:
    """What holds for the SBAS as a whole, and whether it has the satellite."""
    ladder.rule_out(heads.blocked, Reason.TEST_MODE)
    ladder.rule_out(heads.silent, Reason.MESSAGES_MISSED)
    ladder.rule_out(dg.older(t, heads.mask_ns, dg.MASK_TIMEOUT_S[mode]), Reason.NO_MASK)
    ladder.rule_out(dg.older(t, rows["mask_ns"], dg.MASK_TIMEOUT_S[mode]), Reason.NOT_IN_MASK)
    if mode == PA:
        ladder.rule_out(~heads.terms.present, Reason.NO_DEGRADATION)


def _judge_fast(ladder: _Ladder, fast: dg.Fast, rows: Rows, t: Ints, mode: int) -> Bools:
    """Where there are no fast corrections: a reason in PA, a large variance in NPA. Not monitored and do not use hold until revoked."""
    ladder.rule_out(rows["udrei"] == NOT_MONITORED, Reason.NOT_MONITORED)
    ladder.rule_out(rows["udrei"] > NOT_MONITORED, Reason.DO_NOT_USE)
    conditions = (
        (rows["of_ns"] == NEVER, Reason.NO_FAST),
        (dg.older(t, rows["udre_ns"], dg.UDREI_TIMEOUT_S[mode]), Reason.UDREI_TIMED_OUT),
        (dg.older(t, rows["factor_ns"], dg.LONG_TERM_TIMEOUT_S[mode]), Reason.NO_FACTOR),
        (fast.timed_out, Reason.FAST_TIMED_OUT),
        (fast.rate_timed_out, Reason.RATE_TIMED_OUT),
    )
    if mode == PA:
        ladder.rule_out(rows["udrei"] > MOST_UDREI_PA, Reason.UDREI_TOO_HIGH)
        for condition, reason in (*conditions[:4], (fast.only_one, Reason.ONE_FAST), conditions[4]):
            ladder.rule_out(condition, reason)
    missing: Bools = np.logical_or.reduce([condition for condition, _ in conditions])
    return missing


def _judge_delta_udre(ladder: _Ladder, heads: Heads, rows: Rows, seen: Sight, t: Ints, mode: int) -> Floats:
    """delta UDRE of type 27 or 28, one where neither is sent; in PA it has to be here where one is. A.4.4.13, A.4.4.16."""
    has = heads.covariance & ~dg.older(t, rows["cov_ns"], dg.LONG_TERM_TIMEOUT_S[mode])
    C = np.where(heads.terms.present, heads.terms.C_covariance, 0.0)
    of_covariance = np.where(has, covariance_delta_udre(rows["R"], seen.u_ecef) + C * rows["scale"], 1.0)
    if mode == PA:
        ladder.rule_out((heads.covariance & ~has) | np.isnan(heads.service), Reason.NO_DELTA_UDRE)
    return np.fmax(of_covariance, heads.service)


def _flt_variance(heads: Heads, fast: dg.Fast, rows: Rows, orbits: Orbits, delta_udre: Floats, t: Ints, mode: int) -> Floats:
    """sigma^2_flt where fast and long-term corrections are here."""
    ltc = orbits.long_term
    epsilon_ltc = dg.epsilon_ltc_m(ltc.velocity_code, t, ltc.t0_ns, ltc.sent_ns, heads.terms)
    late = False if mode == PA else dg.beyond_pa(rows, t, ltc.sent_ns)
    epsilon_er = np.where(late, heads.terms.C_er, 0.0)
    return dg.flt_variance_m2(rows["udrei"], delta_udre, (fast.epsilon_fc_m, fast.epsilon_rrc_m, epsilon_ltc, epsilon_er), heads.terms)


_IONO_REASON = np.zeros(len(NoDelay), dtype=np.int64)
_IONO_REASON[[NoDelay.NOT_IN_MASK, NoDelay.NOT_MONITORED, NoDelay.DO_NOT_USE]] = (
    Reason.NO_IONO_MASK,
    Reason.IONO_NOT_MONITORED,
    Reason.IONO_DO_NOT_USE,
)


class _Slant(NamedTuple):
    """Delay, its variance, and whether they are of the grid, (E, S)."""

    delay_m: Floats
    variance_m2: Floats
    of_grid: Bools


def _ionosphere(
    ladder: _Ladder, states: Sequence[State], seen: Sight, t: Ints, lat: Floats, lon: Floats, mode: int, klobuchar: Klobuchar
) -> _Slant:
    """Slant delay by the grid; in NPA by Klobuchar's model where the grid has none. A.4.4.10.4, J.2.3."""
    el = np.where(seen.el_rad > 0.0, seen.el_rad, np.nan)
    pierce = pierce_points(lat, lon, seen.az_rad, el)
    shape = el.shape
    delay, variance, why = np.full(shape, np.nan), np.full(shape, np.nan), np.full(shape, NoDelay.NOT_IN_MASK, dtype=np.int64)
    begin = 0
    for end in range(1, len(states) + 1):
        if end < len(states) and states[end].grid is states[begin].grid and states[end].head.degradation is states[begin].head.degradation:
            continue
        wanted = np.nonzero((ladder.why[begin:end] == Reason.USED) & np.isfinite(el[begin:end]))
        where = (wanted[0] + begin, wanted[1])
        if len(wanted[0]):
            state = states[begin]
            found = vertical_delay(
                Points(
                    np.degrees(pierce.lat_rad[where]), np.degrees(pierce.lon_rad[where]), t[where[0], 0], state.grid, state.head.degradation
                )
            )
            delay[where], variance[where], why[where] = found
        begin = end
    of_grid = why == NoDelay.FOUND
    slant = _Slant(pierce.obliquity * delay, pierce.obliquity**2 * variance, of_grid)
    if mode == PA:
        for no_delay in (NoDelay.NOT_IN_MASK, NoDelay.NOT_MONITORED, NoDelay.DO_NOT_USE):
            ladder.rule_out(why == no_delay, Reason(int(_IONO_REASON[no_delay])))
        return slant
    return _with_model(slant, pierce, seen, el, t, lat, lon, klobuchar)


def _with_model(slant: _Slant, pierce: Pierce, seen: Sight, el: Floats, t: Ints, lat: Floats, lon: Floats, klobuchar: Klobuchar) -> _Slant:
    """Where the grid has nothing: Klobuchar's delay, and sigma_UIRE the larger of a fifth of it and F_pp tau_vert. J.2.3."""
    tow_s = t % WEEK_NS / NS_PER_S
    model = klobuchar_delay_m(tow_s, lat, lon, seen.az_rad, el, klobuchar)
    sigma = np.maximum(model / 5.0, pierce.obliquity * vertical_sigma_without_grid_m(magnetic_latitude_rad(pierce)))
    return _Slant(np.where(slant.of_grid, slant.delay_m, model), np.where(slant.of_grid, slant.variance_m2, sigma * sigma), slant.of_grid)
