"""Where the demo speaks: lines to a stream; on a terminal with the live view below them."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from rich.live import Live

    from train_client.demo.view import Scene

REDRAWN_EVERY_S = 0.2


class Screen:
    """`with` puts the terminal back in order. Colours as NO_COLOR allows; nothing moves where the stream is no terminal."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._live: Live | None = None
        self._kept = ExitStack()
        self._drawn_s = 0.0

    def __enter__(self) -> "Screen":
        if self._stream.isatty():
            from rich.console import Console
            from rich.live import Live

            console = Console(file=self._stream, highlight=False, markup=False)
            if console.is_terminal and not console.is_dumb_terminal:
                self._live = self._kept.enter_context(Live(console=console, auto_refresh=False, transient=True))
        return self

    def __exit__(self, *_: object) -> None:
        self._kept.close()
        self._live = None

    def say(self, line: str) -> None:
        """A line that stays."""
        if self._live is None:
            print(line, file=self._stream, flush=True)
        else:
            self._live.console.print(line, soft_wrap=True)

    def show(self, scene: "Callable[[], Scene | None]") -> None:
        """The live view, a few times a second."""
        if self._live is None or time.monotonic() < self._drawn_s + REDRAWN_EVERY_S:
            return
        from train_client.demo.view import draw

        self._drawn_s = time.monotonic()
        now = scene()
        if now is not None:
            self._live.update(draw(now), refresh=True)
