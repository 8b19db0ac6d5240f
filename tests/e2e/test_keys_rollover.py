"""Keys that change while somebody listens: a new one is trusted before it signs, the old one after. Real processes, real Zenoh."""

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from recordings.keys import load_key, new_key, trusted_table
from tests.e2e.field import SITE_ID as FIELD_ID
from tests.e2e.field import free_port, make_field, running_station, until
from tests.e2e.test_listen import Listening, started
from tests.e2e.test_publisher import SITE_ID, Station, station
from tests.e2e.train_field import make_train, running_train

TODAY = datetime.now(UTC).date()
DAY = timedelta(days=1)
EVERY_S = 0.1
VALID_MS = 1000


@pytest.fixture
def keys(tmp_path: Path) -> dict[str, Path]:
    """Private keys of the site by name, and where the trusted ones stand."""
    paths = {name: tmp_path / f"{name}.pem" for name in ("old", "new", "stranger")}
    for path in paths.values():
        new_key(path)
    return paths | {"trusted": tmp_path / "trusted.toml"}


def trust(keys: dict[str, Path], site: str = SITE_ID, **dates: str) -> None:
    """The old and the new key, each with its lines of dates."""
    tables = [trusted_table(site, load_key(keys[name]).public) + f"{lines}\n" for name, lines in dates.items()]
    keys["trusted"].write_text("".join(tables))


@contextmanager
def listening(keys: dict[str, Path], endpoint: str) -> Iterator[Listening]:
    with started("--json", "--keys", str(keys["trusted"]), "--connect", endpoint) as listener:
        yield listener


def speak(running: Station, messages: int) -> None:
    for sequence in range(1, messages + 1):
        running.health(sequence, valid_for_ms=VALID_MS)
        time.sleep(EVERY_S)


def speak_until_heard(running: Station, listener: Listening) -> None:
    sequence = count(1)

    def heard() -> bool:
        running.health(next(sequence))
        return not listener.out.empty()

    assert until(heard, 20.0)


def everything(listener: Listening, boots: int) -> list[dict[str, Any]]:
    """All messages so far; those of as many boots as there were have come."""
    told: list[dict[str, Any]] = []

    def all_there() -> bool:
        while not listener.out.empty():
            told.append(json.loads(listener.out.get()))
        return len({message["boot_id"] for message in told if message["fresh"]}) == boots

    assert until(all_there, 10.0), told
    return told


def test_a_station_comes_back_with_its_new_key_and_nobody_refuses_it(keys: dict[str, Path]) -> None:
    """Each boot is challenged before it is believed, so that a first message or two may be refused for its boot; none is for its key."""
    trust(keys, old=f"not_after = {TODAY + DAY}", new=f"not_before = {TODAY - DAY}")
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with listening(keys, endpoint) as listener:
        for name in ("old", "new"):
            with station(keys[name], [endpoint], []) as running:
                listener.notice("is there")
                speak(running, 15)
        told = everything(listener, 2)
    for_its_key = [message["refusal"] for message in told if "key" in message["refusal"] or "signature" in message["refusal"]]
    for_its_boot = [message["refusal"] for message in told if message["refusal"]]
    assert (for_its_key, len(for_its_boot) <= 2) == ([], True)


@pytest.mark.parametrize(
    "lines, why",
    [
        (f"not_after = {TODAY - DAY}", "key no longer valid"),
        (f"not_before = {TODAY + 2 * DAY}", "key not yet valid"),  # so that midnight may pass meanwhile
    ],
    ids=["too late", "too early"],
)
def test_outside_of_its_days_a_key_does_not_count(keys: dict[str, Path], lines: str, why: str) -> None:
    trust(keys, old="", new=lines)
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with listening(keys, endpoint) as listener, station(keys["new"], [endpoint], []) as running:
        said = listener.notice("key no")
        speak_until_heard(running, listener)
        told = listener.message()
        answer = listener.notice("answer to a challenge not believed")
    assert [why in said, told["verified"], why in told["refusal"], why in answer] == [True, False, True, True]


def test_a_key_that_is_not_in_the_file_is_refused_beside_dated_ones(keys: dict[str, Path]) -> None:
    trust(keys, old=f"not_after = {TODAY + DAY}")
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with listening(keys, endpoint) as listener, station(keys["stranger"], [endpoint], []) as running:
        speak_until_heard(running, listener)
        told = listener.message()
    assert (told["verified"], told["refusal"].startswith("unknown key")) == (False, True)


def test_a_train_rolls_over_with_its_station(tmp_path: Path, keys: dict[str, Path]) -> None:
    """The station's receivers are silent, so it says NOT_CONFIRMABLE each second; the train says how its trust changes, and why not."""
    place = make_field(tmp_path, {name: f"tcp://127.0.0.1:{free_port()}" for name in "ABC"})
    train = make_train(place, {name: f"tcp://127.0.0.1:{free_port()}" for name in ("front", "rear")})
    trust(keys, FIELD_ID, old=f"not_after = {TODAY + DAY}", new=f"not_before = {TODAY - DAY}")
    place.trusted.write_text(keys["trusted"].read_text())
    log, signing = tmp_path / "train.log", place.folder / "keys" / f"{FIELD_ID}.pem"
    with running_train(train):
        for name, times in (("old", 1), ("new", 2)):
            signing.write_bytes(keys[name].read_bytes())
            with running_station(place):
                assert until(lambda times=times: log.read_text().count("trust NOT_CONFIRMABLE") == times, 20.0), log.read_text()
            assert until(lambda times=times: log.read_text().count("trust NO_COMMS") == times, 20.0), log.read_text()
    refused = [line for line in log.read_text().splitlines() if "not believed" in line and "boot" not in line]
    assert refused == []


def test_a_train_does_not_believe_a_key_that_has_ended(tmp_path: Path, keys: dict[str, Path]) -> None:
    place = make_field(tmp_path, {name: f"tcp://127.0.0.1:{free_port()}" for name in "ABC"})
    train = make_train(place, {name: f"tcp://127.0.0.1:{free_port()}" for name in ("front", "rear")})
    trust(keys, FIELD_ID, old=f"not_after = {TODAY - DAY}")
    place.trusted.write_text(keys["trusted"].read_text())
    log, signing = tmp_path / "train.log", place.folder / "keys" / f"{FIELD_ID}.pem"
    signing.write_bytes(keys["old"].read_bytes())
    with running_train(train), running_station(place):
        assert until(lambda: "not believed: key no longer valid" in log.read_text(), 20.0), log.read_text()
        time.sleep(2.5)  # more than two heartbeats
    assert "trust NOT_CONFIRMABLE" not in log.read_text()
