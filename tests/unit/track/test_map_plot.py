"""The picture of a map: it can be read, says what the map says, and is the same each time."""

import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from tests.unit.track.lines import edge, line, straight, turning
from train_client.track.plot import map_svg
from train_client.track.track_map import Boundary, Section, Switch, TrackMap


def yard() -> TrackMap:
    s_m = np.arange(0.0, 301.0, 2.5)
    curve = edge("curve", "a", "n", turning(s_m, np.full(len(s_m) - 1, 1 / 200)), s_m, 0.05)
    track = line(curve, straight("left", "n", "b", 0, 50), straight("right", "n", "c", 0, 80))
    return replace(
        track,
        switches=(Switch("n", (("curve", "left"), ("curve", "right"))),),
        sections=(Section("curve", 100.0, 150.0, gnss=False, station="s-1"), Section("left", 0.0, 20.0, radio=False, multipath="wall")),
        boundaries=(Boundary("area", "curve", 20.0, 1),),
    )


def texts(svg: str) -> list[str]:
    return [element.text or "" for element in ElementTree.fromstring(svg).iter("{http://www.w3.org/2000/svg}text")]


@pytest.mark.parametrize(
    "words", ["curve", "left", "right", "a", "b", "c", "n", "area", "no GNSS", "no radio", "s-1 vouches", "multipath wall", "least R 200 m"]
)
def test_everything_in_the_map_is_named(words: str) -> None:
    assert words in texts(map_svg(yard()))


def test_the_same_map_gives_the_same_bytes() -> None:
    assert map_svg(yard()) == map_svg(yard())


def test_a_line_without_sections_has_no_legend() -> None:
    assert not {"no GNSS", "no radio"} & set(texts(map_svg(replace(yard(), sections=()))))


def test_north_is_up_and_the_scale_is_one() -> None:
    """A straight of 400 m to the north: a vertical line, as long as the distances written beside it say."""
    svg = map_svg(line(straight("line", "a", "b", 0, 400)))
    (d,) = re.findall(r'd="(M[^"]*)" fill="none" stroke="#0072b2" stroke-width="2.2"', svg)
    xs, ys = np.array([[float(v) for v in step.split()] for step in d[1:].split("L")]).T
    (bar,) = re.findall(r'd="M([\d.]+) [\d.]+L[\d. ]+L[\d. ]+L([\d.]+) [\d.]+" fill="none" stroke="#1a1a1a"', svg)
    bar_px, bar_m = float(bar[1]) - float(bar[0]), next(float(words[:-2]) for words in texts(svg) if re.fullmatch(r"\d+ m", words))
    assert (np.ptp(xs), ys[0] - ys[-1]) == (pytest.approx(0.0, abs=0.1), pytest.approx(400.0 / bar_m * bar_px, rel=0.01))


def test_a_dense_line_does_not_make_a_large_picture() -> None:
    s_m = np.arange(0.0, 10_001.0, 1.0)
    enu_m = np.column_stack((np.zeros_like(s_m), s_m, np.zeros_like(s_m)))
    assert len(map_svg(line(edge("line", "a", "b", enu_m, s_m)))) < 200_000


def test_texts_of_the_plan_do_not_cover_each_other() -> None:
    labels = re.findall(r'<text x="([\d.]+)" y="([\d.]+)" font-size="1[0-2.5]+" text-anchor="middle"[^>]*paint-order', map_svg(yard()))
    places = np.array([[float(x), float(y)] for x, y in labels])
    apart = np.abs(places[:, None] - places[None]) + np.eye(len(places))[..., None] * 99
    assert ((apart[..., 0] > 8) | (apart[..., 1] > 8)).all()


def test_points_off_the_earth_are_not_drawn() -> None:
    (whole,) = line(straight("line", "a", "b", 0, 400)).edges
    with pytest.raises(ValueError, match="see `wayside map check`"):
        map_svg(line(replace(whole, pos_ecef_m=whole.pos_ecef_m * 2)))


def test_a_wrong_s_does_not_make_a_picture_of_ticks() -> None:
    (whole,) = line(straight("line", "a", "b", 0, 10)).edges
    assert len(map_svg(line(replace(whole, s_m=whole.s_m * 40_000.0)))) < 50_000
