"""Listeners on real links of this machine, and what they delivered and said."""

import re
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from recordings.sources.kinds import parse_source
from recordings.sources.listener import Listener

PATIENCE_S = 5.0
DATA = bytes(range(256)) * 4096  # 1 MiB: more than any buffer on the way


@dataclass
class Heard:
    """What a listener delivered and said."""

    pieces: list[tuple[str, int, bytes]] = field(default_factory=list)
    said: list[str] = field(default_factory=list)

    @property
    def data(self) -> bytes:
        return b"".join(data for _, _, data in self.pieces)

    def deliver(self, receiver: str, mono_ns: int, data: bytes) -> None:
        self.pieces.append((receiver, mono_ns, data))

    def say(self, receiver: str, line: str) -> None:
        self.said.append(f"{receiver}: {line}")

    def waits_s(self) -> list[float]:
        """The announced waits before the next try."""
        return [float(wait) for line in self.said for wait in re.findall(r"next try in (\S+) s", line)]


def until(true: Callable[[], bool]) -> bool:
    """True as soon as the condition is, False after some seconds."""
    until_s = time.monotonic() + PATIENCE_S
    while not true():
        if time.monotonic() > until_s:
            return False
        time.sleep(0.002)
    return True


@contextmanager
def listening(url: str, silent_after_s: float = 10.0, first_wait_s: float = 0.05, longest_wait_s: float = 0.2) -> Iterator[Heard]:
    heard = Heard()
    listener = Listener(
        "A",
        parse_source(url),
        heard.deliver,
        heard.say,
        first_wait_s=first_wait_s,
        longest_wait_s=longest_wait_s,
        silent_after_s=silent_after_s,
    )
    listener.start()
    try:
        yield heard
    finally:
        listener.stop()
        assert not listener.is_alive()


def tcp_server(port: int = 0) -> socket.socket:
    server = socket.create_server(("127.0.0.1", port))
    server.settimeout(PATIENCE_S)
    return server


def url_of(bound: socket.socket, scheme: str = "tcp") -> str:
    return f"{scheme}://127.0.0.1:{bound.getsockname()[1]}"


def free_udp_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as bound:
        bound.bind(("127.0.0.1", 0))
        return int(bound.getsockname()[1])
