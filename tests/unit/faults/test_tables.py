"""The tables of a fault file."""

import pytest

from integrity.gnss.gps_time import NS_PER_S
from recordings.faults import Fault, parse_faults
from recordings.faults.kinds import ConstellationClock, SatelliteStep
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


TABLES = {
    "satellite_acceleration": 'satellite = "C45"\nrate_mps2 = 0.01',
    "code_carrier_divergence": 'satellite = "J03"\nrate_mps = 0.0125',
    "low_power": 'satellite = "R24"\ndrop_db = 3',
    "constellation_clock": 'system = "BeiDou"\nsize_m = 20',
    "constellation_frame": 'system = "R"\noffset_ecef_m = [20, 0.5, -3]',
    "iono_front": "slope_mm_per_km = 300\nwidth_km = 50\nspeed_mps = 200\nazimuth_deg = 225",
    "receiver_noise": 'receiver = "B"\nfactor = 5',
    "receiver_clock_jump": 'receiver = "B"\nsize_m = 299792.458',
    "multipath": 'receiver = "B"\nsatellites = ["S29", "E11"]\namplitude_m = 2.5\nperiod_s = 120',
    "meaconing": 'from_receiver = "A"\nto_receivers = ["B", "C"]\ndelay_m = 300',
}


@pytest.mark.parametrize("kind", TABLES)
def test_tables_of_a_kind_are_read(kind: str) -> None:
    (found,) = parsed(fault_table(f'kind = "{kind}"\n{TABLES[kind]}\n{WHEN}'))
    assert found.kind == kind


def test_a_system_may_be_given_by_letter_or_name() -> None:
    by_name, by_letter = (ConstellationClock.model_validate({"system": system, "size_m": 1.0}) for system in ("Galileo", "E"))
    assert by_name == by_letter


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
    "satellite of no system": (
        f'kind = "low_power"\nsatellite = "R33"\ndrop_db = 3\n{WHEN}',
        'faults.toml:3: fault.0.satellite = "R33": expected a satellite',
        "G32 E36 C63 R32 J10 S58",
    ),
    "no such system": (
        f'kind = "constellation_clock"\nsystem = "NavIC"\nsize_m = 3\n{WHEN}',
        'faults.toml:3: fault.0.system = "NavIC": expected one of GPS',
        "QZSS",
    ),
    "noise of nothing": (
        f'kind = "receiver_noise"\nreceiver = "A"\nfactor = 1\n{WHEN}',
        "faults.toml:4: fault.0.factor = 1: expected a factor, above 1",
        "1000",
    ),
    "front too thick": (
        f'kind = "iono_front"\nslope_mm_per_km = 500\nwidth_km = 800\nspeed_mps = 100\nazimuth_deg = 0\n{WHEN}',
        "faults.toml:1: fault.0: the front delays by 400 m, expected at most 200",
        "make width_km 400 or less",
    ),
    "frame not displaced": (
        f'kind = "constellation_frame"\nsystem = "GPS"\noffset_ecef_m = [0, 0, 0]\n{WHEN}',
        "faults.toml:4: fault.0.offset_ecef_m",
        "not all 0",
    ),
    "frame on another planet": (
        f'kind = "constellation_frame"\nsystem = "GPS"\noffset_ecef_m = [0, 0, 200000]\n{WHEN}',
        "faults.toml:4: fault.0.offset_ecef_m",
        "at most 100000",
    ),
    "a receiver repeats itself": (
        f'kind = "meaconing"\nfrom_receiver = "A"\nto_receivers = ["B", "A"]\ndelay_m = 3\n{WHEN}',
        "faults.toml:1: fault.0: A hears itself",
        "only others",
    ),
    "repeated by nobody": (
        f'kind = "meaconing"\nfrom_receiver = "D"\nto_receivers = ["B"]\ndelay_m = 3\n{WHEN}',
        'faults.toml:3: fault.0.from_receiver = "D": the site has no receiver "D"',
        "A or B or C",
    ),
    "heard twice": (
        f'kind = "meaconing"\nfrom_receiver = "A"\nto_receivers = ["B", "B"]\ndelay_m = 3\n{WHEN}',
        "faults.toml:4: fault.0.to_receivers",
        "a receiver stands twice",
    ),
    "reflected twice": (
        f'kind = "multipath"\nreceiver = "A"\nsatellites = ["G05", "G05"]\namplitude_m = 3\nperiod_s = 60\n{WHEN}',
        "faults.toml:1: fault.0: a satellite stands twice",
        "once",
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
