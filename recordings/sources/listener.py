"""The thread that listens to one receiver: it stamps what comes in, hands it on, and opens the link again whenever it is lost."""

import contextlib
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from threading import Thread
from typing import Any

from integrity.errors import LinkError
from integrity.gnss.gps_time import NS_PER_S
from recordings.sources.inbox import Inbox
from recordings.sources.kinds import FileSource, Source, parse_source
from recordings.sources.links import SILENT_AFTER_S, Link, Wake
from recordings.sources.ntrip import NtripSource

FIRST_WAIT_S = 1.0
LONGEST_WAIT_S = 60.0
STOP_TIMEOUT_S = 0.4
LINES_REMEMBERED = 32

Deliver = Callable[[str, int, bytes], None]
Say = Callable[[str, str], None]


class Listener(Thread):
    """Listens to one receiver until stopped, or until its file ends.

    `deliver(receiver, mono_ns, data)` gets every piece of bytes in order, with the monotonic clock read right after the bytes were;
    it runs in this thread. `say(receiver, line)` gets one line per change. Nothing that happens to the link, and no error in either,
    ends the thread: a lost link is opened again after `first_wait_s`, then twice that and so on up to `longest_wait_s`, and after
    `first_wait_s` again only once bytes came in.
    """

    def __init__(
        self,
        receiver: str,
        source: Source,
        deliver: Deliver,
        say: Say,
        *,
        first_wait_s: float = FIRST_WAIT_S,
        longest_wait_s: float = LONGEST_WAIT_S,
        silent_after_s: float = SILENT_AFTER_S,
    ) -> None:
        super().__init__(name=f"listener-{receiver}", daemon=True)
        self.receiver = receiver
        self.source = source
        self._deliver = deliver
        self._say = say
        self._first_wait_s = first_wait_s
        self._longest_wait_s = longest_wait_s
        self._silent_after_s = silent_after_s
        self._wake = Wake()
        self._receiving = False
        self._said: deque[str] = deque(maxlen=LINES_REMEMBERED)  # since bytes last began to come in

    def stop(self) -> None:
        """End the thread, within half a second; nothing is delivered afterwards, except what a `deliver` already holds."""
        self._wake.set()
        if self.ident is None:
            self._wake.close()
        else:
            self.join(STOP_TIMEOUT_S)  # not longer: the system may be looking up a name, which nothing can stop

    def run(self) -> None:
        """Open, hand on, wait, open again."""
        wait_s = self._first_wait_s
        while (trouble := self._listen()) is not None and not self._wake.is_set:
            if self._receiving:
                wait_s = self._first_wait_s
            self._tell_once(f"{trouble}; next try in {wait_s:g} s")
            self._wake.wait(wait_s)
            wait_s = min(2.0 * wait_s, self._longest_wait_s)
        self._wake.close()

    def _listen(self) -> str | None:
        """Open the link once and hand on what it brings. What went wrong in the end, or None where the source ended or was stopped."""
        self._receiving = False
        where = ""
        try:
            with contextlib.closing(self.source.open(self._wake, self._tell, self._silent_after_s)) as link:
                self._tell_once(f"{self.source.opened} {self.source.url}")
                where = "link lost: "
                self._hand_on(link)
        except LinkError as error:
            return f"{where}{error}"
        except Exception as error:
            return f"{where}unexpected {type(error).__name__}: {error}"
        return None

    def _hand_on(self, link: Link) -> None:
        while (data := link.read(None)) is not None:
            mono_ns = time.monotonic_ns()
            if self._wake.is_set:
                return
            if not data:
                continue
            if not self._receiving:
                self._receiving = True
                self._said.clear()
                self._tell("bytes come in")
            self._deliver(self.receiver, mono_ns, data)
        self._tell(f"end of {self.source.url}")

    def _tell_once(self, line: str) -> None:
        """A link that fails in the same way again and again says it once."""
        if line not in self._said:
            self._said.append(line)
            self._tell(line)

    def _tell(self, line: str) -> None:
        with contextlib.suppress(Exception):  # a closed stderr is no reason to stop listening
            self._say(self.receiver, line)


def listener_of(receiver: str, url: str, folder: Path, inbox: Inbox[Any], interval_ns: int, say: Callable[[str], None]) -> Listener:
    """Listens to the source that a file in `folder` names, for an inbox; silent for three epochs, or longer, is lost.

    Relative paths count from where the file lies. Raises ConfigError for what is no source.
    """
    source = parse_source(url)
    if isinstance(source, FileSource):
        source = replace(source, path=str(folder / source.path))
    if isinstance(source, NtripSource) and source.ca is not None:
        source = replace(source, ca=str(folder / source.ca))
    put = inbox.put_of_file if isinstance(source, FileSource) else inbox.put
    silent_after_s = max(SILENT_AFTER_S, 3 * interval_ns / NS_PER_S)
    return Listener(receiver, source, put, lambda name, line: say(f"{name}: {line}"), silent_after_s=silent_after_s)
