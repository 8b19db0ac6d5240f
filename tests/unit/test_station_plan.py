"""What a triangle can promise: the table follows from the same limits as a station's, and the advice works."""

import json
from functools import cache
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from integrity.limits import derive
from integrity.triangle import reference_triangle
from recordings.site_file import parse_site
from recordings.toml_file import ConfigProblems
from station.check import check_site
from station.plan import FALSE_STOPS_PER_YEAR, MISSED_DETECTION, SitePlan, as_json, plan_site, render
from tests.unit.sites import edited

REFUSED = ("tolerance_m = 20.0", "tolerance_m = 12.0")
NO_TOLERANCE = ("tolerance_m = 20.0\n", "")
SMALL_TRIANGLE = ("sigma_differential_m = 0.5", "sigma_differential_m = 11.0")


def written(folder: Path, *edits: tuple[str, str]) -> Path:
    path = folder / "site.toml"
    path.write_text(edited(*edits))
    return path


@cache
def planned(*edits: tuple[str, str]) -> SitePlan:
    with TemporaryDirectory() as folder:
        return plan_site(written(Path(folder), *edits))


@pytest.mark.parametrize("policy", ["stop", "exclude"])
def test_what_the_file_promises_is_what_a_station_derives(policy: str) -> None:
    edit = ('on_satellite_fault = "stop"', f'on_satellite_fault = "{policy}"')
    site = parse_site(edited(edit), "site.toml").config
    limits, promised = derive(site, reference_triangle(site)), planned(edit).promised
    checks = ("circle_A", "shape", "common", "residual", "b_value")
    assert (promised.radius_m, promised.circle_m, promised.shape_m, promised.common_m, promised.residual_m, promised.b_value_m) == (
        limits.radius_m,
        *(limits.by_name[check].smallest_fault for check in checks),
    )


@pytest.mark.parametrize(("policy", "by_exclusions"), [("stop", {"b_value_m"}), ("exclude", {"b_value_m", "residual_m"})])
def test_what_goes_by_false_exclusions_does_not_depend_on_stops(policy: str, by_exclusions: set[str]) -> None:
    plan = planned(('on_satellite_fault = "stop"', f'on_satellite_fault = "{policy}"'))
    few, many = (p for p in plan.promises if p.missed_detection == 1e-5 and p.false_stops_per_year in (1.0, 10.0))
    columns = ("circle_m", "shape_m", "common_m", "residual_m", "b_value_m")
    assert {column for column in columns if getattr(few, column) == getattr(many, column)} == by_exclusions


@pytest.mark.parametrize(("policy", "columns"), [("stop", "one range: by 1 "), ("exclude", "satellite and one range: by 1 ")])
def test_the_table_says_what_goes_by_false_exclusions(policy: str, columns: str) -> None:
    text = render(planned(('on_satellite_fault = "stop"', f'on_satellite_fault = "{policy}"')))
    assert f"\n{columns}false exclusions a year, as the file promises\n" in text


def test_every_pair_of_promises_is_there() -> None:
    pairs = [(p.false_stops_per_year, p.missed_detection) for p in planned().promises]
    assert pairs == [(stops, missed) for stops in FALSE_STOPS_PER_YEAR for missed in MISSED_DETECTION]


def test_fewer_false_stops_need_a_larger_radius() -> None:
    radii = [p.radius_m for p in planned().promises if p.missed_detection == 1e-5]
    assert radii == sorted(radii, reverse=True) and len(set(radii)) == 4


def test_fewer_misses_need_a_larger_tolerance() -> None:
    tolerances = [p.least_tolerance_m for p in planned().promises if p.false_stops_per_year == 1.0]
    assert tolerances == sorted(tolerances) and len(set(tolerances)) == 3


def test_a_sound_file_keeps_what_it_promises() -> None:
    plan = planned()
    assert (plan.promised.broken, plan.changes) == ((), ())


def test_a_refused_file_is_planned() -> None:
    promised = planned(REFUSED).promised
    assert promised.broken == (f"needs a tolerance of {promised.least_tolerance_m:.2f} m, the line has 12",)


def test_a_triangle_too_small_is_planned() -> None:
    broken = planned(SMALL_TRIANGLE, NO_TOLERANCE).promised.broken
    assert len(broken) == 1 and broken[0].startswith("collapse needs 12.0 sigma, the triangle has ")


@pytest.mark.parametrize(("more_m", "kept"), [(-0.001, False), (0.001, True)])
def test_the_tolerance_needed_is_the_one_that_the_check_asks_for(tmp_path: Path, more_m: float, kept: bool) -> None:
    needed_m = planned().promised.least_tolerance_m
    assert check_site(written(tmp_path, ("tolerance_m = 20.0", f"tolerance_m = {needed_m + more_m:.4f}"))).ok is kept


@pytest.mark.parametrize("edits", [(REFUSED,), (SMALL_TRIANGLE, NO_TOLERANCE), ()])
def test_a_promise_is_kept_where_the_check_accepts_it(tmp_path: Path, edits: tuple[tuple[str, str], ...]) -> None:
    path = written(tmp_path, *edits)
    assert check_site(path).ok is (not plan_site(path).promised.broken)


def advised(plan: SitePlan, key: str) -> str:
    change = next(change for change in plan.changes if f"{key} = " in change)
    return change.partition(f"{key} = ")[2].partition(",")[0].partition(" ")[0]


@pytest.mark.parametrize(("key", "old"), [("tolerance_m", "12.0"), ("sigma_common_m", "1.2")])
def test_each_advice_for_the_circles_makes_the_check_accept(tmp_path: Path, key: str, old: str) -> None:
    value = advised(planned(REFUSED), key)
    text = edited(REFUSED).replace(f"\n{key} = {old}\n", f"\n{key} = {value}\n")
    path = tmp_path / "advised.toml"
    path.write_text(text)
    assert value != old and check_site(path).ok


def test_the_advice_for_the_collapse_test_makes_the_check_accept(tmp_path: Path) -> None:
    plan = planned(SMALL_TRIANGLE, NO_TOLERANCE)
    level, up = advised(plan, "sigma_differential_m"), advised(plan, "sigma_differential_up_m")
    path = written(
        tmp_path,
        ("sigma_differential_m = 0.5", f"sigma_differential_m = {level}"),
        ("sigma_differential_up_m = 1.0", f"sigma_differential_up_m = {up}"),
        NO_TOLERANCE,
    )
    assert check_site(path).ok


def test_the_promises_told_as_kept_are_those_that_the_check_accepts(tmp_path: Path) -> None:
    kept = []
    for stops, missed in product(FALSE_STOPS_PER_YEAR, MISSED_DETECTION):
        promises = (
            ("false_stops_per_year = 1.0", f"false_stops_per_year = {stops}"),
            ("missed_detection = 1e-5", f"missed_detection = {missed}"),
        )
        if check_site(written(tmp_path, REFUSED, *promises)).ok:
            kept.append(f"{stops:g} stops a year with {missed:g} missed")
    assert 0 < len(kept) < 12, "the edit of the test tells nothing apart"
    assert planned(REFUSED).changes[-1] == f"promises that this site keeps: {', '.join(kept)}"


def test_short_sides_are_told() -> None:
    near = "position_ecef_m = [-3962113.542, 3381303.869, 3668678.638]"  # 7.5 m east of A, a sixteenth of the way to B
    plan = planned(("position_ecef_m = [-3962186.571, 3381218.295, 3668678.638]", near))
    remarks = {side.ends: len(side.remarks) for side in plan.sides}
    assert remarks == {"A-B": 2, "A-C": 0, "B-C": 0}


def test_without_coordinates_there_is_nothing_to_plan() -> None:
    with pytest.raises(ConfigProblems, match="missing coordinates"):
        planned(("position_ecef_m = [-3962186.571, 3381218.295, 3668678.638]\n", ""))


def test_the_table_marks_the_file_s_own_promises() -> None:
    own = [line for line in render(planned()).splitlines() if line.endswith("(the file's)")]
    assert len(own) == 1 and own[0].split()[:2] == ["1", "1e-05"]


def test_the_plan_is_one_json_object() -> None:
    found = json.loads(json.dumps(as_json(planned(REFUSED))))
    assert [len(found["promises"]), found["wanted_m"], len(found["promised"]["broken"])] == [12, 12.0, 1]
