"""Reports of epochs to draw, and what is read off the drawing."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any
from xml.etree import ElementTree

import numpy as np

from integrity.config import IntegrityConfig, ReceiverConfig, SiteConfig
from integrity.exclusion import Exclusion
from integrity.gnss.gps_time import NS_PER_S, parse_utc
from integrity.limits import Limits, derive
from integrity.outputs import EpochReport
from integrity.states import STATE_OF_CAUSE, Cause, Outcome, State
from integrity.triangle import ReferenceTriangle, reference_triangle
from integrity.verdict import CLEAN
from recordings.report.plot import replay_svg
from tests.unit.sites import A_ECEF_M, B_ECEF_M, C_ECEF_M

SVG = "{http://www.w3.org/2000/svg}"
START_NS = parse_utc("2026-11-22T00:00:00Z")
CAUSES = [cause for cause in Cause if cause is not Cause.NONE]
E_OF_A_CALM_EPOCH_M = np.array([[0.4, -0.3, 1.0], [0.2, -0.5, 1.2], [0.5, -0.1, 0.8]])

# UPC1, UPC2 and GARR of the Catalan network, 2010: sides of 38 m, 19.7 km and 19.7 km, the first two on one pixel of the plan.
FLAT_ECEF_M = ((4788065.1, 177215.5, 4196294.4), (4788053.0, 177184.0, 4196311.0), (4796983.6, 160309.1, 4187340.1))


def site_of(points: Sequence[tuple[float, float, float]]) -> tuple[ReferenceTriangle, Limits]:
    receivers = tuple(ReceiverConfig(name, point) for name, point in zip("ABC", points, strict=True))
    site = SiteConfig("t", "x", None, NS_PER_S, "none", receivers, IntegrityConfig(), 3000, "")
    triangle = reference_triangle(site)
    return triangle, derive(site, triangle)


TRIANGLE, LIMITS = site_of((A_ECEF_M, B_ECEF_M, C_ECEF_M))
CHECK_NAMES = tuple(t.name for t in LIMITS.thresholds)
THRESHOLD = np.array([t.value for t in LIMITS.thresholds])


def calm(second: int) -> EpochReport:
    return EpochReport(
        gps_time_ns=START_NS + second * NS_PER_S,
        mono_ns=second * NS_PER_S,
        state=State.NORMAL,
        cause=Cause.NONE,
        subjects=(),
        verdict=CLEAN,
        triangle_alone=State.NORMAL,
        exclusions=(),
        channels=(),
        receivers=("A", "B", "C"),
        e_enu_m=E_OF_A_CALM_EPOCH_M * (1.0 + 0.3 * math.sin(second)),
        unsolved=np.zeros(3, dtype=np.int64),
        satellites_used=np.array([9, 9, 9]),
        check_names=CHECK_NAMES,
        statistic=0.3 * THRESHOLD,
        threshold=THRESHOLD,
        outcome=np.full(len(THRESHOLD), Outcome.PASS),
        signals=("G01.1C",),
        used=np.array([True]),
        residual_sigmas=np.array([0.5]),
        b_m=np.array([[0.1], [0.0], [-0.1]]),
    )


def stopped(report: EpochReport, cause: Cause, *subjects: str, **more: Any) -> EpochReport:
    return replace(report, state=STATE_OF_CAUSE[cause], cause=cause, subjects=subjects, **more)


def moved(report: EpochReport, receiver: int, east_m: float) -> EpochReport:
    e_enu_m = np.array(report.e_enu_m)
    e_enu_m[receiver, 0] += east_m
    return replace(report, e_enu_m=e_enu_m)


def eventful() -> list[EpochReport]:
    """Ten minutes with every state, an excluded satellite, a gap, and a receiver that is three kilometres away."""
    out = (Exclusion("G12", START_NS, "residual", 9.0, 5.6),)
    reports = [calm(second) for second in range(600) if not 300 <= second < 330]
    for i in range(60, 90):
        reports[i] = stopped(moved(reports[i], 1, 3000.0), Cause.RECEIVER, "B")
    for i in range(200, 240):
        reports[i] = stopped(reports[i], Cause.SATELLITE, "G12", exclusions=out, triangle_alone=State.SATELLITE_ANOMALY)
    return reports


def every_cause(subjects_each: int) -> list[EpochReport]:
    """Every cause in turn, each with a number of different subjects."""
    reports = [calm(second) for second in range(50 * len(CAUSES) * subjects_each)]
    for k in range(len(CAUSES) * subjects_each):
        for i in range(50 * k + 20, 50 * k + 40):
            reports[i] = stopped(reports[i], CAUSES[k % len(CAUSES)], f"G{k // len(CAUSES) + 1:02d}")
    return reports


def draw(
    reports: Sequence[EpochReport], silences: Sequence[tuple[int, int]] = (), site: tuple[ReferenceTriangle, Limits] = (TRIANGLE, LIMITS)
) -> ElementTree.Element:
    return ElementTree.fromstring(replay_svg("Test site", *site, reports, silences))


def by_id(svg: ElementTree.Element, name: str) -> ElementTree.Element:
    return next(element for element in svg.iter() if element.get("id") == name)
