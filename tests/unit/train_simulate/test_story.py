"""The story as the station decides it, and what of it reaches the train."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from integrity.events import ObservationsReceived, RawBytes
from integrity.gnss.gps_time import NS_PER_S, parse_utc
from integrity.gnss.observations import ObservationRow
from integrity.gnss.signals import satellite_of
from integrity.outputs import EpochReport
from integrity.reception import Reception
from integrity.states import Cause, State
from integrity.station_monitor import StationMonitor
from recordings.simulate.observations import Antenna, fixed
from recordings.site_file import load_site, override_site
from train_client.simulate.line import sample_line
from train_client.simulate.motion import antennas_on, sample_run
from train_client.simulate.story import END_S, STATION_SETTINGS, TIMELINE, Phase, Story, alone, tell
from train_client.train_file import load_train

SAMPLES = Path(__file__).parents[3] / "recordings" / "samples"
SITE = override_site(load_site(SAMPLES / "site.toml"), STATION_SETTINGS).config
START_NS = parse_utc("2026-03-02T03:00:00Z")
SEED = 1
RETURNS_WITHIN_S = 4.0
RECEIVERS = ("A", "B", "C", "front", "rear")


@cache
def train() -> tuple[Antenna, ...]:
    return antennas_on(sample_run(sample_line(), START_NS), load_train(SAMPLES / "train.toml").config.antennas)


@cache
def story() -> Story:
    return tell(SITE, train(), START_NS, SEED)


@cache
def decided() -> dict[float, EpochReport]:
    """What the station says, by seconds from the first epoch."""
    monitor = StationMonitor(SITE)
    ground = [event for event in story().events if not isinstance(event, RawBytes) or event.receiver in SITE.receiver_names]
    outputs = [output for output in monitor.feed(ground) if isinstance(output, EpochReport)]
    return {(report.gps_time_ns - START_NS) / NS_PER_S: report for report in outputs}


@cache
def rows(told: Story, receiver: str) -> dict[float, ObservationRow]:
    """What a receiver's bytes say, by seconds from the first epoch."""
    reception = Reception(RECEIVERS)
    heard = (
        event for burst in told.events if isinstance(burst, RawBytes) and burst.receiver == receiver for event in reception.take(burst)
    )
    return {(e.mono_ns - START_NS) / NS_PER_S: e.row for e in heard if isinstance(e, ObservationsReceived)}


def phase(kind: str) -> Phase:
    (found,) = (p for p in story().phases if p.kind == kind)
    return found


@pytest.mark.parametrize("kind", [p.kind for p in TIMELINE])
def test_the_station_says_in_every_epoch_of_a_phase_what_the_story_expects(kind: str) -> None:
    told = phase(kind)
    said = {(r.state, r.cause, r.subjects, r.excluded) for t, r in decided().items() if told.start_s <= t < told.end_s}
    assert said == {(told.state, told.cause, told.subjects, told.excluded)}


def test_the_satellite_that_stepped_stays_out_until_the_end() -> None:
    stepped = phase("satellite_step")
    assert {r.excluded for t, r in decided().items() if t >= stepped.start_s} == {(stepped.fault["satellite"],)}


def test_no_satellite_is_out_before_one_is_wrong() -> None:
    assert {r.excluded for t, r in decided().items() if t < phase("satellite_step").start_s} == {()}


def test_the_station_is_normal_in_every_other_epoch_but_the_first_seconds_after_a_fault() -> None:
    busy = [(p.start_s, p.end_s + RETURNS_WITHIN_S * (p.kind != "start")) for p in story().phases]
    calm = [r for t, r in decided().items() if not any(start <= t < end for start, end in busy)]
    assert len(calm) > 200
    assert {(r.state, r.cause) for r in calm} == {(State.NORMAL, Cause.NONE)}


def test_the_station_is_normal_again_a_second_before_each_phase() -> None:
    for told in story().phases[1:]:
        before = {r.state for t, r in decided().items() if told.start_s - 1.0 <= t < told.start_s}
        assert before == {State.NORMAL}, told.name


def test_the_story_ends_with_its_last_epoch() -> None:
    assert max(decided()) == pytest.approx(END_S - 0.1)


def test_every_epoch_brings_one_burst_of_each_receiver_in_order_of_time() -> None:
    bursts = [(event.mono_ns, event.receiver) for event in story().events if isinstance(event, RawBytes)]
    epochs_ns = START_NS + np.arange(1080) * (NS_PER_S // 10)
    assert bursts == [(t, receiver) for t in epochs_ns.tolist() for receiver in RECEIVERS]


@pytest.mark.parametrize("receiver", RECEIVERS)
def test_the_fault_of_a_satellite_is_in_the_ranges_of_everybody(receiver: str) -> None:
    told = phase("satellite_step")
    without = tell(SITE, train(), START_NS, SEED, [p for p in TIMELINE if p is not TIMELINE[2]], duration_s=40.0)
    sound = rows(without, receiver)
    (satellite,) = told.excluded
    for t in (told.start_s - 0.1, told.start_s, told.end_s - 0.1, told.end_s):
        faulty, row = rows(story(), receiver)[t], sound[t]
        longer_m = dict(zip(map(satellite_of, row.signals), faulty.pseudorange_m - row.pseudorange_m, strict=True))
        expected_m = 30.0 if told.start_s <= t < told.end_s else 0.0
        assert longer_m == {s: pytest.approx(expected_m if s == satellite else 0.0, abs=1e-6) for s in longer_m}


@pytest.mark.parametrize("receiver", RECEIVERS)
def test_the_faulty_satellite_is_high_for_everybody(receiver: str) -> None:
    """Strength goes by the sine of the elevation, from 38 to 50 dB-Hz: 47.5 are 52 degrees, less the noise of 0.5."""
    told = phase("satellite_step")
    row = rows(story(), receiver)[told.start_s]
    (cn0_dbhz,) = (c for s, c in zip(row.signals, row.cn0_dbhz, strict=True) if satellite_of(s) in told.excluded)
    assert cn0_dbhz > 47.5


@pytest.mark.parametrize("antenna", ["front", "rear"])
def test_what_happens_on_the_ground_does_not_reach_the_train(antenna: str) -> None:
    quiet = tell(SITE, train(), START_NS, SEED, [p for p in TIMELINE if p.kind == "satellite_step"])
    bursts = [[e.data for e in told.events if isinstance(e, RawBytes) and e.receiver == antenna] for told in (story(), quiet)]
    assert bursts[0] == bursts[1]


def test_ground_and_train_hear_the_same_satellites_with_the_same_ephemerides() -> None:
    ground, aboard = (rows(story(), receiver)[5.0] for receiver in ("A", "front"))
    common = set(ground.signals) & set(aboard.signals)
    assert len(common) > 12
    assert {s[0] for s in common} == {"G", "E"}


def test_errors_of_satellites_and_ionosphere_are_common_to_ground_and_train() -> None:
    """An antenna of the train at the point and on the clock of a station's: carriers differ by whole cycles and the noise of 2 mm."""
    beside = Antenna("front", fixed(SITE.receivers[0].position_ecef_m), clock="A")
    told = tell(SITE, (beside,), START_NS, SEED, (), duration_s=30.0)
    cycles = np.array([row.carrier_cycles - rows(told, "A")[t].carrier_cycles for t, row in rows(told, "front").items()])
    assert cycles.shape[1] > 12
    assert np.abs(cycles - np.round(cycles)).max() < 0.1


def test_the_noise_aboard_is_0_3_m_at_every_elevation() -> None:
    """Two receivers at one point differ by their clocks and sqrt(2) times the noise; 300 epochs tell it to 4 %."""
    twins = [Antenna(name, fixed(SITE.receivers[0].position_ecef_m)) for name in ("front", "rear")]
    told = tell(SITE, twins, START_NS, SEED, (), duration_s=30.0)
    pairs = [(row, rows(told, "rear")[t]) for t, row in rows(told, "front").items()]
    differences_m = np.array([a.pseudorange_m - b.pseudorange_m for a, b in pairs])
    differences_m -= differences_m.mean(axis=1, keepdims=True)
    n = differences_m.shape[1]
    sigma_m = differences_m.std(axis=0) / np.sqrt(2.0 * (1.0 - 1.0 / n))
    np.testing.assert_allclose(sigma_m, 0.3, rtol=0.2)


def test_a_shorter_story_leaves_out_what_comes_later() -> None:
    told = tell(SITE, train(), START_NS, SEED, duration_s=20.0)
    assert [p.kind for p in told.phases] == ["start", "receiver_bias"]


@pytest.mark.parametrize("kind", [p.kind for p in TIMELINE[1:]])
def test_one_kind_alone_comes_where_the_first_fault_was(kind: str) -> None:
    start, only = alone(kind)
    assert (start, only.kind, only.start_s) == (TIMELINE[0], kind, 12.0)
