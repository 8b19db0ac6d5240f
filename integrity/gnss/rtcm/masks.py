"""Which satellites and signals the bits of MSM masks mean, counted from 1 at the first bit sent. What is not here is reserved.

Source: RTCM 10403.3, tables 3.5-90 to 3.5-108 (satellites and signals of GPS, GLONASS, Galileo, SBAS, QZSS, BeiDou).
"""

from typing import NamedTuple

SATELLITE_BITS, SIGNAL_BITS = 64, 32


class System(NamedTuple):
    """Letter; RINEX number of the satellite of bit 1, and how many there are; RINEX code of each signal bit."""

    letter: str
    first: int
    satellites: int
    codes: dict[int, str]


def _codes(*runs: tuple[int, str]) -> dict[int, str]:
    """Signals in runs of consecutive bits: the first bit, and the codes from there on."""
    return {first + i: code for first, codes in runs for i, code in enumerate(codes.split())}


# The message number of MSM n is this number plus n.
SYSTEMS: dict[int, System] = {
    1070: System("G", 1, 32, _codes((2, "1C 1P 1W"), (8, "2C 2P 2W"), (15, "2S 2L 2X"), (22, "5I 5Q 5X"), (30, "1S 1L 1X"))),
    1080: System("R", 1, 24, _codes((2, "1C 1P"), (8, "2C 2P"))),
    1090: System("E", 1, 36, _codes((2, "1C 1A 1B 1X 1Z"), (8, "6C 6A 6B 6X 6Z"), (14, "7I 7Q 7X"), (18, "8I 8Q 8X"), (22, "5I 5Q 5X"))),
    1100: System("S", 20, 39, _codes((2, "1C"), (22, "5I 5Q 5X"))),  # PRN 120 to 158
    1110: System("J", 1, 10, _codes((2, "1C"), (9, "6S 6L 6X"), (15, "2S 2L 2X"), (22, "5I 5Q 5X"), (30, "1S 1L 1X"))),
    1120: System("C", 1, 63, _codes((2, "2I 2Q 2X"), (8, "6I 6Q 6X"), (14, "7I 7Q 7X"), (22, "5D 5P 5X 7D"), (30, "1D 1P 1X"))),
}
NUMBER_OF = {system.letter: number for number, system in SYSTEMS.items()}


def bits_of(mask: int, width: int) -> list[int]:
    """The bits set in a mask, counted from 1 at the first of `width`."""
    return [bit for bit in range(1, width + 1) if mask >> width - bit & 1]


def satellite_name(system: System, bit: int) -> str | None:
    """`G05` of a bit of the satellite mask; None where it is reserved."""
    return f"{system.letter}{system.first + bit - 1:02d}" if 1 <= bit <= system.satellites else None


def places_of(signal: str) -> tuple[int, int] | None:
    """The bits of a signal such as `G05.1C` in the masks of its system; None where it has none."""
    satellite, _, code = signal.partition(".")
    system = SYSTEMS.get(NUMBER_OF.get(signal[:1], 0))
    if system is None or not satellite[1:].isdecimal():
        return None
    bit = int(satellite[1:]) - system.first + 1
    signal_bit = next((b for b, known in system.codes.items() if known == code), None)
    return (bit, signal_bit) if signal_bit is not None and satellite_name(system, bit) == satellite else None
