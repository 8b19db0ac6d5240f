"""What a set says of orbit and clock as one number, so that two receivers far from each other can tell whether they hold the same set."""

import struct
from functools import lru_cache
from zlib import crc32

from integrity.gnss.ephemeris.broadcast import Ephemeris, GeoEphemeris, GlonassEphemeris, KeplerEphemeris

_STATE = ("x_m", "y_m", "z_m", "vx_mps", "vy_mps", "vz_mps", "ax_mps2", "ay_mps2", "az_mps2")
# In this order, each as an IEEE 754 double, big-endian: the numbers as they were sent, times their power of two and, of angles, times pi.
KEPLER = (
    *("sqrt_a", "e", "i0", "omega0", "omega", "m0", "delta_n", "i_dot", "omega_dot"),
    *("cuc", "cus", "crc", "crs", "cic", "cis", "af0", "af1", "af2", "group_delay_s", "group_delay_2_s"),
)
PARAMETERS: dict[type[Ephemeris], tuple[str, ...]] = {
    KeplerEphemeris: KEPLER,
    GlonassEphemeris: (*_STATE, "tau_n_s", "gamma_n", "delta_tau_n_s"),
    GeoEphemeris: (*_STATE, "af0", "af1"),
}


@lru_cache(maxsize=1024)
def content_crc32(eph: Ephemeris) -> int:
    """CRC-32 (ISO 3309) of satellite, message, issue, reference times and parameters; what is not sent is left out.

    Without the time of transmission, health and accuracy: the same set is sent many times, and these may change on the way.
    """
    head, times_ns = eph.satellite, [eph.toe_ns]
    if isinstance(eph, KeplerEphemeris):
        head, times_ns = head + eph.message, [*times_ns, eph.toc_ns]
    sent = [value for name in PARAMETERS[type(eph)] if (value := getattr(eph, name)) is not None]
    return crc32(head.encode("ascii") + struct.pack(f">H{len(times_ns)}q{len(sent)}d", eph.issue, *times_ns, *sent))
