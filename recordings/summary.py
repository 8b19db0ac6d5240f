"""What a replay found, for people and for machines: states, episodes, exclusions, errors per receiver, and a hash of the decisions."""

import csv
import hashlib
import json
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from integrity import SOFTWARE
from integrity.gnss.gps_time import format_utc
from integrity.limits import Limits
from integrity.outputs import EpochReport, HealthReport, Output
from integrity.states import Cause, State
from recordings.site_file import SiteFile


@dataclass(frozen=True)
class Summary:
    """Of the epochs of a window: `reports`, the health published in it, rows not aligned per receiver, time taken."""

    recording: str
    site: SiteFile
    limits: Limits
    reports: Sequence[EpochReport]
    health: Sequence[HealthReport]
    dropped: dict[str, dict[str, int]]
    wall_s: float


def in_window(outputs: Sequence[Output], start_ns: int | None, end_ns: int | None) -> tuple[list[EpochReport], list[HealthReport]]:
    """Reports and health at GPS times from `start_ns` up to `end_ns`, not included; heartbeats by the host's clock of the last epoch."""

    def inside(gps_ns: int | None) -> bool:
        return gps_ns is not None and (start_ns is None or gps_ns >= start_ns) and (end_ns is None or gps_ns < end_ns)

    reports = [o for o in outputs if isinstance(o, EpochReport) and inside(o.gps_time_ns)]
    health = [o for o in outputs if isinstance(o, HealthReport) and (inside(o.gps_time_ns) or (o.gps_time_ns is None and start_ns is None))]
    return reports, health


def decisions_sha256(reports: Sequence[EpochReport]) -> str:
    """SHA-256 of one JSON line per epoch: [gps_time_ns, state, cause, subjects, excluded]; never over floats."""
    digest = hashlib.sha256()
    for r in reports:
        line = json.dumps([r.gps_time_ns, r.state, r.cause, sorted(r.subjects), sorted(r.excluded)], separators=(",", ":"))
        digest.update(line.encode() + b"\n")
    return digest.hexdigest()


def episodes(summary: Summary) -> list[dict[str, Any]]:
    """Stretches of one state, cause and subjects that are not NORMAL, silences included; `end` is when something else was published."""
    by_epoch = {r.gps_time_ns: r for r in summary.reports}
    found: list[dict[str, Any]] = []
    open_key: tuple[object, ...] | None = None
    for h in summary.health:
        report = by_epoch.get(h.gps_time_ns) if h.gps_time_ns is not None else None
        silent = report is None or h.mono_ns != report.mono_ns
        when = _utc_of(h, report)
        key = (h.state, h.cause, h.subjects)
        if key != open_key:
            if open_key is not None and found and found[-1]["end"] is None:
                found[-1]["end"] = when
            open_key = key
            if h.state is not State.NORMAL:
                verdict = None if silent or report is None or report.verdict.state is State.NORMAL else report.verdict
                found.append(
                    {
                        "start": when,
                        "end": None,
                        "state": h.state,
                        "cause": h.cause,
                        "subjects": sorted(h.subjects),
                        "check": verdict.check if verdict else ("silence" if silent else ""),
                        "statistic": _number(verdict.statistic) if verdict else None,
                        "threshold": _number(verdict.threshold) if verdict else None,
                        "reasons": list(h.reasons),
                    }
                )
    if found and found[-1]["end"] is None and summary.health:
        last = summary.health[-1]
        found[-1]["end"] = _utc_of(last, by_epoch.get(last.gps_time_ns or -1))
    return found


def silences(summary: Summary) -> list[tuple[int, int]]:
    """Stretches (from, to) of GPS time in which a stream was silent: from the last epoch before to the first after, or to the last word."""
    epochs = sorted(r.gps_time_ns for r in summary.reports)
    mono_of = {r.gps_time_ns: r.mono_ns for r in summary.reports}
    found: dict[int, int] = {}
    for h in summary.health:
        if h.gps_time_ns is not None and h.mono_ns != mono_of.get(h.gps_time_ns, h.mono_ns):
            later = bisect_right(epochs, h.gps_time_ns)
            end_ns = epochs[later] if later < len(epochs) else h.gps_time_ns + h.mono_ns - mono_of[h.gps_time_ns]
            found[h.gps_time_ns] = end_ns
    return sorted(found.items())


def exclusions(reports: Sequence[EpochReport]) -> list[dict[str, Any]]:
    """Each stay of a satellite on the exclusion list."""
    found: list[dict[str, Any]] = []
    current: dict[str, dict[str, Any]] = {}
    for r in reports:
        listed = {x.satellite: x for x in r.exclusions}
        for satellite in [s for s in current if s not in listed]:
            current.pop(satellite)["end"] = format_utc(r.gps_time_ns)
        for satellite, x in listed.items():
            if satellite not in current:
                current[satellite] = {
                    "satellite": satellite,
                    "start": format_utc(r.gps_time_ns),
                    "end": None,
                    "check": x.check,
                    "statistic": _number(x.statistic),
                    "threshold": _number(x.threshold),
                }
                found.append(current[satellite])
    for entry in current.values():
        entry["end"] = format_utc(reports[-1].gps_time_ns)
    return found


def receivers(reports: Sequence[EpochReport], names: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Epochs, epochs solved, and horizontal and vertical errors of each receiver; None where nothing was solved."""
    e = np.array([r.e_enu_m for r in reports]).reshape(len(reports), len(names), 3)
    result: dict[str, dict[str, Any]] = {}
    for i, name in enumerate(names):
        solved = np.isfinite(e[:, i]).all(axis=1)
        h, v = np.hypot(e[solved, i, 0], e[solved, i, 1]), e[solved, i, 2]
        any_solved = bool(solved.any())
        result[name] = {
            "epochs": len(reports),
            "solved": int(solved.sum()),
            "h_rms_m": _rounded(np.sqrt((h**2).mean())) if any_solved else None,
            "h_p95_m": _rounded(np.percentile(h, 95.0)) if any_solved else None,
            "h_max_m": _rounded(h.max()) if any_solved else None,
            "v_rms_m": _rounded(np.sqrt((v**2).mean())) if any_solved else None,
        }
    return result


def as_json_object(summary: Summary) -> dict[str, Any]:
    """The object that `wayside replay --json` prints."""
    reports, config = summary.reports, summary.site.config
    states = Counter(r.state for r in reports)
    alone = Counter(r.triangle_alone for r in reports)
    return {
        "recording": summary.recording,
        "site": config.site_id,
        "config_sha256": config.config_sha256,
        "software": SOFTWARE,
        "start": format_utc(reports[0].gps_time_ns) if reports else None,
        "end": format_utc(reports[-1].gps_time_ns) if reports else None,
        "epochs": len(reports),
        "wall_s": round(summary.wall_s, 3),
        "alignment": {name: {"dropped": sum(counts.values()), "reasons": counts} for name, counts in summary.dropped.items()},
        "states": {state: states[state] for state in State},
        "episodes": episodes(summary),
        "exclusions": exclusions(reports),
        "triangle_alone": {state: alone[state] for state in State},
        "receivers": receivers(reports, config.receiver_names),
        "decisions_sha256": decisions_sha256(reports),
    }


def alerted(summary: Summary) -> bool:
    """Whether anything but NORMAL was published after start-up; also when start-up never ended."""
    after_start = [h for h in summary.health if h.cause is not Cause.NOT_READY]
    return not after_start or any(h.state is not State.NORMAL for h in after_start)


def write_epochs_csv(path: Path, reports: Sequence[EpochReport], names: Sequence[str]) -> None:
    """One row per epoch: decision, positions, and every check's statistic and threshold; empty where there is no number."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        checks = reports[0].check_names if reports else ()
        receiver_columns = [f"{name}_{suffix}" for name in names for suffix in ("e_m", "n_m", "u_m", "sats")]
        check_columns = [column for check in checks for column in (check, f"{check}_threshold")]
        head = ["gps_time_ns", "utc", "state", "cause", "subjects", "excluded", "triangle_alone"]
        writer.writerow([*head, *receiver_columns, *check_columns])
        writer.writerows(_csv_rows(reports))


def _csv_rows(reports: Sequence[EpochReport]) -> Iterator[list[object]]:
    for r in reports:
        positions: list[object] = []
        for e_enu_m, satellites in zip(r.e_enu_m.tolist(), r.satellites_used.tolist(), strict=True):
            positions += [*("" if v != v else f"{v:.3f}" for v in e_enu_m), satellites]
        checks: list[object] = []
        for statistic, threshold in zip(r.statistic.tolist(), r.threshold.tolist(), strict=True):
            checks += ["" if statistic != statistic else f"{statistic:.6g}", f"{threshold:.6g}"]
        yield [
            r.gps_time_ns,
            format_utc(r.gps_time_ns),
            r.state,
            r.cause,
            " ".join(sorted(r.subjects)),
            " ".join(r.excluded),
            r.triangle_alone,
            *positions,
            *checks,
        ]


def _utc_of(health: HealthReport, report: EpochReport | None) -> str | None:
    """Time of a publication: of its epoch, or, for a heartbeat, of the epoch before plus the silence since; None before the first."""
    if health.gps_time_ns is None:
        return None
    silence_ns = 0 if report is None else health.mono_ns - report.mono_ns
    return format_utc(health.gps_time_ns + silence_ns)


def _number(value: float) -> float | None:
    return float(f"{value:.6g}") if np.isfinite(value) else None


def _rounded(value: float) -> float:
    return round(float(value), 3)
