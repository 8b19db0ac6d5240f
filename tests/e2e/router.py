"""The router of the field in Python: the configuration that is shipped for zenohd, with the addresses and files of a test.

`python -m tests.e2e.router ENDPOINT FOLDER`: certificates as `wayside keys certificate FOLDER router --router` makes them.
"""

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import zenoh

from tests.e2e.field import REPOSITORY, free_port

SHIPPED = REPOSITORY / "station" / "zenohd.json5"


def shipped(endpoint: str, folder: Path) -> zenoh.Config:
    """The very file; nothing else of it is changed."""
    config = zenoh.Config.from_file(str(SHIPPED))
    config.insert_json5("listen/endpoints", json.dumps([endpoint]))
    for key in ("root_ca_certificate", "listen_certificate", "listen_private_key", "connect_certificate", "connect_private_key"):
        given = Path(json.loads(config.get_json(f"transport/link/tls/{key}")))
        config.insert_json5(f"transport/link/tls/{key}", json.dumps(str(folder / given.name)))
    return config


@contextmanager
def running_router(folder: Path) -> Iterator[str]:
    """A process of its own; yields its endpoint."""
    endpoint = f"tls/127.0.0.1:{free_port()}"
    command = [sys.executable, "-m", "tests.e2e.router", endpoint, str(folder)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=REPOSITORY, text=True) as process:
        try:
            assert process.stdout
            assert process.stdout.readline() == "ready\n"
            yield endpoint
        finally:
            process.kill()


def main() -> None:
    """Route until stdin ends."""
    with zenoh.open(shipped(sys.argv[1], Path(sys.argv[2]))):
        print("ready", flush=True)
        sys.stdin.read()


if __name__ == "__main__":
    main()
