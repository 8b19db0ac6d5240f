"""The whole core on simulated faults, under both rules: each is decided in its first epoch, and what is none stops nothing."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from integrity.config import SiteConfig
from integrity.events import ObservationsReceived
from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.observations import ObservationRow
from integrity.gnss.signals import L1_HZ
from integrity.outputs import Output
from integrity.states import Cause, State
from tests.unit.monitored import FAULT_S, SECONDS, SOUND, decided, first_fault, frozen, range_fault, states, used_satellites
from tests.unit.streams import (
    RECOVER_AFTER_S,
    SITE,
    epoch_of,
    health,
    moved,
    reports,
    rows_changed,
    stream,
    with_more,
    with_signals,
    with_values,
)

L1_WAVELENGTH_M = SPEED_OF_LIGHT_MPS / L1_HZ


def named(site: SiteConfig, **changes: object) -> SiteConfig:
    return replace(site, integrity=replace(site.integrity, **changes))  # type: ignore[arg-type]


# ---- faults, in their first epoch


@pytest.mark.parametrize("satellite", used_satellites()[::4])
def test_a_satellite_step_is_named_in_its_first_epoch(satellite: str) -> None:
    outputs = decided(range_fault(stream(SECONDS), "ABC", 60.0, satellite))
    assert first_fault(outputs) == (FAULT_S, State.SATELLITE_ANOMALY, Cause.SATELLITE, (satellite,))


def test_a_satellite_step_leaves_normal_where_the_site_excludes() -> None:
    site = named(SITE, on_satellite_fault="exclude")
    outputs = decided(range_fault(stream(SECONDS), "ABC", 60.0, used_satellites()[0]), site)
    assert (states(outputs)[-1], health(outputs)[-1].excluded) == (State.NORMAL, (used_satellites()[0],))


@cache
def stepped() -> tuple[Output, ...]:
    """Under "stop", a satellite steps by 60 m, on code and carrier, and back 5 s later."""
    satellite = used_satellites()[0]

    def change(row: ObservationRow) -> ObservationRow:
        if not FAULT_S <= epoch_of(row) < FAULT_S + 5:
            return row
        columns = [i for i, s in enumerate(row.signals) if s.startswith(satellite)]
        return with_more(with_more(row, "pseudorange_m", 60.0, columns), "carrier_cycles", 60.0 / L1_WAVELENGTH_M, columns)

    return tuple(decided(rows_changed(stream(float(FAULT_S + 30)), change)))


def test_a_satellite_whose_carrier_stepped_is_out_by_its_step_and_stays_out() -> None:
    last = reports(stepped())[-1]
    assert [(x.satellite, x.check) for x in last.exclusions] == [(used_satellites()[0], "step")]


def test_the_line_stops_no_longer_for_it_than_for_other_faults() -> None:
    """Clean from the second after it stepped back, for `recover_after_s`, and as long again until the state goes up."""
    said = states(stepped())
    assert set(said[FAULT_S : FAULT_S + 6]) == {State.SATELLITE_ANOMALY}
    assert said.index(State.NORMAL, FAULT_S) == FAULT_S + 6 + 2 * int(RECOVER_AFTER_S)


def test_an_excluded_satellite_is_not_monitored() -> None:
    site = named(SITE, on_satellite_fault="exclude")
    outputs = decided(range_fault(stream(SECONDS), "ABC", 60.0, used_satellites()[0]), site)
    assert not any(s.startswith(used_satellites()[0]) for s in health(outputs)[-1].monitored)


def half_the_sky(row: ObservationRow) -> list[int]:
    return list(range(0, len(row.signals), 2))


@pytest.mark.parametrize("receiver", "ABC")
def test_a_receiver_fault_is_seen_in_its_first_epoch(receiver: str) -> None:
    def change(row: ObservationRow) -> ObservationRow:
        faulty = row.receiver == receiver and epoch_of(row) >= FAULT_S
        return with_more(row, "pseudorange_m", 40.0, half_the_sky(row)) if faulty else row

    assert first_fault(decided(rows_changed(stream(SECONDS), change)))[:2] == (FAULT_S, State.NOT_CONFIRMABLE)


@pytest.mark.parametrize("azimuth", [0.0, 2.0, 4.0])
@pytest.mark.parametrize("receiver", "ABC")
def test_a_moved_antenna_is_named_in_its_first_epoch(receiver: str, azimuth: float) -> None:
    def change(row: ObservationRow) -> ObservationRow:
        return moved(row, 8.0, azimuth) if row.receiver == receiver and epoch_of(row) >= FAULT_S else row

    assert first_fault(decided(rows_changed(stream(SECONDS), change))) == (FAULT_S, State.NOT_CONFIRMABLE, Cause.RECEIVER, (receiver,))


def test_two_antennas_moved_alike_name_nobody() -> None:
    def change(row: ObservationRow) -> ObservationRow:
        return moved(row, 8.0, 1.0) if row.receiver in "AB" and epoch_of(row) >= FAULT_S else row

    assert first_fault(decided(rows_changed(stream(SECONDS), change)))[2:] == (Cause.AMBIGUOUS, ())


@pytest.mark.parametrize(
    ("name", "value", "used"),
    [("cn0_dbhz", 24.9, False), ("cn0_dbhz", 25.0, True), ("pseudorange_m", 9.9e6, False), ("pseudorange_m", 1.1e8, False)],
)
def test_a_weak_or_absurd_signal_at_one_receiver_is_not_used(name: str, value: float, used: bool) -> None:
    satellite = used_satellites()[0]

    def change(row: ObservationRow) -> ObservationRow:
        columns = [i for i, s in enumerate(row.signals) if s.startswith(satellite)]
        return with_values(row, name, value, columns) if row.receiver == "B" and epoch_of(row) == SECONDS - 1 else row

    monitored = health(decided(rows_changed(stream(SECONDS), change)))[-1].monitored
    assert any(s.startswith(satellite) for s in monitored) == used


def test_a_satellite_below_the_mask_is_not_used() -> None:
    outputs = decided(stream(SECONDS), named(SITE, elevation_mask_deg=30.0))
    assert set(health(outputs)[-1].monitored) < set(health(SOUND)[-1].monitored)


@pytest.mark.parametrize("receiver", "ABC")
def test_a_clock_jump_of_a_receiver_stops_nothing(receiver: str) -> None:
    outputs = decided(range_fault(stream(SECONDS), receiver, 30_000.0))
    assert states(outputs) == states(SOUND)


@pytest.mark.parametrize("receiver", "ABC")
def test_a_frozen_receiver_is_named_in_its_first_epoch(receiver: str) -> None:
    assert first_fault(decided(frozen(stream(SECONDS), receiver))) == (FAULT_S, State.NOT_CONFIRMABLE, Cause.DATA, (receiver,))


def test_one_transmitter_for_all_is_spoofing() -> None:
    # Everyone repeats what A measures, each with a clock of its own.
    of_a = {epoch_of(e.row): e.row for e in stream(SECONDS) if isinstance(e, ObservationsReceived) and e.row.receiver == "A"}

    def change(row: ObservationRow) -> ObservationRow:
        if epoch_of(row) < FAULT_S:
            return row
        heard = with_more(of_a[epoch_of(row)], "pseudorange_m", 100.0 * "ABC".index(row.receiver))
        return replace(heard, receiver=row.receiver)

    found = first_fault(decided(rows_changed(stream(SECONDS), change)))
    assert found == (FAULT_S, State.SATELLITE_ANOMALY, Cause.SPOOFING, ("A", "B", "C"))


@pytest.mark.parametrize("receivers", ["AB", "BC", "ABC"])
def test_a_drop_of_cn0_at_two_receivers_is_jamming(receivers: str) -> None:
    def change(row: ObservationRow) -> ObservationRow:
        return with_more(row, "cn0_dbhz", -9.0) if row.receiver in receivers and epoch_of(row) >= FAULT_S else row

    assert first_fault(decided(rows_changed(stream(SECONDS), change)))[:3] == (FAULT_S, State.SATELLITE_ANOMALY, Cause.JAMMING)


def test_a_drop_of_cn0_at_one_receiver_is_not() -> None:
    def change(row: ObservationRow) -> ObservationRow:
        return with_more(row, "cn0_dbhz", -9.0) if row.receiver == "A" and epoch_of(row) >= FAULT_S else row

    assert states(decided(rows_changed(stream(SECONDS), change))) == states(SOUND)


def test_without_cn0_the_check_is_named_as_not_monitored() -> None:
    outputs = decided(rows_changed(stream(SECONDS), lambda row: with_values(row, "cn0_dbhz", np.nan)))
    assert (states(outputs), "cn0" in health(outputs)[-1].not_monitored) == (states(SOUND), True)


@pytest.mark.parametrize(("receivers", "subjects"), [("ABC", ()), ("AB", ()), ("A", ("A",)), ("C", ("C",))])
def test_too_few_common_satellites_are_no_data_and_the_one_that_lacks_them_is_named(receivers: str, subjects: tuple[str, ...]) -> None:
    kept = used_satellites()[:4]

    def change(row: ObservationRow) -> ObservationRow:
        lacks = row.receiver in receivers and epoch_of(row) >= FAULT_S
        return with_signals(row, lambda s: s.partition(".")[0] in kept) if lacks else row

    assert first_fault(decided(rows_changed(stream(SECONDS), change))) == (FAULT_S, State.NOT_CONFIRMABLE, Cause.DATA, subjects)


def test_who_lacks_satellites_is_not_named_where_it_is_an_excluded_one_that_is_missing() -> None:
    """B and C keep five satellites, one of them excluded by then: they would be too few without A, too."""
    wrong, *others = used_satellites()
    kept = {"A": others[:3], "B": [wrong, *others[:4]], "C": [wrong, *others[:4]]}

    def change(row: ObservationRow) -> ObservationRow:
        return with_signals(row, lambda s: s.partition(".")[0] in kept[row.receiver]) if epoch_of(row) >= FAULT_S + 2 else row

    outputs = decided(rows_changed(range_fault(stream(SECONDS), "ABC", 30.0, wrong), change), named(SITE, on_satellite_fault="exclude"))
    assert first_fault(outputs) == (FAULT_S + 2, State.NOT_CONFIRMABLE, Cause.DATA, ())


def test_where_either_of_two_could_be_blamed_for_too_few_common_satellites_none_is() -> None:
    used = used_satellites()
    halves = {"A": used[::2], "B": used, "C": used[1::2]}

    def change(row: ObservationRow) -> ObservationRow:
        return with_signals(row, lambda s: s.partition(".")[0] in halves[row.receiver]) if epoch_of(row) >= FAULT_S else row

    assert first_fault(decided(rows_changed(stream(SECONDS), change))) == (FAULT_S, State.NOT_CONFIRMABLE, Cause.DATA, ())


def test_without_cn0_most_signals_lost_at_two_receivers_are_jamming() -> None:
    kept = used_satellites()[:4]

    def change(row: ObservationRow) -> ObservationRow:
        lost = row.receiver in "AB" and epoch_of(row) >= FAULT_S
        return with_values(with_signals(row, lambda s: s.partition(".")[0] in kept) if lost else row, "cn0_dbhz", np.nan)

    assert first_fault(decided(rows_changed(stream(SECONDS), change)))[:3] == (FAULT_S, State.SATELLITE_ANOMALY, Cause.JAMMING)


def test_exchanged_antennas_are_hinted_at() -> None:
    other = {"A": "B", "B": "A", "C": "C"}
    outputs = decided(rows_changed(stream(SECONDS), lambda row: replace(row, receiver=other[row.receiver])))
    assert "receivers A and B stand at each other's points" in reports(outputs)[0].verdict.reasons[0]


def test_a_satellite_of_an_unknown_system_is_ignored() -> None:
    def change(row: ObservationRow) -> ObservationRow:
        return replace(row, signals=("R05.1C", *row.signals[1:]))

    assert states(decided(rows_changed(stream(SECONDS), change))) == states(SOUND)


# ---- the rule of the source

TRIANGLE_SITE = named(SITE, rule="triangle")


def test_under_the_rule_of_the_source_a_sound_stream_is_normal() -> None:
    assert states(decided(stream(SECONDS), TRIANGLE_SITE)) == states(SOUND)


def test_under_the_rule_of_the_source_a_moved_triangle_is_a_satellite_anomaly() -> None:
    # The same faults of half the sky for everyone move all three alike.
    def change(row: ObservationRow) -> ObservationRow:
        return with_more(row, "pseudorange_m", 60.0, half_the_sky(row)) if epoch_of(row) >= FAULT_S else row

    found = first_fault(decided(rows_changed(stream(SECONDS), change), TRIANGLE_SITE))
    assert found[:2] == (FAULT_S, State.SATELLITE_ANOMALY)


def test_under_the_rule_of_the_source_a_broken_triangle_is_not_confirmable() -> None:
    def change(row: ObservationRow) -> ObservationRow:
        faulty = row.receiver == "B" and epoch_of(row) >= FAULT_S
        return with_more(row, "pseudorange_m", 60.0, half_the_sky(row)) if faulty else row

    found = first_fault(decided(rows_changed(stream(SECONDS), change), TRIANGLE_SITE))
    assert found[:2] == (FAULT_S, State.NOT_CONFIRMABLE)


def test_under_the_rule_of_the_source_no_satellite_is_excluded() -> None:
    outputs = decided(range_fault(stream(SECONDS), "ABC", 60.0, used_satellites()[0]), TRIANGLE_SITE)
    assert {h.excluded for h in health(outputs)} == {()}


def test_what_the_triangle_alone_says_is_what_its_rule_decides() -> None:
    events = range_fault(stream(SECONDS), "ABC", 60.0, used_satellites()[0])
    alone = [r.triangle_alone for r in reports(decided(events))]
    assert alone == [r.verdict.state for r in reports(decided(events, TRIANGLE_SITE))]
