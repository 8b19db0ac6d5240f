"""Names of signals; the expected ones are the tables of the interface descriptions and of RINEX 3.05, side by side."""

import pytest

from integrity.gnss.signals import carrier_hz
from integrity.gnss.ubx.identifiers import EVERY_CODE, SIGNALS, satellite_before_8, signal_of

GPS, SBAS, GALILEO, BEIDOU, QZSS, GLONASS, NAVIC = 0, 1, 2, 3, 5, 6, 7

# Signal as u-blox names it, a satellite and the numbers; its RINEX name; its carrier in MHz.
NAMED = {
    "GPS L1 C/A": ((GPS, 5, 0), "G05.1C", 1575.42),
    "GPS L2 CL": ((GPS, 5, 3), "G05.2L", 1227.60),
    "GPS L2 CM": ((GPS, 5, 4), "G05.2S", 1227.60),
    "GPS L5 I": ((GPS, 5, 6), "G05.5I", 1176.45),
    "GPS L5 Q": ((GPS, 5, 7), "G05.5Q", 1176.45),
    "SBAS L1 C/A": ((SBAS, 129, 0), "S29.1C", 1575.42),
    "Galileo E1 C": ((GALILEO, 11, 0), "E11.1C", 1575.42),
    "Galileo E1 B": ((GALILEO, 11, 1), "E11.1B", 1575.42),
    "Galileo E5 aI": ((GALILEO, 11, 3), "E11.5I", 1176.45),
    "Galileo E5 aQ": ((GALILEO, 11, 4), "E11.5Q", 1176.45),
    "Galileo E5 bI": ((GALILEO, 11, 5), "E11.7I", 1207.14),
    "Galileo E5 bQ": ((GALILEO, 11, 6), "E11.7Q", 1207.14),
    "Galileo E6 B": ((GALILEO, 11, 8), "E11.6B", 1278.75),
    "Galileo E6 C": ((GALILEO, 11, 9), "E11.6C", 1278.75),
    "Galileo E6 A": ((GALILEO, 11, 10), "E11.6A", 1278.75),
    "BeiDou B1I D1": ((BEIDOU, 6, 0), "C06.2I", 1561.098),
    "BeiDou B1I D2": ((BEIDOU, 6, 1), "C06.2I", 1561.098),
    "BeiDou B2I D1": ((BEIDOU, 6, 2), "C06.7I", 1207.14),
    "BeiDou B2I D2": ((BEIDOU, 6, 3), "C06.7I", 1207.14),
    "BeiDou B3I D1": ((BEIDOU, 6, 4), "C06.6I", 1268.52),
    "BeiDou B3I D2": ((BEIDOU, 6, 10), "C06.6I", 1268.52),
    "BeiDou B1C pilot": ((BEIDOU, 6, 5), "C06.1P", 1575.42),
    "BeiDou B1C data": ((BEIDOU, 6, 6), "C06.1D", 1575.42),
    "BeiDou B2a pilot": ((BEIDOU, 6, 7), "C06.5P", 1176.45),
    "BeiDou B2a data": ((BEIDOU, 6, 8), "C06.5D", 1176.45),
    "QZSS L1 C/A": ((QZSS, 2, 0), "J02.1C", 1575.42),
    "QZSS L1 S": ((QZSS, 2, 1), "J02.1Z", 1575.42),
    "QZSS L2 CM": ((QZSS, 2, 4), "J02.2S", 1227.60),
    "QZSS L2 CL": ((QZSS, 2, 5), "J02.2L", 1227.60),
    "QZSS L5 I": ((QZSS, 2, 8), "J02.5I", 1176.45),
    "QZSS L5 Q": ((QZSS, 2, 9), "J02.5Q", 1176.45),
    "QZSS L1 C/B": ((QZSS, 2, 12), "J02.1E", 1575.42),
    "GLONASS L1 OF": ((GLONASS, 7, 0), "R07.1C", 1602.0),
    "GLONASS L2 OF": ((GLONASS, 7, 2), "R07.2C", 1246.0),
}


@pytest.mark.parametrize("signal", NAMED)
def test_every_signal_by_its_rinex_name(signal: str) -> None:
    numbers, name, _ = NAMED[signal]
    assert signal_of(*numbers) == name


@pytest.mark.parametrize("signal", NAMED)
def test_the_name_leads_to_the_carrier_of_the_signal(signal: str) -> None:
    _, name, carrier_mhz = NAMED[signal]
    carrier = carrier_hz(name[0], name[4])
    assert carrier is not None and carrier[0] == pytest.approx(carrier_mhz * 1e6, abs=1e-3)


def test_no_signal_is_known_but_those() -> None:
    assert set(SIGNALS) == {(gnss, sig) for (gnss, _, sig), _, _ in NAMED.values()}


def test_codes_by_system_are_those_of_all_signals() -> None:
    assert {(system, code) for system, codes in EVERY_CODE.items() for code in codes} == {(n[0], n[4:]) for _, n, _ in NAMED.values()}


@pytest.mark.parametrize(
    ("gnss", "first", "last", "names"),
    [(GPS, 1, 32, "G01 G32"), (SBAS, 120, 158, "S20 S58"), (GALILEO, 1, 36, "E01 E36"), (BEIDOU, 1, 63, "C01 C63"),
     (QZSS, 1, 10, "J01 J10"), (GLONASS, 1, 32, "R01 R32")],
)  # fmt: skip
def test_satellites_of_each_system(gnss: int, first: int, last: int, names: str) -> None:
    found = [signal_of(gnss, sv, 0) for sv in range(256)]
    named = [sv for sv, name in enumerate(found) if name is not None]
    assert (named, f"{found[first]} {found[last]}".replace(".1C", "").replace(".2I", "")) == ([*range(first, last + 1)], names)


@pytest.mark.parametrize("gnss_and_sig", [(NAVIC, 0), (4, 0), (GPS, 1), (GALILEO, 2), (GLONASS, 1), (255, 255)])
def test_what_is_no_signal_has_no_name(gnss_and_sig: tuple[int, int]) -> None:
    assert signal_of(gnss_and_sig[0], 1, gnss_and_sig[1]) is None


@pytest.mark.parametrize(
    ("sv", "name"),
    [(0, None), (1, "G01"), (32, "G32"), (33, None), (119, None), (120, "S20"), (158, "S58"), (159, None), (192, None), (193, "J01"),
     (197, "J05"), (198, None), (255, None)],
)  # fmt: skip
def test_satellites_by_the_one_number_of_older_receivers(sv: int, name: str | None) -> None:
    assert satellite_before_8(sv) == name
