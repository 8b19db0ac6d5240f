"""Fuzzing by hand: `python -m tests.fuzz ubx --frames 1000000`, or guided by coverage: `python -m tests.fuzz ubx --atheris 300`.

A finding is told with the seed that gives it again and the fewest frames that do; then the exit status is 1.
"""

import argparse
import importlib
import sys
import time

from tests.fuzz.target import Finding, run

NAMES = ("ubx", "rtcm", "rinex", "rinexnav", "hatanaka", "sbas", "words", "reception", "health")
SHOWN_DIGITS = 400


def shown(finding: Finding, times: int) -> str:
    lines = (f"\n  {'untouched' if piece.untouched else 'touched'} {piece.data.hex()[:SHOWN_DIGITS]}" for piece in finding.pieces[:20])
    first = f"at {finding.place}, {times} times, first with seed {finding.seed}, from {len(finding.pieces)} pieces:"
    return f"{finding.error[:1000]}\n  {first}{''.join(lines)}"


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("target", choices=NAMES)
    parser.add_argument("--frames", type=int, default=1_000_000, help="how many frames to damage")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--atheris", type=int, metavar="SECONDS", help="guided by coverage instead, for so long")
    options = parser.parse_args()
    if options.atheris is not None:
        from tests.fuzz.guided import guided

        return guided(options.target, options.atheris, options.seed)
    target = importlib.import_module(f"tests.fuzz.{options.target}").TARGET
    begun = time.monotonic()
    outcome = run(target, options.frames, options.seed)
    for finding, times in outcome.findings.values():
        print(shown(finding, times))
    told = ", ".join(f"{name} {n}" for name, n in sorted(outcome.told.items()))
    print(
        f"{options.target}: {outcome.touched} frames touched and {outcome.untouched} not, in {time.monotonic() - begun:.0f} s; told: {told}"
    )
    memory = ", ".join(f"{mb:.1f}" for mb in outcome.resident_mb)
    print(f"memory after the first batch, in the middle, at the end: {memory} MB")
    print(f"findings: {len(outcome.findings)}")
    return 1 if outcome.findings else 0


if __name__ == "__main__":
    sys.exit(main())
