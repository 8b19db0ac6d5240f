"""Progress is for people at a terminal who have waited for two seconds, and for nobody else."""

import io
import sys

import pytest

from integrity.events import Event, Tick
from recordings import cli

EVENTS: tuple[Event, ...] = tuple(Tick(i, i, None) for i in range(1000))


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def said(monkeypatch: pytest.MonkeyPatch, stderr: io.StringIO, seconds: float) -> str:
    """What is said when the 1000 events take so long; they must come through as they are."""
    clock = iter([0.0, *[seconds] * len(EVENTS)])
    monkeypatch.setattr("time.monotonic", lambda: next(clock))
    monkeypatch.setattr(sys, "stderr", stderr)
    assert tuple(cli.watched(EVENTS)) == EVENTS
    return stderr.getvalue()


def test_after_two_seconds_a_terminal_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "deciding, 50 %" in said(monkeypatch, Terminal(), 2.1)


def test_before_that_nothing_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    assert said(monkeypatch, Terminal(), 1.9) == ""


def test_what_is_no_terminal_is_told_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    assert said(monkeypatch, io.StringIO(), 100.0) == ""
