"""Fuzzing guided by coverage, by atheris (libFuzzer for Python), where it is installed: any bytes, and frames damaged as elsewhere here."""

import importlib
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from random import Random

from tests.fuzz.target import Piece, Target

INSTRUMENTED = ("integrity", "recordings.rinex", "recordings.sbas_files")
SEEDS, FRAMES_OF_A_SEED, LONGEST_BYTES = 60, 12, 8192


def guided(name: str, seconds: int, seed: int) -> int:
    """Run for so long. libFuzzer ends the process: what it finds it writes to a file, and gives a status of its own; 2: not installed."""
    try:
        atheris = importlib.import_module("atheris")
    except ImportError as error:
        print(f"atheris cannot be imported ({error}): install it with `pip install atheris`, or leave --atheris out", file=sys.stderr)
        return 2
    with atheris.instrument_imports(include=list(INSTRUMENTED)):
        target: Target = importlib.import_module(f"tests.fuzz.{name}").TARGET

    def one_input(data: bytes) -> None:
        target.examine([Piece(part, False) for part in target.split(data)], Random(0))

    def mutated(data: bytes, max_size: int, of_seed: int) -> bytes:
        return of_frames(target, data, max_size, of_seed, atheris.Mutate)

    with tempfile.TemporaryDirectory() as directory:
        write_seeds(target, Path(directory), seed)
        limits = [f"-max_total_time={seconds}", f"-max_len={LONGEST_BYTES}", f"-seed={seed + 1}", "-timeout=60", "-rss_limit_mb=4096"]
        atheris.Setup([f"tests.fuzz {name}", *limits, "-print_final_stats=1", directory], one_input, custom_mutator=mutated)
        atheris.Fuzz()
    return 0


def of_frames(target: Target, data: bytes, max_size: int, seed: int, by_bytes: Callable[[bytes, int], bytes]) -> bytes:
    """An input changed by libFuzzer, or one of its frames damaged, or with a sound frame more."""
    rng = Random(seed)
    if rng.random() < 0.4:
        return by_bytes(data, max_size)
    parts = target.split(data)
    k = rng.randrange(len(parts)) if parts else 0
    if not parts or rng.random() < 0.2:
        parts.insert(k, rng.choice(target.sound(rng)))
    else:
        parts[k] = target.touch(rng, parts[k])
    return b"".join(parts)[:max_size]


def write_seeds(target: Target, directory: Path, seed: int) -> None:
    """Short runs of sound frames to begin with."""
    for k in range(SEEDS):
        rng = Random(f"{seed}.{k}")
        frames = target.sound(rng)
        first = 0 if target.any_order is False else rng.randrange(len(frames))
        (directory / f"sound_{k}").write_bytes(b"".join(frames[first : first + rng.randint(1, FRAMES_OF_A_SEED)])[:LONGEST_BYTES])
