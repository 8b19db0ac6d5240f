"""A site that decides on pairs of frequencies, and what its receivers send under a quiet ionosphere and under one that no model has."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

from integrity.config import SIGMAS_OF_PAIRS_M, IntegrityConfig, SiteConfig
from integrity.events import EphemerisReceived, Event, ObservationsReceived, RawBytes, Tick
from integrity.gnss.observations import ObservationRow
from integrity.gnss.signals import is_in_lower_band
from recordings.simulate.errors import NOMINAL
from recordings.simulate.observations import antennas_of, simulate
from recordings.simulate.receiver import as_bytes
from recordings.simulate.rtcm import as_rtcm
from tests.unit.long_streams import Form
from tests.unit.streams import RECOVER_AFTER_S, SEED, SITE, START_NS, a_site, rows_changed, with_signals

SECONDS = 20
_OF_PAIRS: dict[str, Any] = {**SIGMAS_OF_PAIRS_M, "sigma_differential_up_m": 2.0 * SIGMAS_OF_PAIRS_M["sigma_differential_m"]}
PAIRS_SITE = a_site(integrity=IntegrityConfig(recover_after_s=RECOVER_AFTER_S, frequencies=2, **_OF_PAIRS))
STORM = replace(
    NOMINAL, ionosphere=3.0
)  # three times the modelled delay beyond it, and as much again from one side of the sky to the other


def speaking(site: SiteConfig, form: Form) -> SiteConfig:
    """The site with receivers of another protocol."""
    protocol = "rtcm3" if form == "rtcm3" else "ubx"
    return replace(site, receivers=tuple(replace(receiver, protocol=protocol) for receiver in site.receivers))  # type: ignore[arg-type]


@cache
def everything(storm: bool = False, seconds: int = SECONDS) -> tuple[Event, ...]:
    """Rows of both frequencies, ephemerides, and the terms of the ionosphere."""
    return simulate(SITE, START_NS, seconds, 1.0, SEED, STORM if storm else NOMINAL, 2)


@cache
def measured(storm: bool = False, seconds: int = SECONDS) -> tuple[Event, ...]:
    """The same without those terms."""
    return tuple(event for event in everything(storm, seconds) if isinstance(event, ObservationsReceived | EphemerisReceived | Tick))


@cache
def sent(form: Form, storm: bool = False) -> tuple[Event, ...]:
    """The same as bytes: UBX words have the terms of the ionosphere, RTCM has no message of them."""
    return as_sent(everything(storm), form)


def as_sent(events: Sequence[Event], form: Form) -> tuple[Event, ...]:
    """Bytes and ticks."""
    of_form = as_bytes(events, antennas_of(SITE)) if form == "ubx" else as_rtcm(events, antennas_of(SITE))
    return tuple(event for event in of_form if isinstance(event, RawBytes | Tick))


def without_second(events: Sequence[Event], receivers: str = "ABC", from_s: int = 0, systems: str = "GE") -> tuple[Event, ...]:
    """Receivers that measure nothing below L1 of these systems from a time on."""

    def change(row: ObservationRow) -> ObservationRow:
        late = (row.receive_time_ns - START_NS) // 10**9 >= from_s
        return with_signals(row, lambda s: not (is_in_lower_band(s) and s[0] in systems)) if late and row.receiver in receivers else row

    return rows_changed(events, change)
