"""The station under its live load: `python -m tests.benchmarks.live [--seconds 600] [--json]`.

Three simulated receivers at 10 Hz send UBX bytes over loopback TCP; the station decides, records, signs and publishes; another process
verifies every message. Latency runs from the moment at which the last byte of an epoch's last receiver has been handed to the socket,
to the moment at which the listener has verified the signed health of that epoch (one monotonic clock serves all processes of a machine).

`--floor` puts a station in its place that decides nothing: it reads the same bytes, and signs and puts a message of the same size. What
that takes is the machine's share and that of Python, Zenoh and Ed25519.
"""

import argparse
import contextlib
import itertools
import json
import os
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from integrity.messages import wayside_pb2 as pb
from integrity.messages.key_expressions import CHALLENGE, HEALTH, site_key
from integrity.messages.signatures import sign_health
from integrity.messages.verification import HealthVerifier
from recordings.keys import keys_of, load_key, read_trusted
from recordings.link import Arrival, dial_link, open_link
from recordings.simulate.server import ReceiverServer
from tests.e2e.field import REPOSITORY, SITE_ID, START_NS, Field, make_field, measured, running_station, until

INTERVAL_S = 0.1
USUAL_BYTES = 360  # of a message besides what every one has
SETTLED_AFTER_S = 30.0  # from when on the memory counts as settled
MB = 1e6


def listen(endpoint: str, trusted: Path, out: Path) -> None:
    """The listener's process: verify as messages come, write `gps_time_ns mono_ns state arrived_mono_ns` of each, until stdin closes."""
    verifier = HealthVerifier(SITE_ID, keys_of(read_trusted(trusted), SITE_ID, trusted), 3000)
    with out.open("w", buffering=1) as file, dial_link([endpoint], lambda: None) as link:

        def take(arrival: Arrival) -> None:
            received = verifier.health(arrival.key_expr, arrival.data, arrival.mono_ns)
            done_ns = time.monotonic_ns()
            if received.health is None:
                file.write(f"refused {received.refusal}\n")
            else:
                file.write(f"{received.health.gps_time_ns} {done_ns} {received.said} {arrival.mono_ns}\n")

        link.subscribe(site_key(SITE_ID, HEALTH), take)
        sys.stdin.read()


def bare_station(endpoint: str, key: Path, addresses: list[str]) -> None:
    """The process that decides nothing: after the bytes of all receivers, a signed NORMAL of a usual size for the next epoch."""
    boot_id = bytes(16)
    place = site_key(SITE_ID, HEALTH)
    signing = load_key(key)
    with open_link([endpoint], []) as link, contextlib.ExitStack() as open_sockets:
        put = link.urgent(place, "wayside.v1.SignedHealth")
        link.answer(site_key(SITE_ID, CHALLENGE), "wayside.v1.SignedChallengeReply", lambda nonce: b"")
        sockets = [open_sockets.enter_context(socket.create_connection((h, int(p)))) for h, _, p in (a.partition(":") for a in addresses)]
        for epoch in itertools.count(1):
            if not all(connection.recv(1 << 16) for connection in sockets):
                return
            health = pb.Health(site=SITE_ID, boot_id=boot_id, sequence=epoch, state=pb.NORMAL, issued_mono_ns=time.monotonic_ns())
            health.gps_time_ns = START_NS + (epoch - 1) * round(INTERVAL_S * 1e9)
            health.reasons.append(" " * USUAL_BYTES)
            put(sign_health(signing, place, health).SerializeToString())


@contextlib.contextmanager
def running_bare_station(field: Field, server: ReceiverServer) -> Iterator[subprocess.Popen[str]]:
    """`bare_station` as a process of its own."""
    key = field.folder / "keys" / f"{SITE_ID}.pem"
    addresses = [f"{host}:{port}" for host, port in server.addresses.values()]
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.benchmarks.live", "--bare", field.endpoint, str(key), *addresses], cwd=REPOSITORY, text=True
    )
    (field.folder / "station.log").touch()
    field.records.mkdir()
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def measure(seconds: float, floor: bool) -> dict[str, Any]:
    """Run it all once."""
    with tempfile.TemporaryDirectory() as folder, ReceiverServer("ABC", "127.0.0.1", 0) as server:
        field = make_field(Path(folder), {r: f"tcp://{host}:{port}" for r, (host, port) in server.addresses.items()}, INTERVAL_S)
        events = measured(field.site, seconds)
        out = Path(folder) / "heard.txt"
        listener = subprocess.Popen(
            [sys.executable, "-m", "tests.benchmarks.live", "--listen", field.endpoint, str(field.trusted), str(out)],
            stdin=subprocess.PIPE,
            cwd=REPOSITORY,
        )
        sent_ns: dict[int, int] = {}
        with running_bare_station(field, server) if floor else running_station(field) as station:
            threading.Thread(target=_complain_if_it_ends, args=(station, Path(folder) / "station.log"), daemon=True).start()
            server.wait_for_clients()
            process = psutil.Process(station.pid)
            until(lambda: out.exists() and _has_peer(field.endpoint), 10.0)
            watch = _Watch(process)
            began_s, cpu_s = time.monotonic(), sum(process.cpu_times()[:2])
            server.play(events, sent=lambda _, epoch_ns, mono_ns: sent_ns.__setitem__(epoch_ns, mono_ns))
            cpu_share = (sum(process.cpu_times()[:2]) - cpu_s) / (time.monotonic() - began_s)
            time.sleep(0.5)
            rss = watch.stop()
            station.terminate()
            exit_code = station.wait(10.0)
        listener.communicate(timeout=10.0)
        talk = (Path(folder) / "station.log").read_text()
        recorded = sum(path.stat().st_size for path in field.recordings())
        return _summary(seconds, sent_ns, out.read_text().splitlines(), rss, cpu_share, exit_code, talk, recorded)


def _complain_if_it_ends(station: subprocess.Popen[str], log: Path) -> None:
    """A station that does not start leaves the receivers waiting for ever."""
    if station.wait() not in (0, -9, -15):
        print(f"the station ended: {log.read_text()}", file=sys.stderr)
        os._exit(1)


class _Watch:
    """Resident memory of a process each second, (time, bytes)."""

    def __init__(self, process: psutil.Process) -> None:
        self._process, self._stopped, self.samples = process, threading.Event(), list[tuple[float, int]]()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        began_s = time.monotonic()
        while not self._stopped.wait(1.0):
            self.samples.append((time.monotonic() - began_s, self._process.memory_info().rss))

    def stop(self) -> list[tuple[float, int]]:
        self._stopped.set()
        self._thread.join()
        return self.samples


def _has_peer(endpoint: str) -> bool:
    port = int(endpoint.rpartition(":")[2])
    return any(c.status == psutil.CONN_ESTABLISHED and c.laddr and c.laddr.port == port for c in psutil.net_connections("tcp"))


def _summary(
    seconds: float,
    sent_ns: dict[int, int],
    heard: list[str],
    rss: list[tuple[float, int]],
    cpu_share: float,
    exit_code: int,
    talk: str,
    recorded: int,
) -> dict[str, Any]:
    verified = [line.split() for line in heard if not line.startswith("refused")]
    latency_ms = np.array([(int(done) - sent_ns[int(gps)]) / 1e6 for gps, done, *_ in verified if int(gps) in sent_ns])
    parts_ms = {
        "sent to arrived": [(int(arrived) - sent_ns[int(gps)]) / 1e6 for gps, _, _, arrived in verified if int(gps) in sent_ns],
        "verification": [(int(done) - int(arrived)) / 1e6 for _, done, _, arrived in verified],
    }
    settled = [b for t, b in rss if t >= min(SETTLED_AFTER_S, seconds / 2)]
    quarter = max(1, len(settled) // 4)
    return {
        "seconds": seconds,
        "epochs_sent": len(sent_ns),
        "healths_verified": len(verified),
        "refused": len(heard) - len(verified),
        "normal": sum(state == "NORMAL" for _, _, state, *_ in verified),
        "latency_ms": {
            name: round(float(np.percentile(latency_ms, q)), 3) for name, q in (("p50", 50), ("p99", 99), ("p999", 99.9), ("max", 100))
        },
        "median_parts_ms": {name: round(float(np.median(part)), 3) for name, part in parts_ms.items()},
        "rss_mb": round(max(b for _, b in rss) / MB, 1),
        "rss_growth_mb": round((float(np.mean(settled[-quarter:])) - float(np.mean(settled[:quarter]))) / MB, 2),
        "cpu_percent_of_a_core": round(100.0 * cpu_share, 2),
        "recorded_mb": round(recorded / MB, 2),
        "exit_code": exit_code,
        "talk": talk.splitlines(),
    }


def main() -> None:
    """Print what was measured, against what was asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--floor", action="store_true", help="a station that decides nothing")
    parser.add_argument("--bare", nargs=5, help=argparse.SUPPRESS)
    parser.add_argument("--listen", nargs=3, metavar=("ENDPOINT", "TRUSTED", "OUT"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.listen:
        endpoint, trusted, out = arguments.listen
        listen(endpoint, Path(trusted), Path(out))
        return
    if arguments.bare:
        endpoint, key, *addresses = arguments.bare
        bare_station(endpoint, Path(key), addresses)
        return
    found = measure(arguments.seconds, arguments.floor)
    if arguments.json:
        print(json.dumps(found, indent=2))
        return
    latency = found["latency_ms"]
    print(f"{found['epochs_sent']} epochs at 10 Hz sent, {found['healths_verified']} healths verified, {found['refused']} refused")
    print(f"last byte to verified health: p50 {latency['p50']:.2f} ms (asked 2), p99 {latency['p99']:.2f} ms (asked 5), ", end="")
    print(f"p99.9 {latency['p999']:.2f} ms, max {latency['max']:.2f} ms")
    print(f"resident memory: {found['rss_mb']:.0f} MB (asked 150), growth {found['rss_growth_mb']:.2f} MB (asked 5)")
    print(f"processor: {found['cpu_percent_of_a_core']:.1f} % of a core (asked 12); recorded {found['recorded_mb']:.1f} MB")


if __name__ == "__main__":
    main()
