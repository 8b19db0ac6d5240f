"""What a train may believe, once more and by hand: the rules of `wayside.proto` and of the trust machine, from the bytes on.

It shares no code with what it is held against: it reads fields by `health_wire`, and knows which bytes the station's key has signed from
who made them. Bytes that the library cannot read (text that is no UTF-8, say) are refused; that a message is unreadable is taken from it.
"""

from collections.abc import Iterable
from functools import lru_cache
from typing import NamedTuple

from tests.fuzz.health_wire import LENGTH, VARINT, Field, Unreadable, fields_of

MS = 1_000_000
NORMAL, SATELLITE_ANOMALY = 1, 2
SITE, BOOT, SEQUENCE, GPS_TIME, ISSUED, VALID_FOR, COVERS_FROM, COVERS_TO, STATE, CAUSE, MONITORED, EXCLUDED, SIGNALS = (
    *(1, 2, 3, 4, 6, 7, 8, 9, 10, 11, 15, 16),
    21,
)
MAPS = 22
SIGNAL_NAME = 1
ANSWERED_NONCE, ANSWERED_BOOT, ANSWERED_ISSUED, ANSWERED_SEQUENCE = 1, 2, 3, 4


class Judged(NamedTuple):
    """Whether a message is the station's next, says NORMAL by every rule, or an anomaly, and is young enough to count.

    `may_be_next`: it may come of a boot that is not in force yet.
    """

    accepted: bool
    normal: bool = False
    anomaly: bool = False
    fresh: bool = False
    may_be_next: bool = False


REFUSED = Judged(False)


class Message:
    """Fields of a message by number: as they count where they stand several times."""

    def __init__(self, data: bytes) -> None:
        """Raises Unreadable."""
        self._fields: dict[tuple[int, int], list[Field]] = {}
        for field in fields_of(data):
            self._fields.setdefault((field.number, field.kind), []).append(field)

    def texts(self, number: int) -> list[bytes]:
        return [value for field in self._fields.get((number, LENGTH), ()) if isinstance(value := field.value, bytes)]

    def text(self, number: int) -> bytes:
        return (self.texts(number) or [b""])[-1]

    def number(self, number: int, bits: int = 64) -> int:
        """Without sign; 0 where there is none."""
        fields = self._fields.get((number, VARINT))
        value = fields[-1].value if fields else 0
        assert isinstance(value, int)
        return value & (1 << bits) - 1

    def signed(self, number: int) -> int:
        """With one."""
        value = self.number(number)
        return value - (1 << 64) if value >> 63 else value

    def has(self, number: int) -> bool:
        return (number, VARINT) in self._fields


@lru_cache(maxsize=1024)  # most messages of a story come again and again
def read(data: bytes) -> Message | None:
    """The message, or None."""
    try:
        return Message(data)
    except Unreadable:
        return None


class Train:
    """One train that follows one station."""

    def __init__(self, site: str, max_valid_ms: int, recover_messages: int, map_sha256: str = "") -> None:
        self.site, self.max_valid_ns, self.recover_messages = site.encode(), max_valid_ms * MS, recover_messages
        self.map_sha256 = map_sha256.encode()
        self.boot, self.asked_ns, self.answered_ns, self.issued_ns = b"", 0, 0, 0
        self.over: set[bytes] = set()
        self.speaker, self.sequence, self.least, self.bytes, self.epoch_ns = b"", 0, 0, b"", None
        self.in_a_row, self.until_ns = 0, -1
        self._vouched: list[Message] = []

    speaker: bytes
    epoch_ns: int | None

    def time_is(self, now_ns: int) -> None:
        """Validity runs."""
        if now_ns > self.until_ns:
            self.in_a_row = 0
        if self.in_a_row < self.recover_messages:
            self._vouched.clear()

    def may_use(self) -> bool:
        """As of the last `time_is`, and what was judged since."""
        return self.in_a_row >= self.recover_messages

    def vouches_for(self, gps_ns: int, used: Iterable[str]) -> bool:
        """Whether some message, since GNSS may be used, covers an epoch and the signals that were used in it."""
        return any(_covers(told, gps_ns, set(used)) for told in self._vouched)

    def answer(self, nonce: bytes, sent_ns: int, now_ns: int, data: bytes) -> bool:
        """Whether the station is that boot. Bytes that are rightly signed and can be read."""
        told = read(data)
        if told is None or told.text(ANSWERED_NONCE) != nonce or not 0 <= now_ns - sent_ns <= self.max_valid_ns:
            return False
        boot = told.text(ANSWERED_BOOT)
        if len(boot) != 16 or boot in self.over or (self.boot and sent_ns < self.asked_ns):
            return False
        if self.boot and boot != self.boot:
            if sent_ns <= self.answered_ns:
                return False
            self.over.add(self.boot)
        self._speaks(boot)
        self.boot, self.asked_ns, self.answered_ns, self.issued_ns = boot, sent_ns, now_ns, told.signed(ANSWERED_ISSUED)
        self.least = max(self.least, told.number(ANSWERED_SEQUENCE))
        return True

    def health(self, now_ns: int, data: bytes) -> Judged:
        """Of bytes that are rightly signed and can be read."""
        told = read(data)
        assert told is not None, "the library reads what is no message"
        boot, sequence = told.text(BOOT), told.number(SEQUENCE)
        if told.text(SITE) != self.site or len(boot) != 16 or sequence < 1 or boot in self.over:
            return REFUSED
        if self.boot and boot != self.boot:
            return Judged(False, may_be_next=True)
        last, least = (self.sequence, self.least) if boot == self.speaker else (0, 0)
        if sequence <= last or sequence < least:
            return REFUSED
        self._speaks(boot)
        rises = told.has(GPS_TIME) and (self.epoch_ns is None or told.signed(GPS_TIME) > self.epoch_ns)
        normal = told.number(STATE, 32) == NORMAL and told.number(CAUSE, 32) == 0 and rises
        self.sequence, self.epoch_ns = sequence, told.signed(GPS_TIME) if told.has(GPS_TIME) else self.epoch_ns
        if not self.boot:
            return Judged(True, normal, told.number(STATE, 32) == SATELLITE_ANOMALY, may_be_next=True)
        since_ns, before_ns = now_ns - self.asked_ns, self.issued_ns - told.signed(ISSUED)
        age_ns = since_ns + before_ns + (max(abs(since_ns), abs(before_ns)) + 999) // 1000
        valid_ns = min(told.number(VALID_FOR, 32) * MS, self.max_valid_ns)
        fresh = 0 <= age_ns <= valid_ns
        self._counts(told, normal, fresh, now_ns, (valid_ns - age_ns) * 1000 // 1001)
        return Judged(True, normal, told.number(STATE, 32) == SATELLITE_ANOMALY, fresh)

    def _speaks(self, boot: bytes) -> None:
        if boot != self.speaker:
            self.speaker, self.sequence, self.least, self.epoch_ns = boot, 0, 0, None

    def _counts(self, told: Message, normal: bool, fresh: bool, now_ns: int, left_ns: int) -> None:
        maps = told.texts(MAPS)
        if not normal or (maps and self.map_sha256 not in maps):
            self.in_a_row, self.until_ns = 0, now_ns
            self._vouched.clear()
        elif fresh:
            self.in_a_row, self.until_ns = self.in_a_row + 1, now_ns + left_ns
            if self.may_use():
                self._vouched.append(told)


def _covers(told: Message, gps_ns: int, used: set[str]) -> bool:
    if not told.has(COVERS_FROM) or not told.signed(COVERS_FROM) <= gps_ns <= told.signed(COVERS_TO) <= told.signed(GPS_TIME):
        return False
    listed, out = set(told.texts(MONITORED)), set(told.texts(EXCLUDED))
    named = {of.text(SIGNAL_NAME) for data in told.texts(SIGNALS) if (of := read(data)) is not None}
    return used <= {name.decode() for name in named & listed if name.partition(b".")[0] not in out}


def says_normal(data: bytes) -> bool:
    """Whether a message could read as NORMAL to anybody, whatever came before it."""
    told = read(data)
    return told is not None and told.number(STATE, 32) == NORMAL and told.number(CAUSE, 32) == 0 and told.has(GPS_TIME)
