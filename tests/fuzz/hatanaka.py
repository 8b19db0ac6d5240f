"""Compact RINEX 1 and 3: runs of epochs that begin anew, of which some are damaged."""

import math
import re
from collections import Counter
from collections.abc import Sequence
from functools import cache
from random import Random

from tests.fuzz import rinex
from tests.fuzz.mutations import in_other_order
from tests.fuzz.rinex import Epoch, header
from tests.fuzz.target import Piece, Target
from tests.fuzz.text import of_whole_lines, touched_text

RUNS, EPOCHS, ORDER = 30, 5, 3  # of a file, of a run, of differences


def compressed(run: Sequence[Epoch], version: int) -> str:
    """Epochs after Hatanaka (2008), section 3: differences of the third order, changes of text; the clock is not told."""
    lines: list[str] = []
    line_before, known = "", dict[str, list[list[int]]]()
    digits: dict[str, str] = {}
    for epoch in run:
        line = epoch_line(epoch, version)
        lines += [changes(line, line_before) if line_before else line.replace(" ", "&", 1) if version == 2 else line, ""]
        line_before, before, known = line, known, {}
        digits_before, digits = digits, {}
        for name, record in epoch.records.items():
            stacks = before.get(name, [[] for _ in record])
            known[name] = [
                [] if math.isnan(number) else [*stack, round(number * 1000)] for (number, _), stack in zip(record, stacks, strict=True)
            ]
            digits[name] = "".join(two for _, two in record)
            numbers = " ".join(difference(stack) for stack in known[name])
            lines.append(f"{numbers} {changes(digits[name], digits_before.get(name, ''))}".rstrip())
    return "\n".join(lines) + "\n"


def epoch_line(epoch: Epoch, version: int) -> str:
    text = (rinex.text_2 if version == 2 else rinex.text_3)(epoch).split("\n")[0]
    return text[:32] + "".join(epoch.records) if version == 2 else f"{text:<41}" + "".join(epoch.records)


def changes(text: str, before: str) -> str:
    """What stands for a text after another: a blank for what stays, `&` for a blank."""
    size = max(len(text), len(before))
    pairs = zip(text.ljust(size), before.ljust(size), strict=True)
    return "".join(" " if new == old else "&" if new == " " else new for new, old in pairs).rstrip()


def difference(values: list[int]) -> str:
    """The last number of an arc as it is written: the first with the order, the others as differences of up to it."""
    if len(values) == 1:
        return f"{ORDER}&{values[0]}"
    order = min(len(values) - 1, ORDER)
    return str(sum((-1) ** k * math.comb(order, k) * values[-1 - k] for k in range(order + 1))) if values else ""


@cache
def written() -> dict[int, tuple[bytes, list[tuple[bytes, bytes]]]]:
    """By version a header, and of many runs the compressed text and the plain."""
    rng, found = Random(0), {}
    program = header("by test", "CRINEX PROG / DATE")
    for version, name, plain in ((2, "1.0", rinex.header_2()), (3, "3.0", rinex.header_3())):
        runs = []
        for n in range(4 * RUNS):
            same = rinex.an_epoch(rng, 0, version).records
            run = [
                Epoch(EPOCHS * n + k, {sat: tuple(rinex.value(rng, kind) for kind in kinds(sat, version)) for sat in same})
                for k in range(EPOCHS)
            ]
            text = "".join((rinex.text_2 if version == 2 else rinex.text_3)(epoch) for epoch in run)
            runs.append((compressed(run, version).encode(), text.encode()))
        head = header(f"{name:<20}COMPACT RINEX FORMAT", "CRINEX VERS   / TYPE") + program + plain
        found[version] = head.encode(), runs
    return found


def kinds(satellite: str, version: int) -> list[str]:
    return [name[0] for name in (rinex.TYPES_2 if version == 2 else rinex.TYPES_3[satellite[0]])]


def sound(rng: Random) -> list[bytes]:
    head, runs = written()[rng.choice((2, 3))]
    return [head, *in_other_order(rng, [text for text, _ in rng.sample(runs, RUNS)])]


def examine(pieces: Sequence[Piece], rng: Random) -> Counter[str]:
    """A refusal, or rows in range, among them those of untouched runs; but for the last epochs of one before a touched run."""
    file = rinex.read_twice(b"".join(piece.data for piece in pieces), rng)
    if file is None:
        return Counter(refused=1)
    head, *body = of_whole_lines(pieces)
    version = next((version for version, (text, _) in written().items() if text == head.data), None)
    if version is not None:
        plain = dict(written()[version][1])
        after = (*body[1:], Piece(b"", True))
        kept = [plain[piece.data] for piece, following in zip(body, after, strict=False) if piece.untouched and following.untouched]
        whole = (rinex.header_2() if version == 2 else rinex.header_3()).encode() + b"".join(kept)
        rinex.assert_found(file.rows, whole, EPOCHS * len(kept))
    return Counter(rows=len(file.rows), problems=sum(file.problems.values()))


def touch(rng: Random, record: bytes) -> bytes:
    """Headers only now and then: most damage there makes no file of it."""
    return record if rinex.END in record and rng.random() < 0.9 else touched_text(rng, record)


def split(data: bytes) -> list[bytes]:
    return re.split(rb"(?<=\n)(?=[>&])", data)


TARGET = Target(sound, touch, split, examine, any_order=False)
