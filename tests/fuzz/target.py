"""What is fuzzed: how its sound frames are made, how one is damaged, and what must hold of any sequence of both.

A batch is a sequence of pieces. `examine` fails by whatever escapes from the code under test, or by an assertion of its own; else it counts
what was told, so that one can see that damage reached the decoders and did not end at a checksum.
"""

import traceback
from collections import Counter
from collections.abc import Callable, Sequence
from random import Random
from typing import NamedTuple

import psutil

from tests.fuzz.mutations import in_other_order

SHARES_TOUCHED = (0.1, 0.6, 0.9)  # of the frames of a batch
MOST_TRIALS = 100  # of a reduction


class Piece(NamedTuple):
    """Bytes of a batch, and whether they are a sound frame that nobody touched."""

    data: bytes
    untouched: bool


class Target(NamedTuple):
    """`split` takes any bytes apart about where frames begin; joined again they are the same. `any_order`: frames need no order."""

    sound: Callable[[Random], list[bytes]]
    touch: Callable[[Random, bytes], bytes]
    split: Callable[[bytes], list[bytes]]
    examine: Callable[[Sequence[Piece], Random], Counter[str]]
    any_order: bool = True


class Finding(NamedTuple):
    """An error, the place in the code where it arose, and the fewest pieces that still give it, with the seed of the batch."""

    error: str
    place: str
    seed: str
    pieces: tuple[Piece, ...]


class Outcome(NamedTuple):
    """Of many batches: frames that were touched and that were not, what was told, findings by error and place, with their number.

    `resident_mb`: memory of this process after the first batch, in the middle and at the end.
    """

    touched: int
    untouched: int
    told: Counter[str]
    findings: dict[tuple[str, str], tuple[Finding, int]]
    resident_mb: tuple[float, ...]


def batch(target: Target, rng: Random) -> list[Piece]:
    """Sound frames, few or most of them touched, some of them repeated or in another order."""
    share, pieces = rng.choice(SHARES_TOUCHED), []
    for frame in target.sound(rng):
        data = target.touch(rng, frame) if rng.random() < share else frame
        pieces.append(Piece(data, data == frame))
    return in_other_order(rng, pieces) if target.any_order else pieces


def run(target: Target, frames: int, seed: int) -> Outcome:
    """Batches until so many frames have been touched."""
    told: Counter[str] = Counter()
    findings: dict[tuple[str, str], tuple[Finding, int]] = {}
    touched = untouched = number = 0
    resident_mb: list[float] = []
    while touched < frames:
        name = f"{seed}.{number}"
        pieces = batch(target, Random(name))
        found = finding_of(target, pieces, name, told)
        if found is not None:
            kind = found.error.partition("\n")[0][:60], found.place
            first, n = findings.get(kind) or (reduced(target, found), 0)
            findings[kind] = first, n + 1
        n_untouched = sum(piece.untouched for piece in pieces)
        touched, untouched, number = touched + len(pieces) - n_untouched, untouched + n_untouched, number + 1
        while touched >= len(resident_mb) * frames / 2 and len(resident_mb) < 3:
            resident_mb.append(psutil.Process().memory_info().rss / 1e6)
    return Outcome(touched, untouched, told, findings, tuple(resident_mb))


def finding_of(target: Target, pieces: Sequence[Piece], seed: str, told: Counter[str]) -> Finding | None:
    """What is wrong with a batch, or None."""
    try:
        told.update(target.examine(pieces, Random(f"examine {seed}")))
    except Exception as error:  # whatever it is, it should not have escaped
        frames = [frame for frame in traceback.extract_tb(error.__traceback__) if "site-packages" not in frame.filename]
        place = f"{'/'.join(frames[-1].filename.split('/')[-3:])}:{frames[-1].lineno}"
        return Finding(f"{type(error).__name__}: {error}", place, seed, tuple(pieces))
    return None


def reduced(target: Target, finding: Finding) -> Finding:
    """The same finding with as few pieces as leaving out halves, quarters, ... gives."""
    size, trials = max(1, len(finding.pieces) // 2), 0
    while trials < MOST_TRIALS:
        begin = 0
        while begin < len(finding.pieces) and trials < MOST_TRIALS:
            fewer = finding.pieces[:begin] + finding.pieces[begin + size :]
            again = finding_of(target, fewer, finding.seed, Counter())
            trials += 1
            if again is not None and again.place == finding.place:
                finding = again
            else:
                begin += size
        if size == 1:
            break
        size = max(1, size // 2)
    return finding
