"""The closed form: the place on any straight line in the neighbourhood of a point, from sums over the satellites [000 3.5, 3.6].

The range to a satellite in direction u shrinks by u p where the point moves by p. So what n satellites say, about every line at once, is
a 3 x 3 matrix, a vector and a number (`Sums`): to try another line needs neither satellites nor geometry again.

First order in the distance from the point: off by d^2 / (2 rho), 1 mm at 200 m. Sums run over the satellites one by one, so that
satellites which are not used change no bit of a result.
"""

from typing import NamedTuple

import numpy as np

from integrity.gnss.observations import BEYOND_MEASURE, Bools, Floats, Ints, slices

# Of the products of (u_x, u_y, u_z, y): xx xy xz yy yz zz, xr yr zr, rr; and which of them make a matrix, a vector.
ROWS, COLUMNS = np.array([[0, 0, 0, 1, 1, 2, 0, 1, 2, 3], [0, 1, 2, 1, 2, 2, 3, 3, 3, 3]])
MATRIX, VECTOR, SQUARE = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]]), slice(6, 9), 9


class Sums(NamedTuple):
    """What the satellites seen from n points say about the neighbourhood.

    `moments` (n, 10): weighted sums of the products of (u_x, u_y, u_z, y), where u is the line of sight in local axes and y the residual,
    all less the mean of their constellation; these `means` (n, 4, K); `weight` (n, K) of each constellation; satellites used (n,); `dof`
    (n,): n - 1 - C, since a distance and C clocks are solved for (section 1.16).
    """

    moments: Floats
    means: Floats
    weight: Floats
    n_used: Ints
    dof: Ints


class Near(NamedTuple):
    """Points of linearisation (n, 3) with their local axes (n, 3, 3), and what is seen from there."""

    pos_ecef_m: Floats
    enu: Floats
    sums: Sums

    def some(self, which: Ints | Bools) -> "Near":
        """Of some of the points."""
        moments, means, weight, n_used, dof = self.sums
        return Near(self.pos_ecef_m[which], self.enu[which], Sums(moments[which], means[which], weight[which], n_used[which], dof[which]))


class Along(NamedTuple):
    """Solutions on straight lines (n,): distance from where the line begins, sum of w (a - mean a)^2, weighted squares left, TPDOP."""

    d_m: Floats
    s_aa: Floats
    sse: Floats
    tpdop: Floats


def sums_of(residual_m: Floats, los_enu: Floats, sigma_m: Floats, used: Bools, system_of: Ints, n_systems: int) -> Sums:
    """Sums over the satellites: residual_m (E, R, S), los_enu (3, E, R, S), the rest broadcasts to (E, R, S); n = E R.

    What is not finite is not used, whatever `used` says.
    """
    n_epochs, n_receivers, n_signals = residual_m.shape
    used = used & (np.abs(residual_m) < BEYOND_MEASURE) & (sigma_m > 1.0 / BEYOND_MEASURE) & (sigma_m < BEYOND_MEASURE)
    w = used / np.where(used, sigma_m * sigma_m, 1.0)
    member = (system_of == np.arange(n_systems)[:, None]).astype(np.float64)  # (K, S)
    totals = np.empty((5, n_epochs, n_receivers, n_systems))
    moments = np.empty((10, n_epochs, n_receivers))
    for few in slices(n_epochs, n_receivers * n_signals):
        v = np.empty((5, *w[few].shape))
        v[:3], v[3], v[4] = los_enu[:, few], residual_m[few], 1.0
        v = np.where(used[few], v, 0.0)
        totals[:, few] = _sum_in_turn((w[few] * v)[..., None, :] * member)
        v = v[:4] - _means(totals[:, few])[..., system_of]
        moments[:, few] = _sum_in_turn((w[few] * v)[ROWS] * v[COLUMNS])
    n = n_epochs * n_receivers
    means, weight = _means(totals).reshape(4, n, n_systems), totals[4].reshape(n, n_systems)
    n_used = used.sum(axis=-1).reshape(n)
    return Sums(moments.reshape(10, n).T, means.transpose(1, 0, 2), weight, n_used, n_used - 1 - (weight > 0.0).sum(axis=1))


def _means(totals: Floats) -> Floats:
    """Of the first rows of weighted sums, the last row being the weight; 0 where there is none."""
    means: Floats = totals[:-1] / np.where(totals[-1] > 0.0, totals[-1], 1.0)
    return means


def _sum_in_turn(v: Floats) -> Floats:
    """Sums over the last axis in its order: zeros in between change nothing, which `sum` does not promise."""
    if not v.shape[-1]:
        return np.zeros(v.shape[:-1])
    sums: Floats = np.add.accumulate(v, axis=-1)[..., -1]
    return sums


def along(near: Near, begin_ecef_m: Floats, along_ecef: Floats) -> Along:
    """Solutions on lines, one for each point, that begin at (n, 3) and lead along (n, 3).

    With a = -e u and the residuals y + u p of a line that begins at p: d = sum w (a - mean a)(y - mean y) / sum w (a - mean a)^2.
    TPDOP is sqrt(mean(w) / that sum): 1 / sqrt(sum (a - mean a)^2) for equal weights [000 3.6]; sections 1.5, 1.6, 1.16.
    """
    moments, _, weight, n_used, _ = near.sums
    y_u, y_y = moments[:, VECTOR], moments[:, SQUARE]
    lines = np.array((along_ecef, begin_ecef_m - near.pos_ecef_m))
    e, p = e_p = dot(near.enu, lines[:, :, None])
    M_e, M_p = dot(moments[:, MATRIX], e_p[:, :, None])
    s_aa, s_ay = dot(e, M_e), -dot(e, y_u + M_p)
    with np.errstate(divide="ignore", invalid="ignore"):
        d_m = s_ay / s_aa
        tpdop = np.sqrt(weight.sum(axis=1) / (n_used * s_aa))
        sse = np.maximum(y_y + dot(p, 2.0 * y_u + M_p) - d_m * s_ay, 0.0)
    return Along(d_m, s_aa, sse, tpdop)


def clocks_m(near: Near, place_ecef_m: Floats) -> Floats:
    """Receiver clocks (n, K) that belong to places (n, 3); NaN where a constellation is not used."""
    moved = dot(near.enu, (place_ecef_m - near.pos_ecef_m)[:, None])
    means = near.sums.means
    clock_m = means[:, 3] + dot(means[:, :3].transpose(0, 2, 1), moved[:, None])
    result: Floats = np.where(near.sums.weight > 0.0, clock_m, np.nan)
    return result


def time_dilution(near: Near, along_ecef: Floats, found: Along) -> Floats:
    """TTDOP (n, K): dilution of each constellation's clock, sqrt(C_22) of (H'H)^-1 for equal weights; NaN for one that is not used.

    With W_k the weight of a constellation: C_22 = mean(w) (1 / W_k + (mean a)_k^2 / s_aa). TGDOP^2 = TPDOP^2 + sum TTDOP^2; 1.6, 1.16.
    """
    _, means, weight, n_used, _ = near.sums
    a_mean = -dot(dot(near.enu, along_ecef[:, None])[:, None], means[:, :3].transpose(0, 2, 1))  # (n, K)
    with np.errstate(divide="ignore", invalid="ignore"):
        w_mean = weight.sum(axis=1) / n_used
        ttdop = np.sqrt(w_mean[:, None] * (1.0 / weight + a_mean * a_mean / found.s_aa[:, None]))
    result: Floats = np.where(weight > 0.0, ttdop, np.nan)
    return result


def dot(a: Floats, b: Floats) -> Floats:
    """Products of vectors (..., 3): added in their order, so that one has the same bits as many."""
    result: Floats = np.add.reduce(a * b, axis=-1)
    return result
