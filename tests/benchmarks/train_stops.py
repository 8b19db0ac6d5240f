"""The station dies, or freezes, at random moments: `python -m tests.benchmarks.train_stops [--moments 30] [--json]`.

Station and train are processes of their own, fed at 10 Hz by simulated receivers. SIGKILL and SIGSTOP take turns. Measured is the time
from the last epoch that the train could know to be covered (the station's stamp of the last NORMAL message; one monotonic clock serves
all processes of a machine) to the moment at which the train trusts no more, by its own words.
"""

import argparse
import json
import random
import signal
import tempfile
import time
from pathlib import Path
from typing import Any

from integrity.messages import wayside_pb2 as pb
from integrity.messages.key_expressions import HEALTH, site_key
from recordings.link import Arrival, dial_link
from recordings.simulate.server import ReceiverServer
from tests.e2e.field import SITE_ID, make_field, playing, running_station
from tests.e2e.train_field import ANTENNAS, both_measured, make_train, running_train, urls

VALID_FOR_MS = 3000
ALLOWED_MS = 100
ONE_MOMENT_S = 16.0  # of data: start, recovery, a moment, the end of validity
SIGNALS = (signal.SIGKILL, signal.SIGSTOP)


class Normals:
    """Stamps of NORMAL messages as they come."""

    def __init__(self) -> None:
        self.last_issued_ns = 0

    def take(self, arrival: Arrival) -> None:
        health = pb.Health.FromString(pb.SignedHealth.FromString(arrival.data).health)
        if health.state == pb.NORMAL:
            self.last_issued_ns = health.issued_mono_ns


def measure(moments: int, seed: int) -> dict[str, Any]:
    """Run it all once."""
    rng = random.Random(seed)
    with tempfile.TemporaryDirectory() as folder, ReceiverServer((*"ABC", *ANTENNAS), "127.0.0.1", 0) as server:
        sources = urls(server)
        place = make_field(Path(folder), {name: sources[name] for name in "ABC"}, 0.1)
        train_file = make_train(place, sources)
        events = both_measured(place.site_file, moments * ONE_MOMENT_S + 30.0)
        with playing(server, events), running_train(train_file) as train:
            found = [_one(place, train, SIGNALS[moment % 2], rng.uniform(0.0, 1.0)) for moment in range(moments)]
    late = [f["stopped_after_ms"] for f in found]
    return {"moments": found, "worst_ms": max(late), "allowed_ms": VALID_FOR_MS + ALLOWED_MS}


def _one(place: Any, train: Any, how: signal.Signals, after_s: float) -> dict[str, Any]:
    normals = Normals()
    with running_station(place) as station:
        train.until(lambda p: p["trust"] == "TRUST_NORMAL", 20.0)
        with dial_link([place.endpoint], lambda: None) as link:
            link.subscribe(site_key(SITE_ID, HEALTH), normals.take)
            time.sleep(0.5 + after_s)
            began = len(train.positions)
            station.send_signal(how)
            time.sleep(0.2)  # what was on its way has arrived
        untrusted = train.until(lambda p: p["trust"] != "TRUST_NORMAL", 10.0)
        assert train.positions[began:], "the train says nothing"
    return {"signal": how.name, "stopped_after_ms": round((int(untrusted["mono_ns"]) - normals.last_issued_ns) / 1e6, 1)}


def main() -> None:
    """Print what was measured, against what was asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--moments", type=int, default=30)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    found = measure(arguments.moments, arguments.seed)
    if arguments.json:
        print(json.dumps(found, indent=2))
        return
    times = sorted(f["stopped_after_ms"] for f in found["moments"])
    print(
        f"{len(times)} moments: trust ended {times[0]:.0f} to {times[-1]:.0f} ms after the last epoch covered (asked {found['allowed_ms']})"
    )


if __name__ == "__main__":
    main()
