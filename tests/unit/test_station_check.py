import json
import re
from pathlib import Path

import pytest

from integrity.limits import derive
from integrity.triangle import reference_triangle
from recordings.site_file import parse_site
from station.check import CheckReport, as_json, check_site, render
from tests.unit.sites import SITE, edited

LOCAL = ("tcp/0.0.0.0:7447", "tcp/127.0.0.1:7447")  # an open endpoint is a warning


def checked(folder: Path, *edits: tuple[str, str]) -> CheckReport:
    path = folder / "site.toml"
    path.write_text(edited(LOCAL, *edits))
    return check_site(path)


def test_the_sound_file_can_be_used(tmp_path: Path) -> None:
    assert checked(tmp_path).ok


# A triangle laid out with pymap3d: 120 m east, and 60 m east with 103.923 m north; coordinates are rounded to a millimetre.
def test_sides(tmp_path: Path) -> None:
    facts = checked(tmp_path).facts
    assert facts is not None and facts.sides_m == pytest.approx({"A-B": 120.0, "A-C": 120.0, "B-C": 120.0}, abs=0.002)


def test_angles(tmp_path: Path) -> None:
    facts = checked(tmp_path).facts
    assert facts is not None and facts.angles_deg == pytest.approx({"A": 60.0, "B": 60.0, "C": 60.0}, abs=0.002)


def test_angles_of_a_right_angled_triangle_stand_at_the_right_receivers(tmp_path: Path) -> None:
    north_of_a = "[-3962086.674, 3381290.800, 3668719.425]"  # 50 m north of A, by pymap3d.enu2ecef: 50/120 is the tangent at B
    facts = checked(tmp_path, ("[-3962101.898, 3381224.913, 3668763.412]", north_of_a)).facts
    assert facts is not None and facts.angles_deg == pytest.approx({"A": 90.0, "B": 22.620, "C": 67.380}, abs=0.003)


def test_a_missing_source_is_an_error_of_the_check(tmp_path: Path) -> None:
    report = checked(tmp_path, ('source = "tcp://10.0.0.2:2000"\n', ""))
    assert [(error.line, error.key) for error in report.errors] == [(11, "receivers.B.source")]


def test_a_missing_source_is_reported_among_other_errors(tmp_path: Path) -> None:
    report = checked(tmp_path, ('source = "tcp://10.0.0.2:2000"\n', ""), ("epoch = 2011.40", "epoch = 1"), ('rule = "full"', "rule = 1"))
    assert [error.key for error in report.errors] == ["site.epoch", "receivers.B.source", "integrity.rule"]


def test_a_tolerance_that_cannot_be_kept_is_an_error_at_its_line(tmp_path: Path) -> None:
    report = checked(tmp_path, ("tolerance_m = 20.0", "tolerance_m = 6.0"))
    assert [(error.line, error.key, error.value) for error in report.errors] == [(23, "integrity.tolerance_m", "6.0")]


def test_promises_beyond_the_triangle_are_an_error_of_the_receivers(tmp_path: Path) -> None:
    report = checked(
        tmp_path, ("sigma_differential_m = 0.5", "sigma_differential_m = 9.0"), ("= 1e-5", "= 1e-30"), ("tolerance_m = 20.0", "")
    )
    assert [(error.line, error.key) for error in report.errors] == [(7, "receivers")]


def test_the_facts_of_the_triangle_are_there_even_if_the_promises_contradict(tmp_path: Path) -> None:
    assert "sides          A-B 120.00 m" in render(checked(tmp_path, ("tolerance_m = 20.0", "tolerance_m = 6.0")))


def test_a_tolerance_that_cannot_be_kept_is_reported_among_other_errors(tmp_path: Path) -> None:
    report = checked(
        tmp_path,
        ('id = "kokubunji-1"', ""),
        ('rule = "full"', 'rule = "ful"'),
        ("tolerance_m = 20.0", "tolerance_m = 6.0"),
        ("valid_for_ms = 3000", "valid_for_ms = 3"),
    )
    assert [error.key for error in report.errors] == ["site.id", "integrity.rule", "integrity.tolerance_m", "publish.valid_for_ms"]


def test_a_slip_in_an_error_model_is_not_held_against_the_tolerance(tmp_path: Path) -> None:
    report = checked(tmp_path, ("sigma_common_m = 1.2", "sgma_common_m = 0.2"), ("tolerance_m = 20.0", "tolerance_m = 10.0"))
    assert [error.key for error in report.errors] == ["integrity.sgma_common_m"]


def test_a_triangle_too_small_is_reported_once(tmp_path: Path) -> None:
    report = checked(tmp_path, ("sigma_differential_m = 0.5", "sigma_differential_m = 20.0"), ("tolerance_m = 20.0", ""))
    assert [error.key for error in report.errors] == ["receivers"]


def test_a_refused_file_has_no_configuration_hash(tmp_path: Path) -> None:
    assert as_json(checked(tmp_path, ('rule = "full"', 'rule = "ful"')))["config_sha256"] is None


def test_a_file_that_is_not_toml(tmp_path: Path) -> None:
    assert [error.line for error in checked(tmp_path, ('rule = "full"', "rule = full")).errors] == [19]


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    assert "cannot be read" in render(check_site(tmp_path / "none.toml"))


def test_warnings_come_with_errors(tmp_path: Path) -> None:
    report = checked(tmp_path, ('frame = "JGD2011"', ""), ('rule = "full"', "rule = 1"))
    assert [warning.key for warning in report.warnings] == ["site.frame"]


def test_every_finding_is_a_line_with_its_place(tmp_path: Path) -> None:
    report = checked(tmp_path, ('host_clock = "ntp"', 'host_clock = "none"'), ('rule = "full"', 'rule = "ful"'))
    lines = render(report).splitlines()
    file = tmp_path / "site.toml"
    assert lines[0] == f'error: {file}:19: integrity.rule = "ful": expected "full" or "triangle"; did you mean "full"?'
    assert lines[1].startswith(f'warning: {file}:6: site.host_clock = "none": time spoofing is not monitored')
    assert lines[2] == ""
    assert lines[-1] == f"{file}: 1 error, 1 warning: refused"


def test_the_text_has_frame_and_epoch(tmp_path: Path) -> None:
    assert "frame          JGD2011, epoch 2011.40\n" in render(checked(tmp_path))


def test_the_text_says_so_where_there_is_no_epoch(tmp_path: Path) -> None:
    assert "frame          JGD2011, epoch unstated\n" in render(checked(tmp_path, ("epoch = 2011.40\n", "")))


def test_the_text_has_the_radius_and_a_row_for_every_check(tmp_path: Path) -> None:
    text = render(checked(tmp_path))
    config = parse_site(SITE, "site.toml").config
    limits = derive(config, reference_triangle(config))
    rows = [line for line in text.splitlines() if line.split(" ")[0] in limits.by_name]
    assert f"circle radius  {limits.radius_m:.2f} m\n" in text
    assert [row.split(" ")[0] for row in rows] == [threshold.name for threshold in limits.thresholds]
    for row, threshold in zip(rows, limits.thresholds, strict=True):
        _, _, value, _, caught, reason = re.split(" {2,}", row)
        assert number(value, threshold.unit) == pytest.approx(threshold.value, rel=0.05)
        assert (reason, caught == "-") == (threshold.reason, threshold.smallest_fault is None)
        if threshold.smallest_fault is not None:
            assert number(caught, threshold.fault_unit) == pytest.approx(threshold.smallest_fault, rel=0.05)


def number(cell: str, unit: str) -> float:
    """Of a cell such as `7.66 m`."""
    return float(cell.removesuffix(f" {unit}"))


def test_the_json_of_a_sound_file_survives_json(tmp_path: Path) -> None:
    config = parse_site(SITE, "site.toml").config
    limits = derive(config, reference_triangle(config))
    found = json.loads(json.dumps(as_json(checked(tmp_path)), allow_nan=False))
    assert (found["ok"], found["errors"], found["warnings"], found["site"]) == (True, [], [], "kokubunji-1")
    assert found["radius_m"] == limits.radius_m
    assert {row["name"]: row["value"] for row in found["thresholds"]} == {t.name: t.value for t in limits.thresholds}
    assert set(found["sides_m"]) == {"A-B", "A-C", "B-C"} and set(found["angles_deg"]) == {"A", "B", "C"}


def test_the_json_of_a_refused_file_has_the_same_keys(tmp_path: Path) -> None:
    refused, sound = as_json(checked(tmp_path, ('rule = "full"', "rule = 1"))), as_json(checked(tmp_path))
    assert refused.keys() == sound.keys()


def test_an_error_in_json_has_its_parts(tmp_path: Path) -> None:
    (error,) = as_json(checked(tmp_path, ('rule = "full"', 'rule = "ful"')))["errors"]
    assert (error["file"], error["line"], error["key"], error["value"]) == (str(tmp_path / "site.toml"), 19, "integrity.rule", '"ful"')
