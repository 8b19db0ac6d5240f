"""Ephemerides from RTCM 3 messages, and messages from ephemerides.

A message does not say when it was sent. Its week is that of the transmission, so that near the beginning of a week the reference times
may lie in the next one or the one before; senders that write the week of the reference time are understood too.
"""

from typing import NamedTuple

from integrity.gnss.ephemeris.broadcast import Ephemeris, GlonassEphemeris, KeplerEphemeris, KeplerMessage
from integrity.gnss.ephemeris.kepler import GEOSTATIONARY
from integrity.gnss.gps_time import (
    BDT_BEHIND_GPS_NS,
    GLONASS_AHEAD_OF_UTC_NS,
    NS_PER_S,
    WEEK_NS,
    WEEK_S,
    gps_from_utc,
    utc_from_gps,
)
from integrity.gnss.navigation import beidou, glonass, inav, lnav
from integrity.gnss.navigation.bits import Layout, nearest_ns
from integrity.gnss.rtcm.navigation_tables import TABLES
from integrity.gnss.signals import GLONASS_CHANNELS

FIRST_WEEK = 1700  # August 2012, when MSM began: without any time known, weeks are taken to be the first from here on
LAST_WEEK = 4095  # June 2058: a later one is damage that the CRC let through, or a sender's
EDGE_S = 43_200  # so close to the edge of a week a reference time may belong to another week than the transmission
GLONASS_NUMBER, GLONASS_SLOTS = 1020, 24


class _Kind(NamedTuple):
    """System, number of satellites, steps of the reference times, and how weeks are counted: GPS week of the first, how many there are."""

    system: str
    satellites: int
    step_s: int
    week_0: int
    weeks_ns: int


_GALILEO = _Kind("E", 36, 60, inav.FIRST_WEEK, inav.WEEKS_NS)
_KINDS = {
    1019: _Kind("G", 32, 16, 0, lnav.WEEKS_NS),
    1042: _Kind("C", 63, 8, beidou.FIRST_WEEK, beidou.WEEKS_NS),
    1044: _Kind("J", 10, 16, 0, lnav.WEEKS_NS),
    1045: _GALILEO,
    1046: _GALILEO,
}


def ephemeris_of(message: bytes, near_ns: int | None, epoch_ns: int | None) -> Ephemeris | None:
    """The set that a message of `EPHEMERIS_NUMBERS` holds; None where it is too short, contradicts itself, or makes no sense.

    `near_ns` is a GPS time within half a week of the message, `epoch_ns` that of the last measurements before it; None: not known. The
    set then counts as transmitted at `epoch_ns`, or as early as it may be used. A set of GLONASS that does not tell its day needs
    `epoch_ns`.
    """
    number = message[0] << 4 | message[1] >> 4
    table = TABLES[number]
    if 8 * len(message) < table.bits:
        return None
    bits = int.from_bytes(message, "big") >> 8 * len(message) - table.bits
    near_ns = near_ns if epoch_ns is None else epoch_ns
    eph = _glonass(table, bits, near_ns, epoch_ns) if number == GLONASS_NUMBER else _kepler(number, table, bits, near_ns, epoch_ns)
    return None if eph is None or eph.implausibility() is not None else eph


def glonass_channel_of(message: bytes) -> tuple[int, int] | None:
    """Slot and channel of a satellite from message 1020; None where it is too short or neither can be."""
    table = TABLES[GLONASS_NUMBER]
    if 8 * len(message) < table.bits:
        return None
    bits = int.from_bytes(message, "big") >> 8 * len(message) - table.bits
    slot, channel = table.integer(bits, "satellite"), table.integer(bits, "channel") - glonass.CHANNEL_LESS
    return (slot, channel) if 1 <= slot <= GLONASS_SLOTS and channel in GLONASS_CHANNELS else None


def week_middle_ns(message: bytes) -> int | None:
    """A GPS time within half a week of the transmission of a message that tells a week and is a set, if no time is known yet."""
    eph = ephemeris_of(message, None, None)
    if not isinstance(eph, KeplerEphemeris):
        return None
    number = message[0] << 4 | message[1] >> 4
    table = TABLES[number]
    bits = int.from_bytes(message, "big") >> 8 * len(message) - table.bits
    return _week(number, table.integer(bits, "week"), None) * WEEK_NS + WEEK_NS // 2


def _week(number: int, sent: int, near_ns: int | None) -> int:
    """GPS week of a week as sent."""
    kind = _KINDS[number]
    first = FIRST_WEEK + (sent + kind.week_0 - FIRST_WEEK) % (kind.weeks_ns // WEEK_NS)
    return first if near_ns is None else nearest_ns(first * WEEK_NS + WEEK_NS // 2, near_ns, kind.weeks_ns) // WEEK_NS


def _toe_ns(week: int, toe_s: int, near_ns: int | None) -> int:
    """Reference time in a week that may be the week before or after it."""
    stated_ns = week * WEEK_NS + toe_s * NS_PER_S
    if near_ns is None or EDGE_S < toe_s < WEEK_S - EDGE_S:
        return stated_ns
    other_ns = stated_ns + (WEEK_NS if toe_s <= EDGE_S else -WEEK_NS)
    return min(stated_ns, other_ns, key=lambda toe_ns: (abs(toe_ns - near_ns), toe_ns))


def _kepler(number: int, table: Layout, bits: int, near_ns: int | None, epoch_ns: int | None) -> KeplerEphemeris | None:
    kind = _KINDS[number]
    raw = {name: table.integer(bits, name) for name, field in table.fields.items() if field.unit is None}
    toe_s, toc_s = raw["toe_s"] * kind.step_s, raw["toc_s"] * kind.step_s
    if not 1 <= raw["satellite"] <= kind.satellites or max(toe_s, toc_s) >= WEEK_S:
        return None
    if "iodc" in raw and raw["iodc"] & 0xFF != raw["issue"]:
        return None
    behind_ns = BDT_BEHIND_GPS_NS if kind.system == "C" else 0
    toe_ns = _toe_ns(_week(number, raw["week"], near_ns), toe_s, near_ns) + behind_ns
    if not FIRST_WEEK <= toe_ns // WEEK_NS <= LAST_WEEK:
        return None
    fit_half_s, satellite = _fit_half_s(kind.system, raw), f"{kind.system}{raw['satellite']:02d}"
    quantities = table.quantities(bits)
    if kind.system == "J" and quantities["group_delay_s"] == lnav.QZSS_NO_GROUP_DELAY_S:
        return None
    return KeplerEphemeris(
        satellite=satellite,
        message=_message(number, satellite),
        issue=raw["issue"],
        healthy=_healthy(kind.system, raw),
        accuracy_m=_accuracy_m(raw),
        transmission_ns=toe_ns - round(fit_half_s * NS_PER_S) if epoch_ns is None else epoch_ns,
        toe_ns=toe_ns,
        toc_ns=nearest_ns(toc_s * NS_PER_S + behind_ns, toe_ns, WEEK_NS),
        fit_half_s=fit_half_s,
        **quantities,
    )


def _message(number: int, satellite: str) -> KeplerMessage:
    match number:
        case 1045:
            return "FNAV"
        case 1046:
            return "INAV"
        case 1042:
            return "D2" if satellite in GEOSTATIONARY else "D1"
    return "LNAV"


def _healthy(system: str, raw: dict[str, int]) -> bool:
    return raw["health"] & ~(lnav.QZSS_OTHER_SIGNAL if system == "J" else 0) == 0 and not raw.get("unsure", 0)


def _accuracy_m(raw: dict[str, int]) -> float | None:
    if "sisa_index" in raw:
        return inav.SISA_M[raw["sisa_index"]] if raw["sisa_index"] < inav.SISA_END else None
    return lnav.URA_UPPER_M[raw["ura_index"]] if raw["ura_index"] != lnav.URA_NO_PROMISE else None


def _fit_half_s(system: str, raw: dict[str, int]) -> float:
    if system in "GJ":
        return (lnav.FIT_HALF_S if system == "G" else lnav.QZSS_FIT_HALF_S)[raw["fit_flag"]]
    return inav.FIT_HALF_S if system == "E" else beidou.FIT_HALF_S


def _glonass(table: Layout, bits: int, near_ns: int | None, epoch_ns: int | None) -> GlonassEphemeris | None:
    raw = {name: table.integer(bits, name) for name, field in table.fields.items() if field.unit is None}
    toe_ns = _glonass_toe_ns(raw, near_ns, epoch_ns)
    if toe_ns is None or not 1 <= raw["satellite"] <= GLONASS_SLOTS:
        return None
    told = GlonassEphemeris.__dataclass_fields__
    return GlonassEphemeris(
        satellite=f"R{raw['satellite']:02d}",
        channel=raw["channel"] - glonass.CHANNEL_LESS,
        issue=raw["t_b"],
        healthy=not (raw["b_n"] or (raw["m"] and raw["l_n"]) or (raw["almanac_health_known"] and not raw["almanac_healthy"])),
        accuracy_m=glonass.ACCURACY_M[raw["f_t"]] if raw["m"] and raw["f_t"] < len(glonass.ACCURACY_M) else None,
        transmission_ns=toe_ns - round(glonass.FIT_HALF_S * NS_PER_S) if epoch_ns is None else epoch_ns,
        toe_ns=toe_ns,
        fit_half_s=glonass.FIT_HALF_S,
        **{name: value for name, value in table.quantities(bits).items() if name in told},
    )


def _glonass_toe_ns(raw: dict[str, int], near_ns: int | None, epoch_ns: int | None) -> int | None:
    """t_b in GPS time: of the day that the satellite tells, or of that nearest to the last measurements; None where no day is known."""
    if near_ns is None or raw["t_b"] >= glonass.QUARTERS_A_DAY:
        return None
    utc_of_day_ns = raw["t_b"] * glonass.QUARTER_S * NS_PER_S - GLONASS_AHEAD_OF_UTC_NS
    if raw["m"] and 1 <= raw["n_t"] <= glonass.DAYS_OF_4_YEARS:
        utc_ns = (glonass.FIRST_DAY + raw["n_t"] - 1) * glonass.DAY_NS + utc_of_day_ns
        return gps_from_utc(nearest_ns(utc_ns, utc_from_gps(near_ns), glonass.DAYS_OF_4_YEARS * glonass.DAY_NS))
    return None if epoch_ns is None else gps_from_utc(nearest_ns(utc_of_day_ns, utc_from_gps(epoch_ns), glonass.DAY_NS))


def encode_ephemeris(eph: KeplerEphemeris | GlonassEphemeris) -> bytes:
    """The message that tells a set; what a set does not hold is zero. ValueError where a value does not fit its field."""
    if isinstance(eph, GlonassEphemeris):
        return _written(GLONASS_NUMBER, _glonass_values(eph))
    number = {"G": 1019, "J": 1044, "C": 1042}.get(eph.satellite[0]) or (1045 if eph.message == "FNAV" else 1046)
    kind, table = _KINDS[number], TABLES[number]
    behind_ns = BDT_BEHIND_GPS_NS if kind.system == "C" else 0
    toe_s, toc_s = ((t_ns - behind_ns) // NS_PER_S for t_ns in (eph.toe_ns, eph.toc_ns))
    raw = {
        "satellite": int(eph.satellite[1:]),
        "week": (toe_s // WEEK_S - kind.week_0) % (kind.weeks_ns // WEEK_NS),
        "toe_s": toe_s % WEEK_S / kind.step_s,
        "toc_s": toc_s % WEEK_S / kind.step_s,
        "issue": eph.issue,
        "iodc": eph.issue,
        "health": 0 if eph.healthy else 1 << table.fields["health"].bits - 1,
        "ura_index": _index_of(eph.accuracy_m, lnav.URA_UPPER_M, lnav.URA_NO_PROMISE),
        "sisa_index": _index_of(eph.accuracy_m, inav.SISA_M, inav.SISA_NO_PROMISE),
        "fit_flag": int(eph.fit_half_s > (lnav.QZSS_FIT_HALF_S if kind.system == "J" else lnav.FIT_HALF_S)[0]),
    }
    quantities = {name: getattr(eph, name) or 0.0 for name, field in table.fields.items() if field.unit is not None}
    return _written(number, {name: value for name, value in raw.items() if name in table.fields} | quantities)


def _index_of(accuracy_m: float | None, bounds_m: tuple[float, ...], no_promise: int) -> int:
    """The first index whose bound is not less than the accuracy."""
    return next((i for i, bound_m in enumerate(bounds_m) if accuracy_m is not None and accuracy_m <= bound_m), no_promise)


def _glonass_values(eph: GlonassEphemeris) -> dict[str, float]:
    moscow_ns = utc_from_gps(eph.toe_ns) + GLONASS_AHEAD_OF_UTC_NS
    fields = TABLES[GLONASS_NUMBER].fields
    return {
        "satellite": int(eph.satellite[1:]),
        "channel": eph.channel + glonass.CHANNEL_LESS,
        "b_n": 0 if eph.healthy else 1,
        "t_b": moscow_ns % glonass.DAY_NS / (glonass.QUARTER_S * NS_PER_S),
        "f_t": _index_of(eph.accuracy_m, glonass.ACCURACY_M, len(glonass.ACCURACY_M)),
        "n_t": (moscow_ns // glonass.DAY_NS - glonass.FIRST_DAY) % glonass.DAYS_OF_4_YEARS + 1,
        "m": 1,
        **{name: getattr(eph, name) for name, field in fields.items() if field.unit is not None and hasattr(eph, name)},
    }


def _written(number: int, values: dict[str, float]) -> bytes:
    table = TABLES[number]
    size = (table.bits + 7) // 8
    return (table.message({"number": number, **values}) << 8 * size - table.bits).to_bytes(size, "big")
