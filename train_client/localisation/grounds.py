"""All stations that a train listens to: each judged by itself (`ground`), and what they are worth together where their word counts."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from integrity.messages.key_expressions import HEALTH, site_key
from train_client.config import TrainConfig
from train_client.events import ChallengeAnswered, ChallengeSent, HealthReceived
from train_client.localisation.ground import Ground, GroundMemory, Said
from train_client.outputs import StationReport
from train_client.trust import DENIED, Trust, TrustState, together


class Spoken(NamedTuple):
    """What one of them said, or its silence, and trust in it before."""

    site: str
    before: Trust
    said: Said


class Grounds:
    """`keys` are the raw public keys trusted for each station, by site; `map_sha256` names the train's map."""

    def __init__(
        self, train: TrainConfig, map_sha256: str, keys: Mapping[str, Iterable[bytes]], memories: Mapping[str, GroundMemory]
    ) -> None:
        self._of = {site: Ground(site, keys.get(site, ()), train, map_sha256, memories.get(site)) for site in train.stations}
        self._speaks_at = {site_key(site, HEALTH): ground for site, ground in self._of.items()}

    def memories(self) -> dict[str, GroundMemory]:
        """By site, for a snapshot."""
        return {site: ground.memory() for site, ground in self._of.items()}

    @property
    def next_change_ns(self) -> int | None:
        """When trust in one of them runs out if nothing comes; None: never."""
        times = (ground.next_change_ns for ground in self._of.values())
        return min((t for t in times if t is not None), default=None)

    @property
    def challenge_due(self) -> tuple[int, str]:
        """When one should be challenged next, and which."""
        return min((ground.challenge_due_ns, site) for site, ground in self._of.items())

    def trust(self, sites: Iterable[str]) -> TrustState:
        """In these together."""
        return together(self._in(site) for site in sites)

    def against(self, sites: Iterable[str]) -> str:
        """Who of these speaks against it, in words; "" if nobody does."""
        return ", ".join(f"{site} says {self._in(site).state.value}" for site in sites if self._in(site).says in DENIED)

    def reports(self, mono_ns: int) -> tuple[StationReport, ...]:
        """What is made of each at this moment."""
        return tuple(_report(ground, mono_ns) for ground in self._of.values())

    def is_alarmed(self, site: str, mono_ns: int) -> bool:
        """Whether somebody else speaks in its name."""
        return self._of[site].is_alarmed(mono_ns)

    def time_passes(self, mono_ns: int, before_ns: int | None) -> list[Spoken]:
        """Nothing has come since `before_ns`; a clock that has stepped back is tied to nothing any more."""
        if before_ns is not None and mono_ns < before_ns:
            why = f"the train's clock stepped back by {(before_ns - mono_ns) / 1e9:.3f} s"
            return [Spoken(site, ground.trust, ground.forget(mono_ns, why)) for site, ground in self._of.items()]
        return [Spoken(site, ground.trust, ground.time_passes(mono_ns)) for site, ground in self._of.items()]

    def health(self, event: HealthReceived) -> Spoken | str:
        """The one at whose key it came; in words where that is nobody's."""
        ground = self._speaks_at.get(event.key_expr)
        if ground is None:
            return f"wrong place: came at {event.key_expr}, expected at {' or '.join(self._speaks_at)}"
        return Spoken(ground.site, ground.trust, ground.health(event))

    def challenged(self, event: ChallengeSent) -> None:
        """One was asked to sign a nonce."""
        if ground := self._of.get(event.site):
            ground.challenged(event)

    def answered(self, event: ChallengeAnswered) -> Spoken | None:
        """What came back; None from one that the train does not listen to."""
        ground = self._of.get(event.site)
        return None if ground is None else Spoken(event.site, ground.trust, ground.answered(event))

    def _in(self, site: str) -> Trust:
        """None in a station that the map names and the train does not listen to."""
        return self._of[site].trust if site in self._of else Trust()


def _report(ground: Ground, mono_ns: int) -> StationReport:
    trust, until_ns = ground.trust, ground.trust.valid_until_ns
    left_ns = until_ns - mono_ns if until_ns is not None and trust.state is TrustState.NORMAL else None
    return StationReport(ground.site, trust.state, trust.sequence, left_ns, ground.refused, ground.is_alarmed(mono_ns), ground.missed)
