"""Numbers that are missing, infinite or absurd are no exception, and never NORMAL."""

import numpy as np
import pytest

from integrity.carrier_thresholds import CARRIER_CHECKS
from integrity.events import IonosphereReceived
from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.observations import ROW_FLAGS, ROW_FLOATS, ObservationRow
from integrity.states import Cause, State
from tests.unit.monitored import FAULT_S, SECONDS, SOUND, decided, first_fault, published, states
from tests.unit.streams import START_NS, epoch_of, health, reports, rows_changed, stream, with_more, with_signals, with_values

NO_NUMBERS = [np.nan, np.inf, -np.inf]


@pytest.mark.parametrize("value", NO_NUMBERS)
@pytest.mark.parametrize("name", ROW_FLOATS)
@pytest.mark.parametrize("receivers", ["A", "ABC"])
@pytest.mark.parametrize("columns", [[0], slice(None)], ids=["one signal", "all signals"])
def test_no_number_in_any_field_is_no_exception(name: str, value: float, receivers: str, columns: list[int] | slice) -> None:
    def change(row: ObservationRow) -> ObservationRow:
        return with_values(row, name, value, columns) if row.receiver in receivers and epoch_of(row) >= FAULT_S else row

    assert len(reports(decided(rows_changed(stream(SECONDS), change)))) == SECONDS


@pytest.mark.parametrize("value", NO_NUMBERS)
@pytest.mark.parametrize("receivers", ["A", "ABC"])
def test_no_number_in_all_ranges_is_never_normal(value: float, receivers: str) -> None:
    def change(row: ObservationRow) -> ObservationRow:
        return with_values(row, "pseudorange_m", value) if row.receiver in receivers and epoch_of(row) >= FAULT_S else row

    assert State.NORMAL not in states(decided(rows_changed(stream(SECONDS), change)))[FAULT_S:]


@pytest.mark.parametrize("name", [n for n in (*ROW_FLOATS, *ROW_FLAGS) if n not in ("pseudorange_m", "carrier_cycles", "cn0_dbhz", "slip")])
def test_what_is_not_used_changes_nothing(name: str) -> None:
    outputs = decided(rows_changed(stream(SECONDS), lambda row: with_values(row, name, 1.0)))
    assert published(outputs) == published(SOUND)


def test_carriers_that_slip_all_the_time_are_not_monitored() -> None:
    outputs = decided(rows_changed(stream(SECONDS), lambda row: with_values(row, "slip", 1.0)))
    assert states(outputs) == states(SOUND)
    assert all(set(CARRIER_CHECKS) <= set(report.not_monitored) for report in reports(outputs))


@pytest.mark.parametrize("value", [np.inf, -np.inf])
def test_an_infinite_cn0_does_not_blind_the_monitor_for_good(value: float) -> None:
    def change(row: ObservationRow) -> ObservationRow:
        if epoch_of(row) == 0:
            return with_values(row, "cn0_dbhz", value)
        return with_more(row, "cn0_dbhz", -9.0) if epoch_of(row) >= FAULT_S else row

    assert first_fault(decided(rows_changed(stream(SECONDS), change)))[:3] == (FAULT_S, State.SATELLITE_ANOMALY, Cause.JAMMING)


@pytest.mark.parametrize(
    ("receivers", "from_s", "state", "cause"),
    [
        ("A", 0, State.NOT_CONFIRMABLE, Cause.DATA),
        ("A", FAULT_S, State.NOT_CONFIRMABLE, Cause.DATA),
        ("ABC", 0, State.NOT_CONFIRMABLE, Cause.DATA),
        ("ABC", FAULT_S, State.SATELLITE_ANOMALY, Cause.JAMMING),
    ],
)
def test_an_epoch_without_any_signal_is_no_data_and_jamming_if_several_had_some(
    receivers: str, from_s: int, state: State, cause: Cause
) -> None:
    def change(row: ObservationRow) -> ObservationRow:
        return with_signals(row, lambda signal: False) if row.receiver in receivers and epoch_of(row) >= from_s else row

    last = health(decided(rows_changed(stream(SECONDS), change)))[-1]
    assert (last.state, last.cause) == (state, cause)


@pytest.mark.parametrize("value", [1e300, -1e300, 1e-300])
def test_an_ionosphere_beyond_measure_is_no_exception(value: float) -> None:
    broken = IonosphereReceived(START_NS, Klobuchar((value,) * 4, (value,) * 4))
    events = [broken if isinstance(e, IonosphereReceived) else e for e in stream(SECONDS)]
    assert len(reports(decided(events))) == SECONDS


def test_an_infinite_range_of_a_satellite_leaves_the_others() -> None:
    def change(row: ObservationRow) -> ObservationRow:
        return with_values(row, "pseudorange_m", np.inf, [0]) if row.receiver == "B" and epoch_of(row) >= FAULT_S else row

    assert states(decided(rows_changed(stream(SECONDS), change))) == states(SOUND)
