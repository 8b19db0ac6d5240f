"""A checker that cannot fail proves nothing: each of these mistakes in the code is found, by the setting named."""

import pytest

from tests.model.code import Changes, quick
from tests.model.explore import explore
from tests.model.world import Rules
from tests.model.worlds import SETTINGS

IN_VERIFICATION: dict[str, tuple[str, Changes]] = {
    "no drift": ("replay", {" + -(-max(abs(since_ns), abs(before_ns)) // DRIFT_DIVISOR)": ""}),
    "half the drift": ("replay", {"abs(before_ns)) // DRIFT_DIVISOR": "abs(before_ns)) // (4 * DRIFT_DIVISOR)"}),
    "the round trip forgotten": ("late answer", {"now_mono_ns - self.sent_mono_ns, ": "now_mono_ns - self.received_mono_ns, "}),
    "an equal sequence accepted": ("replay", {"if health.sequence > last.sequence:": "if health.sequence >= last.sequence:"}),
    "a lower sequence accepted": (
        "replay",
        {"if health.sequence < last.sequence:": "if False:", "if health.sequence > last.sequence:": "if data != last.data:"},
    ),
    "an overtaken one accepted": ("replay", {">= last.told else": ">= 0 else"}),
    "the last message forgotten": ("replay", {"self._last = before._replace(": "before._replace("}),
    "superseded boots forgotten": (
        "challenges",
        {"self._superseded.add(self._tie.boot_id)": "pass", "<= self._tie.received_mono_ns": "< 0"},
    ),
    "asked before the last had answered": ("challenges", {"<= self._tie.received_mono_ns:": "< 0:"}),
    "asked when the last had answered": ("challenges", {"<= self._tie.received_mono_ns:": "< self._tie.received_mono_ns:"}),
    "any nonce": ("insertion and masquerade", {"len(nonce) != NONCE_BYTES or reply.nonce != nonce": "len(nonce) != NONCE_BYTES"}),
    "any round trip": ("delay and masquerade", {"if not 0 <= round_trip_ns <= self.max_valid_ms * NS_PER_MS:": "if False:"}),
    "an unconfirmed boot believed": ("replay", {"if not refusal and self._tie and health.boot_id != self._tie.boot_id:": "if False:"}),
    "any signature": ("insertion and masquerade", {"if not signature_is_right(public, signature, context, key_expr, data):": "if False:"}),
    "any site": ("insertion and masquerade", {"if health.site != self.site:": "if False:"}),
    "any place": ("insertion and masquerade", {"if key_expr != expected:": "if False:"}),
    "a late answer puts the old boot in force": (
        "challenges",
        {
            "if self._tie and tie.boot_id != self._tie.boot_id and tie.sent_mono_ns <= self._tie.received_mono_ns:": "if False:",
        },
    ),
    "an answer supersedes its own boot": ("restarts", {"self._superseded.add(self._tie.boot_id)": "self._superseded.add(tie.boot_id)"}),
    "never too old": ("replay", {"fresh = 0 <= age_ns <= received.valid_ns": "fresh = 0 <= age_ns"}),
}
IN_TRUST: dict[str, tuple[str, Changes]] = {
    "what was refused counts": ("replay", {"if not received.verified or received.unconfirmed:": "if received.unconfirmed:"}),
    "what is not fresh counts": ("replay", {"if not received.fresh or (held": "if (held"}),
    "down only if fresh": ("replay", {"if received.said is not State.NORMAL:": "if received.said is not State.NORMAL and received.fresh:"}),
    "one too few": ("restarts", {"now.normals + 1 >= limits": "now.normals + 2 >= limits"}),
    "down does not forget": ("restarts", {"Trust(told.state, 0, told": "Trust(told.state, now.normals, told"}),
    "expiry does not forget": ("restarts", {"Trust(TrustState.STALE, 0, now": "Trust(TrustState.STALE, now.normals, now"}),
    "silence does not forget": ("restarts", {"Trust(TrustState.NO_COMMS, 0, now": "Trust(TrustState.NO_COMMS, now.normals, now"}),
    "the drift of the rest forgotten": ("restarts", {" * DRIFT_DIVISOR // (DRIFT_DIVISOR + 1)": " * (DRIFT_DIVISOR + 1) // DRIFT_DIVISOR"}),
    "the age forgotten": ("replay", {"(received.valid_ns - received.age_ns)": "received.valid_ns"}),
    "never expires": ("restarts", {"        return Input.EXPIRES": "        return Input.NOTHING"}),
    "a nanosecond late": ("restarts", {"if mono_ns > now.valid_until_ns and": "if mono_ns > now.valid_until_ns + 1 and"}),
    "a nanosecond early": ("restarts", {"if mono_ns > now.valid_until_ns and": "if mono_ns >= now.valid_until_ns and"}),
    "announced late": ("restarts", {"return now.valid_until_ns + 1 +": "return now.valid_until_ns + 2 +"}),
    "announced early": ("restarts", {"return now.valid_until_ns + 1 +": "return now.valid_until_ns +"}),
    "never announced": ("restarts", {"if now.valid_until_ns is None or now.state": "if now.state is now.state or now.state"}),
}


def test_a_change_that_finds_no_place_is_a_mistake_of_the_test() -> None:
    with pytest.raises(ValueError, match="expected once"):
        quick({"nowhere": ""})


@pytest.mark.parametrize("name", IN_VERIFICATION)
def test_found_in_verification(name: str) -> None:
    setting, changes = IN_VERIFICATION[name]
    assert _story(setting, changes, {})


@pytest.mark.parametrize("name", IN_TRUST)
def test_found_in_trust(name: str) -> None:
    setting, changes = IN_TRUST[name]
    assert _story(setting, {}, changes)


def _story(name: str, in_verification: Changes, in_trust: Changes) -> str:
    setting = SETTINGS[name]
    return explore(Rules(quick(in_verification, in_trust)), setting.actions, setting.depth, setting.within).story
