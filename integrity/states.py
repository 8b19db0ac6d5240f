"""The words in which the station speaks: published states, causes, outcomes of checks."""

from enum import IntEnum, StrEnum


class State(StrEnum):
    """What the station tells the world."""

    NORMAL = "NORMAL"
    SATELLITE_ANOMALY = "SATELLITE_ANOMALY"
    NOT_CONFIRMABLE = "NOT_CONFIRMABLE"


class Cause(StrEnum):
    """Why the state is not NORMAL; NONE only with NORMAL."""

    NONE = ""
    NOT_READY = "not_ready"
    MAINTENANCE = "maintenance"
    SELF_TEST = "self_test"
    DATA = "data"
    JAMMING = "jamming"
    SPOOFING = "spoofing"
    CONSTELLATION = "constellation"
    SATELLITE = "satellite"
    RECEIVER = "receiver"
    CLOCK = "clock"
    AMBIGUOUS = "ambiguous"


STATE_OF_CAUSE: dict[Cause, State] = {
    cause: State.SATELLITE_ANOMALY
    if cause in (Cause.SATELLITE, Cause.CONSTELLATION, Cause.SPOOFING, Cause.JAMMING)
    else State.NOT_CONFIRMABLE
    for cause in Cause
    if cause is not Cause.NONE
}


class Outcome(IntEnum):
    """Of one check; the worst wins."""

    PASS = 0
    NOT_MONITORED = 1
    UNKNOWN = 2
    FAIL = 3
