"""The station audits its own promise: do the statistics of sound epochs stay as small as the site's sigmas say they do?

Each audited check keeps a ledger. A look is taken at the first epoch at least four correlation times after the last look, and after the
last epoch that was not clean. At each look a bet is placed against the promise, at odds that are fair if the promise holds; wealth that
grows a thousandfold and more is evidence against it that holds at any time, however long the station has been looking.

The bets. Of a chi-square statistic T with k degrees of freedom (common, shape, a circle's square over its variance), whose components
forget as a Gauss-Markov process does, a = exp(-dt / tau) since the look before, where it was T':

    factor = exp(c T) / M,   M = (1 - 2 c s)^(-k/2) exp(a^2 T' c / (1 - 2 c s)),   s = 1 - a^2,   c = (1 - 1/v) / 2.

M is the mean of exp(c T) given T' (moment generating function of s times a noncentral chi-square with noncentrality a^2 T' / s), so that
the mean factor is 1 whatever was seen before: no independence is assumed. Smaller errors than promised only make it smaller, since the
factor grows with T. It is the likelihood ratio against errors whose variance is v times the promised one. Of the largest of m normal
values (residuals, B-values) the bet is that it exceeds a level: with P(exceeds) <= p given the past, by the union bound with every value
as large as the largest was at the look before, factor q / p where it exceeds, (1 - q) / (1 - p) where not, q > p.

Wealth. Sigmas can become too small any day: wealth is a mixture over the look n from which on it is bet, with weight 1 / (n (n + 1)),
    S <- (S + 1 / (n (n + 1))) factor,
and over three alternatives in equal parts. Its mean under the promise never exceeds 1, so by Ville's inequality it ever reaches N / alpha
with a probability of at most alpha / N, and any of N ledgers does with at most alpha = 1e-3.

What this rests on. Errors forget at least as fast as the site says: four correlation times leave a correlation of 0.02, and where the
true one is twice as long 0.14. A look that falls on an epoch that is not clean is not taken, which can only lower the mean. No fault that
the checks do not see is at work: to this audit it looks like sigmas that are too small, and the sentence is right to send someone.
Sources: Ville 1939; Shafer, Shen, Vereshchagin, Vovk 2011, Test martingales, Statistical Science 26; Waudby-Smith, Ramdas 2024, Estimating
means of bounded random variables by betting, JRSS B 86; the mixture over starts: Shin, Ramdas, Rinaldo 2024, E-detectors. Choice of
levels, alternatives and spacing: own.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import erfc, exp, inf, isfinite, log, log1p, sqrt
from typing import Literal, NamedTuple

from integrity.config import SiteConfig
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Floats
from integrity.limits import Limits
from integrity.probability import chi2_quantile, gauss_quantile

FALSE_ACCUSATION = 1e-3  # ever, of all ledgers together
SPACING = 4.0  # correlation times between looks
SHOWN_TAIL = 0.05  # of the level whose exceedances are counted for people
VARIANCES = (1.3, 2.0, 5.0)  # v: sigmas too small by 12, 29 and 55 percent
TAILS = ((0.05, 0.10), (0.05, 0.30), (0.002, 0.04))  # (p, q) at independent looks: the same three, roughly

Law = Literal["chi-square", "largest"]


class Audited(NamedTuple):
    """A check whose promise is audited: `column` among the checks; its statistic over `scale`, squared for a `square`, follows `law`, with
    `dof` degrees of freedom, or `dof` normal values for each satellite; `sigmas` are the keys of the site file that promise it."""

    name: str
    column: int
    law: Law
    dof: int
    scale: float
    square: bool
    correlation_s: float
    spacing_ns: int
    threshold: float
    sigmas: str


@dataclass(frozen=True)
class Ledger:
    """Of one audited check. `since_ns`, `look_ns`: first and last look, or the last epoch not clean (0: none yet); `value` of it; counts of
    `looks` and of those above the shown level; log of the wealth of each alternative, and the most that the logarithm of all has been."""

    since_ns: int = 0
    look_ns: int = 0
    value: float = 0.0
    looks: int = 0
    exceeded: int = 0
    log_wealth: tuple[float, ...] = (-inf,) * len(VARIANCES)
    most: float = -inf


@dataclass(frozen=True)
class AuditMemory:
    """A ledger for each audited check, and the GPS time before which nothing is due."""

    ledgers: tuple[Ledger, ...]
    due_ns: int = 0

    @staticmethod
    def empty(audited: Sequence[Audited]) -> "AuditMemory":
        """Before the first look."""
        return AuditMemory((Ledger(),) * len(audited))


def audited_checks(site: SiteConfig, limits: Limits) -> tuple[Audited, ...]:
    """What is audited of a site."""
    promises = site.integrity
    common_s, differential_s = promises.correlation_common_s, promises.correlation_differential_s
    slowest_s = max(common_s, differential_s)
    sigma_circle_m = sqrt(promises.sigma_common_m**2 + promises.sigma_differential_m**2)

    def of(name: str, law: Law, dof: int, correlation_s: float, sigmas: str, scale: float = 1.0, square: bool = False) -> Audited:
        threshold = (limits[name] / scale) ** 2 if square else limits[name]
        spacing_ns = round(SPACING * correlation_s * NS_PER_S)
        return Audited(name, limits.names.index(name), law, dof, scale, square, correlation_s, spacing_ns, threshold, sigmas)

    circles = [f"circle_{receiver}" for receiver in site.receiver_names]
    both = "sigma_common_m, sigma_differential_m"
    return (
        *(of(circle, "chi-square", 2, slowest_s, both, sigma_circle_m, True) for circle in circles),
        of("common", "chi-square", 2, slowest_s, "sigma_common_m"),
        of("common_3d", "chi-square", 3, slowest_s, "sigma_common_up_m"),
        of("shape", "chi-square", 4, differential_s, "sigma_differential_m"),
        of("shape_3d", "chi-square", 6, differential_s, "sigma_differential_up_m"),
        of("residual", "largest", 1, slowest_s, "sigma_range_m, sigma_range_low_m"),
        of("b_value", "largest", len(circles), differential_s, "sigma_range_differential_m, sigma_range_differential_low_m"),
    )


def advance(
    memory: AuditMemory, epoch_ns: int, statistic: Floats, clean: bool, n_satellites: int, audited: Sequence[Audited]
) -> AuditMemory:
    """The memory after an epoch at GPS time `epoch_ns`: statistics of all checks (C,) on `n_satellites`, and whether all of them passed."""
    if clean and epoch_ns < memory.due_ns:
        return memory
    ledgers = tuple(
        _looked(ledger, of, epoch_ns, float(statistic[of.column]), clean, n_satellites)
        for ledger, of in zip(memory.ledgers, audited, strict=True)
    )
    return AuditMemory(ledgers, min(_due_ns(ledger, of) for ledger, of in zip(ledgers, audited, strict=True)))


def _due_ns(ledger: Ledger, of: Audited) -> int:
    return ledger.look_ns + of.spacing_ns if ledger.look_ns else 0


def _looked(ledger: Ledger, of: Audited, epoch_ns: int, statistic: float, clean: bool, n_satellites: int) -> Ledger:
    if clean and epoch_ns < _due_ns(ledger, of):
        return ledger
    value = statistic / of.scale
    value = value * value if of.square else value
    if not clean:  # begin waiting anew, from as large a value as could have passed
        return replace(ledger, look_ns=epoch_ns, value=min(value, of.threshold) if isfinite(value) else of.threshold)
    if not isfinite(value) or n_satellites < 1:
        return ledger
    a = exp((ledger.look_ns - epoch_ns) / NS_PER_S / of.correlation_s) if ledger.look_ns else 0.0
    count = of.dof if of.law == "chi-square" else of.dof * n_satellites
    bets = _chi_square_bets(value, ledger.value, count, a) if of.law == "chi-square" else _largest_bets(value, ledger.value, count, a)
    looks = ledger.looks + 1
    stake = -log(looks * (looks + 1.0))
    log_wealth = tuple(_log_sum(w, stake) + b for w, b in zip(ledger.log_wealth, bets, strict=True))
    together = max(log_wealth) + log(sum(exp(w - max(log_wealth)) for w in log_wealth) / len(log_wealth))
    return Ledger(
        since_ns=ledger.since_ns or epoch_ns,
        look_ns=epoch_ns,
        value=value,
        looks=looks,
        exceeded=ledger.exceeded + (value > _level(of.law, count, SHOWN_TAIL)),
        log_wealth=log_wealth,
        most=max(ledger.most, together),
    )


def _log_sum(a: float, b: float) -> float:
    return max(a, b) + log1p(exp(-abs(a - b)))


@lru_cache(maxsize=1024)
def _level(law: Law, count: int, tail: float) -> float:
    """What a statistic exceeds with at most the probability `tail`."""
    return chi2_quantile(tail, count) if law == "chi-square" else gauss_quantile(tail / (2.0 * count))


def _upper_tail(x: float) -> float:
    return 0.5 * erfc(x / sqrt(2.0))


def _chi_square_bets(T: float, T_before: float, k: int, a: float) -> tuple[float, ...]:
    """Logarithms of the factors, one for each variance."""
    s = 1.0 - a * a

    def bet(v: float) -> float:
        c = 0.5 * (1.0 - 1.0 / v)
        d = 1.0 - 2.0 * c * s
        return c * T + 0.5 * k * log(d) - a * a * T_before * c / d

    return tuple(bet(v) for v in VARIANCES)


def _largest_bets(w: float, w_before: float, m: int, a: float) -> tuple[float, ...]:
    """The same for the largest of m absolute values."""
    s = sqrt(1.0 - a * a)

    def bet(tail: float, alternative: float) -> float:
        level = _level("largest", m, tail)
        given = m * (_upper_tail((level - a * w_before) / s) + _upper_tail((level + a * w_before) / s))
        p = max(tail, given)  # a satellite that was not there at the look before has its share of `tail`
        q = max(alternative, 1.5 * p)
        if q >= 1.0:
            return 0.0  # too much is known of the next look to bet
        return log(q / p) if w > level else log((1.0 - q) / (1.0 - p))

    return tuple(bet(p, q) for p, q in TAILS)


def broken(memory: AuditMemory) -> tuple[bool, ...]:
    """Which promises have been refuted, once and for all; it takes other sigmas, and with them a new memory."""
    limit = log(len(memory.ledgers) / FALSE_ACCUSATION)
    return tuple(ledger.most >= limit for ledger in memory.ledgers)


def accusations(memory: AuditMemory, audited: Sequence[Audited]) -> tuple[str, ...]:
    """A sentence for each promise that is broken."""
    limit = len(memory.ledgers) / FALSE_ACCUSATION
    return tuple(
        f"the promise of {of.sigmas} is broken: {of.name} exceeded its 1 in {1.0 / SHOWN_TAIL:.0f} level {x.exceeded} times in {x.looks} "
        f"looks over {(x.look_ns - x.since_ns) / NS_PER_S / 3600.0:.1f} h, {SHOWN_TAIL * x.looks:.1f} expected (evidence "
        f"{exp(min(x.most, 700.0)):.2g}, limit {limit:.2g}); measure the sigmas again: wayside replay REC.mcap --calibrate OUT.toml"
        for x, of, is_broken in zip(memory.ledgers, audited, broken(memory), strict=True)
        if is_broken
    )
