"""A train whose ground vouches for pairs of frequencies: it makes them of what its own antennas measure, and uses nothing else."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from integrity.events import Event, ObservationsReceived, RawBytes, Tick
from integrity.gnss.signals import is_pair
from integrity.messages import wayside_pb2 as pb
from recordings.simulate.errors import ErrorModel
from recordings.simulate.observations import observed
from recordings.simulate.receiver import as_bytes
from tests.unit.pairs import without_second
from tests.unit.train.ride import (
    KEY,
    MAP,
    SITE,
    START_NS,
    STEP_NS,
    Say,
    a_run,
    a_train,
    errors_m,
    events,
    nothing_special,
    positions,
    ride,
    valid,
)
from train_client.localisation.localiser import TrainLocaliser
from train_client.outputs import PositionReport, Status
from train_client.simulate.motion import antennas_on
from train_client.simulate.story import TRAIN_ERRORS

EPOCHS = 40
STORM = replace(TRAIN_ERRORS, ionosphere=3.0)
PAIRS = tuple(f"{system}{n:02d}.1C+{code}" for system, code in (("G", "2L"), ("E", "7Q")) for n in range(1, 37))


@cache
def heard(errors: ErrorModel = TRAIN_ERRORS, one_frequency: str = "") -> tuple[Event, ...]:
    """Bytes of antennas, some of which measure one frequency only."""
    antennas = antennas_on(a_run(), a_train().antennas)
    rows = observed(antennas, START_NS, EPOCHS / 5.0, 5.0, 7, errors, 2)
    lacking = [a.receiver for a in antennas if a.receiver == one_frequency]
    told = [without_second([e], "".join(lacking))[0] if _of(e, lacking) else e for e in rows]
    return tuple(event for event in as_bytes(told, antennas) if isinstance(event, RawBytes | Tick))


def _of(event: Event, receivers: Sequence[str]) -> bool:
    return isinstance(event, ObservationsReceived) and event.row.receiver in receivers


def vouching(signals: Sequence[str], from_epoch: int = 0) -> Say:
    def say(number: int, plain: pb.Health) -> pb.Health:
        if number >= from_epoch:
            del plain.monitored[:]
            plain.monitored.extend(signals)
        return plain

    return say


def used(reports: Sequence[PositionReport]) -> set[str]:
    return {s for r in reports if r.fix for s in r.fix.used}


def rms_m(reports: Sequence[PositionReport]) -> float:
    return float(np.sqrt(np.mean(np.square(errors_m(reports, a_run())))))


def test_every_epoch_is_valid_from_the_third_normal_message_on() -> None:
    assert len(valid(ride(events(heard(), vouching(PAIRS))))) == EPOCHS - 2


def test_only_pairs_are_used_in_what_is_valid() -> None:
    found = used(valid(ride(events(heard(), vouching(PAIRS)))))
    assert len(found) >= 10 and found <= set(PAIRS)


def test_the_front_end_is_where_it_was() -> None:
    """Ranges have 0.3 m of white noise: 0.9 m free of ionosphere, and 0.55 m of the satellite."""
    assert rms_m(valid(ride(events(heard(), vouching(PAIRS))))) <= 1.0


def test_an_ionosphere_that_no_model_has_moves_nothing() -> None:
    calm, storm = (errors_m(valid(ride(events(heard(e), vouching(PAIRS)))), a_run()) for e in (TRAIN_ERRORS, STORM))
    assert np.abs(np.subtract(calm, storm)).max() < 0.02


def test_the_same_ionosphere_leaves_a_train_on_one_frequency_without_a_place() -> None:
    assert {r.status for r in positions(ride(events(heard(STORM), nothing_special)))} == {Status.UNKNOWN}


def test_only_the_pairs_that_the_ground_vouches_for_are_used() -> None:
    of_gps = [pair for pair in PAIRS if pair[0] == "G"]
    found = used(valid(ride(events(heard(), vouching(of_gps)))))
    assert found and found <= set(of_gps)


def test_a_pair_of_other_codes_than_the_antennas_measure_is_not_used() -> None:
    """The ground has watched 2W, not 2L: who measures 2L would not see its faults."""
    others = [pair.replace("2L", "2W") for pair in PAIRS]
    assert {s[0] for s in used(valid(ride(events(heard(), vouching(others)))))} == {"E"}


def test_signals_that_stand_alone_are_not_used_beside_pairs() -> None:
    alone = [f"E{n:02d}.1C" for n in range(1, 37)]
    mixed = [*(pair for pair in PAIRS if pair[0] == "G"), *alone]
    found = used(valid(ride(events(heard(), vouching(mixed)))))
    assert found and all(map(is_pair, found))


def test_a_ground_that_vouches_for_single_signals_is_believed_as_ever() -> None:
    found = used(valid(ride(events(heard(), nothing_special))))
    assert found and not any(map(is_pair, found))


def test_pairs_from_some_message_on_are_used_from_there_on() -> None:
    late = {
        (r.fix.gps_time_ns - START_NS) // STEP_NS
        for r in valid(ride(events(heard(), vouching(PAIRS, 20))))
        if r.fix and all(map(is_pair, r.fix.used))
    }
    assert late == set(range(20, EPOCHS))


# ---- antennas with one frequency


def test_an_antenna_with_one_frequency_has_no_place() -> None:
    assert not valid(ride(events(heard(one_frequency="rear"), vouching(PAIRS))))


def test_an_antenna_with_one_frequency_says_why() -> None:
    said = positions(ride(events(heard(one_frequency="rear"), vouching(PAIRS))))[-1]
    assert said.status is Status.UNKNOWN
    assert said.reasons == ("rear: too few satellites with the pairs of frequencies that the ground vouches for",)


def test_all_antennas_with_one_frequency_have_no_place() -> None:
    sent = tuple(e for e in _one_frequency())
    assert not valid(ride(events(sent, vouching(PAIRS))))


@cache
def _one_frequency() -> tuple[Event, ...]:
    antennas = antennas_on(a_run(), a_train().antennas)
    told = as_bytes(observed(antennas, START_NS, EPOCHS / 5.0, 5.0, 7, TRAIN_ERRORS), antennas)
    return tuple(event for event in told if isinstance(event, RawBytes | Tick))


# ---- sigmas, and what is computed ahead


def test_sigmas_of_pairs_are_those_of_the_train_file() -> None:
    """Twice the sigmas of all ranges give twice the sigma of the place."""
    train = a_train()
    wide = replace(train, sigma_range_pair_m=2.0 * train.sigma_range_pair_m, sigma_range_pair_low_m=2.0 * train.sigma_range_pair_low_m)
    one, two = (valid(ride(events(heard(), vouching(PAIRS)), t))[-1].fix for t in (train, wide))
    assert one and two and one.sigma_m and two.sigma_m == pytest.approx(2.0 * one.sigma_m, rel=1e-6)


def test_what_is_computed_ahead_changes_no_bit() -> None:
    localiser = TrainLocaliser(a_train(), MAP, {SITE: [KEY.public]})
    ahead = []
    for event in events(heard(), vouching(PAIRS)):
        ahead += localiser.feed([event])
        localiser.look_ahead()
    assert [r.fix for r in positions(ahead)] == [r.fix for r in positions(ride(events(heard(), vouching(PAIRS))))]
