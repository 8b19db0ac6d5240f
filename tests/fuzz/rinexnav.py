"""RINEX navigation files of versions 2, 3 and 4: records damaged."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import astuple
from functools import cache
from random import Random

from recordings.rinex.navigation import NavigationFile, read_navigation
from tests import rinex_examples as example
from tests.fuzz import bounds
from tests.fuzz.mutations import in_other_order
from tests.fuzz.target import Piece, Target
from tests.fuzz.text import of_whole_lines, read, touched_text
from tests.unit.rinex.navigation_files import (
    HEADER_2,
    HEADER_2_GEO,
    HEADER_2_GLONASS,
    HEADER_3,
    HEADER_3_05,
    HEADER_4,
    record,
    record_2,
    record_4,
)

RECORDS = 60  # of a file
KINDS = (
    (example.GPS_HEAD, example.GPS, "LNAV"),
    (example.QZSS_HEAD, example.QZSS, "LNAV"),
    (example.BEIDOU_HEAD, example.BEIDOU, "D2"),
    (example.GALILEO_HEAD, example.INAV, "INAV"),
    (example.GALILEO_HEAD, example.FNAV, "FNAV"),
    (example.SBAS_HEAD, example.SBAS, "SBAS"),
)
STATUS: example.Rows = ((511.0, 8.381903171539e-09, 2.0, 3.0),)  # what RINEX 3.05 has more of GLONASS


@cache
def files() -> tuple[tuple[bytes, list[bytes]], ...]:
    """Headers, each with records of other satellites and times."""
    found: list[tuple[str, list[str]]] = [
        (header, []) for header in (HEADER_2, HEADER_2_GLONASS, HEADER_2_GEO, HEADER_3, HEADER_3_05, HEADER_4)
    ]
    two, two_glonass, two_geo, three, three_05, four = (records for _, records in found)
    for k in range(1, 25):
        two.append(record_2(f"{k:2d}", _at(example.GPS_HEAD, k), example.GPS))
        two_glonass.append(record_2(f"{k:2d}", _at(example.GLONASS_HEAD, k), example.GLONASS))
        two_geo.append(record_2(f"{20 + k:2d}", f"S22 2003 10 18 {k % 24:2d} 01 04", example.SBAS))
        for head, rows, message in KINDS:
            name = f"{head[0]}{(20 + k if head[0] == 'S' else k):02d}"
            if head[0] == "J" and k > 9:
                continue
            for version_3 in (three, three_05):
                version_3.append(record(name + _at(head, 0)[3:], rows))
            four.append(record_4(name + _at(head, 0)[3:], rows, "D1" if message == "D2" and 5 < k < 59 else message))
        glonass = f"R{k:02d}{example.GLONASS_HEAD[3:]}"
        three.append(record(glonass, example.GLONASS))
        three_05.append(record(glonass, (*example.GLONASS, *STATUS)))
        four.append(record_4(glonass, (*example.GLONASS, *STATUS), "FDMA"))
    return tuple((header.encode(), [text.encode() for text in records]) for header, records in found)


def _at(head: str, hour: int) -> str:
    """A head at another hour; 0 leaves it."""
    return head if not hour else f"{head[:15]}{hour % 24:2d}{head[17:]}"


def sound(rng: Random) -> list[bytes]:
    head, records = rng.choice(files())
    return [head, *in_other_order(rng, rng.sample(records, min(RECORDS, len(records))))]


def touch(rng: Random, text: bytes) -> bytes:
    """Headers only now and then: most damage there makes no file of it."""
    return text if b"END OF HEADER" in text and rng.random() < 0.8 else touched_text(rng, text)


def examine(pieces: Sequence[Piece], rng: Random) -> Counter[str]:
    """A refusal, or sets that can be; among them those of untouched records but for one before a touched one."""
    file = read(b"".join(piece.data for piece in pieces), read_navigation, packed=rng.random() < 0.1)
    if file is None:
        return Counter(refused=1)
    sets = (*file.ephemerides, *file.fnav_ephemerides)
    bounds.assert_sets_in_range(sets)
    if file.klobuchar is not None:
        bounds.assert_finite((*file.klobuchar.alpha, *file.klobuchar.beta))
    if file.galileo_ionosphere is not None:
        bounds.assert_finite(file.galileo_ionosphere)
    head, *body = of_whole_lines(pieces)
    if any(head.data == text for text, _ in files()):
        after = (*body[1:], Piece(b"", True))
        kept = [piece.data for piece, following in zip(body, after, strict=False) if piece.untouched and following.untouched]
        _assert_found(file, head.data + b"".join(kept), len(kept))
    return Counter(sets=len(sets), problems=sum(file.problems.values()))


def _assert_found(file: NavigationFile, whole: bytes, n_records: int) -> None:
    """That every set of a file that nobody touched, which has so many, is in this one."""
    expected = read(whole, read_navigation)
    assert expected is not None and not expected.problems, expected
    sets = (*expected.ephemerides, *expected.fnav_ephemerides)
    assert len(sets) == n_records
    lost = set(map(astuple, sets)) - set(map(astuple, (*file.ephemerides, *file.fnav_ephemerides)))
    assert not lost, f"{lost} is lost"


def split(data: bytes) -> list[bytes]:
    return re.split(rb"(?<=\n)(?=[>A-Z])", data)


TARGET = Target(sound, touch, split, examine, any_order=False)
