"""Ephemerides of RTCM 3: what is refused, which week and day a set is of, what counts as healthy. Numbers and units: tests/crosscheck."""

from dataclasses import replace

import pytest

from integrity.gnss.ephemeris.broadcast import Ephemeris, GlonassEphemeris, KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS, WEEK_S, parse_utc
from integrity.gnss.rtcm.navigation import encode_ephemeris, ephemeris_of, glonass_channel_of, week_middle_ns
from integrity.gnss.rtcm.navigation_tables import TABLES
from tests.unit.gnss.rtcm.sets import GLONASS, GPS, TOE_NS

HOUR_NS = 3600 * NS_PER_S
GALILEO = replace(GPS, satellite="E11", message="INAV", accuracy_m=3.12, fit_half_s=14_400.0, sqrt_a=5440.625, group_delay_2_s=1e-9)
BEIDOU = replace(
    GPS, satellite="C12", message="D1", issue=3, toe_ns=TOE_NS + 14 * NS_PER_S, toc_ns=TOE_NS + 14 * NS_PER_S, group_delay_2_s=1e-9
)
KEPLER = {
    1019: GPS,
    1042: BEIDOU,
    1044: replace(GPS, satellite="J02", fit_half_s=5400.0, sqrt_a=6493.0, e=0.075),
    1045: replace(GALILEO, message="FNAV", group_delay_2_s=None),
    1046: GALILEO,
}


def changed(message: bytes, number: int, **values: int) -> bytes:
    """The message with other numbers in some of its fields."""
    table = TABLES[number]
    spare = 8 * len(message) - table.bits
    bits = int.from_bytes(message, "big") >> spare & ~table.mask(*values)
    for name, value in values.items():
        (part,) = table.fields[name].parts
        bits |= value << table.bits - part.first - part.bits
    return (bits << spare).to_bytes(len(message), "big")


def read(message: bytes, near_ns: int = TOE_NS) -> Ephemeris:
    found = ephemeris_of(message, near_ns, near_ns)
    assert found is not None
    return found


@pytest.mark.parametrize("number", KEPLER)
def test_what_was_read_is_written_to_the_bit(number: int) -> None:
    message = encode_ephemeris(KEPLER[number])
    found = read(message)
    assert isinstance(found, KeplerEphemeris)
    assert encode_ephemeris(found) == message
    assert replace(found, **{name: getattr(KEPLER[number], name) for name in QUANTITIES}) == KEPLER[number]


QUANTITIES = [name for name, field in TABLES[1046].fields.items() if field.unit is not None]


def test_what_was_read_of_glonass_is_written_to_the_bit() -> None:
    message = encode_ephemeris(GLONASS)
    found = read(message, GLONASS.toe_ns)
    assert isinstance(found, GlonassEphemeris)
    assert encode_ephemeris(found) == message
    assert found.toe_ns == GLONASS.toe_ns


@pytest.mark.parametrize(("satellite", "message"), [("C05", "D2"), ("C06", "D1"), ("C58", "D1"), ("C59", "D2")])
def test_which_message_beidou_satellites_send(satellite: str, message: str) -> None:
    found = read(encode_ephemeris(replace(BEIDOU, satellite=satellite)))
    assert isinstance(found, KeplerEphemeris)
    assert found.message == message


@pytest.mark.parametrize(
    ("number", "values", "healthy"),
    [
        (1019, {"health": 1}, False),
        (1019, {"health": 32}, False),
        (1042, {"health": 1}, False),
        (1044, {"health": 1}, True),  # L1C/B, which most satellites do not send
        (1044, {"health": 2}, False),
        (1044, {"health": 32}, False),
        (1045, {"health": 1}, False),
        (1045, {"unsure": 1}, False),
        (1046, {"health": 1}, False),
        (1046, {"unsure": 1}, False),
        (1046, {"e5b_health": 1}, True),
    ],
)
def test_healthy(number: int, values: dict[str, int], healthy: bool) -> None:
    assert read(changed(encode_ephemeris(KEPLER[number]), number, **values)).healthy == healthy


@pytest.mark.parametrize(
    ("values", "healthy"),
    [
        ({"b_n": 1}, False),
        ({"l_n": 1}, False),
        ({"l_n": 1, "m": 0}, True),  # only GLONASS-M tells it
        ({"almanac_health_known": 1}, False),
        ({"almanac_health_known": 1, "almanac_healthy": 1}, True),
    ],
)
def test_healthy_glonass(values: dict[str, int], healthy: bool) -> None:
    assert read(changed(encode_ephemeris(GLONASS), 1020, **values), GLONASS.toe_ns).healthy == healthy


@pytest.mark.parametrize(
    ("number", "values", "accuracy_m"),
    [
        (1019, {"ura_index": 14}, 6144.0),
        (1019, {"ura_index": 15}, None),
        (1042, {"ura_index": 0}, 2.4),
        (1046, {"sisa_index": 125}, 6.0),
        (1046, {"sisa_index": 126}, None),
        (1045, {"sisa_index": 255}, None),
    ],
)
def test_accuracy(number: int, values: dict[str, int], accuracy_m: float | None) -> None:
    assert read(changed(encode_ephemeris(KEPLER[number]), number, **values)).accuracy_m == accuracy_m


@pytest.mark.parametrize(("values", "accuracy_m"), [({"f_t": 14}, 512.0), ({"f_t": 15}, None), ({"f_t": 3, "m": 0}, None)])
def test_accuracy_of_glonass(values: dict[str, int], accuracy_m: float | None) -> None:
    assert read(changed(encode_ephemeris(GLONASS), 1020, **values), GLONASS.toe_ns).accuracy_m == accuracy_m


@pytest.mark.parametrize(("number", "flag", "fit_half_s"), [(1019, 0, 7200.0), (1019, 1, 10_800.0), (1044, 0, 5400.0), (1044, 1, 7200.0)])
def test_fit_interval(number: int, flag: int, fit_half_s: float) -> None:
    assert read(changed(encode_ephemeris(KEPLER[number]), number, fit_flag=flag)).fit_half_s == fit_half_s


@pytest.mark.parametrize(
    ("number", "values"),
    [
        (1019, {"satellite": 0}),
        (1019, {"satellite": 33}),
        (1019, {"toe_s": WEEK_S // 16}),
        (1019, {"toc_s": 65_535}),
        (1019, {"iodc": 78}),  # not of this issue
        (1019, {"sqrt_a": 0}),
        (1044, {"satellite": 11}),
        (1044, {"group_delay_s": 0x80}),  # not known
        (1045, {"satellite": 37}),
        (1046, {"toe_s": WEEK_S // 60}),
        (1042, {"satellite": 0}),
    ],
)
def test_what_makes_no_sense_is_refused(number: int, values: dict[str, int]) -> None:
    assert ephemeris_of(changed(encode_ephemeris(KEPLER[number]), number, **values), TOE_NS, TOE_NS) is None


def test_a_clock_time_behind_the_end_of_the_week_is_refused() -> None:
    at_the_end = replace(GPS, toe_ns=2311 * WEEK_NS - 16 * NS_PER_S, toc_ns=2311 * WEEK_NS - 16 * NS_PER_S)
    behind = changed(encode_ephemeris(at_the_end), 1019, toc_s=WEEK_S // 16)
    assert ephemeris_of(behind, at_the_end.toe_ns, at_the_end.toe_ns) is None


@pytest.mark.parametrize("values", [{"satellite": 0}, {"satellite": 25}, {"channel": 14}, {"t_b": 96}, {"x_m": 0}])
def test_what_makes_no_sense_of_glonass_is_refused(values: dict[str, int]) -> None:
    assert ephemeris_of(changed(encode_ephemeris(GLONASS), 1020, **values), GLONASS.toe_ns, GLONASS.toe_ns) is None


@pytest.mark.parametrize("number", [*KEPLER, 1020])
def test_a_message_cut_short_is_refused(number: int) -> None:
    message = encode_ephemeris(GLONASS if number == 1020 else KEPLER[number])
    assert ephemeris_of(message[:-1], TOE_NS, TOE_NS) is None


@pytest.mark.parametrize("number", KEPLER)
@pytest.mark.parametrize("toe_s", [0, 43_200, 302_400, 561_600, 604_320])
@pytest.mark.parametrize("behind_s", [-7000, -20, 0, 20, 7000])
def test_weeks_around_the_reference_time(behind_s: int, toe_s: int, number: int) -> None:
    """The week as sent is that of the transmission, or, as some senders have it, that of the reference time: no difference."""
    eph = KEPLER[number]
    offset_ns = eph.toe_ns - TOE_NS  # of BDT
    toe_ns = 2310 * WEEK_NS + toe_s * NS_PER_S + offset_ns
    now_ns = toe_ns - behind_s * NS_PER_S
    of_toe = encode_ephemeris(replace(eph, toe_ns=toe_ns, toc_ns=toe_ns))
    sent = TABLES[number].integer(int.from_bytes(of_toe, "big") >> 8 * len(of_toe) - TABLES[number].bits, "week")
    shift = (now_ns - offset_ns) // WEEK_NS - 2310
    of_transmission = changed(of_toe, number, week=sent + shift)
    assert [read(message, now_ns).toe_ns for message in (of_toe, of_transmission)] == [toe_ns, toe_ns]


@pytest.mark.parametrize("number", KEPLER)
@pytest.mark.parametrize("weeks", [-1, 1, 2])
def test_a_set_of_another_week_is_not_one_of_this_week(weeks: int, number: int) -> None:
    found = read(encode_ephemeris(KEPLER[number]), TOE_NS + weeks * WEEK_NS)
    assert found.toe_ns == KEPLER[number].toe_ns


@pytest.mark.parametrize("week", [1700, 2047, 2048, 2310, 2723])
@pytest.mark.parametrize("number", KEPLER)
def test_the_week_alone_tells_the_time(number: int, week: int) -> None:
    shift_ns = (week - 2310) * WEEK_NS
    eph = replace(KEPLER[number], toe_ns=KEPLER[number].toe_ns + shift_ns, toc_ns=KEPLER[number].toc_ns + shift_ns)
    message = encode_ephemeris(eph)
    assert week_middle_ns(message) == week * WEEK_NS + WEEK_NS // 2
    found = ephemeris_of(message, None, None)
    assert found is not None
    assert found.toe_ns == eph.toe_ns


@pytest.mark.parametrize("away_ns", [-11 * HOUR_NS, -600 * NS_PER_S, 0, 600 * NS_PER_S, 11 * HOUR_NS])
@pytest.mark.parametrize(
    "toe_utc", ["2024-02-29T21:15:00Z", "2024-12-31T20:45:00Z", "2025-01-01T12:15:00Z", "2016-12-31T23:45:00Z", "2027-12-31T20:45:00Z"]
)
def test_days_of_glonass_told_and_not(toe_utc: str, away_ns: int) -> None:
    """Moscow's day begins at 21:00 UTC; a leap second ended 2016."""
    eph = replace(GLONASS, toe_ns=parse_utc(toe_utc))
    told = encode_ephemeris(eph)
    untold = changed(told, 1020, n_t=0)
    now_ns = eph.toe_ns + away_ns
    assert [read(message, now_ns).toe_ns for message in (told, untold)] == [eph.toe_ns, eph.toe_ns]


def test_a_glonass_set_of_yesterday_is_one_of_yesterday() -> None:
    assert read(encode_ephemeris(GLONASS), GLONASS.toe_ns + 24 * HOUR_NS).toe_ns == GLONASS.toe_ns


def test_glonass_needs_to_know_the_day() -> None:
    told = encode_ephemeris(GLONASS)
    untold = changed(told, 1020, n_t=0)
    near_ns = GLONASS.toe_ns + 70 * HOUR_NS
    found = [ephemeris_of(message, near_ns, None) for message in (told, untold)]
    assert [None if eph is None else eph.toe_ns for eph in found] == [GLONASS.toe_ns, None]


def test_the_channel_of_a_glonass_satellite() -> None:
    message = encode_ephemeris(GLONASS)
    assert glonass_channel_of(message) == (9, -2)
    assert [glonass_channel_of(m) for m in (message[:-1], changed(message, 1020, channel=14), changed(message, 1020, satellite=0))] == [
        None
    ] * 3


def test_values_that_fit_no_field() -> None:
    with pytest.raises(ValueError, match="crs"):
        encode_ephemeris(replace(GPS, crs=1e6))
