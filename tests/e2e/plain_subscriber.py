"""May GNSS be used? By zenoh, cryptography, protobuf: ENDPOINT=tcp/HOST:PORT SITE=ID KEY=PUBLIC_IN_HEX python plain_subscriber.py"""

import os
import queue
from time import monotonic_ns

import wayside_pb2 as pb  # type: ignore[import-not-found]  # a copy of integrity/messages/wayside_pb2.py lies beside this file
import zenoh
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey


class Station:
    def __init__(self, site: str, key: bytes, max_ns: int) -> None:
        self.site, self.place, self.max_ns, self.key = site, f"wayside/v1/{site}/", max_ns, Ed25519PublicKey.from_public_bytes(key)
        self.nonce, self.asked, self.boot, self.sent, self.issued, self.sequence, self.epoch, self.until = b"", 0, b"none", 0, 0, 0, 0, 0

    def answer(self, data: bytes, now: int) -> str:
        signed = pb.SignedChallengeReply.FromString(data)
        self.key.verify(signed.signature, f"wayside.v1.challenge\0{self.place}challenge\0".encode() + signed.reply)
        reply = pb.ChallengeReply.FromString(signed.reply)
        if reply.nonce != self.nonce or len(reply.boot_id) != 16 or not 0 <= now - self.asked <= self.max_ns:
            raise ValueError("no answer to what was asked last, or too late")
        self.sequence = max(self.sequence if reply.boot_id == self.boot else 0, reply.sequence - 1)
        self.boot, self.sent, self.issued = reply.boot_id, self.asked, reply.issued_mono_ns
        return f"boot {self.boot.hex()} answers"

    def health(self, data: bytes, now: int) -> str:
        signed = pb.SignedHealth.FromString(data)
        self.key.verify(signed.signature, f"wayside.v1.health\0{self.place}health\0".encode() + signed.health)
        health = pb.Health.FromString(signed.health)
        if (health.site, health.boot_id) != (self.site, self.boot) or health.sequence <= self.sequence:
            raise ValueError(f"sequence {health.sequence} once more, or another site or boot")
        normal = (health.state, health.cause) == (pb.NORMAL, pb.CAUSE_UNSPECIFIED) and health.gps_time_ns > self.epoch
        self.sequence, self.epoch = health.sequence, health.gps_time_ns if health.HasField("gps_time_ns") else self.epoch
        since, before = now - self.sent, self.issued - health.issued_mono_ns
        age, valid = since + before + -(-max(abs(since), abs(before)) // 1000), min(health.valid_for_ms * 10**6, self.max_ns)
        self.until = 0 if not normal else now + (valid - age) * 1000 // 1001 if 0 <= age <= valid else self.until
        return f"{'GNSS' if normal and 0 <= age <= valid else 'no GNSS'}: state {health.state}, sequence {health.sequence}, age {age} ns"


if __name__ == "__main__":
    station, inbox = Station(os.environ["SITE"], bytes.fromhex(os.environ["KEY"]), 3 * 10**9), queue.Queue(1000)  # type: ignore[var-annotated]
    plain = '{mode: "client", connect: {endpoints: ["HERE"]}, scouting: {multicast: {enabled: false}, gossip: {enabled: false}}}'
    with zenoh.open(zenoh.Config.from_json5(plain.replace("HERE", os.environ["ENDPOINT"]))) as session:
        session.declare_subscriber(station.place + "health", lambda s: inbox.put((station.health, s, monotonic_ns())))
        while True:
            if monotonic_ns() >= station.asked + 10**9:
                station.nonce, station.asked = os.urandom(16), monotonic_ns()
                session.get(station.place + "challenge", lambda r: inbox.put((station.answer, r.ok, monotonic_ns())), payload=station.nonce)
            if 0 < station.until < monotonic_ns():
                station.until = 0
                print("no GNSS: nothing fresh has come in time", flush=True)
            try:
                judge, sample, now = inbox.get(timeout=0.02)
                print(judge(bytes(sample.payload), now), flush=True)
            except queue.Empty:
                continue
            except Exception as why:
                print(f"refused: {why!r}", flush=True)
