"""What was published over time and why: strips of state, and a lane of words and marks for every cause and excluded satellite."""

from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from typing import NamedTuple

from integrity.gnss.gps_time import DAY_S, NS_PER_S, format_utc
from integrity.states import Cause, State
from recordings.report.marks import STATE_LOOKS, state_mark
from recordings.report.series import Series, Span, by_key
from recordings.report.svg import GRID, INK, QUIET, Box, Drawing, fitted, path, text_width_px
from recordings.report.time_axis import TimeAxis, duration, heading

LEAST_MARK_PX = 2.0  # one epoch of a day still shows
MOST_CAUSE_LANES = 9  # more than this are grouped by cause
MOST_EXCLUSION_LANES = 5  # more than this share one lane
LANE_PX = 27.0


class Lane(NamedTuple):
    """What was so (`words`, and `more` of them), and when."""

    state: State | None
    words: str
    more: str
    spans: list[Span]


def cause_lanes(data: Series, silences: Sequence[Span]) -> list[Lane]:
    """One for each cause and its subjects, by their first time; by cause alone where there would be too many."""
    lanes = _causes(data, by_key((r.cause, r.subjects) for r in data.reports))
    if len(lanes) > MOST_CAUSE_LANES:
        lanes = _causes(data, by_key(r.cause for r in data.reports))
    if silences:
        lanes.append(Lane(State.NOT_CONFIRMABLE, f"{Cause.DATA}, a stream was silent", State.NOT_CONFIRMABLE, sorted(silences)))
    return sorted(lanes, key=lambda lane: lane.spans[0])


def _causes(data: Series, places: Mapping[Hashable, list[int]]) -> list[Lane]:
    lanes = []
    for epochs in places.values():
        first = data.reports[epochs[0]]
        if first.cause is not Cause.NONE:
            subjects = sorted({subject for e in epochs for subject in data.reports[e].subjects})
            lanes.append(Lane(first.state, f"{first.cause} {', '.join(subjects)}".rstrip(), first.state, data.spans(epochs)))
    return lanes


def exclusion_lanes(data: Series) -> list[Lane]:
    """One for each satellite that was out, or one for all of them where there would be too many."""
    out: dict[str, list[int]] = {}
    for e, report in enumerate(data.reports):
        for satellite in report.excluded:
            out.setdefault(satellite, []).append(e)
    if len(out) <= MOST_EXCLUSION_LANES:
        return [Lane(None, f"satellite {satellite}", "excluded", data.spans(epochs)) for satellite, epochs in out.items()]
    together = sorted({e for epochs in out.values() for e in epochs})
    return [Lane(None, f"{len(out)} satellites excluded", ", ".join(sorted(out)), data.spans(together))]


def why_height(causes: Sequence[Lane], exclusions: Sequence[Lane]) -> float:
    """Room that `draw_why` takes."""
    return 52.0 + LANE_PX * (len(causes) + len(exclusions)) + 66.0


def draw_why(
    drawing: Drawing, axis: TimeAxis, top: float, data: Series, causes: Sequence[Lane], exclusions: Sequence[Lane], silences: Sequence[Span]
) -> None:
    """The published state, a lane per cause and per excluded satellite, the verdict of the triangle alone."""
    heading(drawing, axis, top, "Published state", "good: NORMAL all along; blank: no epoch")
    strip = Box(axis.left, top + 18, axis.right, top + 42)
    _strip(drawing, axis, strip, [r.state for r in data.reports], data, silences)
    y = strip.bottom + 4
    for lane in [*causes, *exclusions]:
        _lane(drawing, axis, y, lane)
        y += LANE_PX
    y += 22
    alone = [r.triangle_alone for r in data.reports]
    counts = Counter(alone)
    heading(drawing, axis, y, "Triangle alone", "circles and shape only: " + ", ".join(f"{s} {counts[s]}" for s in State if counts[s]))
    _strip(drawing, axis, Box(axis.left, y + 7, axis.right, y + 16), alone, data, ())


def _strip(drawing: Drawing, axis: TimeAxis, box: Box, states: Sequence[State], data: Series, silences: Sequence[Span]) -> None:
    """Blocks of state; the rarer and worse ones are drawn last and never narrower than can be seen."""
    where = by_key(states)
    for state in (State.NORMAL, State.NOT_CONFIRMABLE, State.SATELLITE_ANOMALY):
        spans = data.spans(where.get(state, []))
        if state is State.NOT_CONFIRMABLE:
            spans = sorted([*spans, *silences])
        for left, right in _pixels(axis, spans, 0.0 if state is State.NORMAL else LEAST_MARK_PX):
            drawing.rect(Box(left, box.top, right, box.bottom), fill=STATE_LOOKS[state].block)
            _block_words(drawing, state, Box(left, box.top, right, box.bottom))
    drawing.rect(box, fill="none", stroke=QUIET, stroke_width=0.8)


def _block_words(drawing: Drawing, state: State, block: Box) -> None:
    """Shape and word, where they fit."""
    if block.bottom - block.top < 20 or block.right - block.left < 22:
        return
    middle = (block.top + block.bottom) / 2
    state_mark(drawing, state, block.left + 12, middle, 7)
    if text_width_px(state, 12, bold=True) + 30 <= block.right - block.left:
        drawing.text(block.left + 24, middle + 4.3, state, 12, bold=True)


def _lane(drawing: Drawing, axis: TimeAxis, top: float, lane: Lane) -> None:
    """Words as near to the first mark as the page lets them, the marks under them."""
    when = f", {_when(axis, lane.spans)}"
    room = axis.right - axis.left - 23 - text_width_px(when, 11.5)
    state_px = text_width_px(lane.more, 11.5) if lane.state else 0.0  # a state is never cut
    words = fitted(lane.words, 11.5, room - state_px, bold=True)
    more_at = 23 + text_width_px(words, 11.5, bold=True)
    more = fitted(lane.more, 11.5, room + 23 - more_at) + when
    marks = _pixels(axis, lane.spans, LEAST_MARK_PX)
    x = max(axis.left, min(marks[0][0], axis.right - more_at - text_width_px(more, 11.5)))
    if lane.state is not None:
        state_mark(drawing, lane.state, x + 7, top + 9, 5)
    else:
        cross = path([(x + 3, top + 5), (x + 11, top + 13)]) + path([(x + 11, top + 5), (x + 3, top + 13)])
        drawing.add("path", d=cross, stroke=INK, stroke_width=1.6, stroke_linecap="round")
    drawing.text(x + 18, top + 13, words, 11.5, bold=True)
    drawing.text(x + more_at, top + 13, more, 11.5)
    drawing.line(axis.left, top + 20.5, axis.right, top + 20.5, stroke=GRID)
    for left, right in marks:
        drawing.rect(Box(left, top + 18, right, top + 23), fill=STATE_LOOKS[lane.state].fill if lane.state else INK)


def _pixels(axis: TimeAxis, spans: Sequence[Span], least_px: float) -> list[tuple[float, float]]:
    """Spans in pixels, none narrower than `least_px`; what then lies within a third of a pixel is one."""
    joined: list[tuple[float, float]] = []
    for start_ns, end_ns in spans:
        left, right = axis.x(start_ns), axis.x(end_ns)
        if right - left < least_px:
            left = max(axis.left, min((left + right - least_px) / 2, axis.right - least_px))
            right = left + least_px
        if joined and left <= joined[-1][1] + 0.34:
            joined[-1] = (joined[-1][0], max(joined[-1][1], right))
        else:
            joined.append((left, right))
    return joined


def _when(axis: TimeAxis, spans: Sequence[Span]) -> str:
    total = duration(sum(end - start for start, end in spans))
    dated = axis.end_ns - axis.start_ns > DAY_S * NS_PER_S
    first = format_utc(spans[0][0])[0 if dated else 11 :].replace("T", " ").removesuffix("Z")
    return f"from {first} for {total}" if len(spans) == 1 else f"{len(spans)} times, first {first}, {total} in all"
