"""Events in, events with faults out.

Whatever their order in the file, faults act in the order in which nature applies them: ranges, reception, then the receiver itself.
Each goes by the recording as it was before any of them.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from integrity.config import SiteConfig
from integrity.errors import ConfigError
from integrity.events import Event, ObservationsReceived
from integrity.gnss.gps_time import format_utc
from integrity.gnss.observations import ObservationRow
from integrity.gnss.signals import satellite_of
from integrity.station_monitor import Snapshot
from recordings.faults.kinds import Jamming, ReceiverDrop, ReceiverFreeze, SatelliteRamp, SatelliteStep, WrongEphemeris, receivers_of
from recordings.faults.orbits import wrong_navigation
from recordings.faults.ranges import Rows, with_ranges_changed
from recordings.faults.reception import frozen, jammed, with_deadline_ticks
from recordings.faults.scenario import Fault
from recordings.faults.truth import RecordedRow, Truth, truth_of

LATER = (Jamming, ReceiverFreeze, ReceiverDrop)  # after everything that changes ranges, in this order


def inject(
    events: Sequence[Event], faults: Sequence[Fault], site: SiteConfig, seed: int = 0, snapshot: Snapshot | None = None
) -> tuple[Event, ...]:
    """The events of a recording with faults in it; `seed` draws the noise of jamming, `snapshot` is what the
    recording begins with: the ephemerides and the ionosphere that had arrived before its events.

    A fault covers whole epochs (nominal times). ConfigError where a fault would change nothing.
    """
    truth = truth_of(events, site, snapshot)
    rows: dict[int, ObservationRow] = {seen.place: seen.row for seen in truth.rows}
    before: dict[int, list[Event]] = {}
    instead: dict[int, Event] = {}
    silenced: dict[str, None] = {}
    for number, fault in sorted(enumerate(faults), key=lambda numbered: _turn(numbered[1])):
        effect = fault.effect
        hit = _rows_hit(fault, truth)
        match effect:
            case WrongEphemeris():
                edits = wrong_navigation(fault, effect, truth, hit, events)
                instead |= edits.instead
                for place, entering in edits.before.items():
                    before[place] = before.get(place, []) + entering
                continue
            case ReceiverDrop():
                for seen in hit:
                    rows.pop(seen.place, None)
                silenced[effect.receiver] = None
                continue
            case Jamming():
                changed = dict(jammed(fault, effect, truth, hit, rows, (seed, number)))
            case ReceiverFreeze():
                changed = dict(frozen(truth, hit, rows))
            case _:
                changed = dict(with_ranges_changed(fault, effect, truth, hit, rows))
        if not changed:
            raise ConfigError(f"{fault}: changes nothing: {_why_nothing(fault, truth)}; choose another start, size, receiver or satellite")
        rows |= changed
    out = _rebuilt(events, rows, before, instead, site)
    return tuple(with_deadline_ticks(out, tuple(silenced), site) if silenced else out)


def _turn(fault: Fault) -> int:
    return next((1 + i for i, kind in enumerate(LATER) if isinstance(fault.effect, kind)), 0)


def _rows_hit(fault: Fault, truth: Truth) -> list[RecordedRow]:
    """Rows that the fault covers; ConfigError where there is none, or its satellite is in none of them."""
    hit = truth.covered(fault.covers, receivers_of(fault.effect))
    if not hit:
        raise ConfigError(f"{fault}: covers no epoch: {_span(truth)}; choose a start within it")
    if isinstance(fault.effect, SatelliteStep | SatelliteRamp | WrongEphemeris):
        seen = _satellites(seen.row for seen in hit)
        if fault.effect.satellite not in seen:
            raise ConfigError(
                f"{fault}: {fault.effect.satellite} is not seen then; seen are {', '.join(seen) or 'no satellites'}; {_span(truth)}"
            )
    return hit


def _why_nothing(fault: Fault, truth: Truth) -> str:
    match fault.effect:
        case ReceiverFreeze():
            return f"no row of the receiver before it could be repeated; {_span(truth)}"
        case Jamming():
            return "no signal is received then, or the ramp has not begun"
        case _:
            return "no ephemeris of a satellite seen then has arrived, or the ranges are what they would be anyway"


def _satellites(rows: Iterable[ObservationRow]) -> list[str]:
    return sorted({satellite_of(signal) for row in rows for signal in row.signals})


def _span(truth: Truth) -> str:
    if not truth.rows:
        return "the recording has no epochs"
    epochs = [seen.epoch_ns for seen in truth.rows]
    return f"the recording spans {format_utc(min(epochs))} to {format_utc(max(epochs))}"


def _rebuilt(
    events: Sequence[Event], rows: Rows, before: dict[int, list[Event]], instead: dict[int, Event], site: SiteConfig
) -> list[Event]:
    """The events with their rows as they are now; rows that are no more are left out, rows of receivers unknown to the site stay."""
    out: list[Event] = []
    for place, event in enumerate(events):
        out += before.get(place, [])
        if not isinstance(event, ObservationsReceived) or event.row.receiver not in site.receiver_names:
            out.append(instead.get(place, event))
        elif place in rows:
            out.append(event if rows[place] is event.row else replace(event, row=rows[place]))
    return out
