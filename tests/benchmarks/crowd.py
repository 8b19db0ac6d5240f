"""Many stations and trains through one router: `python -m tests.benchmarks.crowd [--stations 100] [--trains 300] [--seconds 600] [--json]`.

Each train follows two stations, so each station is heard by six. One router process with the shipped configuration (TLS, certificates and
rights, unless `--plain`); stations and trains each with a link of their own, some of them to a process. Every station speaks right after
each full second, as GNSS epochs fall; every train challenges both of its stations every second. All on one machine, whose monotonic clock
is everybody's; Zenoh has one thread to read and one to write in each process, which are many for its cores. A message's delay runs from
when it was due at the station until a train has verified it.

Exit code 1 if a message was late, lost or refused, if trust was lost, or if memory grew.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from tests.benchmarks.crowd_figures import Look, Watched, complaints, found_of, in_words, percentiles_ms
from tests.benchmarks.crowd_plan import FOLLOWED, PERIOD_NS, Plan, make_keys
from tests.e2e.field import REPOSITORY, free_port

FLAT_AFTER_S = 60  # memory is compared from here on
BEGIN_IN_NS = 2 * PERIOD_NS
LOOK_EVERY_S = 0.02
FEW_THREADS = "(rx: (worker_threads: 1), tx: (worker_threads: 1))"  # of Zenoh, in each of nine processes on one machine


@contextmanager
def _process(module: str, *arguments: object) -> Iterator["subprocess.Popen[str]"]:
    command = [sys.executable, "-m", f"tests.benchmarks.{module}", *map(str, arguments)]
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "ZENOH_RUNTIME": FEW_THREADS}
    with subprocess.Popen(command, cwd=REPOSITORY, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def _hear(process: "subprocess.Popen[str]", word: str) -> None:
    assert process.stdout
    line = process.stdout.readline()
    assert line == f"{word}\n", f"{process.args!r} ended before it was {word}"


def measure(plan: Plan) -> dict[str, Any]:
    """Everything once, in the plan's folder."""
    make_keys(Path(plan.folder), plan)
    plan.write()
    with ExitStack() as stack:
        processes = {"router": stack.enter_context(_process("crowd_router", plan.folder))}
        _hear(processes["router"], "ready")
        for kind, shares in (("stations", plan.shares_of_stations()), ("trains", plan.shares_of_trains())):
            for first, end in shares:
                processes[f"{kind} {first}"] = stack.enter_context(_process(f"crowd_{kind}", plan.folder, first, end))
        talking = {name: process for name, process in processes.items() if name != "router"}
        for process in talking.values():
            _hear(process, "ready")
        base_ns = time.monotonic_ns() + BEGIN_IN_NS
        for process in talking.values():
            assert process.stdin
            process.stdin.write(f"{base_ns}\n")
            process.stdin.flush()
        watched = _watch({name: psutil.Process(process.pid) for name, process in processes.items()}, plan, base_ns)
        for process in talking.values():
            _hear(process, "found")
    return found_of(plan, watched)


def _watch(processes: Mapping[str, psutil.Process], plan: Plan, base_ns: int) -> Watched:
    """Until the last message is due. Meanwhile this thread does what a train's does, sleep and wake: how late the machine lets it."""
    began_ns = base_ns + (plan.settling_s + 1) * PERIOD_NS
    warm_ns = began_ns + min(FLAT_AFTER_S * PERIOD_NS, plan.seconds * PERIOD_NS // 2)
    looks: list[dict[str, Look]] = []
    overslept_ns: list[int] = []
    loads: list[float] = []
    busy_s = 0.0
    for until_ns in (began_ns, warm_ns, base_ns + (plan.last + 1) * PERIOD_NS):
        while (now_ns := time.monotonic_ns()) < until_ns:
            time.sleep(LOOK_EVERY_S)
            if looks:
                overslept_ns.append(time.monotonic_ns() - now_ns - round(LOOK_EVERY_S * 1e9))
        looks.append({name: _look(process) for name, process in processes.items()})
        loads.append(os.getloadavg()[0])
        busy_s = _busy_s() - busy_s if len(looks) in (1, 3) else busy_s
    ours_s = sum(looks[2][name].cpu_s - looks[0][name].cpu_s for name in processes)
    machine = {
        "cores": os.cpu_count(),
        "load_1min": [round(load, 1) for load in loads],
        "cores_used_by_us": round(ours_s / plan.seconds, 2),
        "cores_used_by_others": round((busy_s - ours_s) / plan.seconds, 2),
        "a_sleeper_woke_late_ms": percentiles_ms(np.array(overslept_ns)),
    }
    return Watched(looks[0], looks[1], looks[2], machine)


def _look(process: psutil.Process) -> Look:
    with process.oneshot():
        times = process.cpu_times()
        return Look(process.memory_info().rss / 1e6, times.user + times.system, process.num_threads())


def _busy_s() -> float:
    times = psutil.cpu_times()
    return float(sum(times[:8]) - times.idle - times.iowait)


def main() -> None:
    """Print what was measured, against what was asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--stations", type=int, default=100)
    parser.add_argument("--trains", type=int, default=300)
    parser.add_argument("--seconds", type=int, default=600, help="measured, after those in which trust rises")
    parser.add_argument("--settling", type=int, default=20, help="seconds in which trust rises")
    parser.add_argument("--spread-ms", type=float, default=50.0, help="all stations speak within so long after the full second")
    parser.add_argument("--starts-within-ms", type=float, default=1000.0, help="trains start when they like; 0: all challenge at once")
    parser.add_argument("--plain", action="store_true", help="TCP, without certificates and rights")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    if arguments.stations <= FOLLOWED:
        parser.error(f"--stations {arguments.stations}: expected more than the {FOLLOWED} that each train follows")
    with tempfile.TemporaryDirectory() as folder:
        endpoint = f"{'tcp' if arguments.plain else 'tls'}/127.0.0.1:{free_port()}"
        plan = Plan(
            folder=folder,
            endpoint=endpoint,
            stations=arguments.stations,
            trains=arguments.trains,
            settling_s=arguments.settling,
            seconds=arguments.seconds,
            spread_ms=arguments.spread_ms,
            starts_within_ms=arguments.starts_within_ms,
            recover_messages=10,
        )
        found = measure(plan)
    wrong = complaints(found)
    print(json.dumps(found | {"complaints": wrong}, indent=2) if arguments.json else "\n".join([in_words(found), *wrong]))
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
