"""However a navigation file of any version and system is damaged: it is refused with a DecodeError, or gives sets that an orbit can have.
Where whole lines are lost, or stand twice, every set that is read is one of those that were written.
"""

import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.errors import DecodeError
from recordings.rinex.navigation import NavigationFile, read_navigation
from tests import rinex_examples as example
from tests.rinex_text import navigation_text
from tests.unit.rinex.navigation_files import HEADER_2, HEADER_2_GEO, HEADER_2_GLONASS, HEADER_4, record_2, record_4

ION = """\
> ION G18 LNAV
    2025 02 15 17 00 42 1.676380634308E-08 2.235174179077E-08-1.192092895508E-07
    -1.192092895508E-07 1.208320000000E+05 1.310720000000E+05-1.310720000000E+05
    -1.966080000000E+05 0.000000000000E+00
"""
MESSAGE = {"GPS": "LNAV", "QZSS": "LNAV", "BeiDou GEO": "D2", "Galileo I/NAV": "INAV", "Galileo F/NAV": "FNAV", "SBAS": "SBAS"}
RECORDS = {
    "GPS": (example.GPS_HEAD, example.GPS),
    "QZSS": (example.QZSS_HEAD, example.QZSS),
    "BeiDou GEO": (example.BEIDOU_HEAD, example.BEIDOU),
    "Galileo I/NAV": (example.GALILEO_HEAD, example.INAV),
    "Galileo F/NAV": (example.GALILEO_HEAD, example.FNAV),
    "SBAS": (example.SBAS_HEAD, example.SBAS),
}
GLONASS_4 = record_4(example.GLONASS_HEAD, (*example.GLONASS, (None, None, None, None)), "FDMA")
FILES = {
    "2, GPS": HEADER_2 + record_2(" 6", example.GPS_HEAD, example.GPS) * 2,
    "2, GLONASS": HEADER_2_GLONASS + record_2(" 2", example.GLONASS_HEAD, example.GLONASS) * 2,
    "2, SBAS": HEADER_2_GEO + record_2("22", "S22 2003 10 18 00 01 04", example.SBAS) * 2,
    "3": navigation_text([*example.EVERY_KIND.values()] * 2),
    "4": HEADER_4 + ION + "".join(record_4(*RECORDS[kind], MESSAGE[kind]) for kind in MESSAGE) + GLONASS_4 * 2,
}
LIKELY = st.sampled_from(" 0123456789.-+DEGRSCJnaif*\n\r>\x00\xff")  # what does most harm in such a file
PLACE = st.floats(0.0, 1.0, exclude_max=True)


def read(text: str) -> NavigationFile | None:
    """The file as read, None where it is refused."""
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "site.nav"
        path.write_bytes(text.encode("latin-1"))
        try:
            return read_navigation(path)
        except DecodeError:
            return None


def all_sets(file: NavigationFile) -> set[object]:
    return {*file.ephemerides, *file.fnav_ephemerides}


@pytest.mark.parametrize("version", FILES)
@settings(deadline=None)
@given(changes=st.lists(st.tuples(PLACE, st.sampled_from(["set", "insert", "cut"]), LIKELY), min_size=1, max_size=8))
def test_damaged_bytes_give_plausible_sets_or_a_refusal(version: str, changes: list[tuple[float, str, str]]) -> None:
    text = FILES[version]
    for place, kind, character in changes:
        k = int(place * len(text))
        text = text[:k] + ("" if kind == "cut" else character) + text[k + (0 if kind == "insert" else 1) :]
    file = read(text)
    if file is not None:
        assert {eph.implausibility() for eph in (*file.ephemerides, *file.fnav_ephemerides)} <= {None}


@pytest.mark.parametrize("version", FILES)
@pytest.mark.parametrize("times", [0, 2], ids=["lost", "doubled"])
@settings(deadline=None)
@given(places=st.lists(PLACE, min_size=1, max_size=6))
def test_lines_lost_or_doubled_make_no_new_set(version: str, times: int, places: list[float]) -> None:
    whole = read(FILES[version])
    assert whole is not None
    head, _, body = FILES[version].partition("END OF HEADER\n")
    lines = body.splitlines(keepends=True)
    for k in sorted({int(place * len(lines)) for place in places}, reverse=True):
        lines[k : k + 1] = [lines[k]] * times
    file = read(head + "END OF HEADER\n" + "".join(lines))
    assert file is not None
    assert all_sets(file) <= all_sets(whole)


@settings(deadline=None)
@given(st.binary(max_size=400))
def test_any_bytes_under_a_header_are_read(data: bytes) -> None:
    file = read(HEADER_4 + data.decode("latin-1"))
    assert file is not None
    assert all_sets(file) == set()
