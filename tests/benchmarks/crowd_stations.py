"""Some of the stations of `crowd`, in one process: `python -m tests.benchmarks.crowd_stations FOLDER FIRST END`.

Each has its own link, key and boot, and the publisher of a real station. GNSS epochs fall on the full second, so all of them speak at once.
"""

import gc
import os
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from integrity.messages import wayside_pb2 as pb
from recordings.keys import load_key
from recordings.link import Access, open_link
from recordings.site_file import parse_site
from station.publisher import Publisher
from station.runtime import SWITCH_INTERVAL_S
from tests.benchmarks import air
from tests.benchmarks.crowd_plan import PERIOD_NS, ROUTER, Plan, read_plan
from tests.e2e.field import until
from tests.unit.sites import SITE

CONNECTED_WITHIN_S = 120.0


class Speaker(NamedTuple):
    site: str
    delay_ns: int
    boot_id: bytes
    publisher: Publisher


def health(speaker: Speaker, sequence: int, issued_mono_ns: int) -> pb.Health:
    """Of usual size, for the epoch of that second."""
    message = air.health(sequence, speaker.boot_id, issued_mono_ns)
    message.site, message.gps_time_ns = speaker.site, air.FIRST_NS + sequence * PERIOD_NS
    message.covers_from_gps_ns = message.covers_to_gps_ns = message.gps_time_ns
    return message


def opened(plan: Plan, sites: Sequence[str], stack: ExitStack) -> list[Speaker]:
    """All of them connected, in the order in which they speak."""
    config = parse_site(SITE, "site.toml").config
    speakers, links = [], []
    for site in sites:
        access = Access(site, (ROUTER,)) if plan.secured else None
        link = stack.enter_context(open_link([], [plan.endpoint], plan.tls(site), access))
        boot_id = os.urandom(16)
        publisher = Publisher(link, replace(config, site_id=site), load_key(plan.key_file(site)), boot_id, "wayside benchmark")
        speakers.append(Speaker(site, plan.delay_ns(site), boot_id, publisher))
        links.append(link)
    assert until(lambda: all(link.connected for link in links), CONNECTED_WITHIN_S), "the router did not let every station in"
    return sorted(speakers, key=lambda speaker: speaker.delay_ns)


def speak(plan: Plan, speakers: Sequence[Speaker], base_ns: int) -> npt.NDArray[np.int64]:
    """Every second; how late each message was put, ns, of the messages measured.

    A message is issued when it is due, whether or not this shared process has got round to it: its delay counts as the message's.
    """
    put_late_ns = np.zeros((len(speakers), plan.seconds), np.int64)
    for sequence in range(1, plan.last + 1):
        for k, speaker in enumerate(speakers):
            due_ns = base_ns + sequence * PERIOD_NS + speaker.delay_ns
            time.sleep(max(0, due_ns - time.monotonic_ns()) / 1e9)
            speaker.publisher.health(health(speaker, sequence, due_ns))
            if sequence > plan.settling_s:
                put_late_ns[k, sequence - plan.settling_s - 1] = time.monotonic_ns() - due_ns
        gc.collect()  # as a station does, when nothing is due
    return put_late_ns


def main() -> None:
    """Say `ready`, read when the first second begins, speak, leave in a file what was found; answer challenges until stdin ends."""
    plan, first, end = read_plan(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    with ExitStack() as stack:
        speakers = opened(plan, plan.sites()[first:end], stack)
        print("ready", flush=True)
        base_ns = int(sys.stdin.readline())
        sys.setswitchinterval(SWITCH_INTERVAL_S)
        gc.collect()
        gc.freeze()
        gc.disable()
        np.save(Path(plan.folder) / f"stations-{first}.npy", speak(plan, speakers, base_ns))
        print("found", flush=True)
        sys.stdin.read()


if __name__ == "__main__":
    main()
