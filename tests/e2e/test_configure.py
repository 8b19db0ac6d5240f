"""Receivers configured over real links: what is sent is taken, kept and read back, and whatever a receiver does instead is named."""

import re
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack

import pytest

from integrity.errors import ConfigError, LinkError
from recordings.site_file import SiteFile, parse_site
from station import configure as module
from station.configure import ConfiguredReceiver, configure, message_set
from tests.e2e.simulated_receiver import SimulatedReceiver, on_pty, on_tcp
from tests.unit.sites import edited

NS_PER_S = 1_000_000_000
Serve = Callable[[SimulatedReceiver], AbstractContextManager[str]]


def _site(sources: dict[str, str], interval_s: float = 1.0) -> SiteFile:
    """The sample site with these sources; others are datagrams, which cannot be configured."""
    url = {name: sources.get(name, f"udp://:{port}") for name, port in (("A", 4000), ("B", 4001), ("C", 4002))}
    text = edited(
        ("serial:///dev/ttyACM0?baud=460800", url["A"]),
        ("tcp://10.0.0.2:2000", url["B"]),
        ("ntrip://user:secret@caster.example:2101/MOUNT", url["C"]),
        ("epoch_interval_s = 1.0", f"epoch_interval_s = {interval_s}"),
    )
    return parse_site(text, "site.toml")


def _run(sources: dict[str, str], interval_s: float = 1.0) -> tuple[list[ConfiguredReceiver], list[str]]:
    said: list[str] = []
    return configure(_site(sources, interval_s), lambda receiver, line: said.append(f"{receiver}: {line}")), said


def _problems(sources: dict[str, str]) -> str:
    with pytest.raises(LinkError) as raised:
        _run(sources)
    return str(raised.value)


@pytest.mark.parametrize("serve", [on_pty, on_tcp], ids=["serial", "tcp"])
def test_a_receiver_takes_and_keeps_the_whole_message_set_and_is_named(serve: Serve) -> None:
    receiver = SimulatedReceiver()
    with serve(receiver) as url:
        configured, said = _run({"B": url})
    settings = message_set(NS_PER_S)
    assert configured == [ConfiguredReceiver("B", "ZED-F9P", "HPG 1.51", len(settings))]
    assert receiver.store == settings
    assert receiver.kept_in == {"ram", "bbr", "flash"}
    assert [line for line in said if line.startswith("A")] == [
        "A: skipped (udp): nothing can be sent to it; to configure it, connect it once by serial:// or tcp://"
    ]


def test_the_message_set_at_10_hz() -> None:
    """Key names of the interface description; measurements each epoch, the receiver's own state once a second."""
    assert message_set(NS_PER_S // 10) == {
        "CFG_UART1OUTPROT_UBX": 1,
        "CFG_UART1OUTPROT_NMEA": 0,
        "CFG_USBOUTPROT_UBX": 1,
        "CFG_USBOUTPROT_NMEA": 0,
        "CFG_MSGOUT_UBX_RXM_RAWX_UART1": 1,
        "CFG_MSGOUT_UBX_RXM_RAWX_USB": 1,
        "CFG_MSGOUT_UBX_RXM_SFRBX_UART1": 1,
        "CFG_MSGOUT_UBX_RXM_SFRBX_USB": 1,
        "CFG_MSGOUT_UBX_NAV_PVT_UART1": 1,
        "CFG_MSGOUT_UBX_NAV_PVT_USB": 1,
        "CFG_MSGOUT_UBX_NAV_STATUS_UART1": 10,
        "CFG_MSGOUT_UBX_NAV_STATUS_USB": 10,
        "CFG_MSGOUT_UBX_MON_RF_UART1": 10,
        "CFG_MSGOUT_UBX_MON_RF_USB": 10,
        "CFG_MSGOUT_UBX_SEC_SIG_UART1": 10,
        "CFG_MSGOUT_UBX_SEC_SIG_USB": 10,
        "CFG_RATE_MEAS": 100,
        "CFG_RATE_NAV": 1,
        "CFG_RATE_TIMEREF": 1,
        "CFG_NAVSPG_DYNMODEL": 2,
    }


@pytest.mark.parametrize(("interval_s", "epochs"), [(0.05, 20), (1.0, 1), (65.0, 1)])
def test_the_receivers_own_state_comes_about_once_a_second(interval_s: float, epochs: int) -> None:
    assert message_set(round(interval_s * NS_PER_S))["CFG_MSGOUT_UBX_MON_RF_USB"] == epochs


@pytest.mark.parametrize("interval_s", [0.0625, 300.0], ids=["62.5 ms", "300 s"])
def test_an_interval_that_no_receiver_can_keep_is_refused_before_anything_is_sent(interval_s: float) -> None:
    receiver = SimulatedReceiver()
    with on_tcp(receiver) as url, pytest.raises(ConfigError, match=r"site\.epoch_interval_s"):
        _run({"A": url}, interval_s)
    assert receiver.questions == []


KEY = "CFG_MSGOUT_UBX_SEC_SIG_USB"


@pytest.mark.parametrize(
    ("receiver", "expected"),
    [
        (SimulatedReceiver(refused=frozenset({KEY})), f"receiver A: {KEY}: wanted 1, refused, found 9: .*manual.*"),
        (SimulatedReceiver(unknown=frozenset({KEY})), f"receiver A: {KEY}: wanted 1, found nothing, .*: update its firmware"),
        (SimulatedReceiver(ignored=frozenset({KEY})), f"receiver A: {KEY}: wanted 1, accepted, found 9: .*run this again"),
    ],
    ids=["refused", "unknown", "accepted and not taken"],
)
def test_a_key_that_a_receiver_does_not_take_is_the_only_one_named_and_the_others_are_set(
    receiver: SimulatedReceiver, expected: str
) -> None:
    with on_tcp(receiver) as url:
        problems = _problems({"A": url})
    assert re.fullmatch(expected, problems)
    assert receiver.store.keys() == message_set(NS_PER_S).keys() - {KEY}


def test_a_receiver_that_refuses_everything_is_one_line() -> None:
    receiver = SimulatedReceiver(refused=frozenset(message_set(NS_PER_S)))
    with on_tcp(receiver) as url:
        assert re.fullmatch("receiver A: refused all 20 keys: .*", _problems({"A": url}))


@pytest.mark.parametrize(
    ("receiver", "hint"),
    [(SimulatedReceiver(deaf=True), "it sends UBX messages but does not answer"), (SimulatedReceiver(silent=True), "nothing comes in")],
    ids=["deaf", "silent"],
)
def test_a_receiver_that_does_not_answer_is_asked_three_times(
    receiver: SimulatedReceiver, hint: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "ANSWER_WITHIN_S", 0.2)
    with on_tcp(receiver) as url:
        problems = _problems({"A": url})
    assert receiver.questions == ["MON-VER"] * 3
    assert problems.startswith(f"receiver A: no answer to MON-VER in 3 attempts of 0.2 s: {hint}")


def test_every_receiver_is_tried_before_the_end() -> None:
    """A link that is cut in the middle, a port that is not there, and a sound receiver after them."""
    cut, sound = SimulatedReceiver(hangs_up=True), SimulatedReceiver()
    with ExitStack() as stack:
        sources = {"A": stack.enter_context(on_tcp(cut)), "B": "serial:///dev/no-such-port", "C": stack.enter_context(on_tcp(sound))}
        problems = _problems(sources).splitlines()
    assert problems[0].startswith("receiver A: link lost before CFG-VALSET was answered: ")
    assert problems[1].startswith("receiver B: /dev/no-such-port: no such port: ")
    assert sound.store == message_set(NS_PER_S)


def test_a_site_without_any_receiver_to_configure_is_an_error() -> None:
    assert _problems({}) == "site.toml: no receiver has a source that it can be configured by: expected serial:// or tcp://"
