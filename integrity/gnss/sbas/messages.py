"""SBAS L1 messages as bits: frame with CRC, and for each type where its values stand. One table reads and writes a message.

A frame has 250 bits in one second: preamble 8, type 6, data 212, CRC-24Q over these 226 bits. Here a message is these 226 bits as a whole
number, first bit most significant. Values that repeat (13 corrections, 51 indicators) are one field, which `split` takes apart.
Source: RTCA DO-229D, A.4.3 (frame) and A.4.4 (types; the section stands at each).
"""

from collections.abc import Iterable
from dataclasses import dataclass

from integrity.gnss.crc import crc24q
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.navigation.bits import Field, Layout, in_order, plain, signed

MESSAGE_BITS, CRC_BITS = 226, 24
FRAME_BITS = MESSAGE_BITS + CRC_BITS
TYPE_AT = 212  # bits behind the type
PREAMBLES = (0x53, 0x9A, 0xC6)  # one after the other, A.4.3.3
FIRST_PRN, LAST_PRN = 120, 158
RECEIVED_AFTER_NS = 1_100 * NS_PER_S // 1000  # last bit arrived, after the first was sent: 1 s long, 0.12 s on its way

TEST, MASK, FAST, INTEGRITY, FAST_DEGRADATION, GEO, DEGRADATION, TIME, ALMANAC, IONO_MASK = 0, 1, (2, 3, 4, 5), 6, 7, 9, 10, 12, 17, 18
MIXED, LONG_TERM, IONO_DELAY, SERVICE, COVARIANCE, INTERNAL, NULL = 24, 25, 26, 27, 28, 62, 63

MASK_NUMBERS = 210  # satellites by PRN mask number: 1-37 GPS, 38-61 GLONASS slots, 120-158 SBAS. Table A-3
MOST_IN_MASK = 51
BLOCK = 13  # satellites of one message of types 2 to 5
HALF_BLOCK = 6  # of type 24
IGPS_OF_BAND, IGPS_OF_BLOCK = 201, 15


@dataclass(frozen=True)
class SbasMessage:
    """A message of the SBAS satellite `prn` whose first bit was sent at the GPS time `sent_ns`; `bits` without CRC, which was right."""

    prn: int
    sent_ns: int
    bits: int

    @property
    def kind(self) -> int:
        """Message type, 0 to 63."""
        return self.bits >> TYPE_AT & 0x3F

    @property
    def received_ns(self) -> int:
        """GPS time at which a receiver has all of it."""
        return self.sent_ns + RECEIVED_AFTER_NS


def message_of(frame: int) -> int | str:
    """The message in a frame of 250 bits, or why there is none."""
    bits = frame >> CRC_BITS
    if not 0 <= frame < 1 << FRAME_BITS:
        return "longer than 250 bits"
    if bits >> MESSAGE_BITS - 8 not in PREAMBLES:
        return "preamble wrong"
    return bits if crc24q(frame.to_bytes(-(-FRAME_BITS // 8), "big")) == 0 else "CRC wrong"


def frame_of(bits: int) -> int:
    """A message with its CRC behind it."""
    return bits << CRC_BITS | crc24q(bits.to_bytes(-(-MESSAGE_BITS // 8), "big"))


def split(value: int, count: int, bits: int) -> list[int]:
    """A field of `count` unsigned numbers of `bits` bits each, first one first."""
    ones = (1 << bits) - 1
    return [value >> bits * k & ones for k in range(count - 1, -1, -1)]


def twos_complement(value: int, bits: int) -> int:
    """The signed number in these bits."""
    return value - (1 << bits) if value >> bits - 1 else value


def joined(values: Iterable[int], bits: int) -> int:
    """Numbers as one field, inverse of `split`; signed ones by two's complement."""
    field = 0
    for value in values:
        field = field << bits | value & (1 << bits) - 1
    return field


def _message(*fields: tuple[str, Field]) -> Layout:
    """Fields behind preamble and type; what follows them is spare."""
    layout = in_order(("preamble", plain(8)), ("kind", plain(6)), *fields)
    return layout._replace(bits=MESSAGE_BITS)


def _half(*fields: tuple[str, Field]) -> Layout:
    """Half of a message of long-term corrections, which is also the end of type 24: 106 bits."""
    return in_order(("velocity_code", plain(1)), *fields)._replace(bits=106)


def _order(names: str, *fields: Field) -> tuple[tuple[str, Field], ...]:
    return tuple(zip(names.split(), fields, strict=True))


MASK_LAYOUT = _message(("mask", plain(210)), ("iodp", plain(2)))  # A.4.4.2
FAST_LAYOUT = _message(("iodf", plain(2)), ("iodp", plain(2)), ("prc", plain(BLOCK * 12)), ("udrei", plain(BLOCK * 4)))  # A.4.4.3
PRC_M, PRC_BITS, UDREI_BITS = 0.125, 12, 4
INTEGRITY_LAYOUT = _message(("iodf", plain(8)), ("udrei", plain(MOST_IN_MASK * 4)))  # A.4.4.4
FAST_DEGRADATION_LAYOUT = _message(
    ("t_lat_s", plain(4, 1.0)), ("iodp", plain(2)), ("spare", plain(2)), ("indicator", plain(MOST_IN_MASK * 4))
)  # A.4.4.5
DEGRADATION_LAYOUT = _message(
    ("B_rrc", plain(10, 0.002)),
    ("C_ltc_lsb", plain(10, 0.002)),
    ("C_ltc_v1", plain(10, 0.00005)),
    ("I_ltc_v1", plain(9, 1.0)),
    ("C_ltc_v0", plain(10, 0.002)),
    ("I_ltc_v0", plain(9, 1.0)),
    ("C_geo_lsb", plain(10, 0.0005)),
    ("C_geo_v", plain(10, 0.00005)),
    ("I_geo", plain(9, 1.0)),
    ("C_er", plain(6, 0.5)),
    ("C_iono_step", plain(10, 0.001)),
    ("I_iono", plain(9, 1.0)),
    ("C_iono_ramp", plain(10, 0.000005)),
    ("RSS_UDRE", plain(1)),
    ("RSS_iono", plain(1)),
    ("C_covariance", plain(7, 0.1)),
)  # A.4.4.6, table A-9
GEO_LAYOUT = _message(
    ("reserved", plain(8)),  # the IODN of editions before DO-229C
    ("t0_16s", plain(13)),
    ("ura_index", plain(4)),
    *_order("x_m y_m z_m", signed(30, 0.08), signed(30, 0.08), signed(25, 0.4)),
    *_order("vx_mps vy_mps vz_mps", signed(17, 0.000625), signed(17, 0.000625), signed(18, 0.004)),
    *_order("ax_mps2 ay_mps2 az_mps2", signed(10, 0.0000125), signed(10, 0.0000125), signed(10, 0.0000625)),
    ("af0", signed(12, 2.0**-31)),
    ("af1", signed(8, 2.0**-40)),
)  # A.4.4.11
TIME_LAYOUT = _message(
    *_order("a1_sps a0_s", signed(24, 2.0**-50), signed(32, 2.0**-30)),
    *_order("t0t_4096s week_8bit", plain(8), plain(8)),
    *_order("leap_s leap_week day future_leap_s", signed(8, 1.0), plain(8), plain(8), signed(8, 1.0)),
    *_order("utc_standard tow_s week glonass", plain(3), plain(20), plain(10), plain(1)),
)  # A.4.4.15
ALMANAC_LAYOUT = _message(("satellites", plain(3 * 67)), ("t0_64s", plain(11)))  # A.4.4.12
ALMANAC_OF_ONE = in_order(
    *_order("data_id prn health", plain(2), plain(8), plain(8)),
    *_order("x_m y_m z_m", signed(15, 2600.0), signed(15, 2600.0), signed(9, 26_000.0)),
    *_order("vx_mps vy_mps vz_mps", signed(3, 10.0), signed(3, 10.0), signed(4, 60.0)),
)
IONO_MASK_LAYOUT = _message(("bands", plain(4)), ("band", plain(4)), ("iodi", plain(2)), ("mask", plain(IGPS_OF_BAND)))  # A.4.4.9
IONO_DELAY_LAYOUT = _message(("band", plain(4)), ("block", plain(4)), ("igps", plain(IGPS_OF_BLOCK * 13)), ("iodi", plain(2)))  # A.4.4.10
IGP_DELAY_M, GIVEI_BITS, IGP_BITS = 0.125, 4, 13
MIXED_LAYOUT = _message(
    *_order("prc udrei", plain(HALF_BLOCK * PRC_BITS), plain(HALF_BLOCK * UDREI_BITS)),
    *_order("iodp block iodf spare half", plain(2), plain(2), plain(2), plain(4), plain(106)),
)  # A.4.4.8
LONG_TERM_LAYOUT = _message(("half_1", plain(106)), ("half_2", plain(106)))  # A.4.4.7
STILL_LAYOUT = _half(("satellites", plain(2 * 51)), ("iodp", plain(2)))  # velocity code 0
STILL_OF_ONE = in_order(
    *_order("number iod", plain(6), plain(8)),
    *_order("dx_m dy_m dz_m daf0_s", signed(9, 0.125), signed(9, 0.125), signed(9, 0.125), signed(10, 2.0**-31)),
)
MOVING_LAYOUT = _half(
    *_order("number iod", plain(6), plain(8)),
    *_order("dx_m dy_m dz_m daf0_s", signed(11, 0.125), signed(11, 0.125), signed(11, 0.125), signed(11, 2.0**-31)),
    *_order("dvx_mps dvy_mps dvz_mps daf1", signed(8, 2.0**-11), signed(8, 2.0**-11), signed(8, 2.0**-11), signed(8, 2.0**-39)),
    *_order("t0_16s iodp", plain(13), plain(2)),
)  # velocity code 1
SERVICE_LAYOUT = _message(
    *_order("iods messages_less_1 number_less_1 regions", plain(3), plain(3), plain(3), plain(3)),
    *_order("priority inside outside areas", plain(2), plain(4), plain(4), plain(5 * 35)),
)  # A.4.4.13
AREA_OF_ONE = in_order(
    *_order("lat1_deg lon1_deg lat2_deg lon2_deg", signed(8, 1.0), signed(9, 1.0), signed(8, 1.0), signed(9, 1.0)), ("square", plain(1))
)
COVARIANCE_LAYOUT = _message(("iodp", plain(2)), ("satellites", plain(2 * 105)))  # A.4.4.16
COVARIANCE_OF_ONE = in_order(
    *_order("number scale_exponent", plain(6), plain(3)),
    *_order("E11 E22 E33 E44", plain(9), plain(9), plain(9), plain(9)),
    *_order("E12 E13 E14 E23 E24 E34", *(signed(10, 1.0) for _ in range(6))),
)
