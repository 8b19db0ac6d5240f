"""Does somebody else speak in a station's name? Pure: so many refused messages within so long are an alarm.

An alarm ends no trust: whoever can send rubbish could stop every train by it. But while it lasts trust does not rise
(train_positioning.md section 3, INVALID).
"""

from typing import NamedTuple

from integrity.gnss.gps_time import NS_PER_S
from integrity.messages.verification import Answer, Received

ALARMING = 3
WITHIN_NS = 10 * NS_PER_S
OWN_WORDS = ("overtaken", "late answer", "which boot", "round trip")  # refused, and yet of the station: it, or the network, was slow


class Alarm(NamedTuple):
    """When the last alarming messages came, of the train's clock: at most `ALARMING`, the oldest first."""

    mono_ns: tuple[int, ...] = ()


def is_alarming(judged: Received | Answer) -> bool:
    """Whether it cannot be the station's own word, said once.

    Of a boot that is not confirmed yet it may be the station's, and a copy of the last message may have come twice.
    """
    if isinstance(judged, Received) and judged.unconfirmed:
        return False
    return bool(judged.refusal) and not judged.refusal.startswith(("repeated", *OWN_WORDS))


def after_alarming(now: Alarm, mono_ns: int) -> Alarm:
    """One more has come."""
    return Alarm((*now.mono_ns, mono_ns)[-ALARMING:])


def is_raised(now: Alarm, mono_ns: int) -> bool:
    """Whether there is an alarm: so many within so long, and the last of them not longer ago."""
    if len(now.mono_ns) < ALARMING:
        return False
    return now.mono_ns[-1] - now.mono_ns[0] <= WITHIN_NS and mono_ns - now.mono_ns[-1] <= WITHIN_NS
