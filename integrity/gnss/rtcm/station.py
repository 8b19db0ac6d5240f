"""RTCM 3 messages 1005 and 1006: where the antenna of a reference station is.

Source: RTCM 10403.3, contents of these messages; data fields DF021 to DF028, DF141, DF142, DF364.
"""

from dataclasses import dataclass

from integrity.gnss.navigation.bits import in_order, plain, signed

_UNIT_M = 0.0001
_POSITION = (
    ("number", plain(12)),
    ("station", plain(12)),
    ("itrf_year", plain(6)),
    ("gps", plain(1)),
    ("glonass", plain(1)),
    ("galileo", plain(1)),
    ("computed", plain(1)),  # DF141: no real antenna
    ("x_m", signed(38, _UNIT_M)),
    ("one_oscillator", plain(1)),
    ("reserved", plain(1)),
    ("y_m", signed(38, _UNIT_M)),
    ("quarter_cycle", plain(2)),
    ("z_m", signed(38, _UNIT_M)),
)
TABLES = {1005: in_order(*_POSITION), 1006: in_order(*_POSITION, ("height_m", plain(16, _UNIT_M)))}
STATION_NUMBERS = frozenset(TABLES)


@dataclass(frozen=True)
class AntennaPosition:
    """Antenna reference point in ECEF (the frame is not told), and its height above the marker; None: not told.

    `real` is false of a virtual station, whose measurements were computed for a place where no antenna is.
    """

    station: int
    real: bool
    x_m: float
    y_m: float
    z_m: float
    height_m: float | None


def position_of(message: bytes) -> AntennaPosition | None:
    """What a message of `STATION_NUMBERS` tells; None where it is too short."""
    table = TABLES[message[0] << 4 | message[1] >> 4]
    if 8 * len(message) < table.bits:
        return None
    bits = int.from_bytes(message, "big") >> 8 * len(message) - table.bits
    quantities = table.quantities(bits)
    return AntennaPosition(
        station=table.integer(bits, "station"),
        real=not table.integer(bits, "computed"),
        x_m=quantities["x_m"],
        y_m=quantities["y_m"],
        z_m=quantities["z_m"],
        height_m=quantities.get("height_m"),
    )


def encode_position(position: AntennaPosition) -> bytes:
    """Message 1006, or 1005 where no height is told; ValueError where a value does not fit its field."""
    number = 1005 if position.height_m is None else 1006
    table = TABLES[number]
    values = {name: getattr(position, name) for name in ("x_m", "y_m", "z_m", "height_m") if name in table.fields}
    flags = {"number": number, "station": position.station, "computed": int(not position.real)}
    size = (table.bits + 7) // 8
    return (table.message(flags | values) << 8 * size - table.bits).to_bytes(size, "big")
