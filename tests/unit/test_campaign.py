"""The campaign: what a trial says of faults that are known to show, and not to; shares and their bounds; the same in any number of jobs."""

from dataclasses import replace
from math import sqrt

import pytest
from scipy.stats import binomtest

from integrity.errors import ConfigError
from integrity.gnss.gps_time import NS_PER_S
from integrity.states import Cause, State
from recordings.campaign.campaign import Plan, Played, Simulated, campaign, stage_from
from recordings.campaign.catalogue import CATALOGUE
from recordings.campaign.stage import Stage
from recordings.campaign.summary import as_json_object, refuse_unknown
from recordings.campaign.tally import Share
from recordings.campaign.threat import Draw, Guilty
from recordings.campaign.trial import Said, Trial, play, watched
from recordings.faults import Fault
from recordings.faults.kinds import Effect
from recordings.faults.receiver_kinds import ReceiverBias, ReceiverClockJump, ReceiverDrop, ReceiverRamp
from recordings.faults.satellite_kinds import SatelliteRamp, SatelliteStep
from tests.unit.streams import SITE, START_NS

SOURCE = Simulated(SITE, START_NS, 150.0, seed=3)
PLAN = Plan((SOURCE,), trials=2)
TOLERANCE_M = 15.0
POINTS = tuple(receiver.position_ecef_m for receiver in SITE.receivers)
DRAW = Draw("G05", ("B", "A", "C"), POINTS, 0.6, 0.8, 36.9, (1.0, 0.0, 0.0), -1.0)


def stage() -> Stage:
    return stage_from(SOURCE)


def trial(effect: Effect, tolerance_m: float = TOLERANCE_M) -> Trial:
    start_ns = stage().epoch_ns[80]
    return play(stage(), [Fault(start_ns, start_ns + 20 * NS_PER_S, effect)], tolerance_m)


def in_use() -> str:
    report = stage().reports[stage().epoch_ns[80]]
    return next(signal.partition(".")[0] for signal, used in zip(report.signals, report.used.tolist(), strict=True) if used)


def test_a_large_step_is_caught_in_its_first_epoch() -> None:
    assert trial(SatelliteStep(satellite=in_use(), size_m=100.0)).detected_s == 0.0


def test_a_large_step_names_its_satellite() -> None:
    satellite = in_use()
    assert trial(SatelliteStep(satellite=satellite, size_m=100.0)).named == {satellite}


def test_a_fault_that_is_not_caught_counts_by_how_far_it_moved_the_receiver() -> None:
    shift_m = trial(ReceiverBias(receiver="A", offset_enu_m=(1.0, 0.0, 0.0))).shift_m
    assert shift_m == pytest.approx(1.0, abs=0.01)


def test_what_is_normal_beyond_the_tolerance_is_a_hazard() -> None:
    assert trial(ReceiverBias(receiver="A", offset_enu_m=(1.0, 0.0, 0.0)), tolerance_m=0.5).hazard


def test_a_receiver_that_is_named_is_no_hazard() -> None:
    assert not trial(ReceiverBias(receiver="A", offset_enu_m=(50.0, 0.0, 0.0))).hazard


def test_a_clock_that_jumps_stops_nothing() -> None:
    assert trial(ReceiverClockJump(receiver="B", size_m=299_792.458)).detected_s is None


def test_silence_is_counted_by_the_time_that_passes() -> None:
    detected_s = trial(ReceiverDrop(receiver="C")).detected_s
    assert detected_s == pytest.approx(2.0, abs=1.0)


def test_a_trial_from_a_memory_decides_as_the_whole_stream_does() -> None:
    """The fault begins after the second memory: what came before is not decided again."""
    whole = replace(stage(), memories=stage().memories[:1])
    start_ns = stage().epoch_ns[80]
    faults = [Fault(start_ns, start_ns + 20 * NS_PER_S, SatelliteStep(satellite=in_use(), size_m=20.0))]
    assert play(stage(), faults, TOLERANCE_M) == play(whole, faults, TOLERANCE_M)


def test_a_trial_that_is_watched_for_a_while_is_the_whole_one_up_to_then() -> None:
    """A ramp is caught, and the receiver may be named, minutes before it ends; when it was caught does not depend on what came later."""
    start_ns = stage().epoch_ns[60]
    faults = [Fault(start_ns, start_ns + 80 * NS_PER_S, ReceiverRamp(receiver="A", rate_enu_mps=(0.5, 0.0, 0.0)))]
    whole, cut = (play(stage(), faults, TOLERANCE_M, watched_s=watched_s) for watched_s in (None, 10.0))
    assert (cut.detected_s, cut.cause, cut.shift_at_alert_m) == (whole.detected_s, whole.cause, whole.shift_at_alert_m)


def test_what_is_said_later_than_it_was_watched_does_not_count() -> None:
    said = [
        Said(k * NS_PER_S, State.NORMAL, Cause.NONE, frozenset({"G05"} if k == 2 else {"E11"} if k == 9 else ()), None) for k in range(12)
    ]
    assert [one.gps_ns // NS_PER_S for one in watched(said, NS_PER_S, 4 * NS_PER_S)] == [1, 2, 3, 4, 5, 6]


def test_a_slow_fault_is_played_without_its_end() -> None:
    """The ramp moves a range by half a metre in 50 s, which nothing catches; where it ends the carrier steps back by as much."""
    start_ns = stage().epoch_ns[80]
    faults = [Fault(start_ns, start_ns + 50 * NS_PER_S, SatelliteRamp(satellite=in_use(), rate_mps=0.01))]
    with_end, without = (play(stage(), faults, TOLERANCE_M, epochs_after=n) for n in (5, 0))
    assert (with_end.detected_s, without.detected_s) == (50.0, None)


def test_the_shift_at_the_alert_is_that_of_its_epoch() -> None:
    assert trial(ReceiverBias(receiver="A", offset_enu_m=(50.0, 0.0, 0.0))).shift_at_alert_m == pytest.approx(50.0, abs=0.01)


def test_a_fault_that_is_caught_at_once_has_moved_nothing_before() -> None:
    assert trial(ReceiverBias(receiver="A", offset_enu_m=(50.0, 0.0, 0.0))).shift_m == 0.0


def test_a_point_elsewhere_is_as_far_as_asked_along_the_ground() -> None:
    x, y, z = (a - b for a, b in zip(DRAW.elsewhere_ecef_m(1000.0), POINTS[0], strict=True))
    assert sqrt(x * x + y * y + z * z) == pytest.approx(1000.0, abs=0.01)


def test_faults_begin_where_the_stream_stays_sound_for_as_long_as_they_last() -> None:
    """Not at start-up, not where an epoch in which a station without faults was not NORMAL would follow, not too near the end."""
    spoilt_ns = stage().epoch_ns[100]
    report = replace(stage().reports[spoilt_ns], state=State.NOT_CONFIRMABLE)
    spoilt = replace(stage(), reports=stage().reports | {spoilt_ns: report})
    first = next(i for i, t in enumerate(stage().epoch_ns) if stage().reports[t].state is State.NORMAL)
    assert spoilt.sound_for(20 * NS_PER_S) == [*stage().epoch_ns[first:80], *stage().epoch_ns[101:-20]]


def few(jobs: int) -> list[Played]:
    return [one for piece in campaign(PLAN, jobs, ("RX-BIAS", "MEAC")) for one in piece]


def test_two_processes_play_the_same_as_one() -> None:
    assert few(2) == few(1)


def test_every_size_is_played_equally_often() -> None:
    sizes = [one.size for one in few(1) if one.threat == "MEAC"]
    assert sizes == [30.0, 30.0, 300.0, 300.0, 3000.0, 3000.0]


def test_the_summary_counts_every_trial() -> None:
    found = as_json_object(few(1), PLAN)
    assert sum(size["trials"] for threat in found["threats"] for size in threat["sizes"]) == found["trials"] == 20


def test_every_threat_can_be_made_in_every_size() -> None:
    made = [threat.effects(size, DRAW) for threat in CATALOGUE for size in threat.sizes]
    assert all(made)


def test_no_two_threats_have_one_name() -> None:
    names = [threat.id for threat in CATALOGUE]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize(("name", "right"), [("G05", True), ("E05", False), ("A", True), ("B", False)])
def test_who_may_be_named(name: str, right: bool) -> None:
    assert Guilty(satellites=("G05",), receivers=("A",)).may_be(name) is right


@pytest.mark.parametrize(("name", "right"), [("G17", True), ("E05", False), ("G", False)])
def test_of_a_system_every_satellite_may_be_named(name: str, right: bool) -> None:
    assert Guilty(systems=("G",)).may_be(name) is right


@pytest.mark.parametrize(("count", "of"), [(0, 20), (3, 20), (20, 20)])
def test_bounds_are_those_of_clopper_and_pearson(count: int, of: int) -> None:
    interval = binomtest(count, of).proportion_ci(0.95)
    assert (Share(count, of).low, Share(count, of).high) == pytest.approx((interval.low, interval.high))


def test_nothing_in_3000_is_at_most_one_in_a_thousand() -> None:
    assert Share(0, 3000).at_most == pytest.approx(0.000998, abs=1e-6)


def test_an_unknown_threat_is_refused_with_those_there_are() -> None:
    with pytest.raises(ConfigError, match="expected one of SV-STEP, SV-RAMP"):
        refuse_unknown(("SV-STP",))


def test_a_cause_that_names_comes_first() -> None:
    first = {threat.id: threat.causes[0] for threat in CATALOGUE if threat.causes}
    assert first["RX-BIAS"] is Cause.RECEIVER
