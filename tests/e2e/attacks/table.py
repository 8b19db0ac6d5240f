"""The table of attacks: one line of data each. Threats by their names in EN 50159; what comes besides them is failure, load, the calendar.

The attacks of a group share a station.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import NamedTuple

from tests.e2e.attacks import deeds as do
from tests.e2e.attacks import tactics as he
from tests.e2e.attacks.certificates_scene import as_impostor, certified_scene, with_certificate, with_strange_certificate
from tests.e2e.attacks.ride import Case, Must, through_both, through_wire
from tests.e2e.attacks.scene import LEAP_NS, ROLLOVER_NS, Scene, scene, scene_before
from tests.e2e.attacks.tactics import tactic

REPETITION, DELETION, INSERTION, RESEQUENCE = "repetition", "deletion", "insertion", "re-sequence"
CORRUPTION, DELAY, MASQUERADE = "corruption", "delay", "masquerade"
FAILURE, LOAD, CALENDAR = "failure", "overload", "calendar"

BACK_S = 4.0  # a challenge, ten messages, and a connection to be made anew
REDIALLED_S = 14.0  # a connection that both ends have given up, and a dial that hung meanwhile
ALARMED_S = 10.0 + BACK_S  # for which an alarm holds trust down
STATION_BACK_S = 15.0  # a station that has to find itself first
MOST_GROWTH_MB = 64.0  # messages of 1 kB, 256 to be decided and thousands to be recorded, and what Zenoh holds: 6 to 25 measured
MOST_LATE_MS = 2000.0  # from decision to word: 90 ms measured, 0.7 s where others kept the machine busy

KEY, SIGNATURE, SITE, OLD = "unknown key", "wrong signature", "wrong site", "older"
NONCE, ANSWER = "challenge: wrong nonce", "challenge: wrong signature"


def stays(*refused: str, at_least: int = 0, valid: bool = False) -> Must:
    return Must("stays", refused, at_least, believes=not refused, valid=valid)


def ends(*refused: str, back_s: float = BACK_S) -> Must:
    return Must("ends", refused, back_s=back_s)


def alarms(*refused: str, back_s: float | None = None) -> Must:
    """Trust ends; whether it comes back is asked where `back_s` is longer than the alarm."""
    return Must("ends", refused, 20, back_s=back_s)


def never(*refused: str, at_least: int = 0, back_s: float | None = None) -> Must:
    return Must("never", refused, at_least, back_s=back_s)


SAFE = Must("safe", back_s=ALARMED_S)
FLOODED = Must("safe", ("unreadable", SIGNATURE), 1000, back_s=ALARMED_S, growth_mb=MOST_GROWTH_MB, told_late_ms=MOST_LATE_MS)
FLOODED_ALONE = FLOODED._replace(trust="ends", back_s=None)

ON_THE_AIR = (
    Case("repeated", REPETITION, "each message three times", tactic(he.thrice), stays("repeated")),
    Case("replayed", REPETITION, "each followed by nine earlier ones", tactic(he.with_earlier_ones), stays(OLD, at_least=50)),
    Case("replayed instead", REPETITION, "earlier ones in its place", tactic(he.earlier_ones_instead), alarms(OLD)),
    Case("deleted", DELETION, "nine of ten", tactic(he.one_in_ten), stays(), lasts_s=2.0),
    Case("all deleted", DELETION, "all; challenges are answered", tactic(he.withheld), ends()),
    Case("inserted", INSERTION, "each followed by four forged NORMAL", he.with_forgeries, stays(KEY, SIGNATURE, SITE, at_least=20)),
    Case("another site's key", INSERTION, "another site speaks at this one's place", he.of_another_site, stays(KEY, at_least=10)),
    Case("swapped", RESEQUENCE, "the second of two first", tactic(he.swapped), stays(OLD, at_least=5)),
    Case("flipped", CORRUPTION, "a bit of every second one", tactic(he.every_second_flipped), stays(SIGNATURE, at_least=5)),
    Case("all flipped", CORRUPTION, "a bit of each", tactic(he.flipped), alarms(SIGNATURE, back_s=ALARMED_S)),
    Case("another tail", CORRUPTION, "as after a stall: tails of others", tactic(he.with_another_tail), stays(SIGNATURE, at_least=5)),
    Case("bits on the wire", CORRUPTION, "a bit of every third piece of TCP", do.bits_flipped, SAFE, through_wire, 2.0),
    Case("0.2 s late", DELAY, "every byte, both ways", do.slowed, stays(), through_wire, 3.0),
    Case("5 s late", DELAY, "each message; challenges are answered at once", tactic(he.later(5.0)), never(), lasts_s=8.0),
    Case("ever later", DELAY, "twice as slow as time; nothing is answered", he.ever_later, Must("ends"), lasts_s=5.0),
    Case("held for 4 s", DELAY, "all held, then let go at once", he.held_then_let_go, Must("ends"), lasts_s=4.0),
    Case("asked late", DELAY, "challenges come to the station after 0.8 s", tactic(challenge=he.asked_late(0.8)), stays(), lasts_s=2.5),
    Case("answered late", DELAY, "answers are held for 0.8 s", tactic(challenge=he.answered_late(0.8)), stays(), lasts_s=2.5),
    Case("not answered", DELETION, "all answers", tactic(challenge=he.withheld), stays(), lasts_s=2.0),
    Case("never answered", DELETION, "the same, from the start", tactic(challenge=he.withheld), never(back_s=BACK_S), lasts_s=3.0),
    Case("answers replayed", REPETITION, "the first one to each", tactic(challenge=he.first_answer), stays(NONCE, at_least=2), lasts_s=2.5),
    Case("answered twice", INSERTION, "with that one, too", tactic(challenge=he.answered_twice), stays(NONCE, at_least=2), lasts_s=2.5),
    Case("masquerade", MASQUERADE, "a stranger in its place, under its name", he.MASQUERADE, alarms(SIGNATURE, ANSWER)),
    Case("from the start", MASQUERADE, "the same", he.MASQUERADE, never(SIGNATURE, ANSWER, at_least=20), lasts_s=3.0),
    Case("cut for 0.5 s", FAILURE, "the path", do.cut, stays(), through_wire, 0.5),
    Case("cut for 3 s", FAILURE, "the path", do.cut, SAFE, through_wire, 3.0),
    Case("cut for 30 s", FAILURE, "the path", do.cut, ends(back_s=REDIALLED_S), through_wire, 30.0),
    Case("stalled", FAILURE, "the way down for 7 s, in full flow", do.stalled, ends(back_s=REDIALLED_S), through_both, 7.0),
    Case("flooded", LOAD, "100,000 garbage messages beside it", do.flooded, FLOODED),
    Case("flooded alone", LOAD, "100,000 garbage messages in its place", do.flooded_in_its_place, FLOODED_ALONE),
    Case("stopped", FAILURE, "SIGSTOP to the station", do.stopped, ends(back_s=STATION_BACK_S), through_wire),
    Case("frozen", FAILURE, "its deciding thread; it answers", do.decisions_frozen, ends(back_s=STATION_BACK_S), through_wire),
    Case("killed", FAILURE, "SIGKILL; it begins anew", do.killed, ends(back_s=STATION_BACK_S), through_wire),
    Case("older boot", REPETITION, "what it said before, in its place", do.played_back_after_a_boot, alarms("older boot")),
    Case("older boot first", REPETITION, "the same, to a train that starts", do.played_back_from_the_start, never(), lasts_s=3.0),
)
BEHIND_A_ROUTER = (
    Case("wrong authority", MASQUERADE, "who poses as the station", do.nothing, never(), as_impostor, 4.0),
    Case("other authority", MASQUERADE, "who comes as a train", do.nothing, never(), with_strange_certificate, 3.0),
    Case("ended", MASQUERADE, "the train's certificate", do.nothing, Must("refuses", ("renew it",)), with_certificate("late"), 0.0),
    Case("without rights", MASQUERADE, "the train's certificate", do.nothing, never(), with_certificate("guest"), 3.0),
    Case("guest speaks", MASQUERADE, "who has no rights, at the site's key", do.guest_speaks, stays(), with_certificate("r291"), 2.0),
    Case("other site", MASQUERADE, "it speaks at this one's key", do.other_site_speaks, stays(), with_certificate("r291"), 2.0),
)
ACROSS_A_LEAP_SECOND = (
    Case("leap second", CALENDAR, "2016-12-31T23:59:60Z", do.until_after(LEAP_NS), stays(valid=True), through_wire, 0.0),
)
ACROSS_A_ROLLOVER = (
    Case("week rollover", CALENDAR, "to GPS week 2048", do.until_after(ROLLOVER_NS), stays(valid=True), through_wire, 0.0),
)


class Group(NamedTuple):
    """Attacks on one station, which `scene` makes in a folder."""

    scene: Callable[[Path], AbstractContextManager[Scene]]
    cases: tuple[Case, ...]


GROUPS = (
    Group(scene, ON_THE_AIR),
    Group(certified_scene, BEHIND_A_ROUTER),
    Group(scene_before(LEAP_NS), ACROSS_A_LEAP_SECOND),
    Group(scene_before(ROLLOVER_NS), ACROSS_A_ROLLOVER),
)
