"""Who gets in, who is heard, who hears: certificates and rights between real processes, at a station and at the shipped router."""

import json
import queue
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
import zenoh

from integrity.messages.key_expressions import CHALLENGE, HEALTH, site_key
from recordings.keys import new_key, trusted_table
from recordings.link import Arrival, Link, dial_link
from recordings.tls_files import TlsFiles
from tests.e2e.attacks.certified import OTHER_SITE, SITE, Speaker, certificates_in, of, secured, speaking, strangers_in, tls_table
from tests.e2e.field import REPOSITORY, SITE_ID, free_port, make_field, running_station, until
from tests.e2e.router import running_router
from tests.e2e.test_listen import started
from tests.e2e.test_publisher import environment
from tests.e2e.train_field import make_train, running_train

LONG_ENOUGH_S = 0.5  # for what would come on loopback


@pytest.fixture(scope="module")
def certificates(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return certificates_in(tmp_path_factory.mktemp("tls"))


@pytest.fixture(scope="module")
def strangers(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return strangers_in(tmp_path_factory.mktemp("strangers"))


class Ear:
    """Everything that comes to a link at a key, and the answers to its questions."""

    def __init__(self, link: Link, key: str) -> None:
        self.link, self.heard = link, queue.Queue[Arrival]()
        link.subscribe(key, self.heard.put)

    def texts(self) -> list[str]:
        return [arrival.data.decode() for arrival in list(self.heard.queue)]

    def hears(self, speaker: Speaker, key: str, text: str) -> bool:
        """Whether what is put again and again arrives at last: a subscription takes a moment."""

        def came() -> bool:
            speaker.put(key, text)
            return text in self.texts()

        return until(came, 5.0)

    def asked(self, site: str) -> list[bytes]:
        answers = queue.Queue[Arrival]()
        self.link.ask(site_key(site, CHALLENGE), b"nonce", LONG_ENOUGH_S, answers.put)
        time.sleep(LONG_ENOUGH_S)
        return [arrival.data for arrival in list(answers.queue)]


class _TurnedAwayError(Exception):
    """Nobody let us in at the first attempt."""


def is_let_in(endpoint: str, files: TlsFiles) -> bool:
    def give_up() -> None:
        raise _TurnedAwayError

    try:
        with dial_link([endpoint], give_up, files):
            return True
    except _TurnedAwayError:
        return False


@pytest.fixture(params=["station", "router"])
def door(request: pytest.FixtureRequest, certificates: Path) -> Iterator[tuple[Speaker, str]]:
    """A station that can be dialled, or one behind the router; and where to dial."""
    if request.param == "station":
        endpoint = f"tls/127.0.0.1:{free_port()}"
        with speaking(certificates, SITE, [endpoint], []) as speaker:
            yield speaker, endpoint
    else:
        with running_router(certificates) as endpoint, speaking(certificates, SITE, [], [endpoint]) as speaker:
            yield speaker, endpoint


def test_a_named_certificate_hears_and_is_answered(door: tuple[Speaker, str], certificates: Path) -> None:
    speaker, endpoint = door
    with dial_link([endpoint], lambda: None, of(certificates, "r291")) as link:
        ear = Ear(link, site_key(SITE, HEALTH))
        assert (ear.hears(speaker, site_key(SITE, HEALTH), "real"), ear.asked(SITE)) == (True, [b"nonce!"])


def test_only_certificates_of_the_authority_that_have_not_ended_are_let_in(
    door: tuple[Speaker, str], certificates: Path, strangers: Path
) -> None:
    endpoint = door[1]
    of_another = TlsFiles(certificates / "ca.pem", strangers / "r291.pem", strangers / "r291.key")
    let_in = {
        "right": is_let_in(endpoint, of(certificates, "r291")),
        "of another authority": is_let_in(endpoint, of_another),
        "ended": is_let_in(endpoint, of(certificates, "late")),
    }
    assert let_in == {"right": True, "of another authority": False, "ended": False}


def test_without_a_certificate_nobody_is_let_in(door: tuple[Speaker, str], certificates: Path) -> None:
    config = zenoh.Config()
    for key, value in {
        "mode": "client",
        "connect/endpoints": [door[1]],
        "connect/exit_on_failure": True,
        "scouting/multicast/enabled": False,
        "transport/link/tls": {"root_ca_certificate": str(certificates / "ca.pem"), "enable_mtls": False},
    }.items():
        config.insert_json5(key, json.dumps(value))
    with pytest.raises(zenoh.ZError, match="Unable to connect"), zenoh.open(config):
        pass


def test_a_reader_does_not_believe_a_station_of_another_authority(certificates: Path, strangers: Path) -> None:
    endpoint = f"tls/127.0.0.1:{free_port()}"
    with speaking(strangers, SITE, [endpoint], []):
        own = of(certificates, "r291")
        assert [is_let_in(endpoint, own), is_let_in(endpoint, of(strangers, "r291"))] == [False, True]


def test_a_certificate_without_rights_hears_nothing_and_gets_no_answer(door: tuple[Speaker, str], certificates: Path) -> None:
    speaker, endpoint = door
    with (
        dial_link([endpoint], lambda: None, of(certificates, "guest")) as guest,
        dial_link([endpoint], lambda: None, of(certificates, "r291")) as reader,
    ):
        deaf, ear = Ear(guest, "wayside/v1/**"), Ear(reader, site_key(SITE, HEALTH))
        exact = Ear(guest, site_key(SITE, HEALTH))
        heard = ear.hears(speaker, site_key(SITE, HEALTH), "real")
        assert (heard, deaf.texts(), exact.texts(), deaf.asked(SITE)) == (True, [], [], [])


@pytest.mark.parametrize("name", ["guest", "r292"], ids=["without rights", "a train"])
def test_nobody_who_reads_is_heard(door: tuple[Speaker, str], certificates: Path, name: str) -> None:
    speaker, endpoint = door
    place = site_key(SITE, HEALTH)
    with (
        dial_link([endpoint], lambda: None, of(certificates, name)) as forger,
        dial_link([endpoint], lambda: None, of(certificates, "r291")) as reader,
    ):
        ear = Ear(reader, place)
        assert ear.hears(speaker, place, "before")
        put = forger.urgent(place, "x")
        for _ in range(10):
            put(b"forged")
            time.sleep(LONG_ENOUGH_S / 10)
        assert (ear.hears(speaker, place, "after"), set(ear.texts())) == (True, {"before", "after"})


def test_a_station_is_heard_at_its_own_site_alone(certificates: Path) -> None:
    own, others = site_key(OTHER_SITE, HEALTH), site_key(SITE, HEALTH)
    with ExitStack() as stack:
        endpoint = stack.enter_context(running_router(certificates))
        first = stack.enter_context(speaking(certificates, SITE, [], [endpoint]))
        second = stack.enter_context(speaking(certificates, OTHER_SITE, [], [endpoint], honest=False))
        ear = Ear(stack.enter_context(dial_link([endpoint], lambda: None, of(certificates, "r291"))), "wayside/v1/*/health")
        control = ear.hears(first, others, "of 1"), ear.hears(second, own, "of 2")
        for _ in range(10):
            second.put(others, "forged")
            time.sleep(LONG_ENOUGH_S / 10)
        assert (control, ear.hears(second, own, "after"), set(ear.texts())) == ((True, True), True, {"of 1", "of 2", "after"})


def test_station_train_and_listener_find_each_other_by_their_files(tmp_path: Path, certificates: Path) -> None:
    """Its receivers are silent: the station says so, each second, and who verifies it says NOT_CONFIRMABLE."""
    place = make_field(tmp_path, {name: f"tcp://127.0.0.1:{free_port()}" for name in "ABC"})
    endpoint = place.endpoint.replace("tcp/", "tls/")
    secured(of(certificates, SITE_ID), place.site_file, place.endpoint, f'listen = ["{endpoint}"]\nreaders = ["r291", "r292"]')
    train = make_train(place, {name: f"tcp://127.0.0.1:{free_port()}" for name in ("front", "rear")})
    train.write_text(train.read_text().replace(place.endpoint, endpoint) + f"\n{tls_table(of(certificates, 'r291'))}")
    command = [sys.executable, "-m", "wayside", "listen", SITE_ID, "--json", "--keys", str(place.trusted), "--count", "3"]
    with running_station(place), running_train(train):
        listener = subprocess.run(
            [*command, "--connect", endpoint, "--certificate", str(certificates / "r292.pem")],
            cwd=REPOSITORY,
            env=environment(),
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
        log = tmp_path / "train.log"
        trusted = until(lambda: "trust NOT_CONFIRMABLE" in log.read_text(), 20.0)
    last = json.loads(listener.stdout.splitlines()[-1])
    assert (trusted, last["fresh"], last["state"]) == (True, True, "NOT_CONFIRMABLE")


def test_a_listener_says_that_certificates_may_be_the_reason(tmp_path: Path, certificates: Path) -> None:
    trusted = tmp_path / "trusted.toml"
    trusted.write_text(trusted_table(SITE, new_key(tmp_path / "a.pem").public))
    where = ["--keys", str(trusted), "--connect", f"tls/127.0.0.1:{free_port()}", "--certificate", str(certificates / "r291.pem")]
    with started(*where) as listener:
        assert "or certificates are refused" in listener.out.get(timeout=20.0)
