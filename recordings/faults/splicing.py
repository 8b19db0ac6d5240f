"""Stretches of a receiver's bytes replaced: all others stay, and stay in the events in which they came."""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

from integrity.events import Event, RawBytes


class Edit(NamedTuple):
    """The bytes from `begin` to before `end` become `data`, of any length; counted from the first byte of the receiver in the events."""

    receiver: str
    begin: int
    end: int
    data: bytes


def spliced(events: Sequence[Event], edits: Iterable[Edit]) -> list[Event | None]:
    """Each event with its bytes as they are now, the same object where they are the same; None where none are left.

    New data is cut where the old was; what is longer comes with the last piece. An edit within another one is passed over.
    """
    waiting = _in_order(edits)
    position: dict[str, int] = defaultdict(int)
    out: list[Event | None] = []
    for event in events:
        todo = waiting.get(event.receiver) if isinstance(event, RawBytes) else None
        if not isinstance(event, RawBytes) or todo is None:
            out.append(event)
            continue
        begin = position[event.receiver]
        position[event.receiver] = begin + len(event.data)
        data = _edited(event.data, begin, todo)
        out.append(event if data == event.data else replace(event, data=data) if data else None)
    return out


def _in_order(edits: Iterable[Edit]) -> dict[str, list[Edit]]:
    """By receiver, the last one first."""
    by_receiver: dict[str, list[Edit]] = {}
    for edit in sorted(edits, key=lambda e: (e.begin, -e.end)):
        earlier = by_receiver.setdefault(edit.receiver, [])
        if not earlier or edit.begin >= earlier[-1].end:
            earlier.append(edit)
    for earlier in by_receiver.values():
        earlier.reverse()
    return by_receiver


def _edited(data: bytes, begin: int, todo: list[Edit]) -> bytes:
    """The bytes that stand at `begin` of their stream; takes what is done with away from the end of `todo`."""
    end = begin + len(data)
    parts: list[bytes] = []
    at = begin
    while todo and todo[-1].begin < end:
        edit = todo[-1]
        first, last = max(edit.begin, begin), min(edit.end, end)
        parts.append(data[at - begin : first - begin])
        parts.append(edit.data[first - edit.begin : None if last == edit.end else last - edit.begin])
        at = last
        if edit.end > end:
            break
        todo.pop()
    return b"".join(parts) + data[at - begin :]
