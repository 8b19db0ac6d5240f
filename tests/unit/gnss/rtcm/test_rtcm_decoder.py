"""The RTCM 3 decoder: which messages make a row, of what time it is, what is remembered, what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from integrity.errors import DecodeError
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS, gps_from_week, parse_utc
from integrity.gnss.observations import ROW_ARRAYS, ObservationRow
from integrity.gnss.rtcm.decoder import MOST_MESSAGES, Decoded, RtcmDecoder, RtcmMemory
from integrity.gnss.rtcm.locks import SignalLock
from integrity.gnss.rtcm.msm_writer import Values, encode_msm
from integrity.gnss.rtcm.navigation import encode_ephemeris
from integrity.gnss.rtcm.station import AntennaPosition, encode_position
from tests.unit.gnss.rtcm.sets import GLONASS, GPS

NEAR_NS = gps_from_week(2310, 345_600.0)
T_MS = 345_600_000
SATELLITE: Values = {"whole_ms": 70.0, "channel": 7.0}
GPS_L1, GPS_L2, GLONASS_L1, GALILEO_E1, BEIDOU_B1I = "G05.1C", "G05.2W", "R05.1C", "E05.1C", "C05.2I"


def msm(number: int, time: int, more: bool = False, signal: int = 2, lock: int | None = None, satellite: int = 5) -> bytes:
    header = {"time": time, "more": int(more)}
    lock = (15 if number % 10 < 6 else 704) if lock is None else lock
    return encode_msm(number, header, {satellite: SATELLITE}, {(satellite, signal): {"range_ms": 0.0, "phase_ms": 0.0, "lock": lock}})


def moscow(day: int, ms: int) -> int:
    return day << 27 | ms


def fed(messages: list[bytes], near_ns: int | None = NEAR_NS, decoder: RtcmDecoder | None = None) -> list[Decoded]:
    decoder = decoder or RtcmDecoder("A")
    return [told for message in messages for told in decoder.take(message, near_ns)]


def rows_of(messages: list[bytes], near_ns: int | None = NEAR_NS) -> list[tuple[int, tuple[str, ...]]]:
    """Time after `NEAR_NS` in ms, and signals."""
    rows = [row for row in fed(messages, near_ns) if isinstance(row, ObservationRow)]
    return [((row.receive_time_ns - NEAR_NS) // 1_000_000, row.signals) for row in rows]


EPOCH = [
    msm(1077, T_MS, more=True),
    msm(1087, moscow(4, 10_782_000), more=True),
    msm(1094, T_MS, more=True),
    msm(1127, T_MS - 14_000),
]


def test_all_messages_of_an_epoch_make_one_row() -> None:
    assert rows_of(EPOCH) == [(0, (GPS_L1, GLONASS_L1, GALILEO_E1, BEIDOU_B1I))]


def test_several_messages_of_one_system_make_one_row() -> None:
    assert rows_of([msm(1077, T_MS, more=True), msm(1077, T_MS, signal=10)]) == [(0, (GPS_L1, GPS_L2))]


def test_an_epoch_ends_where_another_begins() -> None:
    assert rows_of([*EPOCH[:2], *[msm(1077, T_MS + 1000)]]) == [(0, (GPS_L1, GLONASS_L1)), (1000, (GPS_L1,))]


def test_a_message_alone_is_an_epoch() -> None:
    assert rows_of([msm(1077, T_MS), msm(1094, T_MS)]) == [(0, (GPS_L1,)), (0, (GALILEO_E1,))]


def test_an_epoch_of_nothing_is_a_row_of_nothing() -> None:
    assert rows_of([encode_msm(1077, {"time": T_MS}, {}, {})]) == [(0, ())]


def test_signals_with_neither_range_nor_carrier_are_left_out() -> None:
    nothing: Values = {"range_ms": None, "phase_ms": None}
    message = encode_msm(1077, {"time": T_MS}, {5: SATELLITE}, {(5, 2): nothing, (5, 10): {"range_ms": 0.0, "phase_ms": None}})
    (row,) = fed([message])
    assert isinstance(row, ObservationRow)
    assert row.signals == (GPS_L2,)
    assert row.pseudorange_m.tolist() == [70 * 299_792.458]


def test_the_same_signal_twice_is_refused() -> None:
    decoder = RtcmDecoder("A")
    messages = [msm(1077, T_MS, more=True), msm(1074, T_MS, more=True), msm(1094, T_MS)]
    (row,) = fed(messages, decoder=decoder)
    assert isinstance(row, ObservationRow)
    assert row.signals == (GPS_L1, GALILEO_E1)
    assert decoder.refused == 1


def test_two_stations_do_not_make_one_row() -> None:
    decoder = RtcmDecoder("A")
    other = encode_msm(1094, {"time": T_MS, "station": 1}, {5: SATELLITE}, {(5, 2): {"range_ms": 0.0}})
    assert fed([msm(1077, T_MS, more=True), other], decoder=decoder) == []
    assert decoder.refused == 1


def test_an_epoch_without_end_is_refused_beyond_a_number_of_messages() -> None:
    decoder = RtcmDecoder("A")
    fed([encode_msm(1077, {"time": T_MS, "more": 1}, {}, {})] * (MOST_MESSAGES + 3), decoder=decoder)
    assert decoder.refused == 3
    assert len(decoder.memory().open_messages) == MOST_MESSAGES


def test_beidou_at_gps_time_belongs_to_the_epoch_that_announced_more() -> None:
    """Receivers from before RTCM 10403.2 write it: tests/crosscheck has such a log."""
    assert rows_of([EPOCH[0], msm(1127, T_MS)]) == [(0, (GPS_L1, BEIDOU_B1I))]


def test_beidou_alone_is_taken_by_its_word() -> None:
    assert rows_of([msm(1077, T_MS), msm(1127, T_MS)]) == [(0, (GPS_L1,)), (14_000, (BEIDOU_B1I,))]


@pytest.mark.parametrize(
    "message", [msm(1077, 604_800_000), msm(1127, (1 << 30) - 1), msm(1087, moscow(0, 86_400_000)), msm(1087, moscow(7, 0)), b"\x43\x50"]
)
def test_what_has_no_time_is_refused(message: bytes) -> None:
    decoder = RtcmDecoder("A")
    assert fed([message], decoder=decoder) == []
    assert decoder.refused == 1


@pytest.mark.parametrize("message", [b"", b"\x43", b"\x3e\xf0\x00\x00", bytes(40)])
def test_messages_of_other_numbers_are_passed_over(message: bytes) -> None:
    decoder = RtcmDecoder("A")
    assert fed([message], decoder=decoder) == []
    assert decoder.memory() == RtcmMemory()


# Times.


@pytest.mark.parametrize(
    ("near_s", "time_ms"), [(-300_000, T_MS), (300_000, T_MS), (259_199, 604_799_999), (259_201, 0), (-345_601, 604_799_000)]
)
def test_the_week_is_the_nearest(near_s: int, time_ms: int) -> None:
    (row,) = fed([msm(1077, time_ms)], NEAR_NS + near_s * NS_PER_S)
    assert isinstance(row, ObservationRow)
    assert row.receive_time_ns % WEEK_NS == time_ms * 1_000_000
    assert abs(row.receive_time_ns - NEAR_NS - near_s * NS_PER_S) <= WEEK_NS // 2


def test_weeks_go_on_by_themselves() -> None:
    decoder = RtcmDecoder("A")
    fed([msm(1077, 604_799_000)], decoder=decoder)
    (row,) = fed([msm(1077, 0)], near_ns=None, decoder=decoder)
    assert isinstance(row, ObservationRow)
    assert row.receive_time_ns == gps_from_week(2311, 0.0)


@pytest.mark.parametrize("day", [0, 1, 2, 3, 4, 5, 6])
@pytest.mark.parametrize(
    ("ms", "utc"),
    [
        (0, "2024-02-24T21:00:00Z"),
        (10_799_999, "2024-02-24T23:59:59.999Z"),
        (10_800_000, "2024-02-25T00:00:00Z"),
        (86_399_000, "2024-02-25T20:59:59Z"),
    ],
)
def test_days_of_moscow(ms: int, utc: str, day: int) -> None:
    """2024-02-25 was a Sunday."""
    expected_ns = parse_utc(utc) + day * 86_400 * NS_PER_S
    (row,) = fed([msm(1087, moscow(day, ms))], expected_ns + 200_000 * NS_PER_S)
    assert isinstance(row, ObservationRow)
    assert row.receive_time_ns == expected_ns


def test_an_unknown_day_is_that_of_the_epoch_before() -> None:
    decoder = RtcmDecoder("A")
    first, second = fed([msm(1077, T_MS), msm(1087, moscow(7, 10_782_000))], decoder=decoder)
    assert isinstance(first, ObservationRow)
    assert isinstance(second, ObservationRow)
    assert first.receive_time_ns == second.receive_time_ns


LEAP_NS = parse_utc("2017-01-01T00:00:00Z")  # the leap second began one second before, a Saturday's last


@pytest.mark.parametrize(("after_s", "day", "ms"), [(-2, 0, 10_799_000), (-1, 0, 10_800_000), (0, 0, 10_800_000), (1, 0, 10_801_000)])
def test_a_leap_second(after_s: int, day: int, ms: int) -> None:
    time_ns = LEAP_NS + after_s * NS_PER_S
    gps = msm(1077, time_ns % WEEK_NS // 1_000_000, more=True)
    (row,) = fed([gps, msm(1087, moscow(day, ms))], time_ns)
    assert isinstance(row, ObservationRow)
    assert (row.receive_time_ns, row.signals) == (time_ns, (GPS_L1, GLONASS_L1))


def test_without_a_week_nothing_can_be_dated() -> None:
    decoder = RtcmDecoder("A")
    assert fed(EPOCH, None, decoder) == []
    assert decoder.undated == len(EPOCH)


def test_an_ephemeris_tells_the_week() -> None:
    decoder = RtcmDecoder("A")
    told = fed([encode_ephemeris(GPS), *EPOCH], None, decoder)
    assert [type(x) for x in told] == [KeplerEphemeris, ObservationRow]
    assert isinstance(told[1], ObservationRow)
    assert told[1].receive_time_ns == NEAR_NS


# Locks and channels.


@pytest.mark.parametrize(
    ("before", "after", "step_ms", "slip"),
    [
        (704, 704, 1000, False),
        (500, 500, 1000, False),
        (704, 500, 1000, True),  # it has gone down
        (0, 64, 64, False),  # it reaches back to the row before, exactly
        (0, 64, 65, True),
        (500, 500, 851_968, False),
        (500, 500, 851_969, True),
        (500, 705, 1000, True),  # reserved: nobody knows
        (500, 704, -1000, True),  # time went back
    ],
)
def test_slips(before: int, after: int, step_ms: int, slip: bool) -> None:
    first, second = fed([msm(1077, T_MS, lock=before), msm(1077, T_MS + step_ms, lock=after)])
    assert isinstance(first, ObservationRow)
    assert isinstance(second, ObservationRow)
    assert (first.slip[0], second.slip[0]) == (True, slip)


def test_a_signal_that_was_away_may_come_back_without_a_slip() -> None:
    rows = fed([msm(1077, T_MS), msm(1077, T_MS + 1000, satellite=6), msm(1077, T_MS + 2000)])
    assert [bool(row.slip[0]) for row in rows if isinstance(row, ObservationRow)] == [True, True, False]


def test_channels_of_glonass_are_remembered() -> None:
    decoder = RtcmDecoder("A")
    with_channel = encode_ephemeris(replace(GLONASS, satellite="R05", channel=-4))
    without = msm(1084, moscow(4, 10_782_000), lock=0)
    rows = [row for row in fed([without, with_channel, without], decoder=decoder) if isinstance(row, ObservationRow)]
    assert [np.isnan(row.carrier_cycles[0]) for row in rows] == [True, False]
    assert rows[1].carrier_cycles[0] == 70 * (1_602_000.0 - 4 * 562.5)
    fed([msm(1087, moscow(4, 10_783_000))], decoder=decoder)
    assert decoder.memory().channels == ((5, 0),)


# Ephemerides and positions.


def test_an_ephemeris_is_told_once() -> None:
    messages = [encode_ephemeris(GPS), msm(1077, T_MS), encode_ephemeris(GPS)]
    assert [type(x) for x in fed(messages)] == [KeplerEphemeris, ObservationRow]


@pytest.mark.parametrize("change", [{"healthy": False}, {"issue": 78}, {"accuracy_m": 3.4}, {"af0": 3.5e-4 + 2.0**-31}])
def test_an_ephemeris_that_changes_is_told_again(change: dict[str, object]) -> None:
    messages = [encode_ephemeris(GPS), encode_ephemeris(replace(GPS, **change))]  # type: ignore[arg-type]
    assert len(fed(messages)) == 2


def test_both_messages_of_galileo_are_told() -> None:
    inav = replace(GPS, satellite="E05", message="INAV", sqrt_a=5440.0, group_delay_2_s=0.0)
    fnav = replace(inav, message="FNAV", group_delay_2_s=None)
    assert len(fed([encode_ephemeris(eph) for eph in (inav, fnav, inav, fnav)])) == 2


def test_a_set_counts_as_transmitted_at_the_epoch_before() -> None:
    told = fed([msm(1077, T_MS), encode_ephemeris(GPS)])
    assert isinstance(told[1], KeplerEphemeris)
    assert told[1].transmission_ns == NEAR_NS


def test_without_an_epoch_a_set_counts_as_transmitted_when_it_first_may_serve() -> None:
    (told,) = fed([encode_ephemeris(GPS)])
    assert isinstance(told, KeplerEphemeris)
    assert told.transmission_ns == GPS.toe_ns - 7200 * NS_PER_S


def test_a_set_that_makes_no_sense_is_refused() -> None:
    decoder = RtcmDecoder("A")
    assert fed([encode_ephemeris(replace(GPS, sqrt_a=6000.0))], decoder=decoder) == []
    assert decoder.refused == 1


def test_the_position_of_the_antenna() -> None:
    (told,) = fed([encode_position(AntennaPosition(7, True, 0.0, 0.5, -1.0, 2.0))])
    assert told == AntennaPosition(7, True, 0.0, 0.5, -1.0, 2.0)


# What is remembered.


def test_a_new_decoder_goes_on_wherever_the_old_one_stopped() -> None:
    locks = [msm(1077, T_MS + 1000 * k, more=True, lock=704 - k) for k in range(1, 4)]
    messages = [encode_ephemeris(GPS), *EPOCH, encode_ephemeris(GLONASS), *locks, *EPOCH, encode_ephemeris(GPS)]
    expected = fed(messages)
    for cut in range(len(messages) + 1):
        old = RtcmDecoder("A")
        found = fed(messages[:cut], decoder=old)
        found += fed(messages[cut:], decoder=RtcmDecoder("A", old.memory()))
        assert [comparable(x) for x in found] == [comparable(x) for x in expected]


def comparable(told: Decoded) -> object:
    """What is told; a row as the bytes of its arrays."""
    if not isinstance(told, ObservationRow):
        return told
    return told.receive_time_ns, told.signals, *(getattr(told, name).tobytes() for name in ROW_ARRAYS)


@pytest.mark.parametrize(
    "memory",
    [
        RtcmMemory(open_messages=(b"\x43\x50",), epoch_ns=NEAR_NS),
        RtcmMemory(open_messages=(b"\x3e\xd0",), epoch_ns=NEAR_NS),
        RtcmMemory(open_messages=(EPOCH[0],)),
        RtcmMemory(channels=((25, 0),)),
        RtcmMemory(channels=((5, 7),)),
    ],
)
def test_a_memory_that_no_decoder_made(memory: RtcmMemory) -> None:
    with pytest.raises(DecodeError, match="start without it"):
        RtcmDecoder("A", memory)


def test_what_is_remembered_of_signals() -> None:
    decoder = RtcmDecoder("A")
    fed([msm(1077, T_MS, lock=64)], decoder=decoder)
    assert decoder.memory().locks == (SignalLock(GPS_L1, NEAR_NS, 0.064),)
