"""The tables of a fault file."""

import pytest

from integrity.gnss.gps_time import NS_PER_S
from recordings.faults import Fault, parse_faults
from recordings.faults.kinds import (
    SatelliteStep,
)
from recordings.toml_file import ConfigProblems
from tests.unit.faults.made import FIRST_NS, SITE


def fault_table(text: str) -> str:
    return f"[[fault]]\n{text}\n"


def parsed(text: str) -> tuple[Fault, ...]:
    return parse_faults(text, "faults.toml", FIRST_NS, SITE)


STEP = 'kind = "satellite_step"\nsatellite = "G05"\nsize_m = 10.0\n'


def test_start_is_utc() -> None:
    (fault,) = parsed(fault_table(STEP + 'start = "2010-03-18T05:20:00Z"\nduration_s = 120'))
    assert fault == Fault(
        FIRST_NS + 1215 * NS_PER_S, FIRST_NS + 1335 * NS_PER_S, SatelliteStep(satellite="G05", size_m=10.0)
    )  # 15 leap seconds in 2010


def test_start_s_counts_from_the_first_epoch() -> None:
    (fault,) = parsed(fault_table(STEP + "start_s = 90\nduration_s = 0.5"))
    assert (fault.start_ns, fault.end_ns) == (FIRST_NS + 90 * NS_PER_S, FIRST_NS + 90_500_000_000)


def test_a_moved_antenna_needs_no_duration() -> None:
    (fault,) = parsed(fault_table('kind = "antenna_moved"\nreceiver = "A"\noffset_enu_m = [1, 0, 0]\nstart_s = 0'))
    assert fault.end_ns is None


WHEN = "start_s = 0\nduration_s = 60\n"
BAD = {
    "unknown kind": (
        'kind = "satelite_step"\n' + WHEN,
        'faults.toml:2: fault.0.kind = "satelite_step": no such kind',
        'mean "satellite_step"?',
    ),
    "no kind": (WHEN, "faults.toml:1: fault.0.kind: missing", "receiver_freeze"),
    "no start": (STEP + "duration_s = 60", "faults.toml:1: fault.0.start: missing", "start_s"),
    "two starts": (STEP + WHEN + 'start = "2010-03-18T05:20:00Z"', "faults.toml:7: fault.0.start", "give one of start"),
    "not a time": (
        STEP + 'start = "noon"\nduration_s = 60',
        'faults.toml:5: fault.0.start = "noon": expected a UTC time',
        "2010-03-18T05:20:00Z",
    ),
    "no duration": (STEP + "start_s = 0", "faults.toml:1: fault.0.duration_s: missing", "seconds, above 0"),
    "duration of nothing": (STEP + "start_s = 0\nduration_s = 0", "faults.toml:6: fault.0.duration_s = 0: expected", "above 0"),
    "unknown satellite": (
        f'kind = "satellite_step"\nsatellite = "G5"\nsize_m = 1\n{WHEN}',
        'faults.toml:3: fault.0.satellite = "G5": expected a satellite',
        "G01",
    ),
    "unknown receiver": (
        f'kind = "receiver_drop"\nreceiver = "D"\n{WHEN}',
        'faults.toml:3: fault.0.receiver = "D": the site has no receiver "D"',
        "A or B or C",
    ),
    "receiver twice": (
        f'kind = "jamming"\nreceivers = ["A", "A"]\ndrop_db = 10\n{WHEN}',
        "faults.toml:3: fault.0.receivers",
        "a receiver stands twice",
    ),
    "one of two receivers": (
        f'kind = "two_receivers"\nreceivers = ["A"]\noffset_enu_m = [1, 0, 0]\n{WHEN}',
        "faults.toml:3: fault.0.receivers",
        "a list of two",
    ),
    "size missing": (f'kind = "satellite_step"\nsatellite = "G05"\n{WHEN}', "faults.toml:1: fault.0.size_m: missing", "metres"),
    "size of nothing": (STEP.replace("10.0", "0.0") + WHEN, "faults.toml:4: fault.0.size_m = 0.0: expected metres, not 0", ""),
    "another kind's key": (f"{STEP}rate_mps = 1.0\n{WHEN}", "faults.toml:5: fault.0.rate_mps = 1.0: no such key", "size_m"),
    "two rates": (
        f'kind = "receiver_ramp"\nreceiver = "A"\nrate_mps = 1\nrate_enu_mps = [1, 0, 0]\n{WHEN}',
        "faults.toml:1: fault.0: give either",
        "rate_enu_mps",
    ),
    "direction": (
        f'kind = "wrong_ephemeris"\nsatellite = "G05"\noffset_m = 100\ndirection = "up"\n{WHEN}',
        'faults.toml:5: fault.0.direction = "up"',
        '"radial"',
    ),
    "spoofer in space": (
        f'kind = "spoofing"\nreceivers = ["A"]\nposition_ecef_m = [1, 2, 3]\n{WHEN}',
        "faults.toml:4: fault.0.position_ecef_m",
        "on the Earth's surface",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_table_says_where_and_what_would_be_right(case: str) -> None:
    text, beginning, contained = BAD[case]
    with pytest.raises(ConfigProblems) as caught:
        parsed(fault_table(text))
    (problem,) = caught.value.problems
    assert str(problem).startswith(beginning)
    assert contained in str(problem)


def test_all_problems_come_at_once() -> None:
    with pytest.raises(ConfigProblems) as caught:
        parsed("[site]\n" + fault_table('kind = "no"\nstart = "noon"') + fault_table(f'kind = "receiver_drop"\n{WHEN}'))
    assert [problem.line for problem in caught.value.problems] == [1, 3, 4, 5]


def test_a_file_without_faults_is_refused() -> None:
    with pytest.raises(ConfigProblems, match=r"faults\.toml: fault: missing"):
        parsed("")
