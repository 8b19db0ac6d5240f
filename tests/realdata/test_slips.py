"""Slips put into real phases at 1 Hz: how many are found, and what is marked where nothing was put in.

Two stations of different make and age; wherever a second frequency of the satellite was measured, before and after.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from integrity.gnss.carrier.slips import Arcs, CarrierMemory, Slip, SlipLimits, find_slips
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats, ObservationBlock
from integrity.gnss.velocity import wavelengths_m
from recordings.rinex.observation import read_blocks

# Two-sided 5 sigma: 6e-7 of good pairs. 5 mm covers a phase at 10 deg; 4 mm/s of L1 delay is a disturbed ionosphere at mid latitudes.
LIMITS = SlipLimits(
    longest_gap_ns=10 * NS_PER_S,
    lock_share=1.0,
    normal_quantile=5.0,
    carrier_sigma_m=0.005,
    ionosphere_mps=0.004,
    doppler_sigma_mps=0.05,
    jerk_mps3=0.1,
)
FILES = ("nagoya_static/base.obs.gz", "nagoya_static/rover.obs.gz", "catalonia_2010/UPC10770.11o.gz")


class Piece(NamedTuple):
    block: ObservationBlock
    wavelength_m: Floats
    memory: CarrierMemory  # before it
    arcs: Arcs
    second: Bools  # (E, R, S): a signal of another frequency of the satellite continues as well


def pieces_of(path: Path) -> Iterator[Piece]:
    header, blocks, _ = read_blocks(path, "A")
    memory = CarrierMemory.empty(1)
    for block in blocks:
        channel = np.array([header.glonass_channels.get(s, 0) for s in block.satellites])
        wavelength_m = wavelengths_m(block.signals, np.broadcast_to(channel, (len(block.epoch_ns), len(channel))))
        arcs, after = find_slips(block, wavelength_m, memory, LIMITS)
        names = np.array(block.satellites)
        other = (names[:, None] == names) & (np.abs(wavelength_m[0][:, None] - wavelength_m[0]) > 1e-6)
        second = arcs.continues & ((arcs.continues[..., None, :] & other).any(axis=-1))
        yield Piece(block, wavelength_m, memory, arcs, second)
        memory = after


@pytest.fixture(scope="module", params=FILES)
def pieces(shared_data: Path, request: pytest.FixtureRequest) -> list[Piece]:
    return list(pieces_of(shared_data / request.param))


@pytest.mark.parametrize("cycles", [1, 2, 5])
def test_with_two_frequencies_every_slip_is_found(pieces: list[Piece], cycles: int) -> None:
    rng = np.random.default_rng(1)
    put, found = 0, 0
    for piece in pieces:
        here = piece.second & (rng.random(piece.second.shape) < 0.003)
        carrier = piece.block.carrier_cycles + np.cumsum(np.where(here, cycles, 0), axis=0)
        arcs, _ = find_slips(replace(piece.block, carrier_cycles=carrier), piece.wavelength_m, piece.memory, LIMITS)
        put, found = put + here.sum(), found + (arcs.slip[here] != Slip.NONE).sum()
    assert put > 100
    assert found == put


def test_hardly_anything_is_marked_that_the_receiver_does_not_mark(pieces: list[Piece]) -> None:
    """At most one look in ten thousand: some of them are slips."""
    by_us = sum(int(((p.arcs.slip & (Slip.GEOMETRY_FREE | Slip.DOPPLER)) > 0).sum()) for p in pieces)
    looks = sum(int(p.arcs.measured.sum()) for p in pieces)
    assert by_us <= 1e-4 * looks


def test_with_doppler_alone_two_cycles_are_found(shared_data: Path) -> None:
    """The first frequency only; at 1 Hz a single cycle, 0.19 m, is less than what Doppler is trusted to."""
    rng = np.random.default_rng(1)
    for piece in pieces_of(shared_data / FILES[0]):
        names = piece.block.satellites
        first = np.array([k == 0 or names[k] != names[k - 1] for k in range(len(names))])
        alone = np.where(first, piece.block.carrier_cycles, np.nan)
        before = replace(piece.block, carrier_cycles=alone)
        here = find_slips(before, piece.wavelength_m, CarrierMemory.empty(1), LIMITS)[0].continues & (rng.random(alone.shape) < 0.01)
        slipped = replace(before, carrier_cycles=alone + np.cumsum(np.where(here, 2, 0), axis=0))
        arcs, _ = find_slips(slipped, piece.wavelength_m, CarrierMemory.empty(1), LIMITS)
        assert (arcs.slip[here] == Slip.DOPPLER).all()
