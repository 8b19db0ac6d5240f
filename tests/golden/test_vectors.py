"""Golden vectors: made again bit by bit, judged as they say by our verifier, and by a subscriber that was written without it."""

import json
import sys
from types import ModuleType
from typing import Any

import pytest
from google.protobuf.json_format import MessageToDict

from integrity.messages import wayside_pb2 as pb
from integrity.messages.verification import HealthVerifier
from tests.golden.vectors import VECTORS, as_text

FILE = json.loads(VECTORS.read_text("utf-8"))
PUBLIC = bytes.fromhex(FILE["public_key"])
CASES = pytest.mark.parametrize("case", FILE["cases"], ids=lambda case: case["name"])


@pytest.fixture(scope="module")
def plain() -> ModuleType:
    """The plain subscriber; what it imports as a copy is our module here."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "wayside_pb2", pb)
        from tests.e2e import plain_subscriber

        return plain_subscriber


def test_the_vectors_are_made_again_bit_by_bit() -> None:
    assert as_text() == VECTORS.read_text("utf-8")


@pytest.mark.parametrize("told", FILE["messages"], ids=lambda told: told["name"])
def test_bytes_are_what_their_contents_say(told: dict[str, Any]) -> None:
    kind = getattr(pb, told["type"].removeprefix("wayside.v1."))
    message = kind.FromString(bytes.fromhex(told["data"]))
    assert MessageToDict(message, preserving_proto_field_name=True) == told["contents"]


def judged(verifier: HealthVerifier, step: dict[str, Any]) -> dict[str, Any]:
    """What our verifier makes of a step, in the words of the vectors."""
    data = bytes.fromhex(step["data"])
    if step["step"] == "challenge":
        asked = bytes.fromhex(step["nonce"]), step["sent_mono_ns"], step["received_mono_ns"]
        return {"believed": not verifier.challenge_answered(*asked, data).refusal}
    received = verifier.health(step["key_expr"], data, step["mono_ns"])
    state = received.said.value if received.verified else None
    return {"believed": received.verified, "state": state, "age_ns": received.age_ns, "fresh": received.fresh}


@CASES
def test_our_verifier_judges_as_the_vectors_say(case: dict[str, Any]) -> None:
    verifier = HealthVerifier(FILE["site"], [PUBLIC], FILE["max_valid_ms"])
    found = [judged(verifier, step) for step in case["steps"]]
    assert found == [{name: step[name] for name in of} for step, of in zip(case["steps"], found, strict=True)]


def may_use_gnss(station: Any, step: dict[str, Any]) -> bool:
    """Whether the plain subscriber takes a step for a reason to use GNSS."""
    data = bytes.fromhex(step["data"])
    if step["step"] == "challenge":
        station.nonce, station.asked = bytes.fromhex(step["nonce"]), step["sent_mono_ns"]
        judge, now_ns = station.answer, step["received_mono_ns"]
    else:
        judge, now_ns = station.health, step["mono_ns"]
    try:
        said: str = judge(data, now_ns)
    except Exception:
        return False
    return said.startswith("GNSS")


@CASES
def test_the_plain_subscriber_uses_gnss_exactly_where_the_vectors_allow_it(plain: ModuleType, case: dict[str, Any]) -> None:
    station = plain.Station(FILE["site"], PUBLIC, FILE["max_valid_ms"] * 1_000_000)
    # It subscribes at one place alone, so that nothing reaches it from another one.
    steps = [step for step in case["steps"] if step.get("key_expr") in (None, f"wayside/v1/{FILE['site']}/health")]
    allowed = [step.get("state") == "NORMAL" and step["fresh"] for step in steps]
    assert [may_use_gnss(station, step) for step in steps] == allowed
