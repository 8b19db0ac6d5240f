"""The commands of a station and of its keys, in processes of their own: what starts and ends as it should, and what is refused and why."""

import json
import re
import signal
import socket
import stat
import tomllib
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import pytest

from integrity.events import RawBytes
from station.configure import message_set
from tests.e2e.commands import Ran, executed, five_mistakes, side_by_side, wayside, written
from tests.e2e.field import SITE_ID, Field, free_ports, make_field, measured, running_station, until
from tests.e2e.simulated_receiver import SimulatedReceiver, on_tcp

START_WITHIN_S = 30.0
END_WITHIN_S = 10.0
NOBODY = {name: f"tcp://127.0.0.{i}:9" for i, name in enumerate("ABC", 1)}  # the port for discarding: nobody answers there any more


# Keys


@pytest.fixture(scope="module")
def new_key(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Ran]:
    path = tmp_path_factory.mktemp("keys") / "north-1.pem"
    return path, wayside("keys", "new", path)


def test_a_new_key_is_for_its_owner_alone(new_key: tuple[Path, Ran]) -> None:
    assert (new_key[1].code, stat.S_IMODE(new_key[0].stat().st_mode)) == (0, 0o600)


def test_a_new_key_prints_a_table_and_nothing_else_on_stdout(new_key: tuple[Path, Ran]) -> None:
    (table,) = tomllib.loads(new_key[1].out)["key"]
    assert (table["site"], len(bytes.fromhex(table["public"]))) == ("north-1", 32)


def test_the_private_key_is_never_printed(new_key: tuple[Path, Ran]) -> None:
    secret = new_key[0].read_text().splitlines()[1]
    assert secret not in new_key[1].out + new_key[1].err + wayside("keys", "show", new_key[0]).out


def test_show_prints_the_same_table_again(new_key: tuple[Path, Ran]) -> None:
    shown = wayside("keys", "show", new_key[0])
    assert (shown.code, shown.out) == (0, new_key[1].out)


def test_no_key_is_overwritten_and_no_table_printed_for_it(new_key: tuple[Path, Ran]) -> None:
    before = new_key[0].read_bytes()
    again = wayside("keys", "new", new_key[0])
    assert (again.code, again.out, new_key[0].read_bytes()) == (2, "", before)
    assert "is there already, and no key is ever overwritten: choose another name" in again.err


# What a station refuses to start with


def edit(field: Field, old: str, new: str) -> None:
    text = field.site_file.read_text()
    assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times in {text}"
    field.site_file.write_text(text.replace(old, new))


def key_of(field: Field) -> Path:
    return field.folder / "keys" / f"{SITE_ID}.pem"


def no_source(field: Field) -> None:
    edit(field, f'[receivers.B]\nsource = "{NOBODY["B"]}"', "[receivers.B]")


def below_a_file(field: Field) -> None:
    edit(field, str(field.records), str(written(field.folder / "file", "no directory") / "deeper"))


# What is wrong with a station's folder, the exit code, and what stderr must say.
UNFIT: dict[str, tuple[Callable[[Field], object], int, str]] = {
    "no source": (no_source, 2, r"site\.toml:\d+: receivers\.B\.source: missing: add the address of the receiver's bytes"),
    "no key": (
        lambda field: key_of(field).unlink(),
        2,
        r"field\.pem: there is no key here: make one with `wayside keys new \S+field\.pem`",
    ),
    "a key that others may read": (lambda field: key_of(field).chmod(0o644), 2, r"mode 644 lets others .*: run `chmod 600 \S+field\.pem`"),
    "another file as the key": (
        lambda field: written(key_of(field), "no key"),
        2,
        r"field\.pem: cannot be used as a key: expected an Ed25519",
    ),
    "a directory below a file": (below_a_file, 2, r"\[record\] directory \S+file/deeper: cannot be written to \(.*\); give a directory"),
    "an endpoint without a port": (
        lambda field: edit(field, f'["{field.endpoint}"]', '["tcp/127.0.0.1"]'),
        2,
        r'publish\.listen = \["tcp/127\.0\.0\.1"\]: expected a list of Zenoh endpoints, PROTOCOL/HOST:PORT',
    ),
}


@dataclass(frozen=True)
class Refused:
    """What became of stations that could not start, and what they had recorded all the same."""

    ran: dict[str, Ran]
    recorded: list[Path]


@pytest.fixture(scope="module")
def refused(tmp_path_factory: pytest.TempPathFactory) -> Refused:
    fields = {what: make_field(tmp_path_factory.mktemp("unfit"), NOBODY) for what in UNFIT}
    for what, field in fields.items():
        UNFIT[what][0](field)
    ran = side_by_side([["station", "run", field.site_file] for field in fields.values()])
    return Refused(dict(zip(UNFIT, ran, strict=True)), [path for field in fields.values() for path in field.folder.rglob("*.mcap*")])


@pytest.mark.parametrize("what", UNFIT)
def test_a_station_that_cannot_start_ends_with_its_exit_code(refused: Refused, what: str) -> None:
    assert refused.ran[what].code == UNFIT[what][1], refused.ran[what].err


@pytest.mark.parametrize("what", UNFIT)
def test_a_station_that_cannot_start_says_why_and_what_to_do(refused: Refused, what: str) -> None:
    assert re.search(UNFIT[what][2], refused.ran[what].err), refused.ran[what].err


@pytest.mark.parametrize("what", UNFIT)
def test_the_reason_is_one_line_on_stderr_without_a_password(refused: Refused, what: str) -> None:
    ran = refused.ran[what]
    assert (ran.out, len(ran.err.splitlines()), "secret" in ran.err) == ("", 1, False), ran.err


def test_a_station_that_cannot_start_records_nothing(refused: Refused) -> None:
    assert refused.recorded == []


def test_a_publish_port_in_use_is_named(tmp_path: Path) -> None:
    field = make_field(tmp_path, NOBODY)
    host, _, port = field.endpoint.removeprefix("tcp/").partition(":")
    with socket.create_server((host, int(port))):
        ran = wayside("station", "run", field.site_file)
    assert (ran.code, ran.err.splitlines()) == (
        5,
        [f"wayside: endpoint {field.endpoint}: the port is in use: end the other process, or choose another port"],
    )


def test_five_mistakes_are_told_by_check_and_keep_a_station_from_running(tmp_path: Path) -> None:
    site = five_mistakes(tmp_path)
    check, run = side_by_side([["station", "check", site, "--json"], ["station", "run", site]])
    told = [error["text"] for error in json.loads(check.out)["errors"]]
    assert (check.code, run.code, len(told)) == (2, 2, 5)
    assert run.err.removeprefix("wayside: ").splitlines() == told


# Running


def is_up(field: Field) -> bool:
    return until(lambda: "listening at" in (field.folder / "station.log").read_text(), START_WITHIN_S)


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 0), (signal.SIGINT, 130)], ids=["terminate", "interrupt"])
def test_a_station_ends_when_it_is_told_to(tmp_path: Path, number: signal.Signals, code: int) -> None:
    field = make_field(tmp_path, NOBODY)
    with running_station(field) as process:
        assert is_up(field)
        process.send_signal(number)
        assert process.wait(END_WITHIN_S) == code, (tmp_path / "station.log").read_text()


def test_a_key_is_made_trusted_and_believed_by_commands_alone(tmp_path: Path) -> None:
    """The table is appended to a file that holds the site's old key already."""
    field = make_field(tmp_path, NOBODY)
    key_of(field).unlink()
    with field.trusted.open("a") as trusted:
        trusted.write(executed("keys", "new", key_of(field)).out)
    with running_station(field):
        assert is_up(field)
        heard = executed("listen", SITE_ID, "--keys", field.trusted, "--connect", field.endpoint, "--count", "1", "--json")
    told = json.loads(heard.out)
    assert (heard.code, told["verified"], told["state"], told["cause"]) == (0, True, "NOT_CONFIRMABLE", "data")


def test_a_station_that_reads_files_ends_with_them_and_is_replayed_as_it_decided(tmp_path: Path) -> None:
    field = make_field(tmp_path, {name: f"file:{tmp_path / name}.ubx" for name in "ABC"})
    sent = [event for event in measured(field.site, 20.0) if isinstance(event, RawBytes)]
    for name in "ABC":
        written(tmp_path / f"{name}.ubx", b"".join(event.data for event in sent if event.receiver == name))
    ran = executed("station", "run", field.site_file)
    assert (ran.code, ran.out, ran.err.splitlines()[-1]) == (0, "", "every source has ended"), ran.err
    (recording,) = field.recordings()
    again = executed("replay", recording, "--diff")
    assert (again.code, again.err) == (0, "all 20 epochs decided as recorded\n")


# Configuring


def test_receivers_are_configured_and_named(tmp_path: Path) -> None:
    receivers = {name: SimulatedReceiver() for name in "ABC"}
    with ExitStack() as stack:
        field = make_field(tmp_path, {name: stack.enter_context(on_tcp(receiver)) for name, receiver in receivers.items()})
        ran = executed("station", "configure", field.site_file)
    assert (ran.code, ran.out) == (0, ""), ran.err
    for name, receiver in receivers.items():
        assert re.search(rf"^{name}: connected to \S+: ZED-F9P, firmware HPG 1\.51$", ran.err, re.MULTILINE), ran.err
        assert receiver.store == message_set(field.site.config.epoch_interval_ns)


def test_a_site_without_a_receiver_to_configure_is_a_matter_of_the_link(tmp_path: Path) -> None:
    field = make_field(tmp_path, {name: f"udp://:{port}" for name, port in zip("ABC", free_ports(3), strict=True)})
    ran = wayside("station", "configure", field.site_file)
    assert ran.code == 5
    assert ran.err.splitlines()[-1].endswith("no receiver has a source that it can be configured by: expected serial:// or tcp://")


def test_a_receiver_that_refuses_ends_configuring_with_its_name_and_the_others_set(tmp_path: Path) -> None:
    receivers = {name: SimulatedReceiver(refused=frozenset({"CFG_RATE_MEAS"} if name == "B" else ())) for name in "ABC"}
    with ExitStack() as stack:
        field = make_field(tmp_path, {name: stack.enter_context(on_tcp(receiver)) for name, receiver in receivers.items()})
        ran = wayside("station", "configure", field.site_file)
    assert (ran.code, ran.err.splitlines()[-1].partition(": wanted")[0]) == (5, "wayside: receiver B: CFG_RATE_MEAS")
    assert receivers["C"].store == message_set(field.site.config.epoch_interval_ns)
