"""The station is lost at random moments: `python -m tests.benchmarks.train_stops [--moments 1000] [--fields 5] [--seed 1] [--json]`.

Asked: trust ends no later than `valid_for_ms` after the last epoch covered, plus 100 ms. A SIGKILL of the station, a SIGSTOP, and a cut of
the path between both take turns; of the cuts, every other one loses what is under way, and the others let it stand. Several fields
(station, train and their simulated receivers at 10 Hz, all on loopback) run side by side. A field lives for some moments, then the next one
begins.

Measured, on the one monotonic clock that serves all processes of a machine: from when validity began by the contract, which is
`issued_mono_ns` of a Health, to when a process that reads the train's positions has read that trust is over. It counts from the last NORMAL
that was issued before the loss, whoever heard it, and where the train held an earlier one, from that. So it includes how late the train's
thread was, its pipe and the reader; `own_ms` beside it is by the train's own stamp. `epoch_ms` counts from the first receiver's sending.

On a machine that others keep busy the train waits for a processor like anybody: how long, the system tells, and it stands beside each
moment. `--train-nice -5` gives train and reader the rank of a service of their own, as the station's unit has it.

Moments are uniform over one validity and one epoch after trust came, drawn by the seed. Where trust is away at that moment there is nothing
to be lost: it is put off, and counted. A field that fails is an error with its reason; its moments that are left are missing, and nothing
is tried again. Exit code 1 where a moment lies beyond the bound, is missing, or ended otherwise than by the end of validity.
"""

import argparse
import json
import os
import random
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from threading import Semaphore
from typing import NamedTuple, TypedDict

import numpy as np

from integrity.errors import ConfigError, LinkError
from integrity.events import Event
from recordings.campaign.tally import Share
from tests.benchmarks.stops_field import INTERVAL_S, VALID_FOR_MS, FieldFailed, Moment, Way, losing_field
from tests.e2e.field import make_field
from tests.e2e.train_field import both_measured

ALLOWED_MS = 100
ENDED_BY_ITSELF = "TRUST_STALE"
MOMENTS_A_FIELD = 20
START_S, ONE_MOMENT_S = 45.0, 11.0  # of data, at most
TURNS = (Way.KILL, Way.STOP, Way.CUT_STANDING, Way.KILL, Way.STOP, Way.CUT_LOSING)


class Life(NamedTuple):
    """Of one field: the moments that were measured, those that were not because trust was away just then, and an error, or ""."""

    moments: list[Moment]
    postponed: int
    error: str


class Found(TypedDict):
    """All of it; times in ms. `worst_unhindered_ms`: less what train and reader then waited for a processor.

    `beyond_at_most`: the share of moments beyond the bound, one-sided with 95 % (Clopper and Pearson 1934).
    """

    asked: int
    measured: int
    by_way: dict[str, int]
    allowed_ms: float
    beyond: int
    beyond_at_most: float
    ended_otherwise: int
    postponed: int
    earliest_ms: float
    median_ms: float
    p999_ms: float
    worst_ms: float
    worst_own_ms: float
    worst_from_epoch_ms: float
    worst_unhindered_ms: float
    errors: list[str]
    moments: list[Moment]


def measure(moments: int, fields: int, seed: int, train_nice: int = 0) -> Found:
    """So many moments, with so many fields at a time."""
    ways = [TURNS[k % len(TURNS)] for k in range(moments)]
    lives = max(fields, -(-moments // MOMENTS_A_FIELD))
    shares = [ways[moments * k // lives : moments * (k + 1) // lives] for k in range(lives)]
    events = _events(START_S + ONE_MOMENT_S * max(map(len, shares)))
    starting = Semaphore(os.cpu_count() or 1)  # a start takes a core for a second: all at once would hold up those that run
    with ThreadPoolExecutor(fields) as pool:
        found = list(pool.map(partial(_live, seed, train_nice, events, starting), range(lives), shares))
    return summary(moments, found)


def _events(seconds: float) -> Sequence[Event]:
    """What the receivers send, the same in all fields."""
    with tempfile.TemporaryDirectory() as folder:
        anywhere = make_field(Path(folder), {name: f"tcp://127.0.0.1:{port}" for port, name in enumerate("ABC", 1)}, INTERVAL_S)
        return both_measured(anywhere.site_file, seconds)


def _live(seed: int, train_nice: int, events: Iterable[Event], starting: Semaphore, number: int, ways: Sequence[Way]) -> Life:
    """One field from its start to its end."""
    rng = random.Random(f"{seed} {number}")
    moments: list[Moment] = []
    postponed = 0
    try:
        with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
            with starting:
                field = stack.enter_context(losing_field(Path(folder), events, train_nice))
                field.trusts()
            for way in ways:
                moments.append(field.lose(way, rng))
                postponed = field.postponed
                sys.stderr.write(f"field {number}: {json.dumps(moments[-1])}\n")
    except (FieldFailed, ConfigError, LinkError, OSError) as failure:
        return Life(moments, postponed, f"field {number}, moment {len(moments)} of {len(ways)}: {failure}")
    return Life(moments, postponed, "")


def summary(asked: int, lives: Sequence[Life]) -> Found:
    """The worst, and how often."""
    moments = [moment for life in lives for moment in life.moments]
    heard_ms = np.array([moment["heard_ms"] for moment in moments] or [np.inf])
    beyond = sum(not moment["heard_ms"] <= VALID_FOR_MS + ALLOWED_MS for moment in moments)
    return {
        "asked": asked,
        "measured": len(moments),
        "by_way": dict(Counter(moment["way"] for moment in moments)),
        "allowed_ms": VALID_FOR_MS + ALLOWED_MS,
        "beyond": beyond,
        "beyond_at_most": Share(beyond, len(moments)).at_most,
        "ended_otherwise": sum(moment["ended_as"] != ENDED_BY_ITSELF for moment in moments),
        "postponed": sum(life.postponed for life in lives),
        "earliest_ms": float(heard_ms.min()),
        "median_ms": float(np.median(heard_ms)),
        "p999_ms": float(np.quantile(heard_ms, 0.999, method="inverted_cdf")),
        "worst_ms": float(heard_ms.max()),
        "worst_own_ms": max((moment["own_ms"] for moment in moments), default=np.inf),
        "worst_from_epoch_ms": max((moment["epoch_ms"] or np.inf for moment in moments), default=np.inf),
        "worst_unhindered_ms": max((moment["heard_ms"] - sum(moment["waited_ms"] or ()) for moment in moments), default=np.inf),
        "errors": [life.error for life in lives if life.error],
        "moments": moments,
    }


def line(found: Found) -> str:
    """For people."""
    ways = ", ".join(f"{count} {way}" for way, count in sorted(found["by_way"].items()))
    return (
        f"{found['measured']} of {found['asked']} moments ({ways}): trust ended {found['earliest_ms']:.0f} to {found['worst_ms']:.1f} ms "
        f"(99.9 %: {found['p999_ms']:.1f}) after the last epoch covered, asked {found['allowed_ms']:.0f}; beyond: {found['beyond']}, "
        f"with 95 % at most {found['beyond_at_most']:.2%} of all; worst by the train's own stamp {found['worst_own_ms']:.1f} ms, "
        f"from the sending of the epoch {found['worst_from_epoch_ms']:.1f} ms, less waits for a processor "
        f"{found['worst_unhindered_ms']:.1f} ms; ended otherwise: {found['ended_otherwise']}; put off, as trust was away: "
        f"{found['postponed']}; fields that failed: {len(found['errors'])}"
    )


def is_good(found: Found) -> bool:
    """Every moment was measured, and trust ended in time by itself."""
    return found["measured"] == found["asked"] and not found["errors"] and found["beyond"] == found["ended_otherwise"] == 0


def main() -> None:
    """Print what was measured, against what was asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--moments", type=int, default=30)
    parser.add_argument("--fields", type=int, default=5, help="at a time; each takes about a quarter of a core")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--train-nice", type=int, default=0, help="rank of the trains, for a machine that others keep busy")
    parser.add_argument("--json", action="store_true", help="every moment too")
    arguments = parser.parse_args()
    found = measure(arguments.moments, arguments.fields, arguments.seed, arguments.train_nice)
    print(json.dumps(found, indent=2) if arguments.json else "\n".join([*found["errors"], line(found)]))
    raise SystemExit(not is_good(found))


if __name__ == "__main__":
    main()
