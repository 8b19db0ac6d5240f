"""What `crowd` makes of what it measured: figures, and what is not as asked."""

import json
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from tests.benchmarks.crowd_plan import Plan

LATE_MS = 250.0  # asked: no message later
GROWTH_MB = 2.0  # of a process, at most: 40 bytes a message of 50 trains over nine minutes would be more


class Look(NamedTuple):
    """At a process."""

    rss_mb: float
    cpu_s: float
    threads: int


class Watched(NamedTuple):
    """Processes when measuring began, when memory was to be flat from, and at the end; and the machine meanwhile."""

    began: Mapping[str, Look]
    warm: Mapping[str, Look]
    ended: Mapping[str, Look]
    machine: dict[str, Any]


def found_of(plan: Plan, watched: Watched) -> dict[str, Any]:
    """From what the processes have left in the plan's folder."""
    folder = Path(plan.folder)
    shares = [first for first, _ in plan.shares_of_trains()]
    of_trains = [np.load(folder / f"trains-{first}.npz") for first in shares]
    said = [json.loads((folder / f"trains-{first}.json").read_text()) for first in shares]
    put_ns = np.concatenate([np.load(folder / f"stations-{first}.npy") for first, _ in plan.shares_of_stations()])
    came_ns, verified_ns = (np.concatenate([part[name] for part in of_trains]) for name in ("came_ns", "verified_ns"))
    arrived = verified_ns >= 0
    refused: Counter[str] = sum((Counter(part["refused"]) for part in said), Counter())
    return {
        "transport": "TLS with certificates and rights" if plan.secured else "TCP",
        "messages": arrived.size,
        "never_arrived": int((~arrived).sum()),
        "missed": sum(part["missed"] for part in said),
        "dropped": sum(part["dropped"] for part in said),
        "late": int((verified_ns > LATE_MS * 1e6).sum()),
        "late_in_seconds": int((verified_ns > LATE_MS * 1e6).any(axis=(0, 1)).sum()),
        "verified_ms": percentiles_ms(verified_ns[arrived]),
        "of_which_put_ms": percentiles_ms(put_ns),
        "of_which_came_ms": percentiles_ms(came_ns[arrived]),
        "refused": dict(refused),
        "train_seconds_not_normal": int(sum(part["not_normal"].sum() for part in of_trains)),
        "memory_mb": {name: [round(warm.rss_mb, 1), round(watched.ended[name].rss_mb, 1)] for name, warm in watched.warm.items()},
        "threads": {name: [warm.threads, watched.ended[name].threads] for name, warm in watched.warm.items()},
        "cpu": {name: round((look.cpu_s - watched.began[name].cpu_s) / plan.seconds, 3) for name, look in watched.ended.items()},
        "machine": watched.machine,
    }


def percentiles_ms(ns: npt.NDArray[np.int64]) -> dict[str, float]:
    """The middle, the hundredth, the worst."""
    if not ns.size:
        return {}
    return {name: round(float(np.percentile(ns, q)) / 1e6, 2) for name, q in (("p50", 50), ("p99", 99), ("max", 100))}


def complaints(found: Mapping[str, Any]) -> list[str]:
    """What is not as asked, in words."""
    wrong = {
        f"{found['late']} messages, in {found['late_in_seconds']} different seconds, were late by more than {LATE_MS:g} ms": found["late"],
        f"{found['never_arrived']} messages never arrived": found["never_arrived"],
        f"{found['missed']} messages were missed by sequence": found["missed"],
        f"{found['dropped']} messages found a full inbox": found["dropped"],
        f"messages were refused: {found['refused']}": found["refused"],
        f"{found['train_seconds_not_normal']} train-seconds were not NORMAL": found["train_seconds_not_normal"],
    }
    grown = {name: round(end - warm, 1) for name, (warm, end) in found["memory_mb"].items() if not end - warm <= GROWTH_MB}
    return [words for words, count in wrong.items() if count] + [f"memory of {name} grew by {mb} MB" for name, mb in grown.items()]


def in_words(found: Mapping[str, Any]) -> str:
    """For a person."""

    def ms(name: str) -> str:
        return ", ".join(f"{which} {value:g}" for which, value in found[name].items())

    machine = found["machine"]
    woke = machine["a_sleeper_woke_late_ms"]
    lines = [
        f"{found['messages']} messages over {found['transport']}, {found['never_arrived']} never arrived, {found['late']} late",
        f"from due to verified, ms:  {ms('verified_ms')}  (asked: none above {LATE_MS:g})",
        f"  of which to put, ms:     {ms('of_which_put_ms')}",
        f"  of which to arrival, ms: {ms('of_which_came_ms')}",
        f"refused: {found['refused'] or 'none'}; train-seconds not NORMAL: {found['train_seconds_not_normal']}",
    ]
    for name, (warm, end) in found["memory_mb"].items():
        share = 100 * found["cpu"][name]
        lines.append(f"  {name:<12} {share:5.1f} % of a core, {warm:.1f} MB then {end:.1f} MB, {found['threads'][name][1]} threads")
    lines.append(
        f"machine: {machine['cores']} cores, {machine['cores_used_by_us']} used by this, {machine['cores_used_by_others']} by others, "
        f"load {machine['load_1min']}; a thread that only sleeps woke late by p99 {woke['p99']:g} ms, max {woke['max']:g} ms"
    )
    return "\n".join(lines)
