"""SBAS messages as a satellite would send them, written with the tables that read them."""

from collections.abc import Iterable, Mapping, Sequence

from integrity.gnss.gps_time import NS_PER_S, gps_from_calendar
from integrity.gnss.navigation.bits import Layout
from integrity.gnss.sbas import messages as m
from integrity.gnss.sbas.messages import SbasMessage, joined

PRN = 137
T0_NS = gps_from_calendar(2025, 2, 15, 17, 0, 0)
SITE = (-3962108.7, 3381309.6, 3668678.7)  # Kamakura

# Type 10 with a number of its own in every field.
DEGRADATION = {
    "B_rrc": 0.054,
    "C_ltc_lsb": 0.004,
    "C_ltc_v1": 0.0025,
    "I_ltc_v1": 120.0,
    "C_ltc_v0": 0.05,
    "I_ltc_v0": 60.0,
    "C_geo_lsb": 0.125,
    "C_geo_v": 0.0125,
    "I_geo": 130.0,
    "C_er": 31.5,
    "C_iono_step": 0.3,
    "I_iono": 300.0,
    "C_iono_ramp": 0.0005,
    "C_covariance": 12.7,
    "RSS_UDRE": 0,
    "RSS_iono": 1,
}
GEO = {"t0_16s": 3824, "ura_index": 3, "x_m": -34_173_000.0, "y_m": 24_694_000.0, "z_m": 4_000.0}


def at(second: float, bits: int, prn: int = PRN) -> SbasMessage:
    """A message whose first bit is sent so many seconds after T0_NS."""
    return SbasMessage(prn, T0_NS + round(second * NS_PER_S), bits)


def message(layout: Layout, kind: int, values: Mapping[str, float]) -> int:
    return layout.message({"preamble": m.PREAMBLES[0], "kind": kind, **values})


def mask(numbers: Iterable[int], iodp: int = 0) -> int:
    return message(m.MASK_LAYOUT, 1, {"mask": sum(1 << m.MASK_NUMBERS - n for n in numbers), "iodp": iodp})


def fast(steps: Sequence[int], udrei: Sequence[int], *, kind: int = 2, iodf: int = 0, iodp: int = 0) -> int:
    """Types 0 and 2 to 5; corrections in eighths of a metre, zeros and "not monitored" where none are given."""
    prc = [*steps, *[0] * (13 - len(steps))]
    indicators = [*udrei, *[14] * (13 - len(udrei))]
    return message(m.FAST_LAYOUT, kind, {"iodf": iodf, "iodp": iodp, "prc": joined(prc, 12), "udrei": joined(indicators, 4)})


def integrity(udrei: Sequence[int], iodf: Sequence[int] = (0, 0, 0, 0)) -> int:
    return message(m.INTEGRITY_LAYOUT, 6, {"iodf": joined(iodf, 2), "udrei": joined([*udrei, *[14] * (51 - len(udrei))], 4)})


def factors(indicator: int, *, t_lat_s: int = 0, iodp: int = 0) -> int:
    """Type 7, the same for all satellites."""
    return message(m.FAST_DEGRADATION_LAYOUT, 7, {"t_lat_s": t_lat_s, "iodp": iodp, "indicator": joined([indicator] * 51, 4)})


def degradation(**values: float) -> int:
    return message(m.DEGRADATION_LAYOUT, 10, DEGRADATION | values)


def geo(**values: float) -> int:
    return message(m.GEO_LAYOUT, 9, GEO | values)


def still(number: int, iod: int, **values: float) -> int:
    """Type 25 with one satellite, velocity code 0."""
    one = m.STILL_OF_ONE.message({"number": number, "iod": iod, **values})
    half = m.STILL_LAYOUT.message({"velocity_code": 0, "satellites": one << m.STILL_OF_ONE.bits, "iodp": 0})
    return message(m.LONG_TERM_LAYOUT, 25, {"half_1": half})


def moving(number: int, iod: int, t0_16s: int, **values: float) -> int:
    """Type 25 with one satellite, velocity code 1."""
    half = m.MOVING_LAYOUT.message({"velocity_code": 1, "number": number, "iod": iod, "t0_16s": t0_16s, "iodp": 0, **values})
    return message(m.LONG_TERM_LAYOUT, 25, {"half_1": half})


def mixed(steps: Sequence[int], udrei: Sequence[int], *, block: int, iodf: int, half: int) -> int:
    """Type 24."""
    fields = {"prc": joined(steps, 12), "udrei": joined(udrei, 4), "iodp": 0, "block": block, "iodf": iodf, "half": half}
    return message(m.MIXED_LAYOUT, 24, fields)


def iono_mask(band: int, igps: Iterable[int], *, bands: int = 1, iodi: int = 0) -> int:
    ones = sum(1 << m.IGPS_OF_BAND - n for n in igps)
    return message(m.IONO_MASK_LAYOUT, 18, {"bands": bands, "band": band, "iodi": iodi, "mask": ones})


def iono_delays(band: int, block: int, igps: Sequence[tuple[int, int]], *, iodi: int = 0) -> int:
    """Type 26; pairs of a delay in eighths of a metre and GIVEI, "not monitored" where none are given."""
    both = [delay << 4 | givei for delay, givei in [*igps, *[(0, 15)] * (15 - len(igps))]]
    return message(m.IONO_DELAY_LAYOUT, 26, {"band": band, "block": block, "iodi": iodi, "igps": joined(both, 13)})


def service(inside: int, outside: int, areas: Sequence[tuple[int, int, int, int, int]], **values: float) -> int:
    """Type 27: areas of two latitudes and longitudes in the order of the message, and 1 for a square."""
    written = [
        m.AREA_OF_ONE.message(dict(zip(("lat1_deg", "lon1_deg", "lat2_deg", "lon2_deg", "square"), area, strict=True))) for area in areas
    ]
    fields = {"regions": len(areas), "inside": inside, "outside": outside, "areas": joined([*written, *[0] * (5 - len(areas))], 35)}
    return message(m.SERVICE_LAYOUT, 27, fields | values)


def covariance(number: int, scale_exponent: int, **elements: float) -> int:
    """Type 28 with one satellite."""
    one = m.COVARIANCE_OF_ONE.message({"number": number, "scale_exponent": scale_exponent, **elements})
    return message(m.COVARIANCE_LAYOUT, 28, {"iodp": 0, "satellites": one << m.COVARIANCE_OF_ONE.bits})
