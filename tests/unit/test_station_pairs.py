"""A station that decides on pairs of frequencies: no ionosphere, no model of it, and every fault answered as on one frequency."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from integrity.events import Event, ObservationsReceived
from integrity.gnss.observations import ObservationRow
from integrity.gnss.signals import is_in_lower_band, is_pair, satellite_of
from integrity.outputs import HealthReport, Output
from integrity.states import Cause, State
from tests.unit.long_streams import START_UP, Form, live, resumed
from tests.unit.many_signals import EPOCHS, More, nothing_more, ranges, rows
from tests.unit.monitored import FAULT_S, decided, first_fault, frozen, published, range_fault
from tests.unit.pairs import PAIRS_SITE, SECONDS, measured, sent, speaking, without_second
from tests.unit.streams import SITE, START_NS, alerts, epoch_of, health, moved, new_monitor, reports, rows_changed, with_more, with_signals
from tests.unit.test_station_monitor_signals import MOSCOW_DAY, not_tracking, satellites, states_after_start_up

of_both_forms = pytest.mark.parametrize("form", ["ubx", "rtcm3"])


@cache
def of_sent(form: Form, storm: bool = False) -> list[Output]:
    return decided(sent(form, storm), speaking(PAIRS_SITE, form))


@cache
def of_measured() -> list[Output]:
    return decided(measured(), PAIRS_SITE)


def of_faulty(events: Sequence[Event]) -> list[Output]:
    return decided(events, PAIRS_SITE)


def last(outputs: Sequence[Output]) -> HealthReport:
    return health(outputs)[-1]


# ---- without an ionosphere


@of_both_forms
@pytest.mark.parametrize("storm", [False, True])
def test_a_station_with_pairs_is_normal_whatever_the_ionosphere(form: Form, storm: bool) -> None:
    assert states_after_start_up(of_sent(form, storm)) == {State.NORMAL}


@of_both_forms
def test_one_frequency_under_the_same_ionosphere_is_never_normal(form: Form) -> None:
    assert State.NORMAL not in {h.state for h in health(decided(sent(form, storm=True), speaking(SITE, form)))}


def test_the_ionosphere_moves_no_position() -> None:
    """Ranges are rounded to 1/1024 m, weights add up to four of them."""
    calm, storm = (np.array([r.e_enu_m for r in reports(decided(measured(s), PAIRS_SITE))]) for s in (False, True))
    assert np.abs(calm - storm).max() < 0.02


def test_positions_are_off_by_noise_three_times_that_of_one_frequency() -> None:
    def spread_m(outputs: Sequence[Output]) -> float:
        e = np.array([r.e_enu_m for r in reports(outputs)])
        return float((e - e.mean(axis=1, keepdims=True)).std())

    one, two = spread_m(decided(measured(seconds=200), SITE)), spread_m(decided(measured(seconds=200), PAIRS_SITE))
    assert 2.2 <= two / one <= 3.8  # 2.98 of GPS, 2.81 of E1 and E5b


def test_nothing_but_pairs_is_monitored() -> None:
    said = last(of_sent("ubx")).monitored
    assert len(said) >= 10 and all(is_pair(signal) for signal in said)


def test_pairs_are_named_by_both_their_codes() -> None:
    assert {s[0] + s.partition(".")[2] for s in last(of_sent("ubx")).monitored} == {"G1C+2L", "E1C+7Q"}


# ---- how it is fed


@pytest.mark.parametrize("cut", [1, 7])
def test_blocks_of_any_size_decide_the_same_to_the_last_bit(cut: int) -> None:
    monitor, events, outputs = new_monitor(PAIRS_SITE), sent("ubx"), []
    for k in range(0, len(events), cut):
        outputs += monitor.feed(events[k : k + cut])
    assert [r.e_enu_m.tobytes() for r in reports(outputs)] == [r.e_enu_m.tobytes() for r in reports(of_sent("ubx"))]
    assert published(outputs) == published(of_sent("ubx"))


@of_both_forms
def test_a_live_station_decides_the_same(form: Form) -> None:
    assert published(live(sent(form), speaking(PAIRS_SITE, form))) == published(of_sent(form))


@of_both_forms
def test_a_station_that_goes_on_from_a_snapshot_decides_the_same(form: Form) -> None:
    at_ns = START_NS + SECONDS // 2 * 10**9
    assert published(resumed(sent(form), speaking(PAIRS_SITE, form), at_ns)) == published(of_sent(form))


# ---- faults


def test_a_fault_of_a_satellite_names_it() -> None:
    bad = satellite_of(last(of_measured()).monitored[3])
    _, state, cause, subjects = first_fault(of_faulty(range_fault(measured(), "ABC", 60.0, bad)))
    assert (state, cause, subjects) == (State.SATELLITE_ANOMALY, Cause.SATELLITE, (bad,))


def test_a_fault_of_the_second_signal_alone_names_the_satellite() -> None:
    bad = satellite_of(last(of_measured()).monitored[3])
    second = next(s for s in measured_signals() if s.startswith(bad) and is_in_lower_band(s))
    _, _, cause, subjects = first_fault(of_faulty(range_fault(measured(), "ABC", 40.0, second)))
    assert (cause, subjects) == (Cause.SATELLITE, (bad,))


def first_row() -> ObservationRow:
    return next(event.row for event in measured() if isinstance(event, ObservationsReceived))


def measured_signals() -> tuple[str, ...]:
    return first_row().signals


@pytest.mark.parametrize("receiver", "ABC")
def test_a_receiver_that_is_off_is_named(receiver: str) -> None:
    def change(row: ObservationRow) -> ObservationRow:
        if row.receiver != receiver or epoch_of(row) < FAULT_S:
            return row
        first_m = (moved(row, 40.0, 1.0).pseudorange_m - row.pseudorange_m)[::2]  # of the first signal of each satellite
        return replace(row, pseudorange_m=row.pseudorange_m + np.repeat(first_m, 2))

    outputs = of_faulty(rows_changed(measured(), change))
    assert {a.subjects for a in alerts(outputs) if a.cause is Cause.RECEIVER} == {(receiver,)}


def test_a_frozen_receiver_is_named() -> None:
    _, _, cause, subjects = first_fault(of_faulty(frozen(measured(), "B")))
    assert (cause, subjects) == (Cause.DATA, ("B",))


@pytest.mark.parametrize("lower", [False, True])
def test_a_receiver_that_repeats_one_band_is_named(lower: bool) -> None:
    kept: dict[str, float] = {}

    def change(row: ObservationRow) -> ObservationRow:
        if row.receiver != "B":
            return row
        if epoch_of(row) < FAULT_S:
            kept.update(zip(row.signals, row.pseudorange_m.tolist(), strict=True))
            return row
        again = [
            kept.get(s, m) if is_in_lower_band(s) is lower else m for s, m in zip(row.signals, row.pseudorange_m.tolist(), strict=True)
        ]
        return replace(row, pseudorange_m=np.array(again))

    assert (Cause.DATA, ("B",)) in {(h.cause, h.subjects) for h in health(of_faulty(rows_changed(measured(), change)))[FAULT_S + 1 :]}


@pytest.mark.parametrize("lower", [False, True])
def test_jamming_of_one_band_is_jamming(lower: bool) -> None:
    """8 dB, by which the signals stay above those of the other band or do not: each band has its own usual strength."""

    def change(row: ObservationRow) -> ObservationRow:
        columns = [i for i, s in enumerate(row.signals) if is_in_lower_band(s)]
        weak = with_more(row, "cn0_dbhz", -10.0, columns)  # as semi-codeless tracking has it
        jammed = [i for i, s in enumerate(row.signals) if is_in_lower_band(s) is lower]
        return with_more(weak, "cn0_dbhz", -8.0, jammed) if epoch_of(row) >= FAULT_S else weak

    assert first_fault(of_faulty(rows_changed(measured(), change)))[2] is Cause.JAMMING


@pytest.mark.parametrize(("receivers", "cause"), [("AB", Cause.JAMMING), ("A", Cause.NONE)])
def test_most_of_the_second_signals_lost_by_two_receivers_is_jamming(receivers: str, cause: Cause) -> None:
    """Two thirds of one band are a third of both; the six satellites left are enough to go on with."""
    strength = dict(zip(measured_signals(), first_row().cn0_dbhz.tolist(), strict=True))
    second = sorted(filter(is_in_lower_band, strength), key=strength.__getitem__)
    lost = second[len(second) // 3 :]

    def change(row: ObservationRow) -> ObservationRow:
        return with_signals(row, lambda s: s not in lost) if row.receiver in receivers and epoch_of(row) >= FAULT_S else row

    assert last(of_faulty(rows_changed(measured(), change))).cause is cause


# ---- receivers with one frequency


def test_receivers_with_one_frequency_are_told_what_to_do() -> None:
    said = last(of_faulty(without_second(measured())))
    assert (said.state, said.cause) == (State.NOT_CONFIRMABLE, Cause.DATA)
    assert said.reasons[-1] == (
        "frequencies = 2 needs the same pairs of 5 satellites from all receivers, and they have: A none, B none, C none; "
        "have those that lack them track a second band, or write frequencies = 1"
    )


def test_one_receiver_with_one_frequency_is_named_among_the_reasons() -> None:
    reason = last(of_faulty(without_second(measured(), "B"))).reasons[-1]
    n = len({satellite_of(s) for s in measured_signals()})
    assert f"A {n} (E1C+7Q G1C+2L), B none, C {n} (E1C+7Q G1C+2L); " in reason


def test_satellites_without_a_pair_at_one_receiver_are_not_monitored() -> None:
    said = last(of_faulty(without_second(measured(), "B", FAULT_S, "E"))).monitored
    assert said and all(signal[0] == "G" for signal in said)


def test_a_sound_station_has_nothing_to_say_about_pairs() -> None:
    assert {h.reasons for h in health(of_measured())[START_UP:]} == {()}


# ---- receivers that track everything


def of_many(more: More = nothing_more) -> list[Output]:
    return decided(rows(MOSCOW_DAY, more), PAIRS_SITE)


def codes(outputs: Sequence[Output], system: str) -> set[str]:
    return {s.partition(".")[2] for h in health(outputs) for s in h.monitored if s[0] == system}


def farthest_m(outputs: Sequence[Output]) -> float:
    return max(float(np.abs(r.e_enu_m).max()) for r in reports(outputs))


@pytest.mark.parametrize(("system", "pair"), [("G", "1C+2L"), ("E", "1C+5Q"), ("C", "2I+6I"), ("J", "1C+2L")])
def test_of_every_system_the_first_pair_is_monitored(system: str, pair: str) -> None:
    assert codes(of_many(), system) == {pair}


def test_pairs_of_six_systems_find_the_points() -> None:
    assert farthest_m(of_many()) < 1e-3


@pytest.mark.parametrize("receiver", "ABC")
def test_a_receiver_without_e5a_makes_all_use_e5b(receiver: str) -> None:
    assert codes(of_many(not_tracking(receiver, "E", "5Q")), "E") == {"1C+7Q"}


def without_l2c(n: int) -> More:
    """The first GPS satellites in view send no L2C."""
    older = sorted(satellites("G"))[:n]
    return lambda r, s, e: None if s.endswith("2L") and satellite_of(s) in older else 0.0


@pytest.mark.parametrize(("n", "gps", "qzss"), [(1, {"1C+2L"}, {"1C+2L"}), (6, {"1C+2W"}, set())])
def test_of_one_clock_one_pair_of_codes_is_monitored(n: int, gps: set[str], qzss: set[str]) -> None:
    """Nine GPS satellites and three QZSS, which have no P(Y): with one older satellite eleven have L2C, with six of them six."""
    assert (len(satellites("G")), len(satellites("J"))) == (9, 3)
    outputs = of_many(without_l2c(n))
    assert (codes(outputs, "G"), codes(outputs, "J")) == (gps, qzss)


def test_a_receiver_that_delays_py_by_metres_moves_no_position() -> None:
    """Two older satellites alone with P(Y) would have moved it."""
    older = without_l2c(2)
    assert farthest_m(of_many(lambda r, s, e: 6.0 if r == "B" and s.endswith("2W") else older(r, s, e))) < 1e-3


@pytest.mark.parametrize(("system", "code"), [("E", "5Q"), ("E", ""), ("G", "2L"), ("C", "6I")])
def test_what_one_receiver_does_not_track_raises_no_alarm(system: str, code: str) -> None:
    assert states_after_start_up(of_many(not_tracking("B", system, code, EPOCHS // 2))) == {State.NORMAL}


def test_one_lost_e5a_moves_no_position_where_receivers_delay_e5b_by_metres() -> None:
    """Were E5b used of that satellite alone, all receivers would move by metres."""
    lost = min(s for s in ranges(MOSCOW_DAY)[0] if s.endswith("5Q") and s[0] == "E" and s.partition(".")[0] in in_use())

    def more(receiver: str, signal: str, epoch: int) -> float | None:
        if receiver == "B" and signal == lost and epoch >= EPOCHS // 2:
            return None
        return 6.0 if signal[0] == "E" and signal.endswith("7Q") else 0.0

    assert farthest_m(of_many(more)) < 1e-3


def in_use() -> set[str]:
    return {satellite_of(s) for s in last(of_many()).monitored}


@pytest.mark.parametrize("code", ["2W", "7Q", "7I"])
def test_a_bias_of_a_signal_that_no_pair_in_use_has_changes_no_number(code: str) -> None:
    found = of_many(lambda r, s, e: 50.0 if s[4:] == code and r == "B" else 0.0)
    assert [r.e_enu_m.tobytes() for r in reports(found)] == [r.e_enu_m.tobytes() for r in reports(of_many())]
