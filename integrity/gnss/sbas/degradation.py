"""How corrections get worse with age, and when they are too old.

Source: RTCA DO-229D, A.4.5.1 (terms epsilon and sigma_flt), A.4.4.3 (fast corrections and their rate), table A-25 (time-outs).
"""

from typing import NamedTuple

import numpy as np

from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats, Ints
from integrity.gnss.sbas.messages import RECEIVED_AFTER_NS
from integrity.gnss.sbas.store import FACTOR_MPS2, FAST_TIMEOUT_S, Rows

# Time-outs from the reception of a message, s, for PA and NPA. Table A-25.
MASK_TIMEOUT_S = (600, 600)
UDREI_TIMEOUT_S = (12, 18)
LONG_TERM_TIMEOUT_S = (240, 360)  # types 24, 25; the same for types 7, 10 and 28
SERVICE_TIMEOUT_S = (86_400, 86_400)
RATE_REACH = 8.0  # a rate may be used for that many times the time between its two corrections: A.4.4.3

# sigma^2 of the UDRE by indicator 0 to 13, m2. Table A-6.
UDRE_VARIANCE_M2 = np.array(
    [0.0520, 0.0924, 0.1444, 0.2830, 0.4678, 0.8315, 1.2992, 1.8709, 2.5465, 3.3260, 5.1968, 20.7870, 230.9661, 2078.695, np.nan, np.nan]
)
NO_DEGRADATION_M = 8.0  # added to sigma_UDRE delta_UDRE without type 10: J.2.2
NO_CORRECTION_VARIANCE_M2 = 60.0**2  # without fast or long-term corrections, in NPA: DO-229C, J.2.2; later editions do not give one

_FACTOR = np.array(FACTOR_MPS2)
_FAST_TIMEOUT = np.array(FAST_TIMEOUT_S)


class Terms(NamedTuple):
    """The numbers of type 10, each (E, 1), with whether it is here at all."""

    present: Bools
    B_rrc: Floats
    C_ltc_lsb: Floats
    C_ltc_v1: Floats
    I_ltc_v1: Floats
    C_ltc_v0: Floats
    I_ltc_v0: Floats
    C_er: Floats
    C_covariance: Floats
    RSS_UDRE: Bools


def older(t_ns: Ints, sent_ns: Ints, limit_s: Floats | Ints | int) -> Bools:
    """Whether more than `limit_s` have passed since a message was received; also where none was."""
    result: Bools = t_ns - sent_ns - RECEIVED_AFTER_NS > limit_s * np.int64(NS_PER_S)
    return result


def seconds_since(t_ns: Ints, from_ns: Ints) -> Floats:
    """From a time to another; zero where it never came, which is reported elsewhere."""
    result: Floats = np.where(from_ns > 0, t_ns - from_ns, 0) / NS_PER_S
    return result


class Fast(NamedTuple):
    """Fast corrections (E, S): to add to a pseudorange, m, with the rate; epsilon terms, m; what is wrong with them."""

    range_m: Floats
    epsilon_fc_m: Floats
    epsilon_rrc_m: Floats
    timed_out: Bools
    only_one: Bools
    rate_timed_out: Bools


def fast(rows: Rows, t_ns: Ints, mode: int, I_fc_s: Floats, t_lat_s: Floats, B_rrc: Floats) -> Fast:
    """By the factor of type 7, a, and the rate of change RRC between two corrections that are dt apart. A.4.4.3, A.4.5.1.1, A.4.5.1.2.

    The time-out of a correction begins anew with each UDRE indicator that confirms it, as t_u does.
    """
    a = _FACTOR[rows["factor"]]
    dt = rows["dt_s"][..., mode]
    since_of: Floats = seconds_since(t_ns, rows["of_ns"])
    paired = np.isfinite(dt)
    dt = np.where(paired, dt, 1.0)
    still = (a == 0.0) | ~paired
    RRC = np.where(still, 0.0, (rows["prc_m"] - rows["previous_m"][..., mode]) / dt)
    jumped = np.where(rows["alarm"], a * np.abs(dt - I_fc_s / 2.0) / 2.0, a * I_fc_s / 4.0) + B_rrc / dt
    exact = np.where(rows["alarm"], dt == I_fc_s / 2.0, rows["in_sequence"])
    return Fast(
        range_m=rows["prc_m"] + RRC * since_of,
        epsilon_fc_m=a * (seconds_since(t_ns, rows["u_ns"]) + t_lat_s) ** 2 / 2.0,
        epsilon_rrc_m=np.where(still | exact, 0.0, jumped * since_of),
        timed_out=older(t_ns, rows["u_ns"], _FAST_TIMEOUT[mode][rows["factor"]]),
        only_one=rows["n_fast"] < 2,
        rate_timed_out=~still & ((dt > I_fc_s) | (since_of - RECEIVED_AFTER_NS / NS_PER_S > RATE_REACH * dt)),
    )


def beyond_pa(rows: Rows, t_ns: Ints, lt_ns: Ints) -> Bools:
    """Where corrections are older than PA allows, which costs C_er in NPA. A.4.5.1.4."""
    too_old: Bools = older(t_ns, rows["u_ns"], _FAST_TIMEOUT[0][rows["factor"]]) | older(t_ns, lt_ns, LONG_TERM_TIMEOUT_S[0])
    return too_old


def epsilon_ltc_m(velocity_code: Ints, t_ns: Ints, t0_ns: Ints, lt_ns: Ints, d: Terms) -> Floats:
    """Of long-term corrections, by velocity code. A.4.5.1.3."""
    since_t0 = seconds_since(t_ns, t0_ns)
    outside = np.maximum(0.0, np.maximum(-since_t0, since_t0 - d.I_ltc_v1))
    moving = np.where((since_t0 > 0.0) & (since_t0 < d.I_ltc_v1), 0.0, d.C_ltc_lsb + d.C_ltc_v1 * outside)
    interval = np.where(d.I_ltc_v0 > 0.0, d.I_ltc_v0, 1.0)  # 0 s is one of 512 values; DO-229 says nothing of it
    still = d.C_ltc_v0 * np.floor(seconds_since(t_ns, lt_ns) / interval)
    return np.where(velocity_code == 1, moving, still)


def flt_variance_m2(udrei: Ints, delta_udre: Floats, epsilons_m: tuple[Floats, ...], d: Terms) -> Floats:
    """sigma^2_flt of fast and long-term corrections. A.4.5.1; J.2.2 without type 10."""
    udre_m: Floats = np.sqrt(UDRE_VARIANCE_M2[udrei]) * delta_udre
    together, squares = udre_m, udre_m * udre_m
    for epsilon_m in epsilons_m:
        together, squares = together + epsilon_m, squares + epsilon_m * epsilon_m
    return np.where(d.present, np.where(d.RSS_UDRE, squares, together * together), (udre_m + NO_DEGRADATION_M) ** 2)
