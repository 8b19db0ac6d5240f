"""How RTCM 3 ephemerides are laid out: 1019 (GPS), 1020 (GLONASS), 1042 (BeiDou), 1044 (QZSS), 1045 and 1046 (Galileo F/NAV, I/NAV).

Numbers and units are those of the satellites' own messages; only their order is RTCM's. GLONASS numbers have a sign and a magnitude.
Source: RTCM 10403.3, contents of these messages (1019: table 3.5-21); data fields DF071 to DF137, DF252 to DF317, DF429 to DF457,
DF488 to DF515.
"""

from integrity.gnss.navigation.bits import SEMICIRCLE_RAD, Field, Layout, in_order, plain, sign_and_magnitude, signed

_ANGLE, _ANGLE_RATE = SEMICIRCLE_RAD * 2.0**-31, SEMICIRCLE_RAD * 2.0**-43

_Named = tuple[str, Field]


def _orbit(toe: _Named, harmonic: Field, radius: Field) -> tuple[_Named, ...]:
    """What stands from Crs to the rate of the node in all messages of Kepler elements."""
    return (
        ("crs", radius),
        ("delta_n", signed(16, _ANGLE_RATE)),
        ("m0", signed(32, _ANGLE)),
        ("cuc", harmonic),
        ("e", plain(32, 2.0**-33)),
        ("cus", harmonic),
        ("sqrt_a", plain(32, 2.0**-19)),
        toe,
        ("cic", harmonic),
        ("omega0", signed(32, _ANGLE)),
        ("cis", harmonic),
        ("i0", signed(32, _ANGLE)),
        ("crc", radius),
        ("omega", signed(32, _ANGLE)),
        ("omega_dot", signed(24, _ANGLE_RATE)),
    )


_NUMBER: _Named = ("number", plain(12))
_I_DOT: _Named = ("i_dot", signed(14, _ANGLE_RATE))
_GPS_CLOCK: tuple[_Named, ...] = (
    ("toc_s", plain(16)),
    ("af2", signed(8, 2.0**-55)),
    ("af1", signed(16, 2.0**-43)),
    ("af0", signed(22, 2.0**-31)),
)
_GPS_ORBIT = _orbit(("toe_s", plain(16)), signed(16, 2.0**-29), signed(16, 2.0**-5))
GPS_1019 = in_order(
    _NUMBER,
    ("satellite", plain(6)),
    ("week", plain(10)),
    ("ura_index", plain(4)),
    ("code_on_l2", plain(2)),
    _I_DOT,
    ("issue", plain(8)),
    *_GPS_CLOCK,
    ("iodc", plain(10)),
    *_GPS_ORBIT,
    ("group_delay_s", signed(8, 2.0**-31)),
    ("health", plain(6)),
    ("l2_p_flag", plain(1)),
    ("fit_flag", plain(1)),
)
QZSS_1044 = in_order(
    _NUMBER,
    ("satellite", plain(4)),
    *_GPS_CLOCK,
    ("issue", plain(8)),
    *_GPS_ORBIT,
    _I_DOT,
    ("code_on_l2", plain(2)),
    ("week", plain(10)),
    ("ura_index", plain(4)),
    ("health", plain(6)),
    ("group_delay_s", signed(8, 2.0**-31)),
    ("iodc", plain(10)),
    ("fit_flag", plain(1)),
)
_GALILEO: tuple[_Named, ...] = (
    _NUMBER,
    ("satellite", plain(6)),
    ("week", plain(12)),
    ("issue", plain(10)),
    ("sisa_index", plain(8)),
    _I_DOT,
    ("toc_s", plain(14)),
    ("af2", signed(6, 2.0**-59)),
    ("af1", signed(21, 2.0**-46)),
    ("af0", signed(31, 2.0**-34)),
    *_orbit(("toe_s", plain(14)), signed(16, 2.0**-29), signed(16, 2.0**-5)),
)
GALILEO_1045 = in_order(
    *_GALILEO,
    ("group_delay_s", signed(10, 2.0**-32)),  # BGD(E1,E5a)
    ("health", plain(2)),  # of E5a
    ("unsure", plain(1)),
    ("reserved", plain(7)),
)
GALILEO_1046 = in_order(
    *_GALILEO,
    ("group_delay_2_s", signed(10, 2.0**-32)),  # BGD(E1,E5a)
    ("group_delay_s", signed(10, 2.0**-32)),  # BGD(E1,E5b)
    ("e5b_health", plain(2)),
    ("e5b_unsure", plain(1)),
    ("health", plain(2)),  # of E1-B
    ("unsure", plain(1)),
    ("reserved", plain(2)),
)
BEIDOU_1042 = in_order(
    _NUMBER,
    ("satellite", plain(6)),
    ("week", plain(13)),
    ("ura_index", plain(4)),
    _I_DOT,
    ("issue", plain(5)),  # AODE
    ("toc_s", plain(17)),
    ("af2", signed(11, 2.0**-66)),
    ("af1", signed(22, 2.0**-50)),
    ("af0", signed(24, 2.0**-33)),
    ("aodc", plain(5)),
    *_orbit(("toe_s", plain(17)), signed(18, 2.0**-31), signed(18, 2.0**-6)),
    ("group_delay_s", signed(10, 1e-10)),
    ("group_delay_2_s", signed(10, 1e-10)),
    ("health", plain(1)),
)


GLONASS_1020 = in_order(
    _NUMBER,
    ("satellite", plain(6)),
    ("channel", plain(5)),  # from -7 on
    ("almanac_healthy", plain(1)),  # C_n
    ("almanac_health_known", plain(1)),
    ("p1", plain(2)),
    ("t_k", plain(12)),
    ("b_n", plain(1)),  # its first bit: unhealthy
    ("p2", plain(1)),
    ("t_b", plain(7)),  # quarters of an hour of the Moscow day
    ("vx_mps", sign_and_magnitude(24, 1000.0 * 2.0**-20)),
    ("x_m", sign_and_magnitude(27, 1000.0 * 2.0**-11)),
    ("ax_mps2", sign_and_magnitude(5, 1000.0 * 2.0**-30)),
    ("vy_mps", sign_and_magnitude(24, 1000.0 * 2.0**-20)),
    ("y_m", sign_and_magnitude(27, 1000.0 * 2.0**-11)),
    ("ay_mps2", sign_and_magnitude(5, 1000.0 * 2.0**-30)),
    ("vz_mps", sign_and_magnitude(24, 1000.0 * 2.0**-20)),
    ("z_m", sign_and_magnitude(27, 1000.0 * 2.0**-11)),
    ("az_mps2", sign_and_magnitude(5, 1000.0 * 2.0**-30)),
    ("p3", plain(1)),
    ("gamma_n", sign_and_magnitude(11, 2.0**-40)),
    ("p", plain(2)),
    ("l_n", plain(1)),  # of the third string: unhealthy
    ("tau_n_s", sign_and_magnitude(22, 2.0**-30)),
    ("delta_tau_n_s", sign_and_magnitude(5, 2.0**-30)),
    ("e_n", plain(5)),
    ("p4", plain(1)),
    ("f_t", plain(4)),
    ("n_t", plain(11)),  # day, from 1, of the four years that begin with a leap year
    ("m", plain(2)),  # 1: GLONASS-M, which alone tells f_t, n_t, l_n and the like
    ("more_known", plain(1)),  # whether what follows is told
    ("n_a", plain(11)),
    ("tau_c_s", sign_and_magnitude(32, 2.0**-31)),
    ("n_4", plain(5)),
    ("tau_gps", sign_and_magnitude(22, 2.0**-30)),
    ("l_n_of_fifth", plain(1)),
    ("reserved", plain(7)),
)
TABLES: dict[int, Layout] = {
    1019: GPS_1019,
    1020: GLONASS_1020,
    1042: BEIDOU_1042,
    1044: QZSS_1044,
    1045: GALILEO_1045,
    1046: GALILEO_1046,
}
EPHEMERIS_NUMBERS = frozenset(TABLES)
