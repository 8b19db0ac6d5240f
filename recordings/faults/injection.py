"""Events in, events with faults out.

Whatever their order in the file, faults act in the order in which nature applies them: ranges, reception, the receiver itself, its
link. Each goes by the recording as it was before any of them.

Where a recording has the bytes of a receiver, the frames concerned are changed in them, checksums redone; all other bytes stay.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from integrity.assembler import nominal_epoch_ns
from integrity.config import SiteConfig
from integrity.errors import ConfigError
from integrity.events import EphemerisReceived, Event, ObservationsReceived
from integrity.gnss.gps_time import format_utc
from integrity.gnss.observations import ObservationRow
from integrity.gnss.signals import SYSTEM_NAMES, satellite_of
from integrity.station_monitor import Snapshot
from recordings.faults.edits import Changes, edits_of
from recordings.faults.kinds import (
    CodeBias,
    CodeCarrierDivergence,
    ConstellationClock,
    ConstellationFrame,
    CorruptBytes,
    Delay,
    IonoFront,
    Jamming,
    LinkEffect,
    LowPower,
    Meaconing,
    ReceiverClockJump,
    ReceiverDrop,
    ReceiverDuplicate,
    ReceiverFreeze,
    ReceiverNoise,
    WrongEphemeris,
    receivers_of,
    satellites_of,
)
from recordings.faults.links import corrupted, delayed, duplicated
from recordings.faults.meaconing import meaconed
from recordings.faults.orbits import serving, wrong_navigation
from recordings.faults.ranges import clock_jumped, with_ranges_changed
from recordings.faults.received import Measured, Received, measured, receive
from recordings.faults.reception import frozen, jammed, last_before, noisier, weakened, with_deadline_ticks
from recordings.faults.scenario import Fault
from recordings.faults.splicing import spliced
from recordings.faults.truth import RecordedRow, Truth, truth_of
from recordings.faults.words import wrong_words

LATER = (  # after all that changes ranges, in this order
    Meaconing,
    LowPower,
    Jamming,
    ReceiverNoise,
    ReceiverClockJump,
    ReceiverFreeze,
    ReceiverDrop,
    ReceiverDuplicate,
    Delay,
    CorruptBytes,
)


def inject(
    events: Sequence[Event], faults: Sequence[Fault], site: SiteConfig, seed: int = 0, snapshot: Snapshot | None = None
) -> tuple[Event, ...]:
    """The events of a recording with faults in it; `seed` draws the noise of jamming and the bits that flip, `snapshot` is what the
    recording begins with: the ephemerides and the ionosphere that had arrived before its events, and what was pending of its bytes.

    A fault covers whole epochs (nominal times). ConfigError where a fault would change nothing.
    """
    if not faults:
        return tuple(events)
    received = receive(events, site, snapshot)
    truth = truth_of(received.events, site, snapshot)
    changes = Changes({seen.place: seen.row for seen in truth.rows})
    on_links: list[tuple[int, Fault, LinkEffect]] = []
    silenced: dict[str, None] = {}
    for number, fault in sorted(enumerate(faults), key=lambda numbered: _turn(numbered[1])):
        effect = fault.effect
        hit = _rows_hit(fault, truth)
        if isinstance(effect, ReceiverDrop | Delay | CorruptBytes):
            silenced[effect.receiver] = None
        if isinstance(effect, LinkEffect):
            on_links.append((number, fault, effect))
        elif not _change(changes, fault, received, truth, hit, (seed, number)):
            raise ConfigError(f"{fault}: changes nothing: {_why_nothing(fault, truth)}; choose another start, size, receiver or satellite")
    out = _rebuilt(events, received, changes, truth)
    if on_links:
        out = _on_their_way(out, on_links, site, seed, snapshot)
    if silenced:
        heard = {found.place: found.receiver for found in measured(out, site, snapshot)}
        out = with_deadline_ticks(out, heard, tuple(silenced), site)
    return tuple(out)


def _turn(fault: Fault) -> int:
    return next((1 + i for i, kind in enumerate(LATER) if isinstance(fault.effect, kind)), 0)


def _change(changes: Changes, fault: Fault, received: Received, truth: Truth, hit: Sequence[RecordedRow], seed: tuple[int, int]) -> bool:
    """Note what a fault changes; whether that is anything."""
    rows = changes.rows
    match fault.effect:
        case WrongEphemeris() as effect:
            return _displace(changes, fault, effect, received, truth, hit)
        case ReceiverDrop():
            changes.dropped.update(seen.place for seen in hit)
            return True
        case Meaconing() as effect:
            changed = dict(meaconed(fault, effect, truth, hit, rows))
        case LowPower() as effect:
            changed = dict(weakened(fault, effect, truth, hit, rows, seed))
        case Jamming() as effect:
            changed = dict(jammed(fault, effect, truth, hit, rows, seed))
        case ReceiverNoise() as effect:
            changed = dict(noisier(effect, truth, hit, rows, seed))
        case ReceiverClockJump() as effect:
            changed = dict(clock_jumped(effect, truth, hit, rows))
        case ReceiverFreeze():
            changed = _freeze(changes, truth, hit)
        case CorruptBytes() | Delay() | ReceiverDuplicate():
            raise AssertionError(f"{fault.kind} acts after everything else")
        case effect:
            changed = dict(with_ranges_changed(fault, effect, truth, hit, rows))
    rows |= changed
    return bool(changed)


def _freeze(changes: Changes, truth: Truth, hit: Sequence[RecordedRow]) -> dict[int, ObservationRow]:
    last = last_before(truth, hit)
    if last is None:
        return {}
    frozen_rows = dict(frozen(hit, changes.rows[last], changes.rows))
    changes.repeats |= dict.fromkeys(frozen_rows, changes.repeats.get(last, last))
    return frozen_rows


def _displace(changes: Changes, fault: Fault, effect: WrongEphemeris, received: Received, truth: Truth, hit: Sequence[RecordedRow]) -> bool:
    """Words are replaced as they come; where ephemerides or measurements come as such, so does the displaced one."""
    serving(fault, effect, truth, hit[0])
    words = dict(wrong_words(fault, effect, truth, received.words))
    changes.words |= words
    as_such = [
        (place, event)
        for place, event in enumerate(received.events)
        if isinstance(event, EphemerisReceived | ObservationsReceived) and not received.as_bytes[place]
    ]
    if as_such:
        told = {place: event for place, event in as_such if isinstance(event, EphemerisReceived)}
        edits = wrong_navigation(fault, effect, truth, hit, told)
        changes.instead |= edits.instead
        for place, entering in edits.before.items():
            changes.before[place] = changes.before.get(place, []) + entering
    return bool(words or as_such)


def _rows_hit(fault: Fault, truth: Truth) -> list[RecordedRow]:
    """Rows that the fault covers; ConfigError where there is none, or its satellite is in none of them."""
    hit = truth.covered(fault.covers, receivers_of(fault.effect))
    if not hit:
        raise ConfigError(f"{fault}: covers no epoch: {_span(truth)}; choose a start within it")
    seen = _satellites(seen.row for seen in hit)
    for satellite in satellites_of(fault.effect):
        if satellite not in seen:
            raise ConfigError(f"{fault}: {satellite} is not seen then; seen are {', '.join(seen) or 'no satellites'}; {_span(truth)}")
    if isinstance(fault.effect, ConstellationClock | ConstellationFrame) and not any(s[0] == fault.effect.system for s in seen):
        systems = ", ".join(SYSTEM_NAMES[letter] for letter in dict.fromkeys(satellite[0] for satellite in seen)) or "no satellites"
        raise ConfigError(f"{fault}: no satellite of {SYSTEM_NAMES[fault.effect.system]} is seen then; seen are {systems}; {_span(truth)}")
    return hit


def _why_nothing(fault: Fault, truth: Truth) -> str:
    match fault.effect:
        case ReceiverFreeze():
            return f"no row of the receiver before it could be repeated; {_span(truth)}"
        case Jamming() | LowPower():
            return "no such signal is received then, or the ramp has not begun"
        case IonoFront():
            return "no signal of a satellite with an ephemeris is pierced behind its edge then"
        case CodeBias() | CodeCarrierDivergence():
            return "the codes of the satellite are not measured then, or the drift has not begun"
        case Meaconing():
            return f"{fault.effect.from_receiver} hears nothing then that the others know an orbit of"
        case WrongEphemeris():
            return "no words with the orbit of the satellite begin then; each page comes every 30 s"
        case _:
            return "no ephemeris of a satellite seen then has arrived, or the ranges are what they would be anyway"


def _satellites(rows: Iterable[ObservationRow]) -> list[str]:
    return sorted({satellite_of(signal) for row in rows for signal in row.signals})


def _span(truth: Truth) -> str:
    if not truth.rows:
        return "the recording has no epochs"
    epochs = [seen.epoch_ns for seen in truth.rows]
    return f"the recording spans {format_utc(min(epochs))} to {format_utc(max(epochs))}"


def _rebuilt(events: Sequence[Event], received: Received, changes: Changes, truth: Truth) -> list[Event]:
    """The events as they are now; rows that are no more are left out, events of receivers unknown to the site stay."""
    place_of = {origin: place for place, origin in enumerate(received.origins) if not received.as_bytes[place]}
    before: dict[int, list[Event]] = {}
    for place, entering in changes.before.items():
        before[received.origins[place]] = before.get(received.origins[place], []) + entering
    out: list[Event] = []
    for origin, event in enumerate(spliced(events, edits_of(received, changes, truth))):
        out += before.get(origin, [])
        at = place_of.get(origin)  # None: bytes
        if event is None or at in changes.dropped:
            continue
        if at is None:
            out.append(event)
        elif isinstance(event, ObservationsReceived) and at in changes.rows:
            row = changes.rows[at]
            out.append(event if row is event.row else replace(event, row=row))
        else:
            out.append(changes.instead.get(at, event))
    return out


def _on_their_way(
    events: list[Event], faults: Sequence[tuple[int, Fault, LinkEffect]], site: SiteConfig, seed: int, snapshot: Snapshot | None
) -> list[Event]:
    """What links make of the events. Bits flip last: what is not a sound frame any more would be no mark of where an epoch ends."""
    found: list[Measured] = []
    for number, fault, effect in faults:
        found = found or list(measured(events, site, snapshot))
        of_receiver = (m for m in found if m.receiver == effect.receiver)
        hit = [m for m in of_receiver if fault.covers(nominal_epoch_ns(m.receive_time_ns, site.epoch_interval_ns))]
        match effect:
            case CorruptBytes():
                changed = corrupted(events, effect, hit, site, (seed, number))  # in place: what was found stays where it was
            case Delay():
                changed, found = delayed(events, effect, hit), []
            case ReceiverDuplicate():
                changed, found = duplicated(events, effect, hit), []
        if changed == events:
            raise ConfigError(f"{fault}: changes nothing: {_why_no_link(effect, hit)}; choose another start, duration, rate or receiver")
        events = changed
    return events


def _why_no_link(effect: LinkEffect, hit: Sequence[Measured]) -> str:
    if not hit:
        return f"another fault has silenced {effect.receiver} then"
    if all(found.burst is None for found in hit):
        return f"the recording has no bytes of {effect.receiver}, only its measurements"
    return "no bit happens to flip"
