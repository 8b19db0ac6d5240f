"""From blocks to what carriers show of satellites: faults, ephemerides and ionosphere that change, cuts, going on from a message."""

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.carrier_thresholds import CARRIER_CHECKS, carrier_thresholds
from integrity.carrier_watch import CarrierMemory
from integrity.errors import DecodeError
from integrity.events import EphemerisReceived, Event, IonosphereReceived
from integrity.gnss.carrier.slips import CarrierMemory as SlipMemory
from integrity.gnss.carrier.slips import Slip, SlipLimits, find_slips
from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import ObservationBlock, ObservationRow
from integrity.gnss.signals import L1_HZ
from integrity.messages import wayside_pb2 as pb
from integrity.messages.carriers import decode_carriers, encode_carriers
from integrity.monitors.carrier_residuals import TrackingMemory, continuing
from integrity.sight import Sight
from integrity.thresholds import Promises
from integrity.triangle import reference_triangle
from tests.unit.pairs import PAIRS_SITE, everything
from tests.unit.streams import SITE, START_NS, a_site, epoch_of, rows_changed, stream
from tests.unit.watched_carriers import Shown, design_of, sights_of, watched

SECONDS = 70
BEGIN = 64  # of faults
H = design_of(SITE).motion.half_epochs
WAVELENGTH_M = SPEED_OF_LIGHT_MPS / L1_HZ
Change = Callable[[ObservationRow], ObservationRow]


@cache
def shown() -> Shown:
    return watched(SITE, sights_of(SITE, stream(SECONDS)))


@cache
def faulty_satellite() -> str:
    """One that all receivers measure throughout, with two more of its constellation at least."""
    return next(name for name, of in shown().signals["ramp"].items() if name[0] == "G" and np.isfinite(of[BEGIN:]).all()).partition(".")[0]


def moves(satellite: str, code_m: Callable[[int], float], carrier_m: Callable[[int], float], receivers: str = "ABC") -> Change:
    """Code and first carrier of a satellite off by so much, by seconds since the beginning."""

    def change(row: ObservationRow) -> ObservationRow:
        if row.receiver not in receivers or f"{satellite}.1C" not in row.signals:
            return row
        column, e = row.signals.index(f"{satellite}.1C"), epoch_of(row)
        pseudorange_m, carrier_cycles = np.array(row.pseudorange_m), np.array(row.carrier_cycles)
        pseudorange_m[column] += code_m(e)
        carrier_cycles[column] += carrier_m(e) / WAVELENGTH_M
        return replace(row, pseudorange_m=pseudorange_m, carrier_cycles=carrier_cycles)

    return change


def step(size_m: float) -> Callable[[int], float]:
    return lambda e: size_m * (e >= BEGIN)


def test_without_a_fault_all_is_quiet() -> None:
    assert max(shown().worst(check) for check in CARRIER_CHECKS if check != "divergence") < 5.0
    assert {check for check in CARRIER_CHECKS if all(np.isnan(of).all() for of in shown().signals[check].values())} == {"divergence"}


FAULTS = [
    ("step", step(0.3), step(0.3)),
    ("innovation", step(12.0), step(0.0)),
    ("acceleration", lambda e: 0.01 * max(0, e - 30) ** 2, lambda e: 0.01 * max(0, e - 30) ** 2),
    ("ramp", lambda e: 0.08 * max(0, e - 30), lambda e: 0.08 * max(0, e - 30)),
]


@pytest.mark.parametrize(("check", "code_m", "carrier_m"), FAULTS, ids=[check for check, *_ in FAULTS])
def test_a_fault_is_shown_by_its_check_and_of_its_satellite_alone(
    check: str, code_m: Callable[[int], float], carrier_m: Callable[[int], float]
) -> None:
    satellite = faulty_satellite()
    found = watched(SITE, sights_of(SITE, rows_changed(stream(SECONDS), moves(satellite, code_m, carrier_m))))
    mine = found.signals[check][f"{satellite}.1C"]
    assert np.nanmax(mine[BEGIN:]) > design_of(SITE).thresholds[check]
    assert np.nan_to_num(mine[:30]).max() < 5.0
    assert max(found.worst(name, but=satellite, since=BEGIN) for name in CARRIER_CHECKS if name != "divergence") < 5.0


def test_a_step_at_two_receivers_is_not_the_satellites() -> None:
    change = moves(faulty_satellite(), step(0.3), step(0.3), "AB")
    assert watched(SITE, sights_of(SITE, rows_changed(stream(SECONDS), change))).worst("step") < 5.0


def test_pairs_are_watched_likewise() -> None:
    """Of a step in code and carrier of the first frequency alone a pair has 2.5 times as much."""
    found = watched(PAIRS_SITE, sights_of(PAIRS_SITE, everything()))
    satellite = next(name for name, of in found.signals["step"].items() if name[0] == "G" and np.isfinite(of[1:]).all())[:3]
    changed = rows_changed(everything(), moves(satellite, lambda e: 0.5 * (e >= 15), lambda e: 0.5 * (e >= 15)))
    faulty = watched(PAIRS_SITE, sights_of(PAIRS_SITE, changed))
    assert max(found.worst(check) for check in ("step", "innovation")) < 5.0
    assert np.flatnonzero(
        np.nan_to_num(next(of for s, of in faulty.signals["step"].items() if s.startswith(satellite))) > 6.7
    ).tolist() == [15]


def with_another_set(at_s: int, later_m: float) -> tuple[Event, ...]:
    """From a time on another set serves the satellite, by which its clock is off: expected ranges change by so much."""
    satellite, events = faulty_satellite(), list(stream(SECONDS))
    old = next(e.ephemeris for e in events if isinstance(e, EphemerisReceived) and e.ephemeris.satellite == satellite)
    assert isinstance(old, KeplerEphemeris)
    new = replace(old, issue=old.issue + 1, transmission_ns=old.transmission_ns + 1, af0=old.af0 + later_m / SPEED_OF_LIGHT_MPS)
    first = next(i for i, e in enumerate(events) if hasattr(e, "row") and epoch_of(e.row) == at_s)
    return (*events[:first], EphemerisReceived(events[first].mono_ns, new), *events[first:])


@pytest.mark.parametrize("cuts", [(), (50,), tuple(range(SECONDS))], ids=["in a block", "between blocks", "epoch by epoch"])
def test_another_set_is_no_motion(cuts: Sequence[int]) -> None:
    """By 30 m, which would be a step of a thousand sigmas. By its clock the satellite sent 100 ns later: it has moved by 0.1 mm at most."""
    found = watched(SITE, sights_of(SITE, with_another_set(50, 30.0), cuts))
    for check in ("step", "ramp", "acceleration"):
        for signal, of in shown().signals[check].items():
            np.testing.assert_allclose(found.signals[check][signal], of, atol=0.01)


def test_the_same_set_sent_again_changes_no_bit() -> None:
    found = watched(SITE, sights_of(SITE, with_another_set(50, 0.0)))
    for check in CARRIER_CHECKS:
        for signal, of in shown().signals[check].items():
            np.testing.assert_allclose(found.signals[check][signal], of, atol=1e-6)


def test_other_terms_of_the_ionosphere_are_no_motion() -> None:
    events = list(stream(SECONDS))
    told = next(e for e in events if isinstance(e, IonosphereReceived))
    other = replace(told, klobuchar=replace(told.klobuchar, alpha=(2e-8, 1e-8, -1e-7, 1e-7)))
    middle = next(i for i, e in enumerate(events) if hasattr(e, "row") and epoch_of(e.row) == 50)
    found = watched(SITE, sights_of(SITE, (*events[:middle], replace(other, mono_ns=events[middle].mono_ns), *events[middle:])))
    for check in CARRIER_CHECKS:
        for signal, of in shown().signals[check].items():
            np.testing.assert_allclose(found.signals[check][signal], of, atol=0.01)


def bits(of: Shown) -> dict[tuple[str, str], bytes]:
    return {(check, name): array.tobytes() for check, by in of.signals.items() for name, array in by.items()}


@given(st.lists(st.integers(1, SECONDS - 1), unique=True, max_size=6))
@settings(max_examples=12, deadline=None)
def test_cutting_changes_no_bit(cuts: list[int]) -> None:
    events = with_another_set(50, 30.0)
    assert bits(watched(SITE, sights_of(SITE, events, cuts))) == bits(watched(SITE, sights_of(SITE, events)))


def some_in_view(sight: Sight) -> Sight:
    """Every second signal is out of view, one more until `BEGIN`."""
    in_view = np.array(sight.sky.in_view)
    in_view[:, ::2] = False
    in_view[sight.block.epoch_ns < START_NS + BEGIN * NS_PER_S, 1] = False
    return replace(sight, sky=replace(sight.sky, in_view=in_view))


@pytest.mark.parametrize("cuts", [(10, 30), tuple(range(SECONDS))], ids=["in blocks", "epoch by epoch"])
def test_what_is_out_of_view_is_left_out_and_changes_no_bit(cuts: Sequence[int]) -> None:
    """Of a block only signals in view are computed, of an epoch all."""
    events = with_another_set(50, 30.0)
    whole, cut = (watched(SITE, [some_in_view(sight) for sight in sights_of(SITE, events, at)]) for at in ((), cuts))
    assert bits(cut) == bits(whole)


def test_a_signal_that_comes_into_view_is_watched_from_its_second_epoch_on() -> None:
    of = watched(SITE, [some_in_view(sight) for sight in sights_of(SITE, stream(SECONDS), [BEGIN])])
    name = sights_of(SITE, stream(SECONDS))[0].block.signals[1]
    assert np.flatnonzero(np.isfinite(of.signals["step"][name])).tolist() == list(range(BEGIN + 1, SECONDS))


@pytest.mark.parametrize("cut", [1, 20, 50, 65])
def test_from_a_message_it_goes_on_to_the_bit(cut: int) -> None:
    """At 50 another set begins to serve: the memory knows which one served before."""
    sights = sights_of(SITE, with_another_set(50, 30.0), [cut])
    begun = watched(SITE, sights[:1])
    message = pb.CarrierMemory.FromString(encode_carriers(begun.memory).SerializeToString())
    decoded = decode_carriers(message, 3, H, int(sights[0].block.epoch_ns[-1]))
    assert bits(watched(SITE, sights[1:], decoded)) == bits(watched(SITE, sights[1:], begun.memory))


def test_nothing_remembered_comes_back_as_nothing() -> None:
    empty = CarrierMemory.empty(3, H)
    again = decode_carriers(encode_carriers(empty), 3, H, None)
    for part in ("tracking", "motion", "divergence"):
        for field in fields(getattr(empty, part)):
            np.testing.assert_array_equal(getattr(getattr(again, part), field.name), getattr(getattr(empty, part), field.name))


@cache
def encoded() -> pb.CarrierMemory:
    return encode_carriers(shown().memory)


ARRAYS = [field.name for field in pb.CarrierMemory.DESCRIPTOR.fields if field.name != "serving"]
SPOILT: dict[str, Any] = {
    "signal": "G99.1C",
    "served_by": 99,
    "receive_time_ns": -1,
    "lock_s": 1e300,
    "epoch_ns": 2**62,
    "residual_m": -1e300,
    "half_m": 1e300,
    "motion_age": H + 1,
    "code_minus_carrier_m": float("inf"),
    "innovation_m": float("nan"),
    "rate_mps": float("nan"),
    "age": -1,
    "since_ns": 2**62,
}


@pytest.mark.parametrize("name", ARRAYS)
def test_arrays_of_other_lengths_are_refused(name: str) -> None:
    message = pb.CarrierMemory()
    message.CopyFrom(encoded())
    del getattr(message, name)[0]
    with pytest.raises(DecodeError):
        decode_carriers(message, 3, H, START_NS + SECONDS * NS_PER_S)


@pytest.mark.parametrize("name", SPOILT)
def test_what_cannot_have_been_remembered_is_refused(name: str) -> None:
    message = pb.CarrierMemory()
    message.CopyFrom(encoded())
    getattr(message, name)[0] = SPOILT[name]
    with pytest.raises(DecodeError):
        decode_carriers(message, 3, H, START_NS + SECONDS * NS_PER_S)


def random_block(seed: int) -> ObservationBlock:
    """Two signals at two receivers for thirty epochs; flags, lock times and half cycles at random, phases without a slip."""
    rng = np.random.default_rng(seed)
    shape = (30, 2, 2)
    epoch_ns = START_NS + NS_PER_S * np.cumsum(rng.choice([1, 1, 2], 30))
    phase = np.where(rng.random(shape) < 0.1, np.nan, 0.0)
    return ObservationBlock(
        ("A", "B"),
        ("G01.1C", "G02.1C"),
        ("G01", "G02"),
        epoch_ns,
        np.stack((epoch_ns, epoch_ns + 1000), axis=1),
        2e7 + phase,
        phase,
        0.0 * phase,
        45.0 + phase,
        rng.choice([np.nan, 0.4, 0.6, 1.0, 2.0, 5.0], shape),
        rng.random(shape) < 0.1,
        rng.random(shape) < 0.1,
    )


@pytest.mark.parametrize("lock_share", [0.5, 1.0])
@pytest.mark.parametrize("seed", range(5))
def test_what_receivers_say_is_what_slip_detection_takes_from_them(seed: int, lock_share: float) -> None:
    """Of signals measured in an epoch and in the one before."""
    block = random_block(seed)
    limits = SlipLimits(60 * NS_PER_S, lock_share, 5.0, 0.005, 0.004, 0.05, 0.1)
    arcs, _ = find_slips(block, np.full((30, 2), WAVELENGTH_M), SlipMemory.empty(2), limits)
    told = (arcs.slip & int(Slip.FLAGGED | Slip.LOCK | Slip.HALF_CYCLE)) == 0
    _, continues = continuing(TrackingMemory.empty(2), block, lock_share)
    both = arcs.measured[1:] & arcs.measured[:-1]
    assert both.sum() > 60
    np.testing.assert_array_equal(continues[1:][both], told[1:][both])


@pytest.mark.parametrize("interval_s", [0.1, 1.0, 30.0])
def test_false_exclusions_are_shared_out(interval_s: float) -> None:
    """The step has no memory: its looks times its probability are its share of the promise, of one family among three checks."""
    site = a_site(interval_s)
    of = Promises(site, reference_triangle(site))
    thresholds = {threshold.name: threshold for threshold in carrier_thresholds(of)}
    assert thresholds["step"].false_alarm_probability * of.looks_per_year * of.satellites * 3 == pytest.approx(of.exclusions, rel=1e-6)
