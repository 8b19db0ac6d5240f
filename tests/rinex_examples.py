"""The examples of navigation records in the format's own documents, one for each kind of record, as lines and as ephemerides.

Source: RINEX 2.11, table A8 (GPS); RINEX 3.04, tables A9 (Galileo), A11 (GLONASS), A13 (QZSS), A15 (BeiDou), A17 (SBAS).
"""

from collections.abc import Sequence

from integrity.gnss.ephemeris.broadcast import Ephemeris, KeplerEphemeris
from recordings.rinex.navigation_fields import epoch_ns, numbers
from recordings.rinex.navigation_kepler import kepler_of
from recordings.rinex.navigation_vectors import geo_of, glonass_of

Rows = tuple[tuple[float | None, ...], ...]  # the clock, then the broadcast orbits; None is blank

GPS_HEAD, GPS = "G06 1999 09 02 17 51 44", (
    (-0.839701388031e-3, -0.165982783074e-10, 0.0),
    (91.0, 93.40625, 0.116040547840e-8, 0.162092304801),
    (0.484101474285e-5, 0.626740418375e-2, 0.652112066746e-5, 0.515365489006e4),
    (409_904.0, -0.242143869400e-7, 0.329237003460, -0.596046447754e-7),
    (0.111541663136e1, 326.59375, 0.206958726335e1, -0.638312302555e-8),
    (0.307155651409e-9, 0.0, 1025.0, 0.0),
    (2.0, 0.0, -0.99e-8, 91.0),
    (406_800.0, 0.0),
)  # fmt: skip
QZSS_HEAD, QZSS = "J01 2014 05 13 08 15 12", (
    (3.323303535581e-4, -1.818989403546e-11, 0.0),
    (69.0, -492.78125, 2.222949737636e-9, 0.7641996743610),
    (-1.654587686062e-5, 7.542252133135e-2, 1.197867095470e-5, 6.492895933151e3),
    (202_512.0, -8.381903171539e-7, -0.9211997910060, -2.041459083557e-6),
    (0.7082252892260, -155.84375, -1.575843337115, -2.349740733276e-9),
    (-6.793140104410e-10, 2.0, 1792.0, 1.0),
    (2.0, 1.0, -4.656612873077e-9, 69.0),
    (198_900.0, 0.0),
)  # fmt: skip
BEIDOU_HEAD, BEIDOU = "C01 2014 05 10 00 00 00", (
    (2.969256602228e-4, 2.196998138970e-11, 0.0),
    (1.0, 436.546875, 1.318269196918e-9, -3.118148933476),
    (1.447647809982e-5, 2.822051756084e-4, 8.092261850834e-6, 6.493480609894e3),
    (518_400.0, -2.654269337654e-8, 3.076630958509, -3.864988684654e-8),
    (0.1103024081152, -250.640625, 2.587808789012, -3.039412318009e-10),
    (2.389385241772e-10, 0.0, 435.0, 0.0),
    (2.0, 0.0, 1.42e-8, -1.04e-8),
    (518_400.0, 0.0),
)  # fmt: skip
_GALILEO_ORBIT: Rows = (
    (93.0, -165.53125, 0.285797618904e-8, 1.38275888459),
    (-0.782497227192e-5, 0.346679124050e-3, 0.114385038614e-4, 0.544062509727e4),
    (439_800.0, 0.298023223877e-7, -2.96185101312, -0.111758708954e-7),
    (0.965683294025, 99.375, -0.629360976005, -0.541593988135e-8),
)  # fmt: skip
GALILEO_HEAD = "E12 2015 06 19 02 10 00"
INAV: Rows = (
    (-0.138392508961e-2, -0.131464616970e-9, 0.0),
    *_GALILEO_ORBIT,
    (-0.571452374714e-11, 516.0, 1849.0, None),
    (3.12, 0.0, -0.651925802231e-8, -0.605359673500e-8),
    (440_734.0,),
)
FNAV: Rows = (
    (-0.138392532244e-2, -0.131450406116e-9, 0.0),
    *_GALILEO_ORBIT,
    (-0.571452374714e-11, 258.0, 1849.0, None),
    (3.12, 0.0, -0.651925802231e-8, 0.0),
    (440_730.0,),
)
GLONASS_HEAD, GLONASS = "R02 2006 10 01 00 15 00", (
    (-0.506537035108e-4, 0.181898940355e-11, 30.0),
    (15_553.6342773, -0.419384956360, 0.0, 0.0),
    (-19_901.1298828, 0.324192047119, -0.931322574615e-9, 1.0),
    (3_553.33544922, 3.52666091919, -0.186264514923e-8, 1.0),
)  # fmt: skip
SBAS_HEAD, SBAS = "S22 2003 10 18  0  1  4", (
    (-1.005828380585e-7, 6.366462912410e-12, 518_442.0),
    (24_828.32392, -3.59375e-4, -1.375e-7, 0.0),
    (-34_089.20872, -1.480625e-3, -5.0e-8, 4.0),
    (-16.5056, 8.36e-4, 6.25e-8, 23.0),
)  # fmt: skip


def lines(head: str, rows: Rows) -> list[str]:
    """A record as RINEX 3 and 4 write it; with a head of RINEX 2 as that does."""
    first = len(head)
    texts = ["".join(" " * 19 if v is None else f"{v:19.12E}".replace("E", "D") for v in row) for row in rows]
    return [head + texts[0], *(" " * (first - 19) + text for text in texts[1:])]


def with_value(rows: Rows, line: int, column: int, value: float | None) -> Rows:
    """The same record with another number in one place."""
    row = rows[line]
    row = (*row, *[None] * (column + 1 - len(row)))
    return (*rows[:line], (*row[:column], value, *row[column + 1 :]), *rows[line + 1 :])


def ephemeris(head: str, rows: Rows, message: str | None = None) -> Ephemeris:
    """The ephemeris in a record of RINEX 3; a failure where there is none."""
    record: Sequence[str] = lines(head, rows)
    at_ns, values = epoch_ns(record[0], 3.04), numbers(record, 3.04)
    assert at_ns is not None
    assert values is not None
    match head[0]:
        case "R":
            found: Ephemeris | str = glonass_of(head[:3], at_ns, values)
        case "S":
            found = geo_of(head[:3], at_ns, values)
        case _:
            found = kepler_of(head[:3], message, at_ns, values)
    assert not isinstance(found, str), found
    return found


def kepler(head: str, rows: Rows) -> KeplerEphemeris:
    found = ephemeris(head, rows)
    assert isinstance(found, KeplerEphemeris)
    return found


EVERY_KIND = {
    "GPS": ephemeris(GPS_HEAD, GPS),
    "QZSS": ephemeris(QZSS_HEAD, QZSS),
    "BeiDou GEO": ephemeris(BEIDOU_HEAD, BEIDOU),
    "BeiDou MEO": ephemeris("C22 2014 05 10 00 00 00", with_value(with_value(BEIDOU, 2, 3, 5282.6), 4, 0, 0.96)),
    "Galileo I/NAV": ephemeris(GALILEO_HEAD, INAV),
    "Galileo F/NAV": ephemeris(GALILEO_HEAD, FNAV),
    "GLONASS": ephemeris(GLONASS_HEAD, GLONASS),
    "SBAS": ephemeris(SBAS_HEAD, SBAS),
}
