"""Every target over a few thousand damaged frames; `python -m tests.fuzz` does the millions."""

import importlib
from random import Random

import pytest

from tests.fuzz.target import Piece, Target, batch, run

# Frames to damage, and what must have been told for the damage to have been seen by the decoders, not by a checksum alone.
TARGETS = {
    "ubx": (1500, {"rawx", "raw", "words", "status"}),
    "rtcm": (300, {"ObservationRow", "KeplerEphemeris", "GlonassEphemeris", "AntennaPosition", "refused"}),
    "words": (2500, {"LNAV", "INAV", "FNAV", "D1", "GlonassEphemeris", "Klobuchar"}),
    "sbas": (500, {"Fast", "Mixed", "IonoDelays", "GeoEphemeris", "levels", "refused frames"}),
    "rinex": (300, {"rows", "problems"}),
    "rinexnav": (600, {"sets", "problems"}),
    "hatanaka": (60, {"rows", "problems"}),
    "reception": (40, {"NORMAL", "NOT_CONFIRMABLE", "bad_frames"}),
    "health": (
        10_000,
        {"trust NORMAL", "position VALID", "unreadable", "wrong signature", "older", "CONTRADICTION", "answer right", "snapshots"},
    ),
}


def target_of(name: str) -> Target:
    found: Target = importlib.import_module(f"tests.fuzz.{name}").TARGET
    return found


@pytest.mark.parametrize("name", TARGETS)
def test_damaged_frames_are_refused_or_give_what_can_be(name: str) -> None:
    frames, expected = TARGETS[name]
    outcome = run(target_of(name), frames, seed=20)
    assert [f"{finding.error} at {finding.place}, seed {finding.seed}" for finding, _ in outcome.findings.values()] == []
    assert expected <= {what for what, n in outcome.told.items() if n}


@pytest.mark.parametrize("name", sorted(set(TARGETS) - {"words", "reception", "rinex", "rinexnav", "hatanaka"}))
def test_an_untouched_frame_that_is_lost_is_noticed(name: str) -> None:
    # Damage that nobody confesses to looks like a reader that loses frames.
    pieces = [piece for piece in batch(target_of(name), Random(1)) if piece.untouched]
    pieces[3] = Piece(pieces[3].data[:-1] + bytes((pieces[3].data[-1] ^ 0xFF,)), untouched=True)
    with pytest.raises(AssertionError):
        target_of(name).examine(pieces, Random(1))
