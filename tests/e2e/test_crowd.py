"""A few stations and more trains through one router, for some seconds: nobody's word is lost, refused or doubted on the way to anybody.

And how many the router takes at all. The full numbers, for ten minutes: `python -m tests.benchmarks.crowd`.
"""

import json
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
import zenoh

from tests.benchmarks.crowd import measure
from tests.benchmarks.crowd_figures import LATE_MS
from tests.benchmarks.crowd_plan import FOLLOWED, Plan
from tests.e2e.attacks.certified import certificates_in, of
from tests.e2e.field import free_port
from tests.e2e.router import running_router

STATIONS, TRAINS, SECONDS = 5, 15, 8
LINKS = 400  # of one machine: with shared memory, on by default, Zenoh 1.10.2 takes 351


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    plan = Plan(
        folder=str(tmp_path_factory.mktemp("crowd")),
        endpoint=f"tls/127.0.0.1:{free_port()}",
        stations=STATIONS,
        trains=TRAINS,
        settling_s=5,
        seconds=SECONDS,
        spread_ms=50.0,
        starts_within_ms=0.0,
        recover_messages=3,
    )
    return measure(plan)


def test_every_message_reaches_every_train_that_follows_its_station(found: dict[str, Any]) -> None:
    assert (found["messages"], found["never_arrived"]) == (TRAINS * FOLLOWED * SECONDS, 0)


def test_no_train_misses_a_message_by_its_sequence(found: dict[str, Any]) -> None:
    assert found["missed"] == 0


def test_no_inbox_is_full(found: dict[str, Any]) -> None:
    assert found["dropped"] == 0


def test_nothing_is_refused(found: dict[str, Any]) -> None:
    assert found["refused"] == {}


def test_trust_stays_normal_in_every_second(found: dict[str, Any]) -> None:
    assert found["train_seconds_not_normal"] == 0


def test_half_of_the_messages_are_verified_in_time_even_on_a_busy_machine(found: dict[str, Any]) -> None:
    assert found["verified_ms"]["p50"] <= LATE_MS


def test_the_shipped_router_takes_many_links_of_one_machine(tmp_path: Path) -> None:
    files = of(certificates_in(tmp_path), "r291")
    config = zenoh.Config()
    tls = {
        "root_ca_certificate": str(files.root_ca),
        "connect_certificate": str(files.certificate),
        "connect_private_key": str(files.private_key),
        "enable_mtls": True,
    }
    with running_router(tmp_path) as endpoint, ExitStack() as stack:
        settings = {"mode": "client", "connect/endpoints": [endpoint], "scouting/multicast/enabled": False, "transport/link/tls": tls}
        for key, value in settings.items():
            config.insert_json5(key, json.dumps(value))
        links = [stack.enter_context(zenoh.open(config)) for _ in range(LINKS)]  # ZError where one is refused
        assert sum(bool(link.info.routers_zid()) for link in links) == LINKS
