"""What all monitors cost beside the positioning itself: `python -m tests.benchmarks.monitors [--json]`.

Three simulated receivers, decoded beforehand: a live epoch (blocks of one, 10 Hz), and a replay (blocks of 1,024, 1 Hz). Positioning is
satellite states, the block and its residuals (`observe`), and design and solution of positions; monitors are all the rest of steps 2 to 4
of the main path, whatever of it was computed ahead included, with what receivers' clocks and the audit make of it. The self test, once a
minute, is told apart. Medians of live epochs; means of a replay.
"""

import argparse
import gc
import json
import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

import integrity.checks
import integrity.deciding
import integrity.station_monitor
from integrity.events import Tick
from integrity.gnss.gps_time import parse_utc
from integrity.station_monitor import StationMonitor
from recordings.simulate.observations import simulate
from recordings.simulate.scenario import load_scenario
from tests.golden.test_sample import SCENARIO

START_NS = parse_utc("2026-03-02T03:00:00Z")
SETTLING = 300  # epochs: filters warm up
POSITIONING = (
    (integrity.deciding, "observe"),
    (integrity.checks, "design"),
    (integrity.checks, "solution"),
    (integrity.checks, "relinearised"),
)
SELF_TEST = "silent_families"
SPENT_S: dict[str, float] = defaultdict(float)  # by function, since it was emptied


def timed(module: Any, name: str) -> None:
    """Count the time that a function takes; what the self test calls counts as self test alone."""
    function: Callable[..., Any] = getattr(module, name)

    def counting(*args: Any, **named: Any) -> Any:
        before, began = dict(SPENT_S), time.perf_counter()
        try:
            return function(*args, **named)
        finally:
            spent_s = time.perf_counter() - began
            if name == SELF_TEST:
                SPENT_S.clear()
                SPENT_S.update(before)
            SPENT_S[name] += spent_s

    setattr(module, name, counting)


def shares_ms() -> tuple[float, float, float]:
    """Positioning, monitors, self test, ms since `SPENT_S` was emptied; it is emptied."""
    positioning = sum(SPENT_S[name] for _, name in POSITIONING)
    found = positioning, SPENT_S["decide"] - positioning + SPENT_S["_remarks"], SPENT_S[SELF_TEST]
    SPENT_S.clear()
    return found[0] * 1e3, found[1] * 1e3, found[2] * 1e3


def a_site(interval_s: float) -> Any:
    """The sample's site at another rate."""
    return replace(load_scenario(SCENARIO).site.config, epoch_interval_ns=round(interval_s * 1e9))


def live(seconds: float) -> dict[str, float]:
    """Of an epoch, ms."""
    monitor, pending = StationMonitor(a_site(0.1)), []
    found: list[tuple[float, float, float]] = []
    for event in simulate(a_site(0.1), START_NS, seconds, 10.0, 1):
        pending.append(event)
        if isinstance(event, Tick):
            monitor.feed(pending)
            monitor.test_itself()
            found.append(shares_ms())
            pending = []
            gc.collect(0)
    of_all = np.array(found[SETTLING:])
    positioning, monitors, _ = np.median(of_all, axis=0)
    return {"positioning_ms": positioning, "monitors_ms": monitors, "self_test_ms": float(np.median(of_all[of_all[:, 2] > 0.0, 2]))}


def replay(seconds: float) -> dict[str, float]:
    """Of an epoch, ms."""
    events = simulate(a_site(1.0), START_NS, seconds, 1.0, 1)
    monitor = StationMonitor(a_site(1.0))
    shares_ms()
    monitor.feed(events)
    positioning, monitors, self_test = (spent / seconds for spent in shares_ms())
    return {"positioning_ms": positioning, "monitors_ms": monitors, "self_test_ms": self_test}


def main() -> None:
    """Both, on one line each."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--json", action="store_true")
    as_json = options.parse_args().json
    for module, name in (*POSITIONING, (integrity.station_monitor, "decide"), (integrity.station_monitor, SELF_TEST)):
        timed(module, name)
    timed(StationMonitor, "_remarks")
    gc.collect()
    gc.freeze()
    gc.disable()
    found = {"live": live(150.0), "replay": replay(4096.0)}
    if as_json:
        print(json.dumps({kind: {name: round(ms, 4) for name, ms in of.items()} for kind, of in found.items()}, indent=2))
        return
    for kind, of in found.items():
        us = {name: 1e3 * ms for name, ms in of.items()}
        print(f"{kind}: monitors {us['monitors_ms']:.0f} us an epoch, positioning {us['positioning_ms']:.0f} us; ", end="")
        print(f"self test {us['self_test_ms']:.0f} us {'a minute' if kind == 'live' else 'an epoch'}")
    print("asked: live, monitors at most 1,000 us; replay, monitors at most as much as positioning")


if __name__ == "__main__":
    main()
