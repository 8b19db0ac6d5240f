"""What the link refuses, and what it does not hand on."""

import queue
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import AbstractContextManager

import pytest
import zenoh

from integrity.errors import LinkError
from recordings.link import Arrival, Link, dial_link, open_link
from tests.e2e.field import REPOSITORY, free_port, until

WITHIN_S = 0.3


def test_who_is_asked_and_says_nothing_has_given_no_answer() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    config = zenoh.Config()
    config.insert_json5("mode", '"peer"')
    config.insert_json5("listen/endpoints", f'["{endpoint}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    kept: list[zenoh.Query] = []  # neither answered nor let go
    answers: queue.Queue[Arrival] = queue.Queue()
    with zenoh.open(config) as silent:
        kept_too = silent.declare_queryable("some/place", kept.append)
        with dial_link([endpoint], lambda: None) as link:

            def heard() -> bool:
                link.ask("some/place", b"?", WITHIN_S, answers.put)
                time.sleep(0.05)
                return bool(kept)

            assert until(heard, 10.0)
            time.sleep(2 * WITHIN_S)
            assert answers.empty()
            kept[-1].reply_err("this one says no")  # too late: asked no more
            time.sleep(0.1)
            assert answers.empty()
        assert kept_too is not None  # Zenoh undeclares what nobody holds


@pytest.mark.parametrize("endpoint", ["tcp", "tcp/127.0.0.1", "tcp/127.0.0.1:70000", "smoke/signal:1", "127.0.0.1:7447", ""])
@pytest.mark.parametrize(
    "attempt",
    [lambda e: open_link([e], []), lambda e: open_link([], [e]), lambda e: dial_link([e], lambda: None)],
    ids=["listen", "connect", "dial"],
)
def test_an_endpoint_that_makes_no_sense_is_refused(endpoint: str, attempt: Callable[[str], AbstractContextManager[Link]]) -> None:
    with pytest.raises(LinkError, match=r"expected PROTOCOL/HOST:PORT"), attempt(endpoint):
        pass


def test_a_port_in_use_is_refused_by_name() -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        endpoint = f"tcp/127.0.0.1:{other.getsockname()[1]}"
        with pytest.raises(LinkError, match=f"endpoint {endpoint}: the port is in use"), open_link([endpoint], []):
            pass


DIALS_WHILE_IT_ENDS = """
import threading, time
import wayside
from recordings import link

def dial():
    with link.dial_link(["tcp/127.0.0.1:9"], lambda: None):
        pass

link.RETRY_MS = (200, 0)  # again at once: some attempt comes back from Zenoh just when the process ends
for _ in range(4):
    threading.Thread(target=dial, daemon=True).start()
time.sleep(0.5)
print("said at last")
wayside.leave(3)
"""


def test_a_process_ends_calmly_while_it_dials_in_vain() -> None:
    ended = subprocess.run([sys.executable, "-c", DIALS_WHILE_IT_ENDS], cwd=REPOSITORY, capture_output=True, text=True, timeout=30.0)
    assert (ended.returncode, ended.stdout, ended.stderr) == (3, "said at last\n", "")
