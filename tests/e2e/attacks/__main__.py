"""The attacks on a train, one after the other: `python -m tests.e2e.attacks [--only NAME] [--json] [-o FILE.md]`.

Exit code 1: one got through. What is printed of each: what the train did, in its own words, and after how long. Trust must have ended
3,100 ms after the issue of the last genuine NORMAL that the train had, at the latest: its validity, and 100 ms.
"""

import argparse
import json
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

from tests.e2e.attacks.ride import Case, Outcome, ride
from tests.e2e.attacks.table import GROUPS

HEAD = "| threat | attack | what is done | what the train did | after how long |\n|---|---|---|---|---|"


def outcomes(only: str | None) -> Iterator[tuple[Case, Outcome]]:
    """Of each attack, or of those with a word in their names."""
    for group in GROUPS:
        cases = [case for case in group.cases if only is None or only in case.name]
        if cases:
            with tempfile.TemporaryDirectory() as folder, group.scene(Path(folder)) as scene:
                for case in cases:
                    yield case, ride(case, scene)


def row(case: Case, found: Outcome) -> str:
    """A line of the table."""
    did = [" → ".join(found.states), f"refused {found.refused}" + (f" ({', '.join(found.refusals)})" if found.refusals else "")]
    did += ["alarm"] * found.alarm
    times = [] if found.ended_ms is None else [f"trust ended after {found.ended_ms:.0f} ms of {case.must.ended_ms:.0f}"]
    times += [] if found.back_ms is None else [f"back {found.back_ms:.0f} ms after the attack"]
    if found.ended_ms is None:
        times.append({"never": "never trusted meanwhile", "refuses": "does not start"}.get(case.must.trust, "stays NORMAL"))
    if case.must.growth_mb is not None:
        times.append(f"{found.growth_mb:.0f} MB more, spoke up to {found.told_late_ms:.0f} ms late")
    verdict = "".join(f" **WRONG: {wrong}**".replace("\n", " ") for wrong in found.wrong)
    return f"| {case.threat} | {case.name} | {case.done} | {'; '.join(did)}{verdict} | {'; '.join(times)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", help="a word in the names of those that are wanted")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("-o", type=Path, help="a file for the table")
    arguments = parser.parse_args()
    found = []
    if not arguments.json:
        print(HEAD, flush=True)
    for case, outcome in outcomes(arguments.only):
        found.append((case, outcome))
        if not arguments.json:
            print(row(case, outcome), flush=True)
    if arguments.json:
        print(json.dumps([{"attack": case.name, "threat": case.threat, "done": case.done} | asdict(o) for case, o in found], indent=2))
    if arguments.o:
        arguments.o.write_text("\n".join([HEAD, *(row(case, outcome) for case, outcome in found), ""]))
    sys.exit(int(any(outcome.wrong for _, outcome in found)))


if __name__ == "__main__":
    main()
