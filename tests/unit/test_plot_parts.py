"""What the drawing of a replay is made of: colours, ticks of time, steps, numbers and scales."""

import math
from itertools import pairwise

import numpy as np
import pytest

from integrity.gnss.gps_time import NS_PER_S, parse_utc
from recordings.report.charts import error_scale
from recordings.report.marks import STATE_LOOKS
from recordings.report.svg import INK, QUIET, WHITE, fitted, nice_step, number, text_width_px, time_ticks
from recordings.report.time_axis import duration


def luminance(colour: str) -> float:
    """Relative luminance of WCAG 2.2."""
    channels = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


@pytest.mark.parametrize(("text", "ground"), [(INK, WHITE), (QUIET, WHITE), *((INK, look.block) for look in STATE_LOOKS.values())])
def test_words_have_contrast(text: str, ground: str) -> None:
    assert (luminance(ground) + 0.05) / (luminance(text) + 0.05) >= 4.5


def test_states_differ_in_lightness() -> None:
    by_lightness = sorted(luminance(look.block) for look in STATE_LOOKS.values())
    assert all((lighter + 0.05) / (darker + 0.05) > 1.5 for darker, lighter in pairwise(by_lightness))


@pytest.mark.parametrize(
    ("start", "end", "labels"),
    [
        ("2026-11-22T05:00:07Z", "2026-11-22T05:00:10Z", "05:00:07 05:00:08 05:00:09 05:00:10"),
        ("2026-11-22T04:59:45Z", "2026-11-22T05:59:15Z", "05:00 05:10 05:20 05:30 05:40 05:50"),
        ("2026-11-22T00:00:00Z", "2026-11-23T00:00:00Z", "22_Nov 03:00 06:00 09:00 12:00 15:00 18:00 21:00 23_Nov"),
        ("2026-02-27T18:00:00Z", "2026-03-02T06:00:00Z", "28_Feb 12:00 1_Mar 12:00 2_Mar"),
        ("2024-02-24T00:00:00Z", "2024-03-07T00:00:00Z", "25_Feb 27_Feb 29_Feb 2_Mar 4_Mar 6_Mar"),
    ],
)
def test_time_ticks(start: str, end: str, labels: str) -> None:
    assert [label.replace(" ", "_") for _, label in time_ticks(parse_utc(start), parse_utc(end), 8)] == labels.split()


def test_a_tick_after_a_leap_second_is_a_second_later() -> None:
    ticks = time_ticks(parse_utc("2016-12-31T23:59:30Z"), parse_utc("2017-01-01T00:00:30Z"), 6)
    assert {b - a for (a, _), (b, _) in pairwise(ticks)} == {15 * NS_PER_S, 16 * NS_PER_S}


@pytest.mark.parametrize(("span", "most", "step"), [(10.0, 5, 2.0), (10.0, 4, 5.0), (11.0, 1, 20.0), (0.3, 3, 0.1), (7.0, 7, 1.0)])
def test_nice_step(span: float, most: int, step: float) -> None:
    assert nice_step(span, most) == pytest.approx(step)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_what_is_not_a_number_is_no_coordinate(value: float) -> None:
    with pytest.raises(ValueError, match="cannot be drawn"):
        number(value)


@pytest.mark.parametrize(("value", "written"), [(1.0, "1"), (-0.04, "0"), (2.349, "2.3"), (-1.25, "-1.2"), (1e6, "1000000")])
def test_numbers_have_one_decimal(value: float, written: str) -> None:
    assert number(value) == written


def test_a_text_that_does_not_fit_is_cut_to_the_room() -> None:
    cut = fitted("receiver B and many others", 12, 80.0)
    assert cut.endswith("…") and text_width_px(cut, 12) <= 80.0


@pytest.mark.parametrize(
    ("seconds", "written"),
    [(0.5, "0.5 s"), (59, "59 s"), (90, "1 min 30 s"), (7200, "2 h"), (90_000, "1 d 1 h")],
)
def test_duration(seconds: float, written: str) -> None:
    assert duration(round(seconds * NS_PER_S)) == written


@pytest.mark.parametrize("largest_m", [0.0, 3.0, 14.9, 15.1, 900.0, 6.4e6])
def test_the_error_scale_grows_over_all_of_its_axis(largest_m: float) -> None:
    scale = error_scale(largest_m, 7.5, 100.0, 300.0)
    y = scale.y(np.linspace(0.0, max(largest_m, 7.5), 500))
    assert (np.diff(y) < 0.0).all() and y.min() >= 100.0 and y[0] == 300.0
