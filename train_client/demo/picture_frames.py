"""Moving pictures in a still format: frames of a layer stand one below the other behind a window, and CSS moves the film.

No script, so that GitHub shows it; one animation a layer, so that hundreds of frames cost a browser little. Who sees no animation, or asked
for reduced motion, sees the frame of one moment, at which the loop also begins.
"""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from itertools import accumulate, groupby
from typing import TypeVar

from recordings.report.svg import Box, Drawing, number

CALM = "@media (prefers-reduced-motion:reduce){.film{animation:none!important}}"

APART_PX = 40.0  # of frames on the film: what reaches out of one is not seen in the next

View = TypeVar("View", bound=Hashable)


@dataclass(frozen=True)
class Reel:
    """Frames at even steps of a story, told `speed` times as fast, the last one held; `still_s` of the story is where it begins.

    `css` grows with the layers.
    """

    end_s: float
    step_s: float
    speed: float
    hold_s: float
    still_s: float
    css: list[str] = field(default_factory=list)

    @property
    def moments_s(self) -> list[float]:
        """Of the story: the middle of every frame."""
        return [(k + 0.5) * self.step_s for k in range(round(self.end_s / self.step_s))]

    @property
    def loop_s(self) -> float:
        """How long all of it takes."""
        return len(self.moments_s) * self.step_s / self.speed + self.hold_s

    @property
    def still(self) -> int:
        """The frame that is seen without animation."""
        return min(int(self.still_s / self.step_s), len(self.moments_s) - 1)

    def layer(self, drawing: Drawing, name: str, window: Box, views: Sequence[View], draw: Callable[[Drawing, View], None]) -> None:
        """A view for each frame, drawn inside a window of the page; equal neighbours are one picture."""
        runs = [(view, len(list(some))) for view, some in groupby(views)]
        firsts = [0, *accumulate(count for _, count in runs)]
        height = window.bottom - window.top
        pitch = height + APART_PX
        shown = max(i for i, first in enumerate(firsts[:-1]) if first <= self.still)
        drawing.open(
            "svg",
            x=window.left,
            y=window.top,
            width=window.right - window.left,
            height=height,
            viewBox=" ".join(map(number, (window.left, window.top, window.right - window.left, height))),
            overflow="hidden",
        )
        drawing.open("g", class_="film", id=name, transform=f"translate(0 {number(-shown * pitch)})")
        for i, (view, _) in enumerate(runs):
            drawing.open("g", transform=f"translate(0 {number(i * pitch)})")
            draw(drawing, view)
            drawing.close("g")
        drawing.close("g")
        drawing.close("svg")
        self._animate(name, [(first, f"translateY({number(-i * pitch)}px)") for i, first in enumerate(firsts[:-1])], "step-end")

    def slide(self, drawing: Drawing, name: str, distance_px: float, draw: Callable[[Drawing], None]) -> None:
        """Something that moves to the right in step with the frames."""
        count = len(self.moments_s)
        drawing.open("g", class_="film", id=name, transform=f"translate({number(distance_px * (self.still + 0.5) / count)} 0)")
        draw(drawing)
        drawing.close("g")
        ends = [(0, "translateX(0)"), (count, f"translateX({number(distance_px)}px)")]
        self._animate(name, ends, f"steps({count})")

    def _animate(self, name: str, steps: Sequence[tuple[int, str]], timing: str) -> None:
        """Keyframes (frame, transform), the last one until the loop ends."""
        percent = 100.0 * self.step_s / self.speed / self.loop_s
        keys = "".join(f"{frame * percent:.3f}%{{transform:{where}}}" for frame, where in steps)
        begin_s = self.still * self.step_s / self.speed
        self.css.append(f"#{name}{{animation:{name} {self.loop_s:.3f}s {timing} -{begin_s:.3f}s infinite}}")
        self.css.append(f"@keyframes {name}{{{keys}100%{{transform:{steps[-1][1]}}}}}")
