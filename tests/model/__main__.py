"""Explore deeper than the tests do: `python -m tests.model --depth 12 seven challenges`. The exit status is 1 if a rule is broken."""

import argparse
import sys
import time

from tests.model.code import quick
from tests.model.explore import explore
from tests.model.world import DRIFTS, Rules
from tests.model.worlds import SETTINGS


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.model", description=__doc__)
    parser.add_argument("settings", nargs="*", default=list(SETTINGS), metavar="SETTING", help=f"of {', '.join(SETTINGS)}")
    parser.add_argument("--depth", type=int, help="instead of that of the tests")
    parser.add_argument("--every-drift", action="store_true", help="all nine pairs of drifts instead of the worst")
    options = parser.parse_args()
    unknown = set(options.settings) - set(SETTINGS)
    if unknown:
        parser.error(f"no such setting: {', '.join(sorted(unknown))}; there are {', '.join(SETTINGS)}")
    broken = False
    for name in options.settings:
        setting = SETTINGS[name]
        for drift in DRIFTS if options.every_drift else [Rules(quick()).drift]:
            begun_s = time.process_time()
            found = explore(Rules(quick(), drift), setting.actions, options.depth or setting.depth, setting.within)
            print(f"{name}: {found} ({time.process_time() - begun_s:.1f} s of processor time)", flush=True)
            broken |= bool(found.story)
    return int(broken)


if __name__ == "__main__":
    sys.exit(main())
