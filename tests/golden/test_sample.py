"""The recording that the project comes with: decided today as the text beside this file says, and every fault in it answered.

After a change that is meant to change decisions: `python -m tests.golden.test_sample`, then read the difference before committing it.
"""

from collections.abc import Sequence
from pathlib import Path

import pytest

from integrity.gnss.gps_time import NS_PER_S, format_utc, parse_utc
from integrity.outputs import EpochReport
from integrity.states import Cause, State
from recordings.diff import differences, recorded_reports
from recordings.faults import Fault, inject, parse_faults
from recordings.reader import Contents, read_recording
from recordings.replay import decide, first_epoch_ns, replayable
from recordings.simulate.observations import simulate
from recordings.simulate.scenario import load_scenario
from recordings.site_file import load_site
from recordings.summary import decisions_sha256
from station.check import check_site

SAMPLES = Path(__file__).parents[2] / "recordings" / "samples"
RECORDING, SCENARIO = SAMPLES / "triangle.mcap", SAMPLES / "triangle.toml"
GOLDEN = Path(__file__).with_name("sample.txt")
RECOVERY_S = 31  # `recover_after_s` of the scenario, and the epoch that completes it


def line(report: EpochReport) -> str:
    """Time, state, cause, subjects, excluded; a dash for none."""
    words = [report.state, report.cause, " ".join(report.subjects), " ".join(report.excluded)]
    return "  ".join([format_utc(report.gps_time_ns), *(str(word) or "-" for word in words)])


def changes(reports: Sequence[EpochReport]) -> str:
    """A line per change of what was decided, the first epoch included, and the last epoch to show that all were."""
    lines = [line(r) for r in reports]
    said = [text.partition("  ")[2] for text in lines]
    changed = [text for k, text in enumerate(lines) if k == 0 or said[k] != said[k - 1]]
    return "\n".join([*changed, f"{format_utc(reports[-1].gps_time_ns)}  end of {len(reports)} epochs"]) + "\n"


def replayed(contents: Contents, block_epochs: int = 1000) -> list[EpochReport]:
    todo = replayable(contents)
    outputs, _ = decide(todo.site, todo.events, todo.snapshot, block_epochs)
    return [o for o in outputs if isinstance(o, EpochReport)]


@pytest.fixture(scope="module")
def contents() -> Contents:
    return read_recording(RECORDING)


@pytest.fixture(scope="module")
def reports(contents: Contents) -> list[EpochReport]:
    return replayed(contents)


@pytest.fixture(scope="module")
def faults(contents: Contents) -> dict[str, Fault]:
    """The truth that goes along, by kind."""
    todo = replayable(contents)
    listed = parse_faults(contents.metadata["truth"]["faults"], "truth", first_epoch_ns(todo), todo.site.config)
    return {fault.kind: fault for fault in listed}


def test_decisions_are_as_committed(reports: list[EpochReport]) -> None:
    assert changes(reports) == GOLDEN.read_text("utf-8")


def test_the_recorded_decisions_are_those_of_today(contents: Contents, reports: list[EpochReport]) -> None:
    assert differences(recorded_reports(contents, None, None), reports) == []


@pytest.mark.parametrize("block_epochs", [7, 60])
def test_decisions_do_not_depend_on_blocks(contents: Contents, reports: list[EpochReport], block_epochs: int) -> None:
    assert decisions_sha256(replayed(contents, block_epochs)) == decisions_sha256(reports)


def test_the_recording_is_what_its_scenario_says_today(contents: Contents, reports: list[EpochReport]) -> None:
    story = load_scenario(SCENARIO)
    site = story.site.config
    events = simulate(site, story.start_ns, story.duration_s, story.rate_hz, story.seed)
    outputs, _ = decide(story.site, inject(events, parse_faults(story.faults, "", story.start_ns, site), site))
    assert decisions_sha256([o for o in outputs if isinstance(o, EpochReport)]) == decisions_sha256(reports)


def test_the_scenario_goes_along_as_it_is_in_its_file(contents: Contents) -> None:
    assert contents.metadata["truth"]["scenario"] == SCENARIO.read_text("utf-8")


def test_the_truth_has_the_faults_of_the_story(faults: dict[str, Fault]) -> None:
    assert list(faults) == ["receiver_bias", "satellite_step", "spoofing", "jamming"]


def during(reports: Sequence[EpochReport], fault: Fault) -> list[EpochReport]:
    return [r for r in reports if fault.covers(r.gps_time_ns)]


def test_the_receiver_that_is_off_is_named_in_every_epoch(reports: list[EpochReport], faults: dict[str, Fault]) -> None:
    said = {(r.state, r.cause, r.subjects) for r in during(reports, faults["receiver_bias"])}
    assert said == {(State.NOT_CONFIRMABLE, Cause.RECEIVER, ("B",))}


def test_the_satellite_that_steps_is_excluded_in_every_epoch(reports: list[EpochReport], faults: dict[str, Fault]) -> None:
    assert {r.excluded for r in during(reports, faults["satellite_step"])} == {("G07",)}


def test_without_the_satellite_trains_may_go_on(reports: list[EpochReport], faults: dict[str, Fault]) -> None:
    assert {r.state for r in during(reports, faults["satellite_step"])} == {State.NORMAL}


def test_spoofing_is_called_so_in_every_epoch(reports: list[EpochReport], faults: dict[str, Fault]) -> None:
    said = {(r.state, r.cause, r.subjects) for r in during(reports, faults["spoofing"])}
    assert said == {(State.SATELLITE_ANOMALY, Cause.SPOOFING, ("A", "B", "C"))}


def test_jamming_is_called_so_before_its_ramp_ends_and_until_it_does(reports: list[EpochReport], faults: dict[str, Fault]) -> None:
    ramp_ns = 20 * NS_PER_S  # of the scenario
    full = [r for r in during(reports, faults["jamming"]) if r.gps_time_ns >= faults["jamming"].start_ns + ramp_ns]
    assert {(r.state, r.cause) for r in full} == {(State.SATELLITE_ANOMALY, Cause.JAMMING)}


def test_jamming_excludes_nothing_more(reports: list[EpochReport], faults: dict[str, Fault]) -> None:
    assert {r.excluded for r in during(reports, faults["jamming"])} == {("G07",)}


@pytest.mark.parametrize("kind", ["receiver_bias", "spoofing", "jamming"])
def test_normal_is_back_when_the_recovery_time_is_over(reports: list[EpochReport], faults: dict[str, Fault], kind: str) -> None:
    end_ns = faults[kind].end_ns
    assert end_ns is not None
    back = next(r.gps_time_ns for r in reports if r.gps_time_ns >= end_ns and r.state is State.NORMAL)
    assert (back - end_ns) // NS_PER_S <= RECOVERY_S


def test_away_from_faults_and_recovery_everything_is_normal(reports: list[EpochReport], faults: dict[str, Fault]) -> None:
    begin_ns = parse_utc("2026-03-02T03:00:00Z") + RECOVERY_S * NS_PER_S
    calm = [
        r
        for r in reports
        if r.gps_time_ns >= begin_ns
        and not any(f.start_ns <= r.gps_time_ns < (f.end_ns or 0) + RECOVERY_S * NS_PER_S for f in faults.values())
    ]
    assert len(calm) > 600
    assert {r.state for r in calm} == {State.NORMAL}


def test_the_satellite_is_out_from_its_step_to_the_end_and_nobody_else_ever(reports: list[EpochReport], faults: dict[str, Fault]) -> None:
    """A carrier that stepped wants an hour to be believed again, and the recording is shorter."""
    stepped_ns = faults["satellite_step"].start_ns
    assert all(r.excluded == (("G07",) if r.gps_time_ns >= stepped_ns else ()) for r in reports)


if __name__ == "__main__":
    GOLDEN.write_text(changes(replayed(read_recording(RECORDING))), "utf-8")


def test_the_sample_site_can_run() -> None:
    report = check_site(SAMPLES / "site.toml")
    assert report.ok, report.errors


def test_the_sample_site_is_that_of_the_scenario() -> None:
    scenario = load_scenario(SAMPLES / "triangle.toml").site
    site = load_site(SAMPLES / "site.toml")
    assert (site.config, site.sources) == (scenario.config, scenario.sources)
