"""The link of a train to the ground: dialled in a thread of its own for as long as it takes, so that nobody waits for it."""

import threading
from collections.abc import Callable, Mapping, Sequence
from functools import partial

from integrity.messages.key_expressions import CHALLENGE, HEALTH, site_key, train_key
from integrity.messages.verification import cut
from recordings.keys import KeyDates
from recordings.link import Arrival, Link, Put, dial_link, nobody_at
from recordings.tls_files import TlsFiles
from train_client.events import ChallengeAnswered, HealthReceived

ANSWER_WITHIN_S = 1.0
STOP_WITHIN_S = 3.0
SAY_AGAIN_NS = 10_000_000_000

Take = Callable[[HealthReceived | ChallengeAnswered], None]


class Air:
    """Hands on what comes from the stations at some endpoints; challenges them, and publishes positions, whenever somebody is there.

    What names a key that does not count today is not handed on: dates need a clock, and who decides has none but its own.
    """

    def __init__(
        self,
        connect: Sequence[str],
        tls: TlsFiles | None,
        stations: Mapping[str, KeyDates],
        train_id: str,
        take: Take,
        say: Callable[[str], None],
    ) -> None:
        self._connect = connect
        self._tls = tls
        self._stations = stations
        self._refused_ns: int | None = None  # when a refusal was said last
        self._train_id = train_id
        self._take = take
        self._say = say
        self._link: Link | None = None
        self._put: Put | None = None
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="air", daemon=True)

    def start(self) -> None:
        """Begin to dial."""
        self._thread.start()

    @property
    def sites(self) -> tuple[str, ...]:
        """The stations."""
        return tuple(self._stations)

    def challenge(self, site: str, nonce: bytes) -> None:
        """Ask a station to sign a nonce; what comes back is handed on. Nobody there: nothing happens."""
        link = self._link
        if link is not None:
            link.ask(site_key(site, CHALLENGE), nonce, ANSWER_WITHIN_S, lambda arrival: self._answer(site, nonce, arrival))

    def publish(self, position: bytes) -> None:
        """Put a TrainPosition, if there is a link."""
        if self._put is not None:
            self._put(position)

    def stop(self) -> None:
        """Close the link: a process that leaves it open does not end."""
        self._ended.set()
        self._thread.join(STOP_WITHIN_S if self._link is not None else 0.0)

    def _answer(self, site: str, nonce: bytes, arrival: Arrival) -> None:
        data = cut(arrival.data)
        if self._counts(self._stations[site].of_answer(data), arrival.mono_ns):
            self._take(ChallengeAnswered(arrival.mono_ns, site, nonce, data, arrival.error))

    def _health(self, dates: KeyDates, arrival: Arrival) -> None:
        data = cut(arrival.data)
        if self._counts(dates.of_health(data), arrival.mono_ns):
            self._take(HealthReceived(arrival.mono_ns, arrival.key_expr, data))

    def _counts(self, refusal: str, mono_ns: int) -> bool:
        """Whether there is no reason against it; a reason is said once every ten seconds: nobody can fill a journal from afar."""
        if refusal and (self._refused_ns is None or mono_ns - self._refused_ns >= SAY_AGAIN_NS):
            self._refused_ns = mono_ns
            self._say(f"not believed: {refusal}")
        return not refusal

    def _run(self) -> None:
        with dial_link(self._connect, lambda: self._say(nobody_at(self._connect)), self._tls) as link:
            for site, dates in self._stations.items():
                link.subscribe(site_key(site, HEALTH), partial(self._health, dates))
            self._put = link.droppable(train_key(self._train_id), "wayside.v1.TrainPosition")
            self._link = link
            self._say(f"connected to {', '.join(self._connect)}")
            self._ended.wait()
            self._link, self._put = None, None
