"""Receivers that track everything: of all signals of six systems, one a satellite is monitored, and in all receivers the same one."""

from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest

from integrity.carrier_thresholds import CARRIER_CHECKS
from integrity.events import Event, ObservationsReceived
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS, parse_utc
from integrity.gnss.observations import ObservationRow
from integrity.gnss.signals import satellite_of
from integrity.outputs import Output
from integrity.reception import Reception
from integrity.states import Cause, State
from tests.unit.long_streams import START_UP, live, resumed, site_of
from tests.unit.many_signals import EPOCHS, More, as_msm, as_rawx, nothing_more, ranges, rows
from tests.unit.monitored import decided, published
from tests.unit.streams import SITE, alerts, health, reports

WEEK = parse_utc("2026-03-08T00:00:00Z") // WEEK_NS * WEEK_NS
MOSCOW_DAY = parse_utc("2026-03-02T21:00:00Z")
TURNS = {
    "GPS week": WEEK,
    "BeiDou week": WEEK + 14 * NS_PER_S,
    "GLONASS day": MOSCOW_DAY,
    "leap second": parse_utc("2017-01-01T00:00:00Z"),
}
LAST_OF_BEIDOU_2 = 18  # C01 to C18 are of the second generation: BDS-SIS-ICD B1I 3.0, 4.3.2
MONITORED = {"G": "1C", "E": "1C", "C": "2I", "J": "1C"}
LATER = EPOCHS // 2  # an epoch well after start-up

of_every_turn = pytest.mark.parametrize("turn", TURNS)


@cache
def sound(turn: str = "GLONASS day") -> tuple[Event, ...]:
    return rows(TURNS[turn])


@cache
def of_sound(turn: str = "GLONASS day") -> list[Output]:
    return decided(sound(turn))


@cache
def as_casters_send_it(turn: str) -> tuple[Event, ...]:
    return as_msm(sound(turn))


def with_more(more: More) -> list[Output]:
    return decided(rows(MOSCOW_DAY, more))


def satellites(system: str) -> set[str]:
    """Those in view of a system."""
    signals, _, rho = ranges(MOSCOW_DAY)
    return {satellite_of(s) for s, seen in zip(signals, np.isfinite(rho[0, 0]), strict=True) if seen and s[0] == system}


def monitored(outputs: Sequence[Output], system: str) -> list[tuple[str, ...]]:
    """Its signals in each epoch."""
    return [tuple(s for s in h.monitored if s[0] == system) for h in health(outputs)]


def of_sound_signals(system: str) -> tuple[str, ...]:
    """What is monitored of it where all is well."""
    return monitored(of_sound(), system)[-1]


def states_after_start_up(outputs: Sequence[Output]) -> set[State]:
    return {h.state for h in health(outputs)[START_UP:]}


def farthest_m(outputs: Sequence[Output]) -> float:
    """Of any receiver from its point."""
    return max(float(np.abs(r.e_enu_m).max()) for r in reports(outputs))


def same_numbers(a: Sequence[Output], b: Sequence[Output]) -> bool:
    """To the last bit: positions and every statistic; those of carriers, in which all signals of a receiver tell its clock, to 1e-6."""
    pairs = list(zip(reports(a), reports(b), strict=True))
    by_carrier = np.isin(pairs[0][0].check_names, CARRIER_CHECKS)
    return all(
        x.e_enu_m.tobytes() == y.e_enu_m.tobytes()
        and x.statistic[~by_carrier].tobytes() == y.statistic[~by_carrier].tobytes()
        and np.allclose(x.statistic[by_carrier], y.statistic[by_carrier], rtol=0.0, atol=1e-6, equal_nan=True)
        for x, y in pairs
    )


# ---- what is monitored


@pytest.mark.parametrize("system", MONITORED)
def test_of_every_satellite_in_view_the_first_signal_is_monitored(system: str) -> None:
    expected = tuple(sorted(f"{satellite}.{MONITORED[system]}" for satellite in satellites(system)))
    assert len(expected) >= 3 and set(monitored(of_sound(), system)) == {expected}


@pytest.mark.parametrize("system", "RS")
def test_glonass_and_sbas_are_in_view_and_never_monitored(system: str) -> None:
    assert satellites(system) and set(monitored(of_sound(), system)) == {()}


@of_every_turn
def test_everything_in_view_is_normal(turn: str) -> None:
    assert states_after_start_up(of_sound(turn)) == {State.NORMAL}


@pytest.mark.parametrize("system", "RS")
def test_glonass_and_sbas_a_kilometre_off_change_no_number(system: str) -> None:
    assert same_numbers(with_more(lambda r, s, e: 1000.0 if s[0] == system and r == "B" else 0.0), of_sound())


@pytest.mark.parametrize("codes", [("1B",), ("2W", "2L"), ("5Q", "7Q"), ("6I", "7I"), ("2C",)])
def test_a_bias_of_another_signal_on_one_receiver_changes_no_number(codes: tuple[str, ...]) -> None:
    assert same_numbers(with_more(lambda r, s, e: 50.0 if s[4:] in codes and r == "B" else 0.0), of_sound())


def test_a_bias_of_the_monitored_signal_on_one_receiver_does() -> None:
    assert not same_numbers(with_more(lambda r, s, e: 1.0 if s == min(of_sound_signals("G")) and r == "B" else 0.0), of_sound())


# ---- receivers that do not track everything


def not_tracking(receiver: str, system: str, code: str = "", from_epoch: int = 0) -> More:
    def more(r: str, signal: str, epoch: int) -> float | None:
        return None if r == receiver and signal[0] == system and signal.endswith(code) and epoch >= from_epoch else 0.0

    return more


@pytest.mark.parametrize("receiver", "ABC")
def test_a_receiver_without_b1i_makes_all_use_b3i(receiver: str) -> None:
    expected = tuple(sorted(f"{satellite}.6I" for satellite in satellites("C")))
    assert set(monitored(with_more(not_tracking(receiver, "C", "2I")), "C")) == {expected}


@pytest.mark.parametrize("from_epoch", [0, LATER])
@pytest.mark.parametrize(("system", "code"), [("C", "2I"), ("C", ""), ("J", ""), ("G", "2L")])
def test_what_one_receiver_does_not_track_raises_no_alarm(system: str, code: str, from_epoch: int) -> None:
    assert states_after_start_up(with_more(not_tracking("B", system, code, from_epoch))) == {State.NORMAL}


@pytest.mark.parametrize("system", "CJ")
def test_a_system_that_one_receiver_stops_tracking_leaves_the_common_set_in_that_epoch(system: str) -> None:
    said = monitored(with_more(not_tracking("B", system, from_epoch=LATER)), system)
    assert [bool(signals) for signals in said] == [epoch < LATER for epoch in range(EPOCHS)]


def losing_one_b1i(b3i_m: float) -> More:
    """B loses B1I of a single satellite; all receivers measure B3I with a delay of their own."""
    lost = min(of_sound_signals("C"))

    def more(receiver: str, signal: str, epoch: int) -> float | None:
        if receiver == "B" and signal == lost and epoch >= LATER:
            return None
        return b3i_m if signal[0] == "C" and signal.endswith("6I") else 0.0

    return more


# Were B3I used of that satellite alone, 8 m would look like its fault, and 6 m would move all receivers by 0.9 m unnoticed.


def test_one_lost_b1i_raises_no_alarm_where_receivers_delay_b3i_by_metres() -> None:
    assert states_after_start_up(with_more(losing_one_b1i(15.0))) == {State.NORMAL}


def test_one_lost_b1i_moves_no_position_where_receivers_delay_b3i_by_metres() -> None:
    assert farthest_m(with_more(losing_one_b1i(6.0))) < 1e-4


def test_the_signals_of_one_beidou_clock_are_of_one_band() -> None:
    for signals in monitored(with_more(losing_one_b1i(0.0)), "C"):
        assert len({(int(s[1:3]) <= LAST_OF_BEIDOU_2, s[4:]) for s in signals}) == 2  # two clocks


# ---- clocks


def of_generation(second: bool, size_m: float) -> More:
    return lambda r, s, e: size_m if s[0] == "C" and (int(s[1:3]) <= LAST_OF_BEIDOU_2) is second else 0.0


@pytest.mark.parametrize("second", [True, False])
def test_the_offset_of_a_generation_of_beidou_moves_no_position(second: bool) -> None:
    assert farthest_m(with_more(of_generation(second, 30.0))) < 1e-4  # 30 m early or late, a satellite moves by 0.3 mm


@pytest.mark.parametrize("system", "GEC")
def test_the_offset_of_a_system_in_one_receiver_moves_no_position(system: str) -> None:
    assert farthest_m(with_more(lambda r, s, e: 30.0 if r == "B" and s[0] in (system, "J" if system == "G" else system) else 0.0)) < 1e-4


def test_the_same_offset_of_one_satellite_of_the_generation_is_its_fault() -> None:
    bad = min(of_sound_signals("C"))
    outputs = with_more(lambda r, s, e: 30.0 if s == bad and e >= LATER else 0.0)
    first = next(a for a in alerts(outputs) if a.before is State.NORMAL)
    assert (first.cause, first.subjects) == (Cause.SATELLITE, (satellite_of(bad),))


# ---- as bytes


def rows_heard(events: Sequence[Event], protocol: str) -> list[ObservationRow]:
    site = site_of("rtcm3" if protocol == "rtcm3" else "ubx")
    reception = Reception(site.receiver_names, protocols=site.protocols)
    return [heard.row for event in events for heard in reception.take(event) if isinstance(heard, ObservationsReceived)]


@of_every_turn
def test_msm_of_all_systems_make_one_row_of_each_time(turn: str) -> None:
    """Weeks, BeiDou's week 14 s later, days of Moscow, and the leap second that GLONASS cannot tell from the second after it."""
    told = [e.row for e in sound(turn) if isinstance(e, ObservationsReceived)]
    heard = rows_heard(as_casters_send_it(turn), "rtcm3")
    assert [(row.receive_time_ns, set(row.signals)) for row in heard] == [(row.receive_time_ns, set(row.signals)) for row in told]


@of_every_turn
def test_rtcm_of_all_systems_decides_as_rows_do(turn: str) -> None:
    assert published(decided(as_casters_send_it(turn), site_of("rtcm3"))) == published(of_sound(turn))


@of_every_turn
def test_ubx_of_all_systems_decides_as_rows_do(turn: str) -> None:
    assert published(decided(as_rawx(sound(turn)))) == published(of_sound(turn))


@of_every_turn
def test_cut_anywhere_and_resumed_at_the_event_rtcm_decides_the_same(turn: str) -> None:
    assert published(resumed(as_casters_send_it(turn), site_of("rtcm3"), TURNS[turn])) == published(of_sound(turn))


@pytest.mark.parametrize("more", [nothing_more, not_tracking("B", "C", "2I", LATER), of_generation(True, 30.0)])
def test_a_live_station_decides_the_same(more: More) -> None:
    sent = rows(MOSCOW_DAY, more)
    assert published(live(sent, SITE)) == published(decided(sent))
