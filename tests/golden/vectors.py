"""Golden byte vectors of what goes over the air, for subscribers in any language: bytes, and what must be made of them.

After a change that is meant to change them: `python -m tests.golden.vectors`, then read the difference before committing it.
"""

import hashlib
import json
from pathlib import Path
from typing import Any

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from google.protobuf.json_format import MessageToDict
from google.protobuf.message import Message

from integrity.messages import wayside_pb2 as pb
from integrity.messages.key_expressions import CHALLENGE, HEALTH, site_key
from integrity.messages.signatures import HEALTH_CONTEXT, SigningKey, key_id, sign_challenge_reply, sign_health, signed_bytes, signing_key

VECTORS = Path(__file__).with_name("vectors.json")
ABOUT = (
    "Golden vectors of wayside.v1, explained in integrity/messages/REFERENCE.md. The private key is a test key that everybody knows: "
    "never trust it. Bytes are in hexadecimal; `contents` is for people; times are of the reader's monotonic clock, in nanoseconds."
)
SITE, MAX_VALID_MS = "test-site", 3000
PLACE, ASKED_AT = site_key(SITE, HEALTH), site_key(SITE, CHALLENGE)
SECRET = hashlib.sha256(b"wayside golden vectors: a test key, trusted nowhere").digest()
KEY = signing_key(Ed25519PrivateKey.from_private_bytes(SECRET))
STRANGER = signing_key(Ed25519PrivateKey.from_private_bytes(hashlib.sha256(b"wayside golden vectors: a stranger").digest()))
BOOT, NEXT_BOOT = bytes(range(16)), bytes(range(16, 32))
NONCE, NEXT_NONCE = bytes(range(32, 48)), bytes(range(48, 64))
GPS_NS, UTC_AHEAD_NS = 1_456_500_000_000_000_000, 315_964_782_000_000_000
MS = 1_000_000
SENT_NS, ROUND_TRIP_NS, STATION_NS = 5_000_000_000_000, 4 * MS, 70_000_000_000_000  # our clock, on the way, the station's clock
ISSUED_NS = STATION_NS + 500 * MS  # of the first health
HEARD_NS = SENT_NS + 510 * MS

Step = dict[str, Any]


def health(sequence: int = 7, **changes: Any) -> pb.Health:
    """A sound NORMAL, but for the changes; None takes a field away."""
    gps_ns = GPS_NS + sequence * 1000 * MS
    fields: dict[str, Any] = {
        "site": SITE,
        "boot_id": BOOT,
        "sequence": sequence,
        "gps_time_ns": gps_ns,
        "utc_ns": gps_ns + UTC_AHEAD_NS,
        "issued_mono_ns": ISSUED_NS + (sequence - 7) * 1000 * MS,
        "valid_for_ms": 3000,
        "covers_from_gps_ns": gps_ns - 1000 * MS + 1,
        "covers_to_gps_ns": gps_ns,
        "state": pb.NORMAL,
        "monitored": ["G05.1C", "E11.1X"],
        "monitored_signals": [monitored("G05.1C", 42, 0xCBF43926), monitored("E11.1X", 7, 0x00000001)],
        "config_sha256": hashlib.sha256(b"").hexdigest(),
        "software": "wayside 0.1.0",
    }
    return pb.Health(**{name: value for name, value in (fields | changes).items() if value is not None})


def monitored(signal: str, issue: int, crc: int) -> pb.MonitoredSignal:
    return pb.MonitoredSignal(
        signal=signal,
        issue=issue,
        ephemeris_crc32=crc,
        undetected_range_m=12.5,
        correction_m=-1.25,
        correction_sigma_m=0.25,
        b_m=[0.5, -0.25, -0.25],
    )


def anomaly(sequence: int = 7, **changes: Any) -> pb.Health:
    more = {"state": pb.SATELLITE_ANOMALY, "cause": pb.SATELLITE, "subjects": ["G07"], "reasons": ["residual 7.5 > 5.4"]}
    return health(sequence, **(more | {"excluded_satellites": ["G07"], "covers_from_gps_ns": None, "covers_to_gps_ns": None} | changes))


def silent(sequence: int = 7) -> pb.Health:
    """A heartbeat before the first epoch."""
    none = dict.fromkeys(("gps_time_ns", "utc_ns", "covers_from_gps_ns", "covers_to_gps_ns", "monitored", "monitored_signals"))
    return health(sequence, state=pb.NOT_CONFIRMABLE, cause=pb.DATA, subjects=["B"], reasons=["B is silent"], **none)


def air(message: pb.Health, key: SigningKey = KEY, place: str = PLACE) -> bytes:
    return sign_health(key, place, message).SerializeToString(deterministic=True)


def raw(data: bytes, key: SigningKey = KEY, context: bytes = HEALTH_CONTEXT, **changes: Any) -> bytes:
    """Any bytes, signed for health."""
    fields = {"health": data, "key_id": key.key_id, "signature": key.private.sign(signed_bytes(context, PLACE, data))}
    return pb.SignedHealth(**(fields | changes)).SerializeToString(deterministic=True)


def reply(nonce: bytes = NONCE, key: SigningKey = KEY, place: str = ASKED_AT, **changes: Any) -> bytes:
    fields: dict[str, Any] = {"nonce": nonce, "boot_id": BOOT, "issued_mono_ns": STATION_NS, "sequence": 6}
    return sign_challenge_reply(key, place, pb.ChallengeReply(**(fields | changes))).SerializeToString(deterministic=True)


def challenge(data: bytes, believed: bool, sent_ns: int = SENT_NS, took_ns: int = ROUND_TRIP_NS, nonce: bytes = NONCE) -> Step:
    """Asked and answered."""
    asked = {"step": "challenge", "nonce": nonce.hex(), "sent_mono_ns": sent_ns, "received_mono_ns": sent_ns + took_ns}
    return asked | {"data": data.hex(), "believed": believed}


def heard(data: bytes, state: str | None, age_ns: int | None = None, mono_ns: int = HEARD_NS, place: str = PLACE) -> Step:
    """Arrived; `state` is None where it must not be believed, `age_ns` is None where nobody can know it."""
    judged = {"believed": state is not None, "state": state, "age_ns": age_ns if state else None}
    fresh = state is not None and age_ns is not None and 0 <= age_ns <= MAX_VALID_MS * MS
    return {"step": "health", "key_expr": place, "mono_ns": mono_ns, "data": data.hex()} | judged | {"fresh": fresh}


# 510 ms after it was asked comes what was issued 500 ms after the answer: at most 10 ms old, and a thousandth of 510 ms for the clocks.
AGE_NS = 10 * MS + 510_000
TIE = challenge(reply(), True)


def later(n: int) -> int:
    """When the message after n others comes, and how old it can be: both clocks have gone on."""
    return HEARD_NS + n * 1000 * MS


def age_later(n: int) -> int:
    return AGE_NS + n * MS


def flipped(data: bytes, at: int) -> bytes:
    """With one bit of one byte the other way."""
    changed = bytearray(data)
    changed[at] ^= 1
    return bytes(changed)


def alone(state: str | None, data: bytes) -> list[Step]:
    """A message after a challenge, and after it one that is sound: what was not believed has changed nothing."""
    return [TIE, heard(data, state, AGE_NS), heard(air(health(9)), "NORMAL", age_later(2), later(2))]


def of_one_message() -> dict[str, list[Step]]:
    sound = air(health())
    future = raw(health().SerializeToString(deterministic=True) + b"\xa2\x06\x03new")  # field 100
    names = {
        "NORMAL": ("NORMAL", sound),
        "SATELLITE_ANOMALY": ("SATELLITE_ANOMALY", air(anomaly())),
        "a heartbeat before the first epoch": ("NOT_CONFIRMABLE", air(silent())),
        "NORMAL with a field that is not known yet": ("NORMAL", future),
        "a state that is not known": ("NOT_CONFIRMABLE", air(health(state=9))),
        "no state": ("NOT_CONFIRMABLE", air(health(state=None))),
        "NORMAL with a cause": ("NOT_CONFIRMABLE", air(health(cause=pb.JAMMING))),
        "NORMAL with a cause that is not known": ("NOT_CONFIRMABLE", air(health(cause=99))),
        "NORMAL without an epoch": ("NOT_CONFIRMABLE", air(health(gps_time_ns=None))),
        "a signature with one bit flipped": (None, flipped(sound, -1)),
        "a message with one bit flipped": (None, flipped(sound, 20)),
        "a shortened signature": (None, raw(health().SerializeToString(), signature=bytes(63))),
        "a key that is not trusted": (None, air(health(), STRANGER)),
        "a key that is not trusted under a name that is": (None, raw(health().SerializeToString(), STRANGER, key_id=KEY.key_id)),
        "signed for another place": (None, air(health(), place=site_key("other", HEALTH))),
        "signed as an answer to a challenge": (None, raw(health().SerializeToString(), context=b"wayside.v1.challenge")),
        "signed, but no Health": (None, raw(b"\xff\xff\xff")),
        "signed, but empty": (None, raw(b"")),
        "signed for another site": (None, air(health(site="other"))),
        "a boot of 15 bytes": (None, air(health(boot_id=BOOT[:15]))),
        "sequence 0": (None, air(health(sequence=0))),
        "a sequence lower than the challenge named": (None, air(health(5))),
        "nothing": (None, b""),
        "noise": (None, b"noise"),
        "cut in the middle": (None, sound[: len(sound) // 2]),
    }
    return {name: alone(state, data) for name, (state, data) in names.items()}


def of_several() -> dict[str, list[Step]]:
    first, copy = heard(air(health()), "NORMAL", AGE_NS), heard(air(health()), None, mono_ns=later(1))
    last_ns = SENT_NS + 3500 * MS * 1000 // 1001  # 3000 ms after it was issued, by clocks that part by a thousandth since the challenge
    in_force = challenge(reply(NEXT_NONCE, boot_id=NEXT_BOOT, sequence=0), True, later(1), nonce=NEXT_NONCE)
    next_ns = later(2) - later(1)
    restarted = health(1, boot_id=NEXT_BOOT, issued_mono_ns=STATION_NS + next_ns, gps_time_ns=GPS_NS + 9000 * MS)
    return {
        "a copy": [TIE, first, copy, heard(air(health(8)), "NORMAL", age_later(1), later(1))],
        "an older one": [TIE, heard(air(health(8)), "NORMAL", age_later(1), later(1)), copy],
        "the same sequence with other bytes": [TIE, first, heard(air(anomaly()), None, mono_ns=later(1))],
        "NORMAL for an epoch that was vouched for before": [
            TIE,
            first,
            heard(air(health(8, gps_time_ns=GPS_NS + 7000 * MS)), "NOT_CONFIRMABLE", age_later(1), later(1)),
        ],
        "at another key expression": [TIE, heard(air(health()), None, place=site_key("other", HEALTH))],
        "before any challenge": [heard(air(health()), "NORMAL")],
        "another boot": [TIE, first, heard(air(restarted), None, mono_ns=later(1))],
        "another boot, and then the old one again": [
            TIE,
            first,
            in_force,
            heard(air(restarted), "NORMAL", next_ns // 1000, later(2)),
            heard(air(health(9)), None, mono_ns=later(2)),
            challenge(reply(sequence=9), False, later(3)),
        ],
        "just in time": [TIE, heard(air(health()), "NORMAL", 3000 * MS, last_ns)],
        "a nanosecond too late": [TIE, heard(air(health()), "NORMAL", 3000 * MS + 1, last_ns + 1)],
        "valid for longer than the reader allows": [
            TIE,
            heard(air(health(valid_for_ms=60_000)), "NORMAL", 3000 * MS + 1, last_ns + 1),
        ],
        "from the future": [TIE, heard(air(health(issued_mono_ns=ISSUED_NS + 100 * MS)), "NORMAL", -90 * MS + 600_000)],
    }


def of_answers() -> dict[str, list[Step]]:
    message = heard(air(health()), "NORMAL")
    data = {
        "an answer to another nonce": reply(NEXT_NONCE),
        "an answer by a key that is not trusted": reply(key=STRANGER),
        "an answer signed for another place": reply(place=PLACE),
        "an answer with one bit flipped": flipped(reply(), -1),
        "an answer of a boot of 15 bytes": reply(boot_id=BOOT[:15]),
        "an answer that is noise": b"noise",
    }
    late = {"an answer that took too long": [challenge(reply(), False, took_ns=3000 * MS + 1), message]}
    return {name: [challenge(of, False), message] for name, of in data.items()} | late


def messages() -> dict[str, Message]:
    """One of each kind, for decoders."""
    return {
        "NORMAL": health(),
        "SATELLITE_ANOMALY": anomaly(),
        "heartbeat": silent(),
        "SignedHealth": pb.SignedHealth.FromString(air(health())),
        "ChallengeReply": pb.ChallengeReply(nonce=NONCE, boot_id=BOOT, issued_mono_ns=STATION_NS, sequence=6),
        "EpochReport": pb.EpochReport(
            gps_time_ns=GPS_NS,
            mono_ns=ISSUED_NS,
            state=pb.NORMAL,
            verdict_state=pb.NORMAL,
            triangle_alone=pb.NORMAL,
            triangle=[
                pb.Vertex(receiver="A", east_m=-0.5, north_m=0.25, up_m=0.0, satellites=9),
                pb.Vertex(receiver="B", unsolved=pb.DIVERGED),
            ],
            checks=[pb.Check(name="shape", statistic=2.5, threshold=37.5, outcome=pb.PASS), pb.Check(name="cn0", outcome=pb.NOT_MONITORED)],
            residuals=[pb.Residual(signal="G05.1C", used=True, sigmas=0.5, b_m=[0.5, -0.25, -0.25])],
        ),
        "Alert": pb.Alert(
            gps_time_ns=GPS_NS, mono_ns=ISSUED_NS, before=pb.NORMAL, state=pb.NOT_CONFIRMABLE, cause=pb.RECEIVER, subjects=["B"]
        ),
        "SiteInfo": pb.SiteInfo(
            site=SITE, frame="ITRF2020", triangle=[pb.SurveyedPoint(receiver="A", x_m=-3962108.673)], key_id=KEY.key_id
        ),
        "TrainPosition": pb.TrainPosition(
            train="r291",
            sequence=1,
            mono_ns=SENT_NS,
            status=pb.POSITION_VALID,
            front=pb.TrackPlace(edge="main", offset_m=0.0),
            facing=-1,
            trust=pb.TRUST_NORMAL,
            site=SITE,
            health_sequence=7,
            valid_for_ms=2990,
        ),
    }


def as_text() -> str:
    """The file, the same on every machine."""
    cases = of_one_message() | of_several() | of_answers()
    told = [
        {
            "name": name,
            "type": message.DESCRIPTOR.full_name,
            "data": message.SerializeToString(deterministic=True).hex(),
            "contents": MessageToDict(message, preserving_proto_field_name=True),
        }
        for name, message in messages().items()
    ]
    head = {"about": ABOUT, "site": SITE, "private_key": SECRET.hex(), "public_key": KEY.public.hex(), "key_id": key_id(KEY.public).hex()}
    whole = head | {"max_valid_ms": MAX_VALID_MS, "messages": told, "cases": [{"name": name, "steps": of} for name, of in cases.items()]}
    return json.dumps(whole, indent=1) + "\n"


if __name__ == "__main__":
    VECTORS.write_text(as_text(), "utf-8")
