"""Who is named when one or two receivers are off, by the rules of section 2.2 as they stand, on errors exactly as the site states them.

Sizes from far below what can be detected to far above, each equally often. Half of the faults are horizontal, half point anywhere. What
the rules remember of the last clean epoch comes in three kinds, each equally often: nothing; an epoch without the fault, up to twenty
minutes before; an epoch into which nine tenths of the fault had crept. The rules are asked whether or not a check has failed, so that
more is named here than a station names.
"""

from typing import Literal, NamedTuple

import numpy as np

from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Floats
from integrity.monitors.triangles import naming_statistics, suspects
from integrity.naming import LastClean, named_receiver
from recordings.campaign.error_model import ErrorModel
from recordings.campaign.tally import Share

Kind = Literal["one", "two alike", "two opposite"]
KINDS: dict[Kind, tuple[float, float, float]] = {"one": (1.0, 0.0, 0.0), "two alike": (1.0, 1.0, 0.0), "two opposite": (1.0, -1.0, 0.0)}
SIZES_M = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 15.0, 20.0, 30.0, 50.0)
AGES_S = (1.0, 10.0, 60.0, 300.0, 1200.0)  # of the last clean epoch, each equally often
CREPT = 0.9
MEMORIES = 3


class Named(NamedTuple):
    """Of faults of one kind and size: how often a receiver that is sound was named, and one that is off."""

    kind: Kind
    size_m: float
    wrong: Share
    right: Share


def namings(model: ErrorModel, trials: int, seed: int) -> tuple[Named, ...]:
    """So many trials of each kind and size."""
    return tuple(
        _named(model, kind, size, trials, np.random.default_rng((seed, k, i)))
        for k, kind in enumerate(KINDS)
        for i, size in enumerate(SIZES_M)
    )


def total(found: tuple[Named, ...], kinds: tuple[Kind, ...] = tuple(KINDS)) -> Share:
    """How often a sound receiver was named, all sizes of some kinds together."""
    shares = [of.wrong for of in found if of.kind in kinds]
    return Share(sum(s.count for s in shares), sum(s.of for s in shares))


def _named(model: ErrorModel, kind: Kind, size_m: float, trials: int, rng: np.random.Generator) -> Named:
    n = model.receivers
    off = np.array(KINDS[kind])
    fault_m = size_m * off[:, None] * _directions(trials, rng)[:, None]  # (N, R, 3)
    age_s = np.array(AGES_S)[rng.integers(len(AGES_S), size=trials)]
    before_m, now_m = _twice(model, age_s, rng)
    now_m += fault_m
    crept = np.arange(trials) % MEMORIES == 2
    before_m += CREPT * fault_m * crept[:, None, None]

    statistics = naming_statistics(now_m, model.var, model.triangle)
    suspected = suspects(model.of_triangle(now_m).circle_m, statistics, model.limits)
    wrong = right = 0
    for i in np.flatnonzero(suspected.any(axis=1)).tolist():
        last = None if i % MEMORIES == 0 else LastClean(0, before_m[i])
        who = named_receiver(
            suspected[i],
            statistics.log_likelihood_ratio[i],
            now_m[i],
            model.var.common[0],
            model.var.differential[0],
            last,
            round(float(age_s[i]) * NS_PER_S),
            model.site.integrity,
            model.limits,
        )
        wrong += bool((who & (off == 0.0)).any())
        right += bool((who & (off != 0.0)).any())
    assert n == len(off), "kinds are stated for three receivers"
    return Named(kind, size_m, Share(wrong, trials), Share(right, trials))


def _directions(trials: int, rng: np.random.Generator) -> Floats:
    """Unit vectors (N, 3): every other one horizontal."""
    towards = rng.standard_normal((trials, 3))
    towards[::2, 2] = 0.0
    unit: Floats = towards / np.sqrt((towards**2).sum(axis=1, keepdims=True))
    return unit


def _twice(model: ErrorModel, age_s: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Displacements (N, R, 3) in two epochs `age_s` (N,) apart, m, without a fault."""
    trials, n, promises = len(age_s), model.receivers, model.site.integrity
    a_common = np.exp(-age_s / promises.correlation_common_s)[:, None]
    a_own = np.exp(-age_s / promises.correlation_differential_s)[:, None, None]
    common, own = rng.standard_normal((trials, 3)), rng.standard_normal((trials, n, 3))
    later_common = a_common * common + np.sqrt(1.0 - a_common**2) * rng.standard_normal((trials, 3))
    later_own = a_own * own + np.sqrt(1.0 - a_own**2) * rng.standard_normal((trials, n, 3))
    return model.displacements_m(common, own), model.displacements_m(later_common, later_own)
