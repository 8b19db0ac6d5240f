"""What the receivers of a station and of a train send in the demo: sound streams, and in them one fault after the other.

Satellites and ionosphere are the same for ground and train, since every process of the simulation depends on the seed and its own name
alone. The fault of a satellite is in the ranges of all receivers; a receiver's fault, spoofing and jamming are on the ground only.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from integrity.config import ReceiverConfig, SiteConfig
from integrity.events import EphemerisReceived, Event, IonosphereReceived, ObservationsReceived, Tick
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.signals import satellite_of
from integrity.states import STATE_OF_CAUSE, Cause, State
from recordings.faults import Fault, inject, parse_faults
from recordings.faults.kinds import KINDS, SatelliteStep
from recordings.simulate.errors import NOMINAL
from recordings.simulate.observations import Antenna, antennas_of, observed
from recordings.simulate.receiver import as_bytes
from recordings.toml_file import format_toml

GROUND_ERRORS = NOMINAL
TRAIN_ERRORS = replace(NOMINAL, noise_m=0.3, noise_low_m=0.0, multipath_m=0.0, multipath_low_m=0.0)  # white, alike at every elevation

STATION_SETTINGS = ("site.epoch_interval_s=0.1", "integrity.recover_after_s=3.0", 'integrity.on_satellite_fault="exclude"')
"""What the timeline reckons with, as settings to be laid over the sample site."""


@dataclass(frozen=True)
class Phase:
    """A stretch of the story, in seconds from the first epoch: what happens from `start_s` to before `end_s`, and what the station says.

    `kind`: a kind of `[[fault]]` with its other keys in `fault`, or something that befalls the station while all receivers are sound. A
    satellite that is not named is the one with the strongest signals then. `cause`, `subjects`, `excluded`: of the health of every epoch;
    once told, `excluded` also names those that an earlier phase made the station exclude.
    """

    name: str
    start_s: float
    end_s: float
    kind: str
    fault: Mapping[str, Any] = field(default_factory=dict)
    cause: Cause = Cause.NONE
    subjects: tuple[str, ...] = ()
    excluded: tuple[str, ...] = ()

    @property
    def state(self) -> State:
        """What the station publishes."""
        return State.NORMAL if self.cause is Cause.NONE else STATE_OF_CAUSE[self.cause]


GROUND = ("A", "B", "C")
BIAS = {"receiver": "B", "offset_enu_m": (12.0, -9.0, 0.0)}  # 15 m
JAMMER = {"receivers": GROUND, "drop_db": 15.0}

# NORMAL returns `recover_after_s` after the end of each fault; another second remains before the next phase.
TIMELINE = (
    Phase("start-up", 0.0, 3.0, "start", cause=Cause.NOT_READY),
    Phase("receiver fault", 12.0, 19.0, "receiver_bias", BIAS, Cause.RECEIVER, ("B",)),
    Phase("satellite fault", 28.0, 38.0, "satellite_step", {"size_m": 30.0}),
    Phase("spoofing", 46.0, 53.0, "spoofing", {"receivers": GROUND}, Cause.SPOOFING, GROUND),
    Phase("jamming", 61.0, 69.0, "jamming", JAMMER, Cause.JAMMING),
    Phase("forged and replayed health", 78.0, 82.0, "forged_health"),
    Phase("decisions frozen", 85.0, 92.0, "frozen_decisions"),
    Phase("station killed", 101.0, 108.0, "station_killed"),
)
END_S = 108.0


@dataclass(frozen=True, eq=False)
class Story:
    """`phases` with their satellites chosen, and `events`: a burst of each receiver and a tick per epoch, in the order of time."""

    phases: tuple[Phase, ...]
    events: tuple[Event, ...]


def tell(
    site: SiteConfig, train: Sequence[Antenna], start_ns: int, seed: int, phases: Sequence[Phase] = TIMELINE, duration_s: float = END_S
) -> Story:
    """The story at a site with receivers A, B and C and a train's antennas, from the GPS time `start_ns` on, at the rate of the site.

    Phases that begin after `duration_s` are left out. 110 s at 10 Hz take about a second to compute.
    """
    rate_hz = NS_PER_S / site.epoch_interval_ns
    ground = antennas_of(site)
    sound = _merged(
        observed(ground, start_ns, duration_s, rate_hz, seed, GROUND_ERRORS),
        observed(train, start_ns, duration_s, rate_hz, seed, TRAIN_ERRORS),
    )
    first_ns = sound[0].mono_ns
    told = _with_those_out([_with_satellite(phase, sound, first_ns) for phase in phases if phase.start_s < duration_s])
    everybody = _with_train(site, train, first_ns)
    faulty = inject(sound, _faults(told, first_ns, everybody), everybody, seed)
    return Story(told, as_bytes(faulty, (*ground, *train)))


def alone(kind: str) -> tuple[Phase, ...]:
    """Start-up and the phase of one kind, moved to where the first of the others would begin."""
    first, (phase,) = TIMELINE[1], (phase for phase in TIMELINE if phase.kind == kind)
    return TIMELINE[0], replace(phase, start_s=first.start_s, end_s=first.start_s + phase.end_s - phase.start_s)


def _merged(ground: Sequence[Event], train: Sequence[Event]) -> tuple[Event, ...]:
    """Both as one stream: of the train's its measurements, and the ephemerides of satellites that the ground does not see."""
    told = {event.ephemeris for event in ground if isinstance(event, EphemerisReceived)}
    missing = [event for event in train if isinstance(event, EphemerisReceived) and event.ephemeris not in told]
    measured = [event for event in train if isinstance(event, ObservationsReceived)]
    order: dict[type[Event], int] = {IonosphereReceived: 0, EphemerisReceived: 1, ObservationsReceived: 2, Tick: 3}
    return tuple(sorted([*ground, *missing, *measured], key=lambda event: (event.mono_ns, order[type(event)])))


def _with_satellite(phase: Phase, events: Sequence[Event], first_ns: int) -> Phase:
    """The phase with the satellite whose signals are strongest in all rows together: high for everybody, and never lost."""
    if phase.kind != SatelliteStep.kind or "satellite" in phase.fault:
        return phase
    strength: Counter[str] = Counter()
    for event in events:
        if isinstance(event, ObservationsReceived) and phase.start_s * NS_PER_S <= event.mono_ns - first_ns < phase.end_s * NS_PER_S:
            strength.update(dict(zip(map(satellite_of, event.row.signals), event.row.cn0_dbhz.tolist(), strict=True)))
    satellite = max(sorted(strength), key=strength.__getitem__)
    return replace(phase, fault={**phase.fault, "satellite": satellite}, excluded=(satellite,))


def _with_those_out(phases: Sequence[Phase]) -> tuple[Phase, ...]:
    """Whom one excludes, the later ones exclude too: a satellite whose carrier stepped comes back after an hour, which no story lasts."""
    found: list[Phase] = []
    out: set[str] = set()
    for phase in phases:
        out |= set(phase.excluded)
        found.append(replace(phase, excluded=tuple(sorted(out))))
    return tuple(found)


def _faults(phases: Sequence[Phase], first_ns: int, site: SiteConfig) -> tuple[Fault, ...]:
    tables = [
        {"kind": phase.kind, "start_s": phase.start_s, "duration_s": phase.end_s - phase.start_s, **phase.fault}
        for phase in phases
        if phase.kind in KINDS
    ]
    return parse_faults(format_toml({"fault": tables}), "the story's faults", first_ns, site) if tables else ()


def _with_train(site: SiteConfig, train: Sequence[Antenna], first_ns: int) -> SiteConfig:
    """The site as if the train's receivers were some of its own: faults act on the receivers of a site."""
    points = [antenna.motion(np.array([first_ns]))[0][0].tolist() for antenna in train]
    receivers = [ReceiverConfig(antenna.receiver, (x, y, z)) for antenna, (x, y, z) in zip(train, points, strict=True)]
    return replace(site, receivers=(*site.receivers, *receivers))
