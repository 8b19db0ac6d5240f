"""Everything that may happen, by name: the ordinary, and the seven threats of EN 50159 (7.3)."""

from integrity.messages import wayside_pb2 as pb
from integrity.messages.signatures import sign_challenge_reply
from tests.model.world import CHALLENGE_PLACE, HEALTH_PLACE, LONG_NS, STEP_NS, Action, Event, Known, Rules, World, nonce_bytes


def _passes(step_ns: int) -> Action:
    return lambda rules, world: Event(rules.pass_time(world, step_ns))


def _heard(state: int) -> Action:
    """The station sends a message, and it arrives at once."""

    def action(rules: Rules, world: World) -> Event:
        sent = rules.issue(world, state)
        return rules.deliver(sent, sent.heard[0].data, true=sent.heard[0])

    return action


def _held(state: int) -> Action:
    """The station sends a message, and it does not arrive: never (deletion), or when the attacker likes (delay)."""
    return lambda rules, world: Event(rules.issue(world, state))


def _late(i: int) -> Action:
    """A message arrives that was sent before: for the first time or once more, in order or not."""
    return lambda rules, world: rules.deliver(world, world.heard[i].data, true=world.heard[i]) if i < len(world.heard) else None


def _station_restarts(rules: Rules, world: World) -> Event:
    return Event(world._replace(boot=world.boot + 1, sequence=0))


def _train_restarts(rules: Rules, world: World) -> Event:
    fresh = rules.start()
    return Event(world._replace(asked={}, verifier=fresh.verifier, trust=fresh.trust, known=Known()))


def _challenge(rules: Rules, world: World) -> Event:
    """Asked and answered at once."""
    asking, nonce = rules.ask(world)
    said = rules.answer(asking, nonce)
    return rules.deliver_answer(said, nonce, said.answers[0].data, said.answers[0])


def _ask(rules: Rules, world: World) -> Event:
    """The station answers at once, and its answer is held."""
    return Event(rules.answer(*rules.ask(world)))


def _ask_held(rules: Rules, world: World) -> Event:
    """The query is held."""
    asking, nonce = rules.ask(world)
    return Event(asking._replace(queries=(nonce, *world.queries)[: rules.remembers]))


def _query_arrives(i: int) -> Action:
    """The station answers a query that was held, for the first time or once more; its answer is held."""
    return lambda rules, world: Event(rules.answer(world, world.queries[i])) if i < len(world.queries) else None


def _answer_arrives(i: int) -> Action:
    def action(rules: Rules, world: World) -> Event | None:
        if i >= len(world.answers) or world.answers[i].nonce not in world.asked:
            return None
        answer = world.answers[i]
        return rules.deliver_answer(world, answer.nonce, answer.data, answer)

    return action


def _answer_replayed(rules: Rules, world: World) -> Event | None:
    """An old answer comes back to a new nonce."""
    if not world.answers:
        return None
    asking, nonce = rules.ask(world)
    return rules.deliver_answer(asking, nonce, world.answers[-1].data)


def _corrupted(rules: Rules, world: World) -> Event | None:
    """Whatever the last message said, NORMAL later than all: all else, and the signature, as it was."""
    if not world.heard:
        return None
    signed = pb.SignedHealth.FromString(world.heard[0].data)
    health = pb.Health.FromString(signed.health)
    health.MergeFrom(pb.Health(sequence=health.sequence + 1, state=pb.NORMAL, gps_time_ns=health.gps_time_ns + 1))
    health.cause = pb.CAUSE_UNSPECIFIED
    signed.health = health.SerializeToString()
    return rules.deliver(world, signed.SerializeToString())


def _cut(rules: Rules, world: World) -> Event | None:
    return rules.deliver(world, world.heard[0].data[:-1]) if world.heard else None


def _from_another_site(rules: Rules, world: World) -> Event:
    """The same key speaks for another site; its message is put here."""
    elsewhere = rules.health(world, pb.NORMAL, "there")
    return rules.deliver(world, rules.signed(rules.key, "wayside/v1/there/health", elsewhere).SerializeToString())


def _for_another_site(rules: Rules, world: World) -> Event:
    """Signed for this place, but it speaks of another site."""
    return rules.deliver(world, rules.signed(rules.key, HEALTH_PLACE, rules.health(world, pb.NORMAL, "there")).SerializeToString())


def _at_another_place(rules: Rules, world: World) -> Event:
    elsewhere = "wayside/v1/there/health"
    return rules.deliver(world, rules.signed(rules.key, elsewhere, rules.health(world, pb.NORMAL)).SerializeToString(), elsewhere)


def _stranger(rules: Rules, world: World) -> Event:
    return rules.deliver(world, rules.signed(rules.stranger, HEALTH_PLACE, rules.health(world, pb.NORMAL)).SerializeToString())


def _stranger_with_our_name(rules: Rules, world: World) -> Event:
    signed = rules.signed(rules.stranger, HEALTH_PLACE, rules.health(world, pb.NORMAL))
    signed.key_id = rules.key.key_id
    return rules.deliver(world, signed.SerializeToString())


def _stranger_answers(rules: Rules, world: World) -> Event:
    asking, nonce = rules.ask(world)
    reply = pb.ChallengeReply(nonce=nonce_bytes(nonce), boot_id=bytes([world.boot]) * 16, issued_mono_ns=0)
    signed = sign_challenge_reply(rules.stranger, CHALLENGE_PLACE, reply)
    signed.key_id = rules.key.key_id
    return rules.deliver_answer(asking, nonce, signed.SerializeToString())


ORDINARY: dict[str, Action] = {
    "0.4 s pass": _passes(STEP_NS),
    "NORMAL arrives": _heard(pb.NORMAL),
    "ANOMALY arrives": _heard(pb.SATELLITE_ANOMALY),
    "challenge answered": _challenge,
}
RESTARTS: dict[str, Action] = {"station restarts": _station_restarts, "train restarts": _train_restarts}
HELD: dict[str, Action] = {"NORMAL held": _held(pb.NORMAL)}
LAST: dict[str, Action] = {"the last message": _late(0)}
BEFORE_LAST: dict[str, Action] = {"the message before the last": _late(1)}
THREATS: dict[str, dict[str, Action]] = {
    "repetition": LAST | BEFORE_LAST,
    "deletion": HELD | {"ANOMALY held": _held(pb.SATELLITE_ANOMALY)},
    "insertion": {
        "message of another site": _from_another_site,
        "message about another site": _for_another_site,
        "message at another place": _at_another_place,
    },
    "re-sequencing": HELD | BEFORE_LAST,
    "corruption": {"last message made NORMAL": _corrupted, "last message cut": _cut},
    "delay": HELD | LAST | {"NOT_CONFIRMABLE held": _held(pb.NOT_CONFIRMABLE), "answer held": _ask, "the last answer": _answer_arrives(0)},
    "masquerade": {
        "NORMAL of a stranger": _stranger,
        "NORMAL of a stranger under the station's name": _stranger_with_our_name,
        "a stranger answers": _stranger_answers,
        "an old answer to a new nonce": _answer_replayed,
    },
}
CHALLENGES: dict[str, Action] = {
    "query held": _ask_held,
    "held query arrives": _query_arrives(0),
    "query before it arrives": _query_arrives(1),
    "the last answer": _answer_arrives(0),
    "the answer before the last": _answer_arrives(1),
}
LONG: dict[str, Action] = {"a day passes": _passes(LONG_NS)}
SEVEN: dict[str, Action] = {  # one of each, and what they need
    **HELD,
    **LAST,
    **BEFORE_LAST,
    "message of another site": _from_another_site,
    "last message made NORMAL": _corrupted,
    "answer held": _ask,
    "the last answer": _answer_arrives(0),
    "NORMAL of a stranger under the station's name": _stranger_with_our_name,
}
