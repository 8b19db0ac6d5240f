import tomllib
from pathlib import Path

import pytest

from integrity.gnss.gps_time import gps_from_week
from recordings.simulate.scenario import load_scenario, parse_scenario
from recordings.toml_file import ConfigProblems

SAMPLE = Path(__file__).parents[3] / "recordings" / "samples" / "triangle.toml"
TEXT = SAMPLE.read_text()


def problems_of(*edits: tuple[str, str]) -> list[tuple[int | None, str]]:
    """Line and key of everything that is wrong with the sample after some edits."""
    text = TEXT
    for old, new in edits:
        assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times in the sample"
        text = text.replace(old, new)
    with pytest.raises(ConfigProblems) as refused:
        parse_scenario(text, "s.toml")
    return [(problem.line, problem.key) for problem in refused.value.problems]


def line_of(text: str) -> int:
    return TEXT[: TEXT.index(text)].count("\n") + 1


def test_the_sample_starts_when_it_says() -> None:
    assert load_scenario(SAMPLE).start_ns == gps_from_week(2408, 86_400.0 + 3 * 3600.0 + 18.0)


def test_the_site_of_a_scenario_is_one_that_can_be_run() -> None:
    assert load_scenario(SAMPLE).site.sources == {name: f"tcp://127.0.0.1:2000{k}" for k, name in enumerate("ABC", 1)}


def test_the_site_has_a_text_of_its_own() -> None:
    assert set(tomllib.loads(load_scenario(SAMPLE).site.text)) == {"site", "receivers", "integrity"}


def test_faults_are_kept_as_they_were_written() -> None:
    assert tomllib.loads(load_scenario(SAMPLE).faults)["fault"] == tomllib.loads(TEXT)["fault"]


def test_faults_keep_the_numbers_of_their_lines() -> None:
    faults = load_scenario(SAMPLE).faults.split("\n")
    lines = {k for k, line in enumerate(TEXT.split("\n")) if "kind = " in line or "size_m" in line}
    assert {k for k, line in enumerate(faults) if "kind = " in line or "size_m" in line} == lines


def test_nothing_but_faults_is_kept_with_them() -> None:
    text = "[[fault]]\nkind = 'x'\n" + TEXT[: TEXT.index("[[fault]]")]
    assert tomllib.loads(parse_scenario(text, "s.toml").faults) == {"fault": [{"kind": "x"}]}


def test_a_scenario_needs_no_faults() -> None:
    assert parse_scenario(TEXT[: TEXT.index("[[fault]]")], "s.toml").faults.strip() == ""


def test_everything_wrong_is_found_at_once() -> None:
    wrong = problems_of(
        ('"2026-03-02T03:00:00Z"', '"2026-13-02"'),
        ("duration_s = 1200", "duration_s = -1"),
        ("sigma_common_m = 1.2", "sigma_common_m = 0"),
        ('[[fault]]\nkind = "jamming"', '[train]\nkind = "jamming"'),
    )
    assert wrong == [
        (line_of("start ="), "scenario.start"),
        (line_of("duration_s = 1200"), "scenario.duration_s"),
        (line_of("sigma_common_m"), "integrity.sigma_common_m"),
        (line_of('[[fault]]\nkind = "jamming"'), "train"),
    ]


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("seed = 1", "seed = -1", "scenario.seed"),
        ("seed = 1", "seed = 1.5", "scenario.seed"),
        ("seed = 1\n", "", "scenario.seed"),
        ("seed = 1", "sede = 1\nseed = 1", "scenario.sede"),
        ('"2026-03-02T03:00:00Z"', "2026-03-02T03:00:00Z", "scenario.start"),
        ("rate_hz = 1.0", "rate_hz = 0", "scenario.rate_hz"),
        ("rate_hz = 1.0", "rate_hz = 2.0", "scenario.rate_hz"),
        ("epoch_interval_s = 1.0", "epoch_interval_s = 5.0", "scenario.rate_hz"),
    ],
)
def test_what_cannot_be_simulated_is_refused(old: str, new: str, key: str) -> None:
    assert [found for _, found in problems_of((old, new))] == [key]


def test_faults_in_single_brackets_are_refused() -> None:
    text = TEXT[: TEXT.index("[[fault]]")] + "[fault]\nkind = 'x'\n"
    with pytest.raises(ConfigProblems, match="write \\[\\[fault\\]\\]"):
        parse_scenario(text, "s.toml")


def test_the_rate_of_the_site_is_named() -> None:
    with pytest.raises(ConfigProblems, match=r"rate_hz = 2\.0: expected 1, .* or write epoch_interval_s = 0\.5"):
        parse_scenario(TEXT.replace("rate_hz = 1.0", "rate_hz = 2.0"), "s.toml")


# ---- frequencies


def measured_on(*edits: tuple[str, str]) -> int:
    text = TEXT
    for old, new in edits:
        text = text.replace(old, new, 1)
    return parse_scenario(text, "s.toml").frequencies


def test_receivers_measure_on_as_many_frequencies_as_the_site_decides_on() -> None:
    assert (measured_on(), measured_on(("[integrity]\n", "[integrity]\nfrequencies = 2\n"))) == (1, 2)


def test_receivers_of_a_scenario_may_measure_on_one_frequency_where_the_site_wants_two() -> None:
    assert measured_on(("[integrity]\n", "[integrity]\nfrequencies = 2\n"), ("[scenario]\n", "[scenario]\nfrequencies = 1\n")) == 1


def test_other_numbers_of_frequencies_are_refused() -> None:
    assert problems_of(("[scenario]\n", "[scenario]\nfrequencies = 3\n")) == [(line_of("[scenario]") + 1, "scenario.frequencies")]
