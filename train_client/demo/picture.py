"""The demo as one moving picture for a README: from its two recordings, and nothing else.

Left the triangle, right the train, below the whole story with a cursor. A state is always a word, a shape and a colour.
"""

from collections.abc import Sequence
from itertools import groupby

from integrity.states import State
from recordings.reader import Contents
from recordings.report.marks import STATE_LOOKS
from recordings.report.svg import GRID, INK, QUIET, Box, Drawing, fitted, path, text_width_px
from train_client.demo.picture_frames import CALM, Reel
from train_client.demo.picture_panels import LinePanel, TrianglePanel, Words, block, draw_words, mark
from train_client.demo.picture_told import Spell, Told, confirmed_now, latest, told

TITLE = "Wayside demo"
WIDTH_PX, HEIGHT_PX = 900.0, 440.0
LEFT, RIGHT = 24.0, 876.0
CLOCK = Box(700, 12, RIGHT, 44)
STATION, TRIANGLE = Box(LEFT, 76, 440, 142), Box(LEFT, 142, 440, 330)
TRAIN, PLACE, LINE = Box(470, 76, RIGHT, 120), Box(470, 120, RIGHT, 154), Box(470, 154, RIGHT, 330)
STRIP = Box(80, 360, RIGHT, 400)
ROW_PX = 20.0

STEP_S, SPEED, HOLD_S = 0.5, 3.0, 2.0


def animated_svg(station: Contents, train: Contents) -> str:
    """The text of an SVG file that moves by itself, for ever. RecordingError where the recordings do not fit each other.

    The same recordings give the same bytes. Without animation it shows the middle of the first time in which the train trusts.
    """
    story = told(station, train)
    calm = next((spell for spell in story.train if spell.word == State.NORMAL), story.train[-1])
    reel = Reel(story.end_s, STEP_S, SPEED, HOLD_S, (calm.from_s + calm.to_s) / 2.0)
    drawing = _drawn(story, reel)
    drawing.add("style", "\n".join([*reel.css, CALM]))
    return drawing.document(WIDTH_PX, HEIGHT_PX, TITLE, _description(story))


def still_svg(station: Contents, train: Contents, story_s: float) -> str:
    """The same picture, standing at one moment of the story."""
    story = told(station, train)
    return _drawn(story, Reel(story.end_s, STEP_S, SPEED, HOLD_S, story_s)).document(WIDTH_PX, HEIGHT_PX, TITLE, _description(story))


def _drawn(story: Told, reel: Reel) -> Drawing:
    """What stands, then what moves."""
    drawing, moments_s = Drawing(), reel.moments_s
    triangle, line = TrianglePanel(story, TRIANGLE), LinePanel(story, LINE)
    _header(drawing, story)
    triangle.still(drawing)
    line.still(drawing)
    _strip(drawing, story)
    reel.layer(drawing, "clock", CLOCK, [f"{int(s)} s of {story.end_s:.0f} s" for s in moments_s], _clock)
    reel.layer(drawing, "station", STATION, [_of_station(story, s) for s in moments_s], lambda d, words: draw_words(d, STATION, words))
    reel.layer(drawing, "triangle", TRIANGLE, [triangle.view(s) for s in moments_s], triangle.draw)
    reel.layer(drawing, "train", TRAIN, [_of_train(story, s) for s in moments_s], lambda d, words: draw_words(d, TRAIN, words))
    reel.layer(drawing, "place", PLACE, [_place(story, s) for s in moments_s], _draw_place)
    reel.layer(drawing, "line", LINE, [line.view(s) for s in moments_s], line.draw)
    reel.slide(drawing, "cursor", STRIP.right - STRIP.left, _cursor)
    return drawing


def _header(drawing: Drawing, story: Told) -> None:
    drawing.text(LEFT, 32, TITLE, 18, bold=True)
    pace = f"as recorded, told {SPEED:g} times as fast"
    drawing.text(LEFT + text_width_px(TITLE, 18, bold=True) + 8, 32, pace, 13, fill=QUIET)
    drawing.line(LEFT, 46, RIGHT, 46, stroke=GRID)
    drawing.text(STATION.left, 66, f"Station {story.site_id}", 13, bold=True, fill=QUIET)
    drawing.text(TRAIN.left, 66, f"Train {story.train_id}", 13, bold=True, fill=QUIET)


def _clock(drawing: Drawing, words: str) -> None:
    drawing.text(RIGHT, 32, words, 15, anchor="end", bold=True)


def _of_station(story: Told, story_s: float) -> Words:
    spell = latest(story.station, story_s)
    return Words(spell.word, spell.lines)


def _of_train(story: Told, story_s: float) -> Words:
    spell = latest(story.train, story_s)
    return Words(spell.word, spell.lines)


def _place(story: Told, story_s: float) -> tuple[str, ...]:
    """Where the train is, or was confirmed last; what it refused."""
    position = latest(story.ridden, story_s).position
    last, refused = position.last_confirmed, position.refused_messages
    place = "no position confirmed yet"
    if position.HasField("last_confirmed"):
        place = f"{'front at' if confirmed_now(position) else 'last confirmed at'} {last.edge} {last.offset_m:.0f} m"
    return (place, *([f"{refused} forged or replayed messages refused"] if refused else []))


def _draw_place(drawing: Drawing, lines: tuple[str, ...]) -> None:
    for k, line in enumerate(lines):
        drawing.text(PLACE.left, PLACE.top + 11 + 17 * k, line, 12, fill=QUIET)


def _strip(drawing: Drawing, story: Told) -> None:
    """What was said from the beginning to the end, and what it was, numbered."""
    for name, spells, top in (("station", story.station, STRIP.top), ("train", story.train, STRIP.top + ROW_PX)):
        drawing.text(LEFT, top + 13, name, 11.5, fill=QUIET)
        for word, from_s, to_s in _joined(spells):
            box = Box(_x(story, from_s), top, _x(story, to_s), top + ROW_PX - 3)
            looks = STATE_LOOKS.get(State(word)) if word in set(State) else None
            drawing.rect(box, fill=block(word) if looks is None else looks.block)
            if box.right - box.left > 13:
                mark(drawing, word, (box.left + box.right) / 2, (box.top + box.bottom) / 2, 5.5)
    bottom = STRIP.top + 2 * ROW_PX
    ends = [*(_x(story, episode.from_s) for episode in story.episodes[1:]), WIDTH_PX]
    for k, (episode, end) in enumerate(zip(story.episodes, ends, strict=True), 1):
        x = _x(story, episode.from_s)
        drawing.line(x, bottom - 3, x, bottom + 24, stroke=QUIET, stroke_width=0.8)
        drawing.text(x + 3, bottom + 10, fitted(f"{k} {episode.name}", 10.5, end - x - 3, bold=True), 10.5, bold=True)
        drawing.text(x + 3, bottom + 23, fitted(episode.numbers, 9.5, end - x - 3), 9.5, fill=QUIET)


def _joined(spells: Sequence[Spell]) -> list[tuple[str, float, float]]:
    """Word, beginning and end of stretches with the same word."""
    runs = [(word, list(some)) for word, some in groupby(spells, lambda spell: spell.word)]
    return [(word, some[0].from_s, some[-1].to_s) for word, some in runs]


def _cursor(drawing: Drawing) -> None:
    drawing.line(STRIP.left, STRIP.top - 4, STRIP.left, STRIP.top + 2 * ROW_PX, stroke=INK, stroke_width=2)
    corners = [(STRIP.left - 5, STRIP.top - 10), (STRIP.left + 5, STRIP.top - 10), (STRIP.left, STRIP.top - 3)]
    drawing.add("path", d=path(corners, closed=True), fill=INK)


def _x(story: Told, story_s: float) -> float:
    return STRIP.left + (STRIP.right - STRIP.left) * story_s / story.end_s


def _description(story: Told) -> str:
    """For a screen reader."""
    episodes = [f"{e.from_s:.0f} s {e.name}" + (f", {e.numbers}" if e.numbers else "") for e in story.episodes]
    return f"Station {story.site_id} and train {story.train_id} in {story.end_s:.0f} s: {'; '.join(episodes)}."
