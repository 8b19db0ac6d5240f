"""Detection and exclusion of faulty ranges by normalised residuals, on one design: nothing is solved again.

Two tests, each with half of the false alarms: the weighted sum of squared residuals against a chi-square threshold of its degrees of
freedom, which sees what many ranges share in, and the largest normalised residual against a threshold of the number of ranges, so that
one large fault is not hidden by many good ranges. Where one fails, the range with the largest normalised residual is left out, if it
stands out and no other range could be the culprit as well, and both tests are done again on what remains.
Sources: Baarda 1968 (w-test, data snooping); Walter, Enge 1995 (weighted RAIM); RTCA DO-229, 2.1.1.5 for the words.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from integrity.gnss.downdate import Rows, cofactors, of_rows, without
from integrity.gnss.least_squares import MOST_PDOP, Design, Solution, postfit_m, solution
from integrity.gnss.leave_one_out import shares
from integrity.gnss.observations import Bools, Floats, Ints, freeze
from integrity.probability import chi2_quantile, gauss_quantile

MOST_SATELLITES = 128  # of all systems that one receiver can see
LEAST_OF_A_CONSTELLATION = 3
ALIKE = 1.0 - 1e-6  # residuals more correlated than this differ by rounding


class Finding(IntEnum):
    """What the tests came to. Only the first two are positions that were checked."""

    PASSED = 0
    EXCLUDED = 1  # passed, after ranges were left out
    UNCHECKED = 2  # no position, or as many unknowns as ranges
    UNEXPLAINED = 3  # the ranges do not fit together, and none stands out
    AMBIGUOUS = 4  # another range could be the culprit as well
    TOO_MANY = 5  # they still do not fit after as many exclusions as are allowed
    UNVERIFIED = 6  # what remains after exclusion has too little redundancy or too poor a geometry to be checked


_OPEN = -1  # the range that stands out has yet to be left out


@dataclass(frozen=True, eq=False)
class Criteria:
    """`chi2` by degrees of freedom (N,), `largest` normalised residual by number of ranges (N,); at most `most_excluded` are left out.

    Two residuals with a correlation above `confusable` are told apart by likelihood only: their squares must differ by `margin`.
    """

    chi2: Floats
    largest: Floats
    most_excluded: int
    confusable: float
    margin: float

    def __post_init__(self) -> None:
        freeze(self)


@dataclass(frozen=True, eq=False)
class Checked:
    """`finding` (E, R) holds `Finding`; `excluded` (E, R, S) only where it is EXCLUDED; `suspects` (E, R, S) which could not be told apart.

    `found` is the solution without what was excluded, elsewhere that of all. `chi2`, `dof`, `largest` (E, R) are the statistics of the last
    test, NaN where there is none.
    """

    finding: Ints
    excluded: Bools
    suspects: Bools
    found: Solution
    chi2: Floats
    dof: Ints
    largest: Floats

    def __post_init__(self) -> None:
        freeze(self)


def criteria(false_alarm: float, most_excluded: int, confusable: float, confusion: float) -> Criteria:
    """Thresholds for a probability of a false alarm per receiver and epoch when the sigmas are right (or too large).

    `confusion` is the probability of preferring the wrong one of two confusable residuals: by the bound on likelihood ratios (Wald 1947),
    P(ratio > 1 / confusion) < confusion, the squares must differ by 2 ln(1 / confusion).
    """
    half = false_alarm / 2.0
    chi2 = [np.nan, *(chi2_quantile(half, dof) for dof in range(1, MOST_SATELLITES + 1))]
    largest = [np.nan, *(gauss_quantile(half / (2.0 * n)) for n in range(1, MOST_SATELLITES + 1))]
    return Criteria(np.array(chi2), np.array(largest), most_excluded, confusable, 2.0 * float(np.log(1.0 / confusion)))


class _Test(NamedTuple):
    """Statistics (F,) of rows; `i` (F,) is the range with the largest normalised residual, `t` (F, S) are all of these."""

    chi2: Floats
    dof: Ints
    n_used: Ints
    largest: Floats
    i: Ints
    t: Floats


class _Closed(NamedTuple):
    """What the search came to, (F,) and (F, S), with the positions (3, F), their cofactors and the last statistics."""

    finding: Ints
    excluded: Bools
    suspects: Bools
    e: Floats
    C: Floats
    chi2: Floats
    dof: Ints
    largest: Floats


def told_apart(used: Bools, system_of: Ints, n_systems: int) -> Bools:
    """`used` (E, R, S) less the satellites of constellations with fewer than three: `detect_and_exclude` cannot say which is at fault.

    One alone determines a clock and nothing checks it; of two the residuals are one number.
    """
    kept = used.copy()
    for k in range(n_systems):
        mine = system_of == k
        kept[..., mine] &= used[..., mine].sum(axis=-1, keepdims=True) >= LEAST_OF_A_CONSTELLATION
    return kept


def detect_and_exclude(of: Design, los_enu: Floats, residual_m: Floats, limits: Criteria) -> Checked:
    """Test every epoch and receiver of a block, and leave out of those that fail what is at fault.

    residual_m (E, R, S), los_enu (3, E, R, S) as the design was made with. Linear at the points: where what is at fault moves the
    position by kilometres, the rest is to be solved again without it.
    """
    found = solution(of, residual_m)
    parts = shares(of, los_enu)
    v = np.where(of.used, postfit_m(residual_m, los_enu, found, of.system_of), 0.0)
    n_clocks = (of.n_of > 0.0).sum(axis=-1)
    test = _tested(Rows(of.used, of.w, v, parts.redundancy, parts.u, of.C, found.e_enu_m, of.safe, n_clocks))
    passed = _passed(test, limits)
    checkable: Bools = found.solved & (test.dof > 0)
    finding = np.where(checkable, np.where(passed, Finding.PASSED, Finding.UNEXPLAINED), Finding.UNCHECKED)
    none = np.zeros(of.used.shape, dtype=np.bool_)
    chi2, largest = (np.where(checkable, x, np.nan) for x in (test.chi2, test.largest))
    checked = Checked(finding, none, none, found, chi2, test.dof, largest)
    at = np.nonzero(checkable & ~passed)
    if not len(at[0]):
        return checked
    e, r = at
    rows = Rows(
        used=of.used[at],
        w=of.w[at],
        v=v[at],
        redundancy=parts.redundancy[at],
        u=parts.u[:, e, r],
        C=of.C[:, :, e, r],
        e=found.e_enu_m[at].T,
        weight=of.safe[at],
        n_clocks=n_clocks[at],
    )
    return _merged(checked, at, _search(rows, of.place, limits), of, los_enu, residual_m)


def normalised_outside(of: Design, los_enu: Floats, sigma_m: Floats, postfit_m: Floats) -> Floats:
    """Residuals (E, R, S) of ranges that are not used over the standard deviation of their prediction, sqrt(sigma_i^2 + a_i' M a_i).

    Of the only one that was left out it is what its normalised residual was among all. NaN where its constellation has no clock.
    Source: Cook, Weisberg, Residuals and Influence in Regression, 1982, 2.2.1 (deleted residuals).
    """
    u = los_enu - of.u_mean.take(of.place, axis=-1)
    predicted_m2 = (1.0 / of.safe).take(of.place, axis=-1) + np.einsum("iers,ijer,jers->ers", u, of.C, u)
    result: Floats = postfit_m / np.sqrt(sigma_m * sigma_m + predicted_m2)
    return result


def _tested(rows: Rows) -> _Test:
    """Both statistics; shapes (F,) may be (E, R)."""
    n_used = rows.used.sum(axis=-1)
    t = np.abs(rows.v) * np.sqrt(rows.w / rows.redundancy)
    ranked = np.where(np.isfinite(t), t, -1.0)
    i = ranked.argmax(axis=-1)
    largest = np.take_along_axis(ranked, i[..., None], axis=-1)[..., 0]
    chi2 = np.einsum("...s,...s,...s->...", rows.w, rows.v, rows.v)
    return _Test(chi2, n_used - 3 - rows.n_clocks, n_used, largest, i, t)


def _passed(test: _Test, limits: Criteria) -> Bools:
    threshold = limits.chi2[np.clip(test.dof, 0, MOST_SATELLITES)]  # NaN without redundancy: fails
    result: Bools = (test.chi2 <= threshold) & (test.largest <= limits.largest[np.minimum(test.n_used, MOST_SATELLITES)])
    return result


def _search(rows: Rows, place: Ints, limits: Criteria) -> _Closed:
    """Leave out what stands out, one range after the other, until every row passes or tells why it cannot."""
    shape = rows.used.shape
    closed = _Closed(
        finding=np.full(shape[0], _OPEN),
        excluded=np.zeros(shape, dtype=np.bool_),
        suspects=np.zeros(shape, dtype=np.bool_),
        e=np.array(rows.e),
        C=np.array(rows.C),
        chi2=np.full(shape[0], np.nan),
        dof=np.zeros(shape[0], dtype=np.int64),
        largest=np.full(shape[0], np.nan),
    )
    used_first, where = rows.used, np.arange(shape[0])
    for n_excluded in range(limits.most_excluded + 1):
        test = _tested(rows)
        Q_i = cofactors(rows, test.i, place)
        confused = _confused(rows, test, Q_i, limits)
        finding = _judged(rows, test, confused, n_excluded, limits)
        done = finding != _OPEN
        k = where[done]
        closed.finding[k] = finding[done]
        closed.excluded[k] = (used_first[k] & ~rows.used[done]) & (finding[done] == Finding.EXCLUDED)[:, None]
        suspects = confused | (np.arange(shape[1]) == test.i[:, None])
        closed.suspects[k] = suspects[done] & (finding[done] == Finding.AMBIGUOUS)[:, None]
        closed.e[:, k], closed.C[:, :, k] = rows.e[:, done], rows.C[:, :, done]
        closed.chi2[k], closed.dof[k], closed.largest[k] = test.chi2[done], test.dof[done], test.largest[done]
        where = where[~done]
        if not len(where):
            break
        rows = without(of_rows(rows, ~done), test.i[~done], Q_i[~done], place)
    return closed


def _judged(rows: Rows, test: _Test, confused: Bools, n_excluded: int, limits: Criteria) -> Ints:
    """The `Finding` of each row, or _OPEN: leave out what stands out."""
    with np.errstate(invalid="ignore"):
        pdop2 = (rows.C[0, 0] + rows.C[1, 1] + rows.C[2, 2]) * rows.w.sum(axis=-1) / np.maximum(test.n_used, 1)
    verified = (test.dof > 0) & (pdop2 <= MOST_PDOP**2)
    stands_out = test.largest > limits.largest[np.minimum(test.n_used, MOST_SATELLITES)]
    finding: Ints = np.select(
        [~verified, _passed(test, limits), np.full(len(verified), n_excluded == limits.most_excluded), ~stands_out, confused.any(axis=-1)],
        [Finding.UNVERIFIED, Finding.EXCLUDED, Finding.TOO_MANY, Finding.UNEXPLAINED, Finding.AMBIGUOUS],
        _OPEN,
    )
    return finding


def _confused(rows: Rows, test: _Test, Q_i: Floats, limits: Criteria) -> Bools:
    """Which others (F, S) could be the culprit as well: a residual correlated with the largest, and nearly as large.

    The residuals' covariance is W^-1 - Q. A fault of i shows in j with the correlation of their residuals; left out instead of i, j makes
    the chi-square larger by t_i^2 - t_j^2, twice the logarithm of the likelihood ratio.
    """
    f = np.arange(len(test.i))
    spread = rows.redundancy / np.where(rows.w > 0.0, rows.w, np.nan)  # variances of the residuals
    correlation = np.abs(Q_i) / np.sqrt(spread * spread[f, test.i][:, None])
    likelier = (test.largest[:, None] ** 2 - test.t**2 > limits.margin) & (correlation <= ALIKE)
    told_apart = (correlation <= limits.confusable) | likelier
    others: Bools = np.isfinite(test.t) & (np.arange(rows.used.shape[1]) != test.i[:, None])
    return others & ~told_apart


def _merged(checked: Checked, at: tuple[Ints, ...], closed: _Closed, of: Design, los_enu: Floats, residual_m: Floats) -> Checked:
    """The search's results among those of the other receivers and epochs `at`; solutions only of those that passed in the end."""
    parts = {name: np.array(getattr(checked, name)) for name in ("finding", "excluded", "suspects", "chi2", "dof", "largest")}
    for name, array in parts.items():
        array[at] = getattr(closed, name)
    kept = closed.finding == Finding.EXCLUDED
    e, r = (x[kept] for x in at)
    found = {name: np.array(getattr(checked.found, name)) for name in Solution.__dataclass_fields__}
    found["e_enu_m"][e, r] = closed.e.T[kept]
    found["cov_enu_m2"][e, r] = closed.C.transpose(2, 0, 1)[kept]
    found["n_used"][e, r] -= closed.excluded[kept].sum(axis=-1)
    w = np.where(closed.excluded[kept], 0.0, of.w[e, r])
    ahead_m = residual_m[e, r] + np.einsum("ifs,fi->fs", los_enu[:, e, r], closed.e.T[kept])
    weight = np.einsum("fs,ks->fk", w, of.groups)
    clock_m = np.einsum("fs,ks->fk", w * np.where(w > 0.0, ahead_m, 0.0), of.groups) / np.where(weight > 0.0, weight, np.nan)
    found["clock_m"][e[:, None], r[:, None], of.clocks] = clock_m
    return Checked(found=Solution(**found), **parts)
