"""What the command was asked for."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Wish:
    """One kind of phase or all (None), seconds of the story or all of it; and when, of the monotonic clock, the command began."""

    kind: str | None
    seconds: float | None
    began_ns: int
