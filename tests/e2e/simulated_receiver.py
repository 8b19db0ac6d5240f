"""A receiver that can be configured, on a pseudo-terminal or a TCP port: real UBX both ways, by pyubx2, which knows nothing of Wayside.

It keeps a store of keys, and sends measurements and NMEA all the time, some of which look like answers inside.
"""

import os
import select
import socket
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from threading import Event, Thread

import pytest
from pyubx2 import GET, POLL, SET, UBXMessage, UBXReader, cfgkey2name, cfgname2key, val2bytes

SYNC = b"\xb5\x62"
PIECE = 7  # bytes of one write: answers arrive in pieces
CHATTER_EVERY_S = 0.01


def _acknowledge(taken: bool, message: tuple[int, int]) -> bytes:
    name = "ACK-ACK" if taken else "ACK-NAK"
    return bytes(UBXMessage("ACK", name, GET, payload=bytes(message)).serialize())


def _rawx() -> bytes:
    """One measurement of 32 bytes, in which a whole refusal of a CFG-VALSET stands."""
    header = b"\x00" * 11 + b"\x01" + b"\x00" * 4
    return bytes(UBXMessage("RXM", "RXM-RAWX", GET, payload=header + _acknowledge(False, (0x06, 0x8A)).ljust(32, b"\x00")).serialize())


CHATTER = b"$GNGGA,,,,,,0,00,99.99,,,,,,*56\r\n" + _rawx()


@dataclass
class SimulatedReceiver:
    """How it answers: `unknown` keys make it refuse a message, `refused` keys too when set; `ignored` keys are accepted and not taken.

    `deaf`: it sends, but answers nothing. `silent`: it does not even send. `hangs_up`: it closes the link when it is to set keys.
    """

    unknown: frozenset[str] = frozenset()
    refused: frozenset[str] = frozenset()
    ignored: frozenset[str] = frozenset()
    deaf: bool = False
    hangs_up: bool = False
    silent: bool = False
    kept_in: set[str] = field(default_factory=set)
    store: dict[str, int] = field(default_factory=dict)
    factory: int = 9  # what every key holds before it is set
    questions: list[str] = field(default_factory=list)

    def chatter(self) -> bytes:
        return b"" if self.silent else CHATTER

    def answer(self, frame: bytes) -> bytes | None:
        """What it says to a message; None to hang up."""
        kind = (frame[2], frame[3])
        message = UBXReader.parse(frame, msgmode=SET if kind == (0x06, 0x8A) else POLL)
        self.questions.append(message.identity)
        if self.deaf or self.silent:
            return b""
        if kind == (0x0A, 0x04):
            return self._version()
        if kind == (0x06, 0x8A):
            return None if self.hangs_up else _acknowledge(self._set(message), kind)
        return self._get(message)

    def _version(self) -> bytes:
        lines = [b"ROM BASE 0x118B2060", b"FWVER=HPG 1.51", b"PROTVER=27.50", b"MOD=ZED-F9P"]
        payload = (
            b"EXT CORE 1.00 (e2b374)".ljust(30, b"\0") + b"00190000".ljust(10, b"\0") + b"".join(line.ljust(30, b"\0") for line in lines)
        )
        return bytes(UBXMessage("MON", "MON-VER", GET, payload=payload).serialize())

    def _set(self, message: UBXMessage) -> bool:
        values = {key: value for key, value in vars(message).items() if key.startswith("CFG_")}
        if values.keys() & (self.unknown | self.refused):
            return False
        self.kept_in |= {layer for layer in ("ram", "bbr", "flash") if getattr(message, layer)}
        self.store.update({key: value for key, value in values.items() if key not in self.ignored})
        return True

    def _get(self, message: UBXMessage) -> bytes:
        names = [cfgkey2name(number)[0] for key, number in vars(message).items() if key.startswith("keys_")]
        if self.unknown & set(names):
            return _acknowledge(False, (0x06, 0x8B))
        in_force = self.store if message.layer == 0 else {}  # RAM
        payload = b"\x01\x00\x00\x00"
        for name in names:
            number, kind = cfgname2key(name)
            payload += number.to_bytes(4, "little") + val2bytes(in_force.get(name, self.factory), kind)
        return bytes(UBXMessage("CFG", "CFG-VALGET", GET, payload=payload).serialize()) + _acknowledge(True, (0x06, 0x8B))


def _talk(receiver: SimulatedReceiver, fd: int, stop: Event) -> None:
    """Serve one link until it is closed, the receiver hangs up, or the test is over."""
    heard = b""
    while not stop.is_set():
        readable, _, _ = select.select([fd], [], [], CHATTER_EVERY_S)
        if readable:
            data = os.read(fd, 4096)
            if not data:
                return
            heard += data
        said = receiver.chatter()
        at = heard.find(SYNC)
        if at >= 0 and len(heard) >= at + 8 + int.from_bytes(heard[at + 4 : at + 6], "little"):
            end = at + 8 + int.from_bytes(heard[at + 4 : at + 6], "little")
            answer = receiver.answer(heard[at:end])
            if answer is None:
                return
            heard = heard[end:]
            said += answer + receiver.chatter()
        for i in range(0, len(said), PIECE):
            os.write(fd, said[i : i + PIECE])


@contextmanager
def on_tcp(receiver: SimulatedReceiver) -> Iterator[str]:
    """Serve on a free port of 127.0.0.1; gives the source's address."""
    stop = Event()
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(0.05)

        def serve() -> None:
            while not stop.is_set():
                with suppress(OSError), server.accept()[0] as connection:  # a time-out, or a connection that is cut
                    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                    _talk(receiver, connection.fileno(), stop)

        with _running(serve, stop):
            yield f"tcp://127.0.0.1:{server.getsockname()[1]}"


@contextmanager
def on_pty(receiver: SimulatedReceiver) -> Iterator[str]:
    """Serve on a pseudo-terminal; gives the source's address. Skips where the system has none."""
    try:
        ours, theirs = os.openpty()
    except OSError as error:
        pytest.skip(f"no pseudo-terminals here: {error}")
    tty.setraw(theirs)
    os.set_blocking(ours, False)
    stop = Event()
    path = os.ttyname(theirs)

    def serve() -> None:
        with suppress(OSError):  # nobody reads: full
            _talk(receiver, ours, stop)

    with _running(serve, stop):
        yield f"serial://{path}?baud=460800"
    os.close(ours)
    os.close(theirs)


@contextmanager
def _running(serve: Callable[[], None], stop: Event) -> Iterator[None]:
    thread = Thread(target=serve)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()
