"""One receiver of a station is told false sets of satellites by the bytes of its words: nothing is decided by them, and it is said."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.config import Protocol
from integrity.events import EphemerisReceived, Event, RawBytes, ToldApart
from integrity.gnss.gps_time import NS_PER_S
from integrity.messages import wayside_pb2 as pb
from integrity.messages.snapshots import decode_snapshot, encode_snapshot
from integrity.monitors.told import FOLLOW_NS
from integrity.outputs import Output
from integrity.reception import Reception
from integrity.states import Cause, State
from integrity.station_monitor import StationMonitor
from recordings.faults.orbits import displaced
from tests.unit.long_streams import NEW_SETS, Form, around, sent, sets_changed, site_of
from tests.unit.monitored import decided, published
from tests.unit.streams import health, new_monitor

FORMS: tuple[Form, ...] = ("ubx", "rtcm3")
G16 = "B was told another orbit of G16 than A and C: 300.0 m apart, issue 209"
of_each_form = pytest.mark.parametrize("form", FORMS)


@cache
def told(form: Form, receivers: str, satellites: str, from_ns: int = NEW_SETS) -> tuple[Event, ...]:
    """A stream over `NEW_SETS` in which some receivers are told of satellites ("": all of GPS) 300 m along their orbits from where they
    are, by the sets that begin at or after a time."""

    def change(event: EphemerisReceived) -> Sequence[EphemerisReceived]:
        eph = event.ephemeris
        if event.mono_ns < from_ns or not eph.satellite.startswith(satellites or "G"):
            return [event]
        return [replace(event, ephemeris=displaced(eph, 300.0, "along", max(eph.transmission_ns, NEW_SETS)))]

    true = around(NEW_SETS, 10, FOLLOW_NS // NS_PER_S + 10)
    false = {(e.mono_ns, e.receiver): e for e in sent(sets_changed(true, change), form) if isinstance(e, RawBytes)}
    return tuple(false[e.mono_ns, e.receiver] if isinstance(e, RawBytes) and e.receiver in receivers else e for e in sent(true, form))


def said(outputs: Sequence[Output]) -> list[tuple[str, ...]]:
    return [tuple(reason for reason in h.reasons if " told " in reason) for h in health(outputs)]


def seconds_of(outputs: Sequence[Output], reason: str) -> list[int]:
    """Since the new sets, in which it is said."""
    return [((h.gps_time_ns or 0) - NEW_SETS) // NS_PER_S for h in health(outputs) if reason in h.reasons]


@of_each_form
def test_what_one_receiver_is_told_of_one_satellite_decides_nothing(form: Form) -> None:
    fed, sound = (decided(told(form, receivers, "G16"), site_of(form)) for receivers in ("B", ""))
    assert published(fed) == published(sound)


@of_each_form
def test_nothing_is_decided_before_all_have_had_the_time_to_be_told_the_same(form: Form) -> None:
    first = next(h for h in health(decided(told(form, "B", ""), site_of(form))) if h.cause is Cause.SPOOFING)
    assert ((first.gps_time_ns or 0) - NEW_SETS) // NS_PER_S in range(FOLLOW_NS // NS_PER_S, FOLLOW_NS // NS_PER_S + 2)


@of_each_form
def test_a_receiver_that_is_told_of_several_satellites_otherwise_is_being_spoofed(form: Form) -> None:
    last = health(decided(told(form, "B", ""), site_of(form)))[-1]
    assert (last.state, last.cause, last.subjects, last.excluded) == (State.SATELLITE_ANOMALY, Cause.SPOOFING, ("B",), ())


@of_each_form
def test_trains_get_the_set_that_two_were_told(form: Form) -> None:
    fed, sound = (
        [[(of.signal, of.issue, of.ephemeris_crc32) for of in h.vouched] for h in health(decided(told(form, who, "G16"), site_of(form)))]
        for who in ("B", "")
    )
    assert fed == sound


@of_each_form
def test_it_is_said_of_whom(form: Form) -> None:
    fed = decided(told(form, "B", "G16"), site_of(form))
    assert seconds_of(fed, G16)[0] in range(FOLLOW_NS // NS_PER_S, FOLLOW_NS // NS_PER_S + 2)


@of_each_form
def test_nothing_is_said_of_receivers_that_are_told_the_same(form: Form) -> None:
    assert set(said(decided(told(form, "", ""), site_of(form)))) == {()}


def test_receivers_of_both_protocols_are_told_the_same() -> None:
    ubx, rtcm3 = (told(form, "", "") for form in FORMS)
    events = [(b if isinstance(a, RawBytes) and a.receiver == "B" else a) for a, b in zip(ubx, rtcm3, strict=True)]
    protocols: dict[str, Protocol] = {"A": "ubx", "B": "rtcm3", "C": "ubx"}
    reception = Reception("ABC", protocols=protocols, most_change=5.5)
    heard = [x for event in events for x in reception.take(event)]
    assert sum(isinstance(x, EphemerisReceived) for x in heard) > 50 and not any(isinstance(x, ToldApart) for x in heard)


@of_each_form
def test_many_satellites_make_one_sentence(form: Form) -> None:
    (sentence,) = said(decided(told(form, "B", ""), site_of(form)))[-1]
    assert sentence.startswith("B was told other orbits of 9 satellites than A and C, of G")


@of_each_form
def test_a_satellite_that_tells_all_a_false_set_is_still_caught(form: Form) -> None:
    last = health(decided(told(form, "ABC", "G16"), site_of(form)))[-1]
    assert (last.state, last.subjects) == (State.SATELLITE_ANOMALY, ("G16",))


@of_each_form
@pytest.mark.parametrize("receiver", "AC")
def test_a_receiver_that_was_told_a_false_set_from_the_start_stops_nothing(form: Form, receiver: str) -> None:
    outputs = decided(told(form, receiver, "G16", 0), site_of(form))
    assert health(outputs)[-1].state is State.NORMAL


# ---- cuts and snapshots


def fed_in_parts(at: Sequence[int], between: Callable[[StationMonitor], StationMonitor]) -> list[Output]:
    events = told("rtcm3", "B", "G16")
    monitor, outputs = new_monitor(site_of("rtcm3")), []
    for start, end in zip([0, *at], [*at, len(events)], strict=True):
        outputs += monitor.feed(events[start:end])
        monitor = between(monitor)
    return outputs


def from_snapshot(monitor: StationMonitor) -> StationMonitor:
    message = encode_snapshot(monitor.snapshot(), monitor.site.receiver_names, 0).SerializeToString()
    return StationMonitor(monitor.site, decode_snapshot(pb.Snapshot.FromString(message)))


cuts = st.lists(st.integers(0, len(told("rtcm3", "B", "G16"))), max_size=4).map(sorted)


@settings(max_examples=8, deadline=None)
@given(cuts, st.sampled_from([lambda monitor: monitor, from_snapshot]))
def test_neither_cuts_nor_a_new_start_change_what_is_said(at: list[int], between: Callable[[StationMonitor], StationMonitor]) -> None:
    whole = decided(told("rtcm3", "B", "G16"), site_of("rtcm3"))
    parts = fed_in_parts(at, between)
    assert (published(parts), said(parts)) == (published(whole), said(whole))
