"""One live epoch of three receivers, from their bytes to the decision, in process: `python -m tests.benchmarks.epoch [--epochs 3000]`.

Three simulated receivers at 10 Hz as UBX, each epoch fed as it would come. `ahead` has the geometry of the next epoch computed between
epochs, as the station does while it waits; `alone` computes it with the epoch. `with_words` are the epochs whose bytes bring navigation
messages too (a receiver sends them when they end, which here is with an epoch). The processor is warm: a paced station, whose caches cool
down between epochs, takes two to three times as long (`tests.benchmarks.live`).

Garbage is collected as in `station.runtime`: after every epoch, before it looks ahead, and never within one. `floor` is what the machine
itself makes of a piece of work that is always the same, a loop that does nothing for about as long, timed in turns with the epochs.
"""

import argparse
import gc
import json
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from integrity.events import Event, RawBytes, Tick
from integrity.outputs import HealthReport
from integrity.states import State
from integrity.station_monitor import StationMonitor
from tests.e2e.field import make_field, measured

SETTLING = 100  # epochs: start-up is another matter
SOURCES = {"A": "tcp://127.0.0.1:2001", "B": "tcp://127.0.0.1:2002", "C": "tcp://127.0.0.1:2003"}
INTERVAL_S = 0.1
WORDS = b"\xb5\x62\x02\x13"  # RXM-SFRBX
TURNS = 20_000  # of the idle loop


def run(epochs: int, ahead: bool) -> dict[str, Any]:
    """Milliseconds per epoch of one stream."""
    with tempfile.TemporaryDirectory() as folder:
        site = make_field(Path(folder), SOURCES, INTERVAL_S).site
    events = measured(site, epochs * INTERVAL_S)
    monitor = StationMonitor(site.config)
    spent_ms: dict[bool, list[float]] = {False: [], True: []}  # by whether words came
    idle_ms: list[float] = []
    normal = 0
    pending: list[Event] = []
    gc.collect()
    gc.freeze()
    gc.disable()
    for event in events:
        pending.append(event)
        if not isinstance(event, Tick):
            continue
        with_words = any(isinstance(e, RawBytes) and WORDS in e.data for e in pending)
        began = time.perf_counter()
        outputs = monitor.feed(pending)
        spent_ms[with_words].append(1e3 * (time.perf_counter() - began))
        normal += sum(isinstance(o, HealthReport) and o.state is State.NORMAL for o in outputs)
        pending = []
        idle_ms.append(_idle_ms())
        gc.collect()
        if ahead:
            monitor.look_ahead()
    gc.enable()
    gc.unfreeze()
    plain, worded = spent_ms[False][SETTLING:], spent_ms[True][SETTLING // 4 :]
    return {"normal": normal, **_percentiles(plain), "with_words": _percentiles(worded), "floor": _percentiles(idle_ms[SETTLING:])}


def _idle_ms() -> float:
    began = time.perf_counter()
    for _ in range(TURNS):
        pass
    return 1e3 * (time.perf_counter() - began)


def _percentiles(spent_ms: list[float]) -> dict[str, Any]:
    p50_ms, p99_ms = np.percentile(spent_ms, [50.0, 99.0])
    return {"epochs": len(spent_ms), "p50_ms": round(float(p50_ms), 3), "p99_ms": round(float(p99_ms), 3)}


def main() -> None:
    """Print both as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--epochs", type=int, default=3000)
    epochs = parser.parse_args().epochs
    print(json.dumps({"ahead": run(epochs, True), "alone": run(epochs, False)}, indent=2))


if __name__ == "__main__":
    main()
