"""One range less: how everything that follows from a solution changes when a range is left out, by rank-one updates.

Source: Sherman, Morrison 1950, on the inverse of the normal equations with the clocks eliminated as in `least_squares`.
"""

from typing import NamedTuple

import numpy as np

from integrity.gnss.leave_one_out import LEAST_REDUNDANCY
from integrity.gnss.observations import Bools, Floats, Ints


class Rows(NamedTuple):
    """Receivers and epochs (F,) as they are without what has been left out so far. Symbols as in `leave_one_out`."""

    used: Bools  # (F, S)
    w: Floats  # (F, S)
    v: Floats  # (F, S): residuals, of what was left out too
    redundancy: Floats  # (F, S), NaN where no other range checks it, or it is not used
    u: Floats  # (3, F, S): unit vectors less their constellation's mean; zero where not used
    C: Floats  # (3, 3, F)
    e: Floats  # (3, F)
    weight: Floats  # (F, L)
    n_clocks: Ints  # (F,): a satellite that has none of its constellation beside it is never left out


def cofactors(rows: Rows, i: Ints, place: Ints) -> Floats:
    """Column i of Q = A M A', the cofactors of the adjusted ranges, (F, S)."""
    f = np.arange(len(i))
    pull = np.einsum("ijf,jf->if", rows.C, rows.u[:, f, i])
    same = place == place[i][:, None]
    Q_i: Floats = np.where(same, 1.0 / rows.weight[f, place[i]][:, None], 0.0) + np.einsum("ifs,if->fs", rows.u, pull)
    return Q_i


def of_rows(rows: Rows, keep: Bools) -> Rows:
    """The rows where `keep` (F,)."""
    return Rows(
        used=rows.used[keep],
        w=rows.w[keep],
        v=rows.v[keep],
        redundancy=rows.redundancy[keep],
        u=rows.u[:, keep],
        C=rows.C[:, :, keep],
        e=rows.e[:, keep],
        weight=rows.weight[keep],
        n_clocks=rows.n_clocks[keep],
    )


def without(rows: Rows, i: Ints, Q_i: Floats, place: Ints) -> Rows:
    """The rows without range i (F,), Q_i as of `cofactors`.

    w_i Q_ji^2 / (1 - h_i) comes on top of Q_jj, Q_ji w_i v_i / (1 - h_i) on top of v_j, and the like for C and e.
    """
    f, k = np.arange(len(i)), place[i]
    w_i, u_i = rows.w[f, i], rows.u[:, f, i]
    gain = w_i / rows.redundancy[f, i]
    step = gain * rows.v[f, i]
    pull = np.einsum("ijf,jf->if", rows.C, u_i)
    weight = rows.weight.copy()
    weight[f, k] -= w_i
    used, w = rows.used.copy(), rows.w.copy()
    used[f, i], w[f, i] = False, 0.0
    redundancy = rows.redundancy - w * Q_i * Q_i * gain[:, None]
    redundancy = np.where(used & (redundancy > LEAST_REDUNDANCY), redundancy, np.nan)
    shift = u_i * (w_i / weight[f, k])  # of the constellation's mean
    u = np.where(used & (place == k[:, None]), rows.u + shift[..., None], np.where(used, rows.u, 0.0))
    C = rows.C + gain * pull[:, None] * pull[None]
    return Rows(used, w, rows.v + Q_i * step[:, None], redundancy, u, C, rows.e + pull * step, weight, rows.n_clocks)
