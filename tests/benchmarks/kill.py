"""Stations killed (kill -9) at random moments: `python -m tests.benchmarks.kill [--times 50]`.

Several stations at a time, each a process of its own, hear the same simulated receivers (10 Hz) over loopback TCP and publish over Zenoh.
Each is killed at a random moment. What a listener received last is then looked for in what `wayside recording recover` saves.
"""

import argparse
import random
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

from integrity.messages import wayside_pb2 as pb
from integrity.messages.key_expressions import HEALTH, site_key
from recordings.link import Arrival, dial_link
from recordings.reader import read_recording
from recordings.replay import complaints, recover
from recordings.simulate.server import ReceiverServer
from tests.e2e.field import SITE_ID, Field, make_field, measured, playing, running_station, until

INTERVAL_S = 0.1
AT_ONCE = 5
EARLIEST_S, LATEST_S = 2.0, 10.0


class Loss(NamedTuple):
    """Of one killed station: what a listener received last, what the recovered recording holds last, and the time between."""

    received: int
    recovered: int
    lost_s: float
    whole: bool


def kill_some(seed: int, n: int) -> list[Loss]:
    """`n` stations at once, each killed at its own moment."""
    rng = random.Random(seed)
    with ExitStack() as stack:
        server = stack.enter_context(ReceiverServer("ABC", "127.0.0.1", 0))
        sources = {r: f"tcp://{host}:{port}" for r, (host, port) in server.addresses.items()}
        fields = []
        for _ in range(n):
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            fields.append(make_field(folder, sources, INTERVAL_S))
        events = measured(fields[0].site, LATEST_S + 5.0, seed)
        stations = [stack.enter_context(running_station(field)) for field in fields]
        heard: list[list[bytes]] = [[] for _ in fields]
        for field, messages in zip(fields, heard, strict=True):
            link = stack.enter_context(dial_link([field.endpoint], lambda: None))

            def take(arrival: Arrival, messages: list[bytes] = messages) -> None:
                messages.append(arrival.data)

            link.subscribe(site_key(SITE_ID, HEALTH), take)
        server.wait_for_clients()
        until(lambda: all("C: connected" in (f.folder / "station.log").read_text() for f in fields), 20.0)
        stack.enter_context(playing(server, events))
        began_s = time.monotonic()
        moments = sorted((rng.uniform(EARLIEST_S, LATEST_S), k) for k in range(n))
        for moment_s, k in moments:
            time.sleep(max(0.0, began_s + moment_s - time.monotonic()))
            stations[k].kill()
        time.sleep(0.3)  # what is on its way arrives
        return [_loss(field, messages) for field, messages in zip(fields, heard, strict=True)]


def _loss(field: Field, messages: list[bytes]) -> Loss:
    last = pb.Health.FromString(pb.SignedHealth.FromString(messages[-1]).health)
    (part,) = field.recordings()
    saved = field.folder / "saved.mcap"
    recover(part, saved)
    contents = read_recording(saved)
    recorded = [entry.message for entry in contents.entries if isinstance(entry.message, pb.Health)]
    end = recorded[-1] if recorded else pb.Health()
    return Loss(last.sequence, end.sequence, (last.issued_mono_ns - end.issued_mono_ns) / 1e9, not complaints(contents))


def main() -> None:
    """Print the losses."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    losses: list[Loss] = []
    while len(losses) < arguments.times:
        losses += kill_some(arguments.seed + len(losses), min(AT_ONCE, arguments.times - len(losses)))
        worst = max(loss.lost_s for loss in losses)
        whole = all(loss.whole for loss in losses)
        print(f"{len(losses)} killed: worst loss {worst:.2f} s (asked 1.5), all recovered whole: {whole}", flush=True)


if __name__ == "__main__":
    main()
