"""A ride between two stations, A and B: each signs with its own key, and the map says which of them vouches for which stretch."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from integrity.events import Event, RawBytes, Tick
from integrity.gnss.gps_time import NS_PER_S
from integrity.messages import wayside_pb2 as pb
from integrity.messages.key_expressions import HEALTH, site_key
from integrity.messages.signatures import signing_key
from tests.unit.train.ride import MAP, START_NS, STEP_NS, Ground, Say, a_train, events, measured, nothing_special
from train_client.config import TrainConfig
from train_client.events import ChallengeAnswered, ChallengeSent, HealthReceived, TrainEvent
from train_client.localisation.localiser import TrainLocaliser
from train_client.outputs import PositionReport
from train_client.track.track_map import Section, TrackMap
from train_client.trust import TrustLimits

A, B = "a-1", "b-1"
KEYS = {site: signing_key(Ed25519PrivateKey.from_private_bytes(site.encode().ljust(32))) for site in (A, B)}
TRUSTED = {site: [key.public] for site, key in KEYS.items()}
EPOCHS = 40

Make = Callable[[int], TrainEvent]
"""An event at a time of the train's clock."""


def mapped(**stretches_m: tuple[float, float]) -> TrackMap:
    """The sample map with a stretch of main-1 for each station by its letter, and all of main-2 for the one that is named last."""
    sections = [Section("main-1", *of, station=f"{letter}-1") for letter, of in stretches_m.items()]
    more = Section("main-2", 0.0, 2000.0, station=sections[-1].station)
    return replace(MAP, sections=(*sections, more))


# The train is 40 m long; its front end begins at 60 m and goes 4 m an epoch.
BOTH = mapped(a=(0.0, 920.0), b=(0.0, 920.0))
HAND_OVER = mapped(a=(0.0, 130.0), b=(98.0, 920.0))
BORDER, BEYOND = 10, 28  # the first epoch with the front end in both stretches, and with the rear end in B's alone
GAP = mapped(a=(0.0, 130.0), b=(149.0, 920.0))
IN_GAP = range(18, 33)  # epochs with an end or an antenna in neither


def two_station_train(**changes: object) -> TrainConfig:
    return a_train(**{"stations": (A, B), **changes})


QUICK = two_station_train(trust=TrustLimits(1, 2 * NS_PER_S))  # one NORMAL is enough


def localiser(track: TrackMap = BOTH, train: TrainConfig | None = None) -> TrainLocaliser:
    return TrainLocaliser(train or two_station_train(), track, TRUSTED)


def ground(site: str, kind: type[Ground] = Ground) -> Ground:
    return kind(key=KEYS[site], site=site, boot=f"boot of {site}".ljust(16).encode())


def stream(
    a: Say = nothing_special,
    b: Say = nothing_special,
    more: Mapping[int, Sequence[Make]] | None = None,
    sent: Sequence[Event] | None = None,
    grounds: Mapping[str, Ground] | None = None,
    mono: Callable[[int], int] = lambda ns: ns,
) -> list[TrainEvent]:
    """Bytes of the antennas; after each epoch challenges, health of A and of B, and what else comes then (`more`, by epoch)."""
    of = {site: ground(site) for site in (A, B)} | dict(grounds or {})
    each = [_blocks(events(measured() if sent is None else sent, say, of[site], mono), site) for site, say in ((A, a), (B, b))]
    found: list[TrainEvent] = []
    number = 0
    for of_a, of_b in zip(*each, strict=True):
        found += [*of_a, *of_b[1:]]
        if isinstance(of_a[0], Tick):
            found += [make(of_a[0].mono_ns) for make in (more or {}).get(number, ())]
            number += 1
    return found


def where_says(site: str, say: Say) -> list[TrainEvent]:
    """The other one says nothing special."""
    return stream(a=say) if site == A else stream(b=say)


def _blocks(of: Iterable[TrainEvent], site: str) -> list[list[TrainEvent]]:
    """What the antennas send, each time with what comes from the station after it."""
    found: list[list[TrainEvent]] = []
    for event in of:
        if isinstance(event, RawBytes | Tick):
            found.append([event])
        else:
            found[-1].append(replace(event, site=site) if isinstance(event, ChallengeSent | ChallengeAnswered) else event)
    return found


def forged(site: str) -> Make:
    """Nobody has signed it."""
    return lambda mono_ns: HealthReceived(mono_ns, site_key(site, HEALTH), b"nonsense")


def says_anomaly(first: int = 0, end: int = 10**6) -> Say:
    """From one epoch up to another one."""

    def say(number: int, plain: pb.Health) -> pb.Health:
        if first <= number < end:
            plain.state, plain.cause = pb.SATELLITE_ANOMALY, pb.SPOOFING
            plain.ClearField("covers_from_gps_ns")
            plain.ClearField("covers_to_gps_ns")
        return plain

    return say


def falls_silent(first: int, end: int = 10**6) -> Say:
    return lambda number, plain: None if first <= number < end else plain


def once_in_five(at: int = 0, then: Say = nothing_special) -> Say:
    """Slower than the train: one message for five epochs."""

    def say(number: int, plain: pb.Health) -> pb.Health | None:
        plain.covers_from_gps_ns, plain.valid_for_ms = plain.gps_time_ns - 5 * STEP_NS + 1, 3000
        return then(number, plain) if number % 5 == at else None

    return say


def epochs(reports: Iterable[PositionReport]) -> set[int]:
    """Their numbers."""
    return {(report.fix.gps_time_ns - START_NS) // STEP_NS for report in reports if report.fix}


def at_ns(number: int) -> int:
    """When an epoch was."""
    return START_NS + number * STEP_NS
