"""The router of `crowd`, a process of its own: the configuration shipped for zenohd, with the rights of all stations and trains.

At a tcp endpoint the same without certificates, and so without rights. `python -m tests.benchmarks.crowd_router FOLDER`.
"""

import json
import sys
from pathlib import Path
from typing import Any

import zenoh

from tests.benchmarks.crowd_plan import Plan, read_plan
from tests.e2e.router import shipped


def config_of(plan: Plan) -> zenoh.Config:
    """As the operator is told to make it: one entry a station under rules, subjects and policies, every train under trains."""
    config = shipped(plan.endpoint, Path(plan.folder))
    rights = json.loads(config.get_json("access_control"))
    config.insert_json5("access_control", json.dumps(_with_all(rights, plan) if plan.secured else {"enabled": False}))
    return config


def _with_all(rights: dict[str, Any], plan: Plan) -> dict[str, Any]:
    """The rights of the first station of the shipped file for each station, those of its trains for all trains."""
    rules, subjects, policies = rights["rules"], rights["subjects"], rights["policies"]
    model = subjects[0]["id"]
    speaks = next(rule for rule in rules if rule["id"] == f"{model} speaks")
    as_model = next(policy for policy in policies if policy["subjects"] == [model])

    def of(site: str, table: dict[str, Any]) -> dict[str, Any]:
        named: dict[str, Any] = json.loads(json.dumps(table).replace(model, site))
        return named

    trains = next(subject for subject in subjects if subject["id"] == "trains")
    rights["rules"] = [rule for rule in rules if not rule["id"].endswith(" speaks")] + [of(site, speaks) for site in plan.sites()]
    rights["subjects"] = [trains | {"cert_common_names": plan.train_ids()}] + [of(site, subjects[0]) for site in plan.sites()]
    rights["policies"] = [policy for policy in policies if policy["subjects"] == ["trains"]] + [of(s, as_model) for s in plan.sites()]
    return rights


def main() -> None:
    """Route until stdin ends."""
    with zenoh.open(config_of(read_plan(sys.argv[1]))):
        print("ready", flush=True)
        sys.stdin.read()


if __name__ == "__main__":
    main()
