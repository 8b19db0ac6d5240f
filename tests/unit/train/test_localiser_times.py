"""The localiser over a turn of the GPS week, at which all GPS satellites send new ephemerides, and over one of Galileo: nothing happens."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from integrity.events import EphemerisReceived, Event, RawBytes, Tick
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS, parse_utc
from integrity.gnss.signals import satellite_of
from integrity.messages import wayside_pb2 as pb
from recordings.simulate.observations import observed
from recordings.simulate.receiver import as_bytes
from tests.unit.train.ride import KEY, LINE, MAP, SITE, Ground, a_train, errors_m, events, positions, ride, valid
from train_client.config import TrainConfig
from train_client.events import TrainEvent
from train_client.localisation.localiser import TrainLocaliser
from train_client.localisation.memory import LocaliserMemory
from train_client.outputs import PositionReport, TrainOutput
from train_client.simulate.motion import Leg, Run, antennas_on, run_of
from train_client.simulate.story import TRAIN_ERRORS
from train_client.snapshots import decode_snapshot, encode_snapshot

WEEK = parse_utc("2026-03-08T00:00:00Z") // WEEK_NS * WEEK_NS
TURNS = {
    "GPS week and new sets of GPS": WEEK,
    "new sets of Galileo": WEEK + 600 * NS_PER_S,
    "leap second": parse_utc("2017-01-01T00:00:00Z"),
}
BEFORE_S, AFTER_S = 6, 34  # three subframes, or seven pages, say everything within 30 s
TRUSTED_FROM = 2  # epochs

Change = Callable[[EphemerisReceived], Sequence[EphemerisReceived]]
of_every_turn = pytest.mark.parametrize("turn", TURNS)


def a_slow_train() -> TrainConfig:
    """One epoch a second."""
    return a_train(epoch_interval_ns=NS_PER_S)


def run_over(event_ns: int) -> Run:
    """At 20 m/s."""
    start_ns = event_ns - (BEFORE_S + 1) * NS_PER_S
    return run_of(LINE, start_ns, 40.0, [Leg(1e-6, 20.0e6)])


def as_it_is(event: EphemerisReceived) -> Sequence[EphemerisReceived]:
    return [event]


def measured_over(event_ns: int, change: Change = as_it_is) -> tuple[Event, ...]:
    """What the antennas send, with navigation messages changed."""
    antennas = antennas_on(run_over(event_ns), a_slow_train().antennas)
    found: list[Event] = []
    for event in observed(antennas, event_ns - BEFORE_S * NS_PER_S, BEFORE_S + AFTER_S, 1.0, 7, TRAIN_ERRORS):
        found += change(event) if isinstance(event, EphemerisReceived) else [event]
    in_order = sorted(found, key=lambda event: (event.mono_ns, not isinstance(event, EphemerisReceived)))
    return tuple(event for event in as_bytes(in_order, antennas) if isinstance(event, RawBytes | Tick))


def once_a_second(number: int, plain: pb.Health) -> pb.Health:
    plain.covers_from_gps_ns, plain.valid_for_ms = plain.gps_time_ns - NS_PER_S + 1, 3000
    return plain


@cache
def told(turn: str) -> list[TrainEvent]:
    return events(measured_over(TURNS[turn]), once_a_second)


@cache
def decided(turn: str) -> tuple[list[TrainOutput], LocaliserMemory]:
    """Everything at once, and what is remembered at the end."""
    localiser = TrainLocaliser(a_slow_train(), MAP, {SITE: [KEY.public]})
    return localiser.feed(told(turn)), localiser.snapshot()


def whole(turn: str) -> list[TrainOutput]:
    return decided(turn)[0]


def gps_ns(reports: Sequence[PositionReport]) -> list[int]:
    return [report.fix.gps_time_ns for report in reports if report.fix]


def in_pieces(of: Sequence[TrainEvent]) -> list[TrainEvent]:
    """Every burst of bytes in two, cut within a frame."""
    pieces: list[TrainEvent] = []
    for event in of:
        if isinstance(event, RawBytes):
            pieces += [replace(event, data=event.data[:-7]), replace(event, data=event.data[-7:])]
        else:
            pieces.append(event)
    return pieces


@of_every_turn
def test_every_epoch_is_valid_once_the_ground_is_trusted(turn: str) -> None:
    first_ns = TURNS[turn] - BEFORE_S * NS_PER_S
    assert gps_ns(valid(whole(turn))) == [first_ns + k * NS_PER_S for k in range(TRUSTED_FROM, BEFORE_S + AFTER_S)]


LATER_NS = 8 * NS_PER_S


class Later(Ground):
    """Goes by what satellites say eight seconds after the train has heard it."""

    def known(self, gps_ns: int) -> int:
        self.counts = {**getattr(self, "counts", {}), gps_ns: len(self.told)}
        return max([count for t_ns, count in self.counts.items() if t_ns <= gps_ns - LATER_NS], default=len(self.told))


@of_every_turn
def test_a_ground_that_goes_by_the_sets_before_for_a_while_is_followed(turn: str) -> None:
    """With the sets that it vouches for, which the train still has: no epoch, and no satellite, is lost."""
    with_new, with_old = (
        valid(ride(events(measured_over(TURNS[turn]), once_a_second, ground), a_slow_train())) for ground in (None, Later())
    )
    assert [report.fix and report.fix.used for report in with_old] == [report.fix and report.fix.used for report in with_new]


@of_every_turn
def test_the_front_end_is_where_it_was(turn: str) -> None:
    errors = errors_m(valid(whole(turn)), run_over(TURNS[turn]))
    assert np.sqrt(np.mean(np.square(errors))) <= 0.6


@of_every_turn
def test_one_piece_at_a_time_with_looks_ahead_decides_the_same(turn: str) -> None:
    localiser = TrainLocaliser(a_slow_train(), MAP, {SITE: [KEY.public]})
    outputs = []
    for event in in_pieces(told(turn)):
        outputs += localiser.feed([event])
        localiser.look_ahead()
    assert outputs == whole(turn)


@of_every_turn
def test_another_localiser_that_goes_on_from_a_snapshot_at_the_turn_decides_the_same(turn: str) -> None:
    pieces = in_pieces(told(turn))
    cut = 1 + next(i for i, event in enumerate(pieces) if event.mono_ns >= TURNS[turn])
    first = TrainLocaliser(a_slow_train(), MAP, {SITE: [KEY.public]})
    outputs = first.feed(pieces[:cut])
    message = encode_snapshot(first.snapshot(), a_slow_train(), MAP, 0).SerializeToString()
    second = TrainLocaliser(a_slow_train(), MAP, {SITE: [KEY.public]}, decode_snapshot(pb.TrainSnapshot.FromString(message), MAP))
    assert outputs + second.feed(pieces[cut:]) == whole(turn)


# ---- ephemerides that change


@pytest.mark.parametrize(("turn", "system"), [("GPS week and new sets of GPS", "G"), ("new sets of Galileo", "E")])
def test_new_sets_are_agreed_on_within_one_cycle(turn: str, system: str) -> None:
    used = {satellite_of(s) for report in positions(whole(turn)) if report.fix for s in report.fix.used if s[0] == system}
    issues = {(eph.satellite, eph.issue) for eph in decided(turn)[1].ephemerides}
    count = {satellite: sum(s == satellite for s, _ in issues) for satellite in used}
    assert len(used) >= 4 and set(count.values()) == {2}


def unused_reasons(reports: Sequence[PositionReport], satellite: str) -> list[str]:
    """Of each epoch, why a satellite was not used; "" where it was."""
    return [
        next((why for s, why in report.fix.unused if satellite_of(s) == satellite), "")
        for report in reports
        if report.fix is not None and any(satellite_of(s) == satellite for s in (*report.fix.used, *dict(report.fix.unused)))
    ]


@cache
def with_bad_health() -> tuple[str, list[PositionReport]]:
    """A Galileo satellite says it is unhealthy from the turn on, for 16 s, under its old issue."""
    event_ns = WEEK + 300 * NS_PER_S
    used = sorted({satellite_of(s) for report in valid(whole("new sets of Galileo")) if report.fix for s in report.fix.used if s[0] == "E"})

    def change(event: EphemerisReceived) -> Sequence[EphemerisReceived]:
        eph = event.ephemeris
        if eph.satellite != used[0] or not isinstance(eph, KeplerEphemeris):
            return [event]
        at_ns = [event_ns, event_ns + 16 * NS_PER_S]
        return [event, *(EphemerisReceived(t, replace(eph, healthy=k == 1, transmission_ns=t)) for k, t in enumerate(at_ns))]

    return used[0], positions(ride(events(measured_over(event_ns, change), once_a_second), a_slow_train()))


def test_an_unhealthy_satellite_is_not_used_until_it_is_healthy_again() -> None:
    satellite, reports = with_bad_health()
    reasons = unused_reasons(reports, satellite)
    changes = [b for a, b in zip(["", *reasons], reasons, strict=False) if a != b]
    assert changes == ["unhealthy by its own message", ""]


def test_an_unhealthy_satellite_costs_no_position() -> None:
    _, reports = with_bad_health()
    assert len({report.fix.gps_time_ns for report in valid(reports) if report.fix}) == BEFORE_S + AFTER_S - TRUSTED_FROM
