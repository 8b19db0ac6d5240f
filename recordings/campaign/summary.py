"""What trials amount to, size by size, as one JSON object."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from integrity import SOFTWARE
from integrity.errors import ConfigError
from integrity.limits import derive
from integrity.states import Cause
from integrity.triangle import reference_triangle
from recordings.campaign.campaign import Plan, Played, stage_from, tolerance_m
from recordings.campaign.catalogue import CATALOGUE
from recordings.campaign.tally import Share, bounded
from recordings.campaign.theory import explain_theory
from recordings.campaign.threat import Threat


def as_json_object(played: Sequence[Played], plan: Plan) -> dict[str, Any]:
    """The campaign: its plan, every threat, and the sums over all of them. The radius is that of the smallest circles of all sites."""
    sites = [stage_from(source).site for source in plan.sources]
    radius_m = min(derive(site, reference_triangle(site)).radius_m for site in sites)
    threats = {threat.id: threat for threat in CATALOGUE}
    by_threat: dict[str, list[Played]] = {}
    for one in played:
        by_threat.setdefault(one.threat, []).append(one)
    return {
        "software": SOFTWARE,
        "sites": sorted({site.site_id for site in sites}),
        "seed": plan.seed,
        "stages": [stage_from(source).name for source in plan.sources],
        "trials": len(played),
        "radius_m": round(radius_m, 2),
        "tolerance_m": round(min(map(tolerance_m, sites)), 2),
        "named_wrongly": bounded(Share(sum(bool(one.named_wrongly) for one in played), len(played))),
        "hazards": bounded(Share(sum(one.trial.hazard for one in played), len(played))),
        "threats": [_of_threat(threats[name], found, radius_m) for name, found in sorted(by_threat.items(), key=lambda x: _place(x[0]))],
    }


def _place(name: str) -> int:
    return next(i for i, threat in enumerate(CATALOGUE) if threat.id == name)


def _of_threat(threat: Threat, played: Sequence[Played], radius_m: float) -> dict[str, Any]:
    return {
        "id": threat.id,
        "title": threat.title,
        "unit": threat.unit,
        "kind": "harmless" if not threat.causes else "abrupt" if threat.abrupt else "slow",
        "duration_s": threat.duration_s,
        "shift_within_radius": bounded(Share(sum(_moved_m(threat, one) <= radius_m for one in played), len(played))),
        "sizes": [_of_size(threat, size, [one for one in played if one.size == size]) for size in threat.sizes],
    }


def _of_size(threat: Threat, size: float, played: Sequence[Played]) -> dict[str, Any]:
    told = [one for one in played if one.trial.detected_s is not None]
    n = len(played)
    return {
        "size": size,
        "trials": n,
        "detected": bounded(Share(len(told), n)),
        "in_first_epoch": bounded(Share(sum(one.trial.detected_s == 0.0 for one in told), n)),
        "triangle_alone": bounded(Share(sum(one.trial.triangle_detected_s is not None for one in played), n)),
        "right_cause": bounded(Share(sum(one.trial.cause in threat.causes[:1] for one in told), len(told))),
        "safe_cause": bounded(Share(sum(one.trial.cause in threat.causes for one in told), len(told))),
        "causes": {cause.value: count for cause, count in _counted(one.trial.cause for one in told)},
        "named_wrongly": sum(bool(one.named_wrongly) for one in played),
        "time_to_alert_s": _quantiles([one.trial.detected_s for one in told if one.trial.detected_s is not None]),
        "shift_m": _quantiles([_moved_m(threat, one) for one in played]),
        "hazards": sum(one.trial.hazard for one in played),
    }


def _moved_m(threat: Threat, one: Played) -> float:
    """How far the fault moved a receiver: a slow one up to the alert, a whole one before it, for what it does at once is told at once."""
    return one.trial.shift_m if threat.abrupt else one.trial.shift_at_alert_m


def took(found: Mapping[str, Any]) -> str:
    """How long a campaign took, and on what."""
    return f"{found['wall_s']:g} s on {found['machine']}"


def _counted(causes: Iterable[Cause]) -> list[tuple[Cause, int]]:
    counts: dict[Cause, int] = {}
    for cause in causes:
        counts[cause] = counts.get(cause, 0) + 1
    return sorted(counts.items(), key=lambda of: (-of[1], of[0]))


def _quantiles(values: Sequence[float]) -> dict[str, float] | None:
    if not values:
        return None
    p50, p95 = np.percentile(values, [50.0, 95.0])
    return {"p50": round(float(p50), 2), "p95": round(float(p95), 2), "max": round(max(values), 2)}


def refuse_unknown(threats: Iterable[str]) -> None:
    """ConfigError for a threat that the catalogue does not have."""
    known = [threat.id for threat in CATALOGUE]
    for name in threats:
        if name not in known:
            raise ConfigError(f"--threat {name}: no such threat: expected one of {', '.join(known)}")


def explain(found: Mapping[str, Any]) -> str:
    """The same for people: a line a threat and size."""
    head = ("threat", "size", "", "trials", "caught", "at once", "alert p95", "moved p95", "triangle", "wrong")
    lines = ["{:<14}{:>12} {:<14}{:>7}{:>8}{:>8}{:>10}{:>10}{:>9}{:>6}  causes".format(*head)]
    for threat in found["threats"]:
        for of in threat["sizes"]:
            alert = "" if of["time_to_alert_s"] is None else f"{of['time_to_alert_s']['p95']:g} s"
            moved = "" if of["shift_m"] is None else f"{of['shift_m']['p95']:.1f} m"
            lines.append(
                f"{threat['id']:<14}{of['size']:>12g} {threat['unit']:<14}{of['trials']:>7}{_percent(of['detected']):>8}"
                f"{_percent(of['in_first_epoch']):>8}{alert:>10}{moved:>10}"
                f"{_percent(of['triangle_alone']):>9}{of['named_wrongly']:>6}  {', '.join(of['causes'])}"
            )
    wrong, hazards = found["named_wrongly"], found["hazards"]
    lines.append(f"named wrongly in {wrong['count']} of {wrong['of']} trials (at most {100 * wrong['at_most']:.2g} % at 95 % confidence)")
    lines.append(f"NORMAL beyond {found['tolerance_m']:g} m in {hazards['count']} (at most {100 * hazards['at_most']:.2g} %)")
    lines += [
        f"{threat['id']}: moved a position by more than the radius of {found['radius_m']:g} m up to the alert in "
        f"{share['of'] - share['count']} of {share['of']} trials"
        for threat in found["threats"]
        if (share := threat["shift_within_radius"])["count"] < share["of"]
    ]
    return "\n".join([*lines, *(explain_theory(found["theory"]) if "theory" in found else ())])


def _percent(share: Mapping[str, Any]) -> str:
    return f"{100 * share['count'] / share['of']:.0f} %" if share["of"] else ""
