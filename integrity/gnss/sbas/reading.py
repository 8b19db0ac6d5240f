"""From the bits of SBAS messages to what they say. A message that its own rules forbid is refused with a reason.

Source: RTCA DO-229D, A.4.4; the section of each type stands at its layout in `messages`.
"""

from collections.abc import Callable, Iterable

from integrity.gnss.ephemeris.broadcast import GeoEphemeris
from integrity.gnss.gps_time import DAY_S, NS_PER_S, WEEK_S
from integrity.gnss.navigation.bits import Layout, nearest_ns
from integrity.gnss.navigation.lnav import URA_NO_PROMISE, URA_UPPER_M
from integrity.gnss.sbas import messages as m
from integrity.gnss.sbas.contents import (
    Almanac,
    Area,
    Content,
    Covariance,
    Covariances,
    Degradation,
    DoNotUse,
    Fast,
    FastDegradation,
    GeoAlmanac,
    Integrity,
    IonoDelays,
    IonoMask,
    LongTerm,
    Mixed,
    NetworkTime,
    PrnMask,
    Service,
)
from integrity.gnss.sbas.messages import SbasMessage, split, twos_complement

GEO_FIT_HALF_S = 360.0  # time-out of type 9 for NPA, table A-25
LAST_BAND, WIDE_BANDS, IGPS_OF_WIDE_BAND = 10, (9, 10), 192
IGPS_OF_LAST_NARROW_BAND = 200  # band 8; the others have 201. Table A-14


def contents(message: SbasMessage) -> Content | str:
    """What a message says; None where it says nothing (types 62, 63); a reason why it cannot be used."""
    kind = message.kind
    if kind in m.FAST:
        return _fast(message)
    if kind in (m.INTERNAL, m.NULL):
        return None
    reader = _READERS.get(kind)
    return f"type {kind}" if reader is None else reader(message)


def _fast(message: SbasMessage) -> Fast:
    layout, bits = m.FAST_LAYOUT, message.bits
    prc = [m.PRC_M * twos_complement(v, m.PRC_BITS) for v in split(layout.integer(bits, "prc"), m.BLOCK, m.PRC_BITS)]
    udrei = split(layout.integer(bits, "udrei"), m.BLOCK, m.UDREI_BITS)
    first = (message.kind - m.FAST[0]) * m.BLOCK + 1
    return _within(Fast(layout.integer(bits, "iodp"), layout.integer(bits, "iodf"), first, tuple(prc), tuple(udrei)))


def _within(fast: Fast) -> Fast:
    """Without the 52nd place, which type 5 has room for."""
    n = min(len(fast.prc_m), m.MOST_IN_MASK - fast.first + 1)
    return fast._replace(prc_m=fast.prc_m[:n], udrei=fast.udrei[:n])


def _mask(message: SbasMessage) -> PrnMask | str:
    mask = m.MASK_LAYOUT.integer(message.bits, "mask")
    if mask.bit_count() > m.MOST_IN_MASK:
        return "type 1 with more than 51 satellites"
    numbers = tuple(n for n in range(1, m.MASK_NUMBERS + 1) if mask >> m.MASK_NUMBERS - n & 1)
    return PrnMask(m.MASK_LAYOUT.integer(message.bits, "iodp"), numbers)


def _integrity(message: SbasMessage) -> Integrity:
    layout, bits = m.INTEGRITY_LAYOUT, message.bits
    return Integrity(
        tuple(split(layout.integer(bits, "iodf"), 4, 2)), tuple(split(layout.integer(bits, "udrei"), m.MOST_IN_MASK, m.UDREI_BITS))
    )


def _fast_degradation(message: SbasMessage) -> FastDegradation:
    layout, bits = m.FAST_DEGRADATION_LAYOUT, message.bits
    indicators = split(layout.integer(bits, "indicator"), m.MOST_IN_MASK, 4)
    return FastDegradation(layout.integer(bits, "iodp"), float(layout.integer(bits, "t_lat_s")), tuple(indicators))


def _degradation(message: SbasMessage) -> Degradation:
    layout = m.DEGRADATION_LAYOUT
    rss_udre, rss_iono = (bool(layout.integer(message.bits, name)) for name in ("RSS_UDRE", "RSS_iono"))
    return Degradation(**layout.quantities(message.bits), RSS_UDRE=rss_udre, RSS_iono=rss_iono)


def _geo(message: SbasMessage) -> GeoEphemeris | str:
    layout, bits = m.GEO_LAYOUT, message.bits
    ura_index = layout.integer(bits, "ura_index")
    t0_s = 16 * layout.integer(bits, "t0_16s")
    if t0_s >= DAY_S:
        return "type 9 with a time beyond the day"
    ephemeris = GeoEphemeris(
        satellite=f"S{message.prn - 100:02d}",
        issue=layout.integer(bits, "reserved"),
        healthy=ura_index != URA_NO_PROMISE,
        accuracy_m=None if ura_index == URA_NO_PROMISE else URA_UPPER_M[ura_index],
        transmission_ns=message.sent_ns,
        toe_ns=_time_of_day_ns(t0_s, message.sent_ns),
        fit_half_s=GEO_FIT_HALF_S,
        **layout.quantities(bits),
    )
    return "type 9 that is no orbit" if ephemeris.implausibility() else ephemeris


def _time_of_day_ns(time_of_day_s: int, sent_ns: int) -> int:
    """The GPS time nearest to `sent_ns` that has this time of day: days change between a message and the time that it names."""
    return nearest_ns(time_of_day_s * NS_PER_S, sent_ns, DAY_S * NS_PER_S)


def _time(message: SbasMessage) -> NetworkTime | str:
    layout, bits = m.TIME_LAYOUT, message.bits
    values = layout.quantities(bits)
    tow_s = layout.integer(bits, "tow_s")
    t0t_s = 4096.0 * layout.integer(bits, "t0t_4096s")
    whole = {name: layout.integer(bits, name) for name in ("week_8bit", "leap_week", "day", "utc_standard", "week")}
    if max(tow_s, t0t_s) >= WEEK_S or whole["day"] > 7:
        return "type 12 with a time beyond the week"
    return NetworkTime(**values, **whole, t0t_s=t0t_s, tow_s=tow_s, glonass=bool(layout.integer(bits, "glonass")))  # type: ignore[arg-type]


def _almanac(message: SbasMessage) -> Almanac | str:
    t0_s = 64 * m.ALMANAC_LAYOUT.integer(message.bits, "t0_64s")
    if t0_s >= DAY_S:
        return "type 17 with a time beyond the day"
    t0_ns = _time_of_day_ns(t0_s, message.sent_ns)
    layout = m.ALMANAC_OF_ONE
    found = []
    for bits in split(m.ALMANAC_LAYOUT.integer(message.bits, "satellites"), 3, layout.bits):
        prn = layout.integer(bits, "prn")
        if m.FIRST_PRN <= prn <= m.LAST_PRN:  # 0: no satellite
            x, y, z, vx, vy, vz = layout.quantities(bits).values()
            found.append(GeoAlmanac(prn, layout.integer(bits, "health"), t0_ns, (x, y, z), (vx, vy, vz)))
    return Almanac(tuple(found))


def _mixed(message: SbasMessage) -> Mixed | str:
    layout, bits = m.MIXED_LAYOUT, message.bits
    prc = [m.PRC_M * twos_complement(v, m.PRC_BITS) for v in split(layout.integer(bits, "prc"), m.HALF_BLOCK, m.PRC_BITS)]
    udrei = split(layout.integer(bits, "udrei"), m.HALF_BLOCK, m.UDREI_BITS)
    first = layout.integer(bits, "block") * m.BLOCK + 1
    fast = Fast(layout.integer(bits, "iodp"), layout.integer(bits, "iodf"), first, tuple(prc), tuple(udrei))
    return _with_halves(fast, (layout.integer(bits, "half"),), message.sent_ns)


def _long_term(message: SbasMessage) -> Mixed | str:
    halves = (m.LONG_TERM_LAYOUT.integer(message.bits, name) for name in ("half_1", "half_2"))
    return _with_halves(None, halves, message.sent_ns)


def _with_halves(fast: Fast | None, halves: Iterable[int], sent_ns: int) -> Mixed | str:
    found: list[LongTerm] = []
    for half in halves:
        if not m.STILL_LAYOUT.integer(half, "velocity_code"):
            found += _standing(half, sent_ns)
            continue
        t0_s = 16 * m.MOVING_LAYOUT.integer(half, "t0_16s")
        if t0_s >= DAY_S:
            return "long-term corrections with a time beyond the day"
        iodp = m.MOVING_LAYOUT.integer(half, "iodp")
        found.append(_one(m.MOVING_LAYOUT, half, iodp, 1, _time_of_day_ns(t0_s, sent_ns)))
    return Mixed(fast, tuple(one for one in found if 1 <= one.place <= m.MOST_IN_MASK))  # place 0: no satellite


def _standing(half: int, sent_ns: int) -> list[LongTerm]:
    """The two satellites of a half without velocities."""
    iodp, both = (m.STILL_LAYOUT.integer(half, name) for name in ("iodp", "satellites"))
    return [_one(m.STILL_OF_ONE, bits, iodp, 0, sent_ns) for bits in split(both, 2, m.STILL_OF_ONE.bits)]


def _one(layout: Layout, bits: int, iodp: int, velocity_code: int, t0_ns: int) -> LongTerm:
    q = layout.quantities(bits)
    return LongTerm(
        iodp=iodp,
        place=layout.integer(bits, "number"),
        iod=layout.integer(bits, "iod"),
        velocity_code=velocity_code,
        d_pos_ecef_m=(q["dx_m"], q["dy_m"], q["dz_m"]),
        d_vel_ecef_mps=(q.get("dvx_mps", 0.0), q.get("dvy_mps", 0.0), q.get("dvz_mps", 0.0)),
        daf0_s=q["daf0_s"],
        daf1=q.get("daf1", 0.0),
        t0_ns=t0_ns,
    )


def igps_of_band(band: int) -> int:
    """How many grid points a band has. Table A-14."""
    return IGPS_OF_WIDE_BAND if band in WIDE_BANDS else IGPS_OF_LAST_NARROW_BAND if band == 8 else m.IGPS_OF_BAND


def _iono_mask(message: SbasMessage) -> IonoMask | str:
    layout, bits = m.IONO_MASK_LAYOUT, message.bits
    band, bands, iodi = (layout.integer(bits, name) for name in ("band", "bands", "iodi"))
    if band > LAST_BAND or bands > LAST_BAND + 1:
        return "type 18 with a band beyond 10"
    mask = layout.integer(bits, "mask")
    igps = tuple(n for n in range(1, m.IGPS_OF_BAND + 1) if mask >> m.IGPS_OF_BAND - n & 1)
    if igps and igps[-1] > igps_of_band(band):
        return "type 18 with a grid point that its band does not have"
    return IonoMask(iodi, bands, band, igps)


def _iono_delays(message: SbasMessage) -> IonoDelays | str:
    layout, bits = m.IONO_DELAY_LAYOUT, message.bits
    band, block, iodi = (layout.integer(bits, name) for name in ("band", "block", "iodi"))
    if band > LAST_BAND or block * m.IGPS_OF_BLOCK >= igps_of_band(band):
        return "type 26 with a band or block that does not exist"
    both = split(layout.integer(bits, "igps"), m.IGPS_OF_BLOCK, m.IGP_BITS)
    steps = [igp >> m.GIVEI_BITS for igp in both]
    delays = tuple(None if step == 0x1FF else m.IGP_DELAY_M * step for step in steps)
    return IonoDelays(iodi, band, block, delays, tuple(igp & 0xF for igp in both))


def _service(message: SbasMessage) -> Service | str:
    layout, bits = m.SERVICE_LAYOUT, message.bits
    iods, last, number, regions, priority, inside, outside = (
        layout.integer(bits, name) for name in layout.fields if name not in _NOT_COUNTED
    )
    if number > last or regions > 5:
        return "type 27 that counts wrong"
    areas = []
    for one in split(layout.integer(bits, "areas"), 5, m.AREA_OF_ONE.bits)[:regions]:
        lat1, lon1, lat2, lon2 = m.AREA_OF_ONE.quantities(one).values()
        if max(abs(lat1), abs(lat2)) > 90.0 or max(abs(lon1), abs(lon2)) > 180.0:
            return "type 27 with a place that is not on Earth"
        areas.append(Area(lat1, lon1, lat2, lon2, bool(m.AREA_OF_ONE.integer(one, "square"))))
    return Service(iods, last + 1, number + 1, priority, inside, outside, tuple(areas))


_NOT_COUNTED = ("preamble", "kind", "areas")


def _covariance(message: SbasMessage) -> Covariances:
    iodp = m.COVARIANCE_LAYOUT.integer(message.bits, "iodp")
    layout = m.COVARIANCE_OF_ONE
    found = []
    for bits in split(m.COVARIANCE_LAYOUT.integer(message.bits, "satellites"), 2, layout.bits):
        place = layout.integer(bits, "number")
        if 1 <= place <= m.MOST_IN_MASK:
            scale = 2.0 ** (layout.integer(bits, "scale_exponent") - 5)
            R = (layout.integer(bits, name) * scale for name in ("E11", "E12", "E13", "E14", "E22", "E23", "E24", "E33", "E34", "E44"))
            found.append(Covariance(iodp, place, scale, tuple(R)))
    return Covariances(tuple(found))


def _test(message: SbasMessage) -> DoNotUse:
    return DoNotUse(message.bits & (1 << m.TYPE_AT) - 1 == 0)


_READERS: dict[int, Callable[[SbasMessage], Content | str]] = {
    m.TEST: _test,
    m.MASK: _mask,
    m.INTEGRITY: _integrity,
    m.FAST_DEGRADATION: _fast_degradation,
    m.GEO: _geo,
    m.DEGRADATION: _degradation,
    m.TIME: _time,
    m.ALMANAC: _almanac,
    m.IONO_MASK: _iono_mask,
    m.MIXED: _mixed,
    m.LONG_TERM: _long_term,
    m.IONO_DELAY: _iono_delays,
    m.SERVICE: _service,
    m.COVARIANCE: _covariance,
}
