"""RINEX 4: each record says what it is. The numbers of a record are those of RINEX 3."""

from pathlib import Path

import pytest

from integrity.gnss.atmosphere import GalileoIonosphere, Klobuchar
from tests import rinex_examples as example
from tests.unit.rinex.navigation_files import HEADER_4, read, record, record_4

GPS = record_4(example.GPS_HEAD, example.GPS, "LNAV")
KLOB = """\
> ION G18 LNAV
    2025 02 15 17 00 42 1.676380634308E-08 2.235174179077E-08-1.192092895508E-07
    -1.192092895508E-07 1.208320000000E+05 1.310720000000E+05-1.310720000000E+05
    -1.966080000000E+05 0.000000000000E+00
"""
NEQN = """\
> ION E12 IFNV
    2025 02 15 17 00 42 1.485000000000E+02 5.039062500000E-01 2.377319335938E-02
     1.600000000000E+01
"""
BDGIM = KLOB.replace("G18 LNAV", "C30 CNVX")
STO = "> STO G18 LNAV\n    2025 02 15 17 00 00 GPUT\n     5.760000000000E+05 0.000000000000E+00 0.000000000000E+00 0.000000000000E+00\n"


@pytest.mark.parametrize(
    ("head", "rows", "message", "kind"),
    [
        (example.GPS_HEAD, example.GPS, "LNAV", "GPS"),
        (example.QZSS_HEAD, example.QZSS, "LNAV", "QZSS"),
        (example.BEIDOU_HEAD, example.BEIDOU, "D2", "BeiDou GEO"),
        (example.GALILEO_HEAD, example.INAV, "INAV", "Galileo I/NAV"),
        (example.GLONASS_HEAD, (*example.GLONASS, (None, None, None, None)), "FDMA", "GLONASS"),
        (example.SBAS_HEAD, example.SBAS, "SBAS", "SBAS"),
    ],
)
def test_a_record_of_every_message(tmp_path: Path, head: str, rows: example.Rows, message: str, kind: str) -> None:
    file = read(tmp_path, HEADER_4 + record_4(head, rows, message))
    assert file.ephemerides == (example.EVERY_KIND[kind],)
    assert file.problems == {}


def test_the_head_says_fnav_whatever_the_data_sources_say(tmp_path: Path) -> None:
    file = read(tmp_path, HEADER_4 + record_4(example.GALILEO_HEAD, example.with_value(example.FNAV, 5, 1, None), "FNAV"))
    assert file.fnav_ephemerides == (example.EVERY_KIND["Galileo F/NAV"],)


def test_klobuchar(tmp_path: Path) -> None:
    assert read(tmp_path, HEADER_4 + KLOB + GPS).klobuchar == Klobuchar(
        alpha=(1.676380634308e-8, 2.235174179077e-8, -1.192092895508e-7, -1.192092895508e-7),
        beta=(120_832.0, 131_072.0, -131_072.0, -196_608.0),
    )


def test_nequick(tmp_path: Path) -> None:
    assert read(tmp_path, HEADER_4 + NEQN).galileo_ionosphere == GalileoIonosphere(148.5, 0.50390625, 2.377319335938e-2, 16)


def test_of_several_ionospheres_the_first_is_kept(tmp_path: Path) -> None:
    file = read(tmp_path, HEADER_4 + NEQN + NEQN.replace("1.485", "9.999"))
    assert file.galileo_ionosphere is not None
    assert file.galileo_ionosphere.ai0 == 148.5


@pytest.mark.parametrize("damage", [("1.676380634308E-08", " " * 18), ("1.676380634308E-08", "1.67638063430*E-08")])
def test_an_ionosphere_that_cannot_be_read(tmp_path: Path, damage: tuple[str, str]) -> None:
    file = read(tmp_path, HEADER_4 + KLOB.replace(*damage))
    assert file.klobuchar is None
    assert file.problems == {"ionosphere not readable": 1}


def test_what_is_not_used_is_counted_by_its_kind(tmp_path: Path) -> None:
    others = [record_4(example.GPS_HEAD, example.GPS, "CNAV"), record_4(example.GPS_HEAD, example.GPS, "CNV2"), BDGIM, STO, STO]
    others.append(record_4(example.GLONASS_HEAD, example.GLONASS, "L3OC"))
    file = read(tmp_path, HEADER_4 + "".join(others) + GPS)
    assert [eph.satellite for eph in file.ephemerides] == ["G06"]
    assert file.problems == {
        "EPH CNAV of system G, not used": 1,
        "EPH CNV2 of system G, not used": 1,
        "EPH L3OC of system R, not used": 1,
        "ION CNVX of system C, not used": 1,
        "STO LNAV of system G, not used": 2,
    }


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("> EPH G06", "> EPX G06", "head of a record not readable"),
        ("> EPH G06", "> EPH G07", "record differs from its head"),
        ("\nG06", "\nG0x", "record differs from its head"),
        ("> EPH G06", "x EPH G06", "record longer than it should be"),
    ],
)
def test_a_damaged_head_costs_its_record_alone(tmp_path: Path, old: str, new: str, reason: str) -> None:
    file = read(tmp_path, HEADER_4 + GPS + GPS.replace(old, new) + GPS)
    assert [eph.satellite for eph in file.ephemerides] == ["G06", "G06"]
    assert file.problems == {reason: 1}


def test_a_record_without_its_head_is_dropped(tmp_path: Path) -> None:
    """It may be of any message."""
    file = read(tmp_path, HEADER_4 + record(example.GPS_HEAD, example.GPS) + GPS)
    assert len(file.ephemerides) == 1
    assert file.problems == {"line outside a record": 8}
