"""Faults put into recordings of permanent stations in Catalonia, 2010-03-18, every 30 s: what the monitor must say, epoch by epoch.

UPC1, UPC2, GARR: two antennas 38 m apart and one 20 km away, an hour. CREU, EBRE, GARR: 130 to 290 km apart, twelve hours.
"""

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from integrity.config import IntegrityConfig, ReceiverConfig, SatelliteFaultPolicy, SiteConfig
from integrity.events import Event, RawBytes
from integrity.gnss.gps_time import NS_PER_S, parse_utc
from integrity.outputs import EpochReport
from integrity.states import Cause, State
from integrity.station_monitor import StationMonitor
from recordings.faults import Fault, inject
from recordings.faults.kinds import (
    ConstellationClock,
    Effect,
    Meaconing,
    ReceiverBias,
    ReceiverClockJump,
    SatelliteAcceleration,
    SatelliteStep,
    Spoofing,
    TwoReceivers,
)
from recordings.faults.satellite_kinds import IonoFront
from recordings.faults.truth import elevations_rad, runs, truth_of
from recordings.importer import import_files
from recordings.rinex.navigation import NavigationFile, read_navigation
from recordings.rinex.observation import ObservationFile, read_observations

DATA = Path(__file__).parents[2].parent / "shared" / "data" / "catalonia_2010"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason=f"no recordings at {DATA}")

INTERVAL_NS = 30 * NS_PER_S
FAULTY_EPOCHS = 24
CLEAN_EPOCHS = 8  # before the fault: the monitor is up after two of them
FILES = {
    "CREU": "CREU0770_00-12h.10o.gz",
    "EBRE": "EBRE0770_00-12h.10o.gz",
    "GARR": "GARR0770_00-12h.10o.gz",
    "UPC1": "UPC10770.11o.gz",
    "UPC2": "UPC20770.11o.gz",
}
NEAR, FAR = ("UPC1", "UPC2", "GARR"), ("CREU", "EBRE", "GARR")
Case = tuple[tuple[str, ...], str]
CASES: list[Case] = [
    *((NEAR, minute) for minute in ("05:05", "05:15", "05:25", "05:35", "05:45")),
    *((FAR, minute) for minute in ("00:20", "02:20", "04:45", "07:10", "09:35", "11:20")),
]
AXES = {"east": (15.0, 0.0, 0.0), "north": (0.0, 15.0, 0.0), "up": (0.0, 0.0, 15.0)}
LOWEST_RAD = np.deg2rad(20.0)

of_cases = pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case[0][0]}-{case[1]}")
of_receivers = pytest.mark.parametrize("receiver", "ABC")
of_axes = pytest.mark.parametrize("axis", AXES)


@cache
def observed(station: str, receiver: str) -> ObservationFile:
    return read_observations(DATA / FILES[station], receiver)


@cache
def navigation() -> NavigationFile:
    return read_navigation(DATA / "brdc0770.10n.gz")


def site_of(stations: Sequence[str], policy: SatelliteFaultPolicy = "stop") -> SiteConfig:
    receivers = []
    for receiver, station in zip("ABC", stations, strict=True):
        position = observed(station, receiver).approx_position_ecef_m
        assert position is not None
        receivers.append(ReceiverConfig(receiver, position))
    integrity = IntegrityConfig(on_satellite_fault=policy)
    return SiteConfig("catalonia", "ITRF", None, INTERVAL_NS, "none", tuple(receivers), integrity, 3000, "")


def start_of(case: Case) -> int:
    return parse_utc(f"2010-03-18T{case[1]}:15Z")


@cache
def recorded(case: Case) -> tuple[Event, ...]:
    """The events around a case, without fault."""
    files = {receiver: [observed(station, receiver)] for receiver, station in zip("ABC", case[0], strict=True)}
    start_ns = start_of(case)
    imported = import_files(
        site_of(case[0]), files, [navigation()], start_ns - CLEAN_EPOCHS * INTERVAL_NS, start_ns + FAULTY_EPOCHS * INTERVAL_NS
    )
    assert imported.epochs == CLEAN_EPOCHS + FAULTY_EPOCHS
    return imported.events


@cache
def decided(case: Case, effect: Effect, policy: SatelliteFaultPolicy = "stop") -> tuple[EpochReport, ...]:
    """What the monitor says of the faulty epochs."""
    site, start_ns = site_of(case[0], policy), start_of(case)
    faulty = inject(recorded(case), [Fault(start_ns, start_ns + FAULTY_EPOCHS * INTERVAL_NS, effect)], site)
    reports = [output for output in StationMonitor(site).feed(faulty) if isinstance(output, EpochReport)]
    assert reports[CLEAN_EPOCHS - 1].state is State.NORMAL
    return tuple(reports[CLEAN_EPOCHS:])


@of_cases
def test_without_a_fault_every_epoch_is_normal_once_the_monitor_is_up(case: Case) -> None:
    reports = [output for output in StationMonitor(site_of(case[0])).feed(recorded(case)) if isinstance(output, EpochReport)]
    assert {report.state for report in reports[3:]} == {State.NORMAL}


# One receiver, all of whose ranges are 15 m of antenna position away


def bias(receiver: str, axis: str) -> ReceiverBias:
    return ReceiverBias(receiver=receiver, offset_enu_m=AXES[axis])


@of_cases
@of_receivers
@of_axes
def test_the_solved_position_of_a_biased_receiver_moves_by_the_bias(case: Case, receiver: str, axis: str) -> None:
    """In the first epoch, to 5 mm: the second order of the range, and the satellites in use stay the same."""
    site, r = site_of(case[0]), "ABC".index(receiver)
    (clean,) = [o for o in StationMonitor(site).feed(recorded(case)) if isinstance(o, EpochReport) and o.gps_time_ns == start_of(case)]
    first = decided(case, bias(receiver, axis))[0]
    assert first.e_enu_m[r] - clean.e_enu_m[r] == pytest.approx(AXES[axis], abs=5e-3)


@of_cases
@of_receivers
@of_axes
def test_a_biased_receiver_stops_the_line_in_the_first_epoch(case: Case, receiver: str, axis: str) -> None:
    assert decided(case, bias(receiver, axis))[0].state is State.NOT_CONFIRMABLE


@of_cases
@of_receivers
@of_axes
def test_a_biased_receiver_is_named(case: Case, receiver: str, axis: str) -> None:
    """Up, where the error common to all is several metres, in fewer epochs."""
    named = [r.verdict.subjects == (receiver,) and r.verdict.cause is Cause.RECEIVER for r in decided(case, bias(receiver, axis))]
    assert np.mean(named) >= (0.75 if axis == "up" else 0.95)


@of_cases
@of_receivers
@of_axes
def test_nobody_else_is_named_for_a_biased_receiver(case: Case, receiver: str, axis: str) -> None:
    subjects = {name for report in decided(case, bias(receiver, axis)) for name in (*report.subjects, *report.verdict.subjects)}
    assert subjects <= {receiver}


@of_cases
@of_receivers
@of_axes
def test_no_satellite_is_excluded_for_a_biased_receiver(case: Case, receiver: str, axis: str) -> None:
    assert {report.excluded for report in decided(case, bias(receiver, axis))} == {()}


# Two receivers that fail alike


@of_cases
@pytest.mark.parametrize("pair", [("A", "B"), ("A", "C"), ("B", "C")], ids="".join)
@pytest.mark.parametrize("axis", ["east", "north"])
def test_two_biased_receivers_are_not_confirmable_in_every_epoch(case: Case, pair: tuple[str, str], axis: str) -> None:
    states = [report.state for report in decided(case, two(pair, axis))]
    assert states == [State.NOT_CONFIRMABLE] * FAULTY_EPOCHS


@of_cases
@pytest.mark.parametrize("pair", [("A", "B"), ("A", "C"), ("B", "C")], ids="".join)
@pytest.mark.parametrize("axis", ["east", "north"])
def test_the_healthy_third_receiver_is_never_named(case: Case, pair: tuple[str, str], axis: str) -> None:
    (third,) = set("ABC") - set(pair)
    assert not [r.gps_time_ns for r in decided(case, two(pair, axis)) if third in r.subjects or third in r.verdict.subjects]


def two(pair: tuple[str, str], axis: str) -> TwoReceivers:
    return TwoReceivers(receivers=pair, offset_enu_m=(6.0, 0.0, 0.0) if axis == "east" else (0.0, 6.0, 0.0))


# A satellite whose range steps by 30 m, one at a time of all above 20 deg


def high_satellites(case: Case) -> list[str]:
    """Seen by all receivers in every faulty epoch, never below 20 deg."""
    truth, start_ns = truth_of([e for e in recorded(case) if not isinstance(e, RawBytes)], site_of(case[0]), None), start_of(case)
    elevations: dict[str, list[float]] = {}
    for run in runs(seen for seen in truth.rows if seen.epoch_ns >= start_ns):
        for seen, el_rad in zip(run, elevations_rad(truth, run), strict=True):
            for satellite, el in dict(zip((signal[:3] for signal in seen.row.signals), el_rad, strict=True)).items():
                elevations.setdefault(satellite, []).append(float(el))
    high = [s for s, els in elevations.items() if len(els) == 3 * FAULTY_EPOCHS and min(els) > LOWEST_RAD]
    assert len(high) >= 4
    return high


def step(satellite: str) -> SatelliteStep:
    return SatelliteStep(satellite=satellite, size_m=30.0)


@of_cases
@pytest.mark.parametrize("policy", ["stop", "exclude"])
def test_a_stepping_satellite_is_excluded_in_the_first_epoch_and_nothing_else_in_any(case: Case, policy: SatelliteFaultPolicy) -> None:
    wrong = {s: excluded for s in high_satellites(case) if (excluded := {r.excluded for r in decided(case, step(s), policy)}) != {(s,)}}
    assert wrong == {}


@of_cases
def test_a_stepping_satellite_leaves_normal_where_the_site_excludes(case: Case) -> None:
    """But for two satellites of the roof: without them the horizontal dilution rises from 1.4 to as much as 3.6."""
    carrying = {"G16", "G19"} if case[0] is NEAR else set()
    wrong = {s: other for s in high_satellites(case) if (other := _other(decided(case, step(s), "exclude"), (State.NORMAL,)))}
    assert set(wrong) <= carrying


@pytest.mark.parametrize("minute", ["05:15", "05:25", "05:35", "05:45"])
@pytest.mark.parametrize("satellite", ["G16", "G19"])
def test_where_the_sky_left_is_too_weak_for_the_circles_the_satellite_is_named(satellite: str, minute: str) -> None:
    reports = [r for r in decided((NEAR, minute), step(satellite), "exclude") if r.state is not State.NORMAL]
    assert {(r.state, r.cause, r.subjects) for r in reports} <= {(State.SATELLITE_ANOMALY, Cause.SATELLITE, (satellite,))}


@of_cases
def test_a_stepping_satellite_is_an_anomaly_where_the_site_stops(case: Case) -> None:
    wrong = {s: other for s in high_satellites(case) if (other := _other(decided(case, step(s)), (State.SATELLITE_ANOMALY,)))}
    assert wrong == {}


@of_cases
def test_a_stepping_satellite_is_named_where_the_site_stops(case: Case) -> None:
    wrong = {s: r.subjects for s in high_satellites(case) if (r := decided(case, step(s))[0]).subjects != (s,)}
    assert wrong == {}


def _other(reports: Sequence[EpochReport], expected: tuple[State, ...]) -> list[str]:
    return [f"epoch {i}: {r.state.name} {r.cause.name} {r.verdict.reasons}" for i, r in enumerate(reports) if r.state not in expected]


# One transmitter for all


@of_cases
@pytest.mark.parametrize("first", "ABC")
def test_receivers_that_hear_one_transmitter_are_spoofed_in_the_first_epoch(case: Case, first: str) -> None:
    report = decided(case, Spoofing(receivers=(first, *(set("ABC") - {first}))))[0]
    assert (report.state, report.cause) == (State.SATELLITE_ANOMALY, Cause.SPOOFING)


@of_cases
def test_spoofed_receivers_solve_to_one_point(case: Case) -> None:
    """Up to their own noise, a few metres, however far apart they stand; the first epoch."""
    site = site_of(case[0])
    report = decided(case, Spoofing(receivers=("A", "B", "C")))[0]
    points = StationMonitor(site).triangle
    solved = points.pos_ecef_m + np.einsum("rij,ri->rj", points.enu, report.e_enu_m)
    assert np.abs(solved - solved.mean(axis=0)).max() < 3.0


@of_cases
@pytest.mark.parametrize("source", "ABC")
def test_receivers_that_hear_another_ones_antenna_are_spoofed_in_the_first_epoch(case: Case, source: str) -> None:
    others = tuple(sorted(set("ABC") - {source}))
    report = decided(case, Meaconing(from_receiver=source, to_receivers=others, delay_m=100.0))[0]
    assert (report.state, report.cause) == (State.SATELLITE_ANOMALY, Cause.SPOOFING)


# Clocks that step move no position


@of_cases
@pytest.mark.parametrize(
    "effect",
    [
        ReceiverClockJump(receiver="B", size_m=299_792.458),
        ReceiverClockJump(receiver="B", size_m=-150_000.0),
        ConstellationClock(system="GPS", size_m=30.0),
    ],
    ids=["1 ms", "half a ms", "GPS"],
)
def test_a_clock_that_steps_stops_nothing(case: Case, effect: Effect) -> None:
    assert {report.state for report in decided(case, effect)} == {State.NORMAL}


# A satellite whose clock runs away


@of_cases
def test_a_satellite_that_accelerates_is_excluded_alone_and_named_in_the_end(case: Case) -> None:
    """1 mm/s2 is 30 m in four minutes, 238 m in the last epoch."""
    for satellite in high_satellites(case):
        reports = decided(case, SatelliteAcceleration(satellite=satellite, rate_mps2=0.001))
        assert {name for report in reports for name in report.excluded} == {satellite}
        assert reports[-1].subjects == (satellite,)


# A front in the ionosphere, which reaches one station and not the others


@of_cases
@pytest.mark.parametrize("azimuth_deg", [0.0, 90.0, 200.0])
def test_a_front_in_the_ionosphere_is_hardly_ever_taken_for_a_receiver(case: Case, azimuth_deg: float) -> None:
    """At sides of hundreds of kilometres it moves one receiver's position by metres. Four epochs of 24 had named one before its ranges were
    asked whether they are those of an antenna that stands elsewhere."""
    front = IonoFront(slope_mm_per_km=425.0, width_km=50.0, speed_mps=750.0, azimuth_deg=azimuth_deg)
    named = [report.verdict.cause is Cause.RECEIVER for report in decided(case, front)]
    assert sum(named) <= 1
