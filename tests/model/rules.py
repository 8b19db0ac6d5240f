"""What must hold after every step, in words for people; "" where it does.

What is forged, changed, repeated, older, of a boot that is not in force or not of this site counts as if it had not come.

The bound on lateness that is checked is zero: half the round trip and the drift are what the train takes off, and they make up for
whatever it cannot know. So trust must be over when the last message that was NORMAL truly is.
"""

from integrity.messages import wayside_pb2 as pb
from tests.model.world import MS, PPM, RECOVER_MESSAGES, VALID_MS, Event, Rules, World, boot_in_force


def unsafe(rules: Rules, world: World) -> str:
    """The first rule that a state breaks."""
    return _late(rules, world) or _too_soon(rules, world) or _time(rules, world) or _no_way_back(rules, world)


def broken(rules: Rules, before: World, event: Event) -> str:
    """The first rule that a step breaks, whatever state it leads to."""
    if event.delivers and not event.fits and event.after.trust != before.trust:
        return f"what must not count made {before.trust} to {event.after.trust}"
    return (_not_down_at_once(event) if event.fits and event.state is not None else "") or _boots(before, event)


def _normal(rules: Rules, world: World) -> bool:
    return world.trust.state is rules.code.trust.TrustState.NORMAL


def _late(rules: Rules, world: World) -> str:
    """NORMAL ends, if nothing comes, before the true validity of the last message that said so does."""
    if not _normal(rules, world):
        return ""
    last_ns = rules.code.trust.next_change_ns(world.trust, rules.limits) - 1  # still trusted then; of the train's clock
    if world.known.end_ns is None:
        return "trusted, and no NORMAL has come"
    over_ns = (last_ns - rules.train_clock_ns(world.now_ns)) * PPM - (world.known.end_ns - world.now_ns) * (PPM + rules.drift.train_ppm)
    return f"trusted {over_ns / PPM / MS:.6f} ms longer than valid" if over_ns > 0 else ""


def _not_down_at_once(event: Event) -> str:
    """A message that says otherwise is what holds, however old it is, and nothing counts any longer."""
    trust = event.after.trust
    if event.state == pb.NORMAL or (trust.state.value == pb.State.Name(pb.State.ValueType(event.state or 0)) and not trust.normals):
        return ""
    return f"{trust} in spite of it"


def _too_soon(rules: Rules, world: World) -> str:
    """NORMAL needs so many in a row."""
    if not _normal(rules, world) or world.known.in_a_row >= RECOVER_MESSAGES:
        return ""
    return f"NORMAL after {world.known.in_a_row} in a row, not {RECOVER_MESSAGES}"


def _boots(before: World, event: Event) -> str:
    """A boot comes into force by its own answer to the train's nonce, in time, and never after a later one."""
    old, new = boot_in_force(before), boot_in_force(event.after)
    if new == old or new is None:
        return ""
    if old is not None and new < old:
        return f"boot {new} in force after boot {old}"
    if event.answer is None or not event.fits or event.answer.boot != new:
        return f"boot {new} in force, which did not answer this nonce within {VALID_MS} ms"
    return ""


def _no_way_back(rules: Rules, world: World) -> str:
    """Once nobody disturbs any more, one challenge and as many NORMAL messages as are asked for lead to trust: no denial lasts."""
    calm, nonce = rules.ask(rules.pass_time(world, MS))
    said = rules.answer(calm, nonce)
    calm = rules.deliver_answer(said, nonce, said.answers[0].data, said.answers[0]).after
    for _ in range(RECOVER_MESSAGES):
        sent = rules.issue(calm, pb.NORMAL)
        calm = rules.deliver(sent, sent.heard[0].data, true=sent.heard[0]).after
    return "" if _normal(rules, calm) else f"{calm.trust} though nobody disturbs any more"


def _time(rules: Rules, world: World) -> str:
    """Nothing changes before the announced moment, something does then, and in one step as in several."""
    trust, limits, now = world.trust, rules.limits, rules.code.trust
    change_ns = now.next_change_ns(trust, limits)
    if change_ns is None:
        return "" if now.after_time(trust, 2**62, limits) == trust else f"{trust} changes, and that was not announced"
    if now.after_time(trust, change_ns - 1, limits) != trust or now.after_time(trust, change_ns, limits).state is trust.state:
        return f"{trust} does not change at {change_ns}, as announced"
    far_ns = change_ns + 2 * limits.no_comms_after_ns
    stepped = now.after_time(now.after_time(trust, change_ns, limits), far_ns, limits)
    return "" if stepped == now.after_time(trust, far_ns, limits) else f"{trust} depends on the steps in which time passes"
