"""Ephemerides that change in the middle of a block: new issues, wrong ones, satellites marked unhealthy, casters that repeat old sets."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from integrity.events import EphemerisReceived, Event, RawBytes, Tick
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import ObservationRow
from integrity.outputs import Alert, HealthReport
from integrity.states import Cause, State
from recordings.faults import Fault, inject
from recordings.faults.receiver_kinds import ReceiverBias
from tests.unit.long_streams import (
    FORMS,
    NEW_SETS,
    UNHEALTHY_FROM,
    UNHEALTHY_S,
    Form,
    marked_unhealthy,
    new_sets,
    satellite_in_use,
    sent,
    sets_changed,
    site_of,
    without,
)
from tests.unit.monitored import decided, published
from tests.unit.streams import SITE, alerts, health, reports, rows_changed, with_more

of_every_form = pytest.mark.parametrize("form", FORMS)

# ---- ephemerides that change


def of_satellite(satellite: str, change: Callable[[KeplerEphemeris], KeplerEphemeris]) -> tuple[Event, ...]:
    """The stream with new sets in which that of one satellite is changed."""

    def changed(event: EphemerisReceived) -> Sequence[EphemerisReceived]:
        eph = event.ephemeris
        new = eph.satellite == satellite and event.mono_ns >= NEW_SETS
        return [replace(event, ephemeris=change(eph))] if new and isinstance(eph, KeplerEphemeris) else [event]

    return sets_changed(new_sets(), changed)


def test_positions_hardly_move_with_new_sets() -> None:
    """Against a stream in which they are not sent: within what the resolution of the format costs, 0.3 m of range; but they move."""
    old = sets_changed(new_sets(), lambda event: [] if event.mono_ns >= NEW_SETS else [event])
    step_m = [
        float(np.abs(a.e_enu_m - b.e_enu_m).max())
        for a, b in zip(reports(decided(old)), reports(decided(new_sets())), strict=True)
        if a.gps_time_ns >= NEW_SETS
    ]
    assert min(step_m) > 0.01 and max(step_m) < 0.5


@cache
def alert_of_a_wrong_set(form: Form, name: str, wrong_by: float) -> Alert:
    """The first after start-up."""
    wrong = of_satellite("G16", lambda eph: replace(eph, **{name: getattr(eph, name) + wrong_by}))
    return next(a for a in alerts(decided(sent(wrong, form), site_of(form))) if a.before is State.NORMAL)


# A clock 36 m off, an orbit 530 m along its track, of which enough shows in the range.
of_wrong_sets = pytest.mark.parametrize(("name", "wrong_by"), [("af0", 2.0**-23), ("m0", 2e-5)])


@of_every_form
@of_wrong_sets
def test_a_wrong_new_set_is_caught_as_the_satellites_fault(form: Form, name: str, wrong_by: float) -> None:
    first = alert_of_a_wrong_set(form, name, wrong_by)
    assert (first.state, first.cause, first.subjects) == (State.SATELLITE_ANOMALY, Cause.SATELLITE, ("G16",))


@of_every_form
@of_wrong_sets
def test_a_wrong_new_set_is_caught_when_it_has_arrived(form: Form, name: str, wrong_by: float) -> None:
    """At once, or with the last of the three subframes that make it up."""
    caught_ns = alert_of_a_wrong_set(form, name, wrong_by).gps_time_ns
    assert caught_ns is not None and 0 <= caught_ns - NEW_SETS <= (30 * NS_PER_S if form == "ubx" else 0)


# ---- health


@pytest.mark.parametrize(("system", "form"), [("G", "rows"), ("E", "rows"), ("E", "rtcm3")])
def test_an_unhealthy_satellite_is_left_out_for_just_as_long_as_it_says_so(system: str, form: Form) -> None:
    satellite, events = marked_unhealthy(system)
    assert without(satellite, health(decided(sent(events, form), site_of(form))), UNHEALTHY_FROM) == list(range(UNHEALTHY_S[system]))


@pytest.mark.parametrize(("system", "told_within_s"), [("G", 30), ("E", 14)])
def test_words_tell_of_bad_and_good_health_within_one_cycle(system: str, told_within_s: int) -> None:
    satellite, events = marked_unhealthy(system)
    seconds = without(satellite, health(decided(sent(events, "ubx"))), UNHEALTHY_FROM)
    assert 0 <= seconds[0] <= told_within_s and -1 <= seconds[-1] - UNHEALTHY_S[system] <= told_within_s
    assert seconds == list(range(seconds[0], seconds[-1] + 1))


@of_every_form
def test_no_exclusion_is_charged_to_an_unhealthy_satellite(form: Form) -> None:
    assert {h.excluded for h in health(decided(sent(marked_unhealthy("E")[1], form), site_of(form)))} == {()}


def test_ranges_of_an_unhealthy_satellite_may_be_anything() -> None:
    satellite, events = marked_unhealthy("G")

    def change(row: ObservationRow) -> ObservationRow:
        columns = [i for i, s in enumerate(row.signals) if s.startswith(satellite)]
        unhealthy = 0 <= row.receive_time_ns - UNHEALTHY_FROM < UNHEALTHY_S["G"] * NS_PER_S
        return with_more(row, "pseudorange_m", 1e4, columns) if unhealthy else row

    assert published(decided(rows_changed(events, change))) == published(decided(events))


def test_a_fault_of_a_receiver_is_named_in_the_very_epoch_of_new_sets() -> None:
    bias = ReceiverBias(receiver="B", offset_enu_m=(30.0, 26.0, 0.0))
    events = inject(new_sets(), [Fault(NEW_SETS, NEW_SETS + 5 * NS_PER_S, bias)], SITE)
    first = next(a for a in alerts(decided(events)) if a.before is State.NORMAL)
    assert (first.gps_time_ns, first.cause, first.subjects) == (NEW_SETS, Cause.RECEIVER, ("B",))


# ---- casters that repeat old sets


@cache
def with_a_stale_caster(protocol_of_a: Form, stale_after_s: int) -> tuple[str, list[HealthReport]]:
    """A satellite whose new set says unhealthy. The caster of B has nothing of it until later, and then still the set before."""
    satellite = satellite_in_use(new_sets(), "G")

    def fresh(event: EphemerisReceived) -> Sequence[EphemerisReceived]:
        eph = event.ephemeris
        new = eph.satellite == satellite and event.mono_ns >= NEW_SETS
        return [replace(event, ephemeris=replace(eph, healthy=False))] if new and isinstance(eph, KeplerEphemeris) else [event]

    def stale(event: EphemerisReceived) -> Sequence[EphemerisReceived]:
        if event.ephemeris.satellite != satellite:
            return [event]
        return [replace(event, mono_ns=NEW_SETS + stale_after_s * NS_PER_S)] if event.mono_ns < NEW_SETS else []

    told, old = (sent(sets_changed(new_sets(), change), "rtcm3") for change in (fresh, stale))
    by_words = sent(sets_changed(new_sets(), fresh), protocol_of_a)
    site = site_of("rtcm3")
    site = replace(site, receivers=(replace(site.receivers[0], protocol="ubx" if protocol_of_a == "ubx" else "rtcm3"), *site.receivers[1:]))

    def of_receiver(events: Sequence[Event], receiver: str) -> dict[int, Event]:
        return {event.mono_ns: event for event in events if isinstance(event, RawBytes) and event.receiver == receiver}

    bursts = [of_receiver(by_words, "A"), of_receiver(old, "B"), of_receiver(told if protocol_of_a == "rtcm3" else old, "C")]
    ticks = [event for event in told if isinstance(event, Tick)]
    events = [event for tick in ticks for event in (*(burst[tick.mono_ns] for burst in bursts), tick)]
    return satellite, health(decided(events, site))


def test_an_old_set_that_a_caster_repeats_does_not_undo_what_the_new_one_says() -> None:
    satellite, said = with_a_stale_caster("rtcm3", 5)
    assert without(satellite, said, NEW_SETS) == list(range(35))


def test_an_old_set_that_a_caster_repeats_does_not_undo_what_words_have_said() -> None:
    satellite, said = with_a_stale_caster("ubx", 25)
    seconds = without(satellite, said, NEW_SETS)
    assert seconds[-1] == 34 and seconds == list(range(seconds[0], 35))
