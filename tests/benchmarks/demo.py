"""The whole demo, again and again: `python -m tests.benchmarks.demo [--runs 50] [--jobs 1] [--seconds N]`.

Prints every row that was ever not as expected, and times: from the start of the process to the first health and the first NORMAL, from a
fault or the last epoch covered to the end of trust.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from tests.e2e.field import REPOSITORY

WORDS = 12  # lines of a demo that came to nothing
NUMBER = re.compile(r"([A-Za-z ]*?after|rms|at most) (-?[0-9.]+|inf|nan)")


def run(arguments: list[str]) -> dict[str, Any]:
    """One demo; what it printed as JSON, its exit code, and how long the process took until the command began."""
    with tempfile.TemporaryDirectory() as folder:
        began_ns = time.monotonic_ns()
        done = subprocess.run(
            [sys.executable, "-m", "wayside", "demo", "--json", *arguments],
            cwd=REPOSITORY,
            env=os.environ | {"TMPDIR": folder},
            capture_output=True,
            text=True,
            check=False,
        )
        if not done.stdout:
            return {"code": done.returncode, "rows": [], "talk": done.stderr}
        told: dict[str, Any] = json.loads(done.stdout)
        return told | {"code": done.returncode, "talk": done.stderr, "before_s": (told["began_mono_ns"] - began_ns) / 1e9}


def numbers(told: dict[str, Any]) -> Iterator[tuple[str, float]]:
    """What the rows say was measured. Start-up counts from the start of the process."""
    for row in told["rows"]:
        for name, value in NUMBER.findall(row["seen"]):
            before_s = told["before_s"] if row["name"] == "start-up" else 0.0
            yield f"{row['name']}: {name.strip()}", float(value) + before_s


def main() -> None:
    """Print as runs end."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=50)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--seconds", type=float)
    parser.add_argument("--fault")
    asked = parser.parse_args()
    arguments = [f"--{name}={value}" for name, value in (("seconds", asked.seconds), ("fault", asked.fault)) if value is not None]
    failures: Counter[str] = Counter()
    measured: dict[str, list[float]] = defaultdict(list)
    good = 0
    with ThreadPoolExecutor(asked.jobs) as pool:
        for n, told in enumerate(pool.map(run, [arguments] * asked.runs), 1):
            good += told["code"] == 0
            bad = [row for row in told["rows"] if not row["as_expected"]]
            failures.update(row["name"] for row in bad)
            for name, value in numbers(told):
                measured[name].append(value)
            print(f"{n} of {asked.runs}: exit {told['code']}; {good} as expected", flush=True)
            for row in bad:
                print(f"    {row['name']}: {'; '.join(row['unmet'])}", flush=True)
            if not told["rows"]:
                print("".join(told["talk"].splitlines(keepends=True)[-WORDS:]), flush=True)
    print(f"\n{good} of {asked.runs} as expected; rows that ever were not: {dict(failures) or 'none'}\n")
    for name, values in measured.items():
        print(f"{name:<60} {min(values):8.3f} to {max(values):8.3f}, median {sorted(values)[len(values) // 2]:8.3f}")


if __name__ == "__main__":
    main()
