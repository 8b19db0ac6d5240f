"""Receivers with two frequencies: the second one as the broadcast models have it, with errors of its own, and the first one as alone."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from integrity.config import SiteConfig
from integrity.events import Event, ObservationsReceived, RawBytes
from integrity.gnss.combination import ionosphere_free
from integrity.gnss.ephemeris.states import satellite_states
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.observations import ROW_ARRAYS, Floats, ObservationBlock, ObservationRow, build_block, layout_of
from integrity.gnss.positioning import points_at, prefit, state_time_ns
from integrity.gnss.signals import MONITORED_SYSTEMS, is_in_lower_band, pair_codes_of
from integrity.reception import Reception
from recordings.simulate.constellation import IONOSPHERE, constellation
from recordings.simulate.errors import NOMINAL, ErrorModel
from recordings.simulate.observations import antennas_of, simulate
from recordings.simulate.receiver import as_bytes
from recordings.simulate.rtcm import as_rtcm
from tests.unit.positioning.field import SILENT
from tests.unit.streams import SEED, SITE, START_NS, TRIANGLE, with_signals

SECONDS = 20


@cache
def events(errors: ErrorModel = NOMINAL, frequencies: int = 2) -> tuple[Event, ...]:
    return simulate(SITE, START_NS, SECONDS, 1.0, SEED, errors, frequencies)


def rows(of: tuple[Event, ...]) -> list[ObservationRow]:
    return [event.row for event in of if isinstance(event, ObservationsReceived)]


def block_of(of: list[ObservationRow]) -> ObservationBlock:
    names = SITE.receiver_names
    epochs = [of[k : k + len(names)] for k in range(0, len(of), len(names))]
    layout = layout_of(of, codes=pair_codes_of(MONITORED_SYSTEMS))
    return build_block(names, [epoch[0].receive_time_ns for epoch in epochs], epochs, layout)


def beyond_m(block: ObservationBlock) -> Floats:
    """Residuals (E, R, S) at the points by the broadcast models, less the mean of each receiver."""
    sets = constellation(SEED, START_NS, START_NS + SECONDS * 10**9)
    store = EphemerisStore(sets)
    index = store.choose(block.satellites, block.epoch_ns, np.full(len(block.epoch_ns), len(store)))
    states = satellite_states(store.ephemerides, index, state_time_ns(block.epoch_ns), block.signals)
    residual_m = prefit(block, states, points_at(TRIANGLE.pos_ecef_m), IONOSPHERE).residual_m
    left_m: Floats = residual_m - np.nanmean(residual_m, axis=-1, keepdims=True)
    return left_m


def test_the_first_frequency_is_as_it_is_alone() -> None:
    first = [with_signals(row, lambda s: not is_in_lower_band(s)) for row in rows(events())]
    assert all(
        getattr(a, name).tobytes() == getattr(b, name).tobytes()
        for a, b in zip(first, rows(events(frequencies=1)), strict=True)
        for name in ROW_ARRAYS
    )


def test_each_satellite_has_both_signals() -> None:
    for row in rows(events()):
        assert [s[0] + s[4:] for s in row.signals] == [f"{s[0]}{code}" for s in row.signals[::2] for code in CODES[s[0]]]


CODES = {"G": ("1C", "2L"), "E": ("1C", "7Q")}


def test_without_errors_all_signals_and_the_pairs_are_the_broadcast_models() -> None:
    """Group delays, ionosphere by frequency; ranges are rounded to 1 mm, and pairs add up 4.1 of it."""
    block = block_of(rows(events(SILENT)))
    assert np.nanmax(np.abs(beyond_m(block))) < 0.002
    assert np.nanmax(np.abs(beyond_m(ionosphere_free(block)))) < 0.006


@pytest.mark.parametrize("errors", [replace(SILENT, noise_m=0.5), replace(SILENT, multipath_m=0.5)], ids=["noise", "multipath"])
def test_noise_and_multipath_of_the_two_are_alike_and_independent(errors: ErrorModel) -> None:
    left_m = beyond_m(block_of(rows(events(errors))))
    first, second = left_m[..., 0::2].ravel(), left_m[..., 1::2].ravel()
    assert second.std() == pytest.approx(first.std(), rel=0.3)
    assert abs(np.corrcoef(first, second)[0, 1]) < 0.2


def test_errors_of_satellites_are_the_same_on_both() -> None:
    left_m = beyond_m(block_of(rows(events(replace(SILENT, satellite_m=5.0)))))
    assert np.abs(left_m[..., 0::2] - left_m[..., 1::2]).max() < 0.005


def test_the_error_of_the_ionosphere_is_in_neither_pair() -> None:
    block = block_of(rows(events(replace(SILENT, ionosphere=3.0))))
    assert np.abs(beyond_m(block)).max() > 5.0
    assert np.abs(beyond_m(ionosphere_free(block))).max() < 0.006


def test_carriers_and_doppler_are_those_of_the_frequency() -> None:
    """Cycles of both, as metres, grow alike but for the ionosphere."""
    block = block_of(rows(events(SILENT)))
    wavelength_m = np.array([299_792_458.0 / HZ[s[0] + s[4:]] for s in block.signals])
    rate_mps = -block.doppler_hz * wavelength_m
    assert np.nanmax(np.abs(rate_mps[..., 0::2] - rate_mps[..., 1::2])) < 0.01


HZ = {"G1C": 1575.42e6, "G2L": 1227.60e6, "E1C": 1575.42e6, "E7Q": 1207.14e6}  # IS-GPS-200, 3.3.1.1; Galileo OS SIS ICD, table 2


@pytest.mark.parametrize("protocol", ["ubx", "rtcm3"])
def test_both_frequencies_arrive_as_bytes(protocol: str) -> None:
    antennas = antennas_of(SITE)
    sent = as_bytes(events(), antennas) if protocol == "ubx" else as_rtcm(events(), antennas)
    site: SiteConfig = replace(SITE, receivers=tuple(replace(r, protocol=protocol) for r in SITE.receivers))  # type: ignore[arg-type]
    reception = Reception(site.receiver_names, protocols=site.protocols)
    taken = (heard for event in sent if isinstance(event, RawBytes) for heard in reception.take(event))
    received = [heard.row for heard in taken if isinstance(heard, ObservationsReceived)]
    assert [set(row.signals) for row in received] == [set(row.signals) for row in rows(events())]
