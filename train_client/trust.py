"""May GNSS be used now, as far as the ground says? Pure, one table; denies by default.

Theory of operation. Trust begins at NO_COMMS. Whatever comes, and whatever does not come in time, means one of the rows of `TABLE`, and
nothing else changes it. One row leads to NORMAL. The clock is the train's own monotonic one, which the challenge ties to the station's
(`integrity.messages.verification`); GNSS time, UTC and the order of arrival never make anything fresh.

    DOWN    a verified message reads SATELLITE_ANOMALY or NOT_CONFIRMABLE, fresh or not: that at once, all counted ones forgotten
    COUNTS  a fresh NORMAL, but not enough of them in a row yet: counted. What was STALE or NO_COMMS is now NOT_CONFIRMABLE
    PROVEN  a fresh NORMAL, and enough of them in a row (or already NORMAL): NORMAL
    EXPIRES the validity of the last message that counted has run out: STALE, all counted ones forgotten
    SILENT  and nothing has counted for `no_comms_after_ns` since: NO_COMMS
    NOTHING a message that was refused (INVALID) or whose boot no challenge has confirmed, or a NORMAL that is not fresh, or one that would
            raise trust while somebody else speaks in the station's name (`train_client.alarm`)

Every message that counts carries its own end: `valid_until_ns`. A message that says "down" has one too, so that silence after it is told.

That is of one station. Where several vouch for a place, all of them must: `together`. Silence of one is no assent, or who cuts the wire of
the one that has seen something would raise trust.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from integrity.messages.verification import DRIFT_DIVISOR, Received
from integrity.states import State


class TrustState(Enum):
    """What a train may do with GNSS: only under NORMAL anything."""

    NORMAL = "NORMAL"
    SATELLITE_ANOMALY = "SATELLITE_ANOMALY"
    NOT_CONFIRMABLE = "NOT_CONFIRMABLE"
    STALE = "STALE"
    NO_COMMS = "NO_COMMS"
    CONFLICT = "CONFLICT"  # of several stations together only


WORST_FIRST = (
    TrustState.CONFLICT,
    TrustState.SATELLITE_ANOMALY,
    TrustState.NOT_CONFIRMABLE,
    TrustState.NO_COMMS,
    TrustState.STALE,
    TrustState.NORMAL,
)
DENIED = WORST_FIRST[:3]  # the ground speaks, and not in favour: there is no position


class TrustLimits(NamedTuple):
    """How many NORMAL messages in a row lead up, and how long after the end of validity silence is NO_COMMS."""

    recover_messages: int
    no_comms_after_ns: int


@dataclass(frozen=True)
class Trust:
    """What is remembered. `normals`: fresh NORMAL messages in a row; `valid_until_ns`: of the train's clock, None before the first one."""

    state: TrustState = TrustState.NO_COMMS
    normals: int = 0
    valid_until_ns: int | None = None
    sequence: int | None = None  # of the message that counted last

    def __post_init__(self) -> None:
        if self.state is TrustState.NORMAL and (self.valid_until_ns is None or self.normals < 1):
            raise ValueError("NORMAL needs a message that is valid, and its end")
        if self.state is TrustState.CONFLICT:
            raise ValueError("one station does not contradict itself")

    @property
    def says(self) -> TrustState | None:
        """What the station has said last, NORMAL before that is believed too; None: it is silent."""
        if self.normals:
            return TrustState.NORMAL
        return self.state if self.state in DENIED else None


class Input(Enum):
    """What a message, or a moment, means to trust."""

    DOWN = "down"
    COUNTS = "counts"
    PROVEN = "proven"
    EXPIRES = "expires"
    SILENT = "silent"
    NOTHING = "nothing"


class _Told(NamedTuple):
    """Of the message, if there is one: its state, its end, its sequence."""

    state: TrustState
    valid_until_ns: int | None
    sequence: int | None


def _down(now: Trust, told: _Told) -> Trust:
    return Trust(told.state, 0, told.valid_until_ns, told.sequence)


def _counts(now: Trust, told: _Told) -> Trust:
    silent = now.state in (TrustState.STALE, TrustState.NO_COMMS)
    return Trust(TrustState.NOT_CONFIRMABLE if silent else now.state, now.normals + 1, told.valid_until_ns, told.sequence)


def _normal(now: Trust, told: _Told) -> Trust:
    return Trust(TrustState.NORMAL, now.normals + 1, told.valid_until_ns, told.sequence)


def _expires(now: Trust, told: _Told) -> Trust:
    return Trust(TrustState.STALE, 0, now.valid_until_ns, now.sequence)


def _silent(now: Trust, told: _Told) -> Trust:
    return Trust(TrustState.NO_COMMS, 0, now.valid_until_ns, now.sequence)


def _nothing(now: Trust, told: _Told) -> Trust:
    return now


TABLE: dict[Input, Callable[[Trust, _Told], Trust]] = {
    Input.DOWN: _down,
    Input.COUNTS: _counts,
    Input.PROVEN: _normal,
    Input.EXPIRES: _expires,
    Input.SILENT: _silent,
    Input.NOTHING: _nothing,
}
STATE_TOLD = {
    State.NORMAL: TrustState.NORMAL,
    State.SATELLITE_ANOMALY: TrustState.SATELLITE_ANOMALY,
    State.NOT_CONFIRMABLE: TrustState.NOT_CONFIRMABLE,
}


def together(stations: Iterable[Trust]) -> TrustState:
    """Trust in a place that these vouch for: NORMAL only where each is, CONFLICT where they say different things, else the worst of them.

    Nobody vouches: NO_COMMS.
    """
    trusts = list(stations)
    if len({trust.says for trust in trusts} - {None}) > 1:
        return TrustState.CONFLICT
    return min((trust.state for trust in trusts), key=WORST_FIRST.index, default=TrustState.NO_COMMS)


def after_message(now: Trust, received: Received, mono_ns: int, limits: TrustLimits, held: bool = False) -> Trust:
    """Trust after a message that was judged at `mono_ns`; first let time pass up to then (`after_time`). `held`: it must not rise now."""
    told = _Told(STATE_TOLD[received.said], _valid_until_ns(received, mono_ns), received.sequence)
    return TABLE[_meaning(now, received, limits, held)](now, told)


def after_time(now: Trust, mono_ns: int, limits: TrustLimits) -> Trust:
    """Trust at `mono_ns`, where nothing has come since."""
    return TABLE[_meaning_of_time(now, mono_ns, limits)](now, _Told(now.state, now.valid_until_ns, now.sequence))


def next_change_ns(now: Trust, limits: TrustLimits) -> int | None:
    """When `after_time` will change something if nothing comes; None: never."""
    if now.valid_until_ns is None or now.state is TrustState.NO_COMMS:
        return None
    return now.valid_until_ns + 1 + (limits.no_comms_after_ns if now.state is TrustState.STALE else 0)


def _meaning(now: Trust, received: Received, limits: TrustLimits, held: bool) -> Input:
    if not received.verified or received.unconfirmed:
        return Input.NOTHING
    if received.said is not State.NORMAL:
        return Input.DOWN
    if not received.fresh or (held and now.state is not TrustState.NORMAL):
        return Input.NOTHING
    proven = now.state is TrustState.NORMAL or now.normals + 1 >= limits.recover_messages
    return Input.PROVEN if proven else Input.COUNTS


def _meaning_of_time(now: Trust, mono_ns: int, limits: TrustLimits) -> Input:
    if now.state is TrustState.NO_COMMS:
        return Input.NOTHING
    if now.valid_until_ns is None or mono_ns > now.valid_until_ns + limits.no_comms_after_ns:
        return Input.SILENT
    if mono_ns > now.valid_until_ns and now.state is not TrustState.STALE:
        return Input.EXPIRES
    return Input.NOTHING


def _valid_until_ns(received: Received, mono_ns: int) -> int:
    """When the age bound reaches the validity: it grows faster than the clock by the drift. A message of unknown age has ended."""
    if received.age_ns is None or not received.fresh:
        return mono_ns
    return mono_ns + (received.valid_ns - received.age_ns) * DRIFT_DIVISOR // (DRIFT_DIVISOR + 1)
