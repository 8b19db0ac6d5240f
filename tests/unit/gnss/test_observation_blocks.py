"""Rows that cannot be built wrong, and blocks that line them up."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from integrity.gnss.observations import ROW_ARRAYS, ROW_FLOATS, ObservationRow, build_block, layout_of


def row(receiver: str, signals: tuple[str, ...], first_range_m: float = 2e7, receive_time_ns: int = 10**18) -> ObservationRow:
    """Ranges `first_range_m`, + 1, + 2, ...; everything else recognisable by its size."""
    n = np.arange(len(signals), dtype=np.float64)
    no = np.zeros(len(signals), dtype=np.bool_)
    return ObservationRow(receiver, receive_time_ns, signals, first_range_m + n, 1e8 + n, 1e3 + n, 40.0 + n, 60.0 + n, no, ~no)


@pytest.mark.parametrize("name", ROW_ARRAYS)
def test_an_array_of_the_wrong_length_is_refused(name: str) -> None:
    good = row("A", ("G01.1C", "G02.1C"))
    shorter: dict[str, Any] = {name: getattr(good, name)[:1]}
    with pytest.raises(ValueError, match=name):
        replace(good, **shorter)


def test_a_signal_that_stands_twice_is_refused() -> None:
    with pytest.raises(ValueError, match="twice"):
        row("A", ("G01.1C", "G01.1C"))


@pytest.mark.parametrize("name", ROW_ARRAYS)
def test_arrays_of_a_row_are_read_only(name: str) -> None:
    with pytest.raises(ValueError, match="read-only"):
        getattr(row("A", ("G01.1C",)), name)[0] = 1


@pytest.mark.parametrize("name", ("receive_time_ns", *ROW_ARRAYS))
def test_arrays_of_a_block_are_read_only(name: str) -> None:
    block = build_block(("A",), [0], [[row("A", ("G01.1C",))]])
    with pytest.raises(ValueError, match="read-only"):
        getattr(block, name)[0] = 1


@pytest.mark.parametrize("name", ROW_ARRAYS)
def test_values_stand_at_their_epoch_receiver_and_signal(name: str) -> None:
    rows = [[row("A", ("G02.1C", "E01.1C"), 1e7), row("B", ("E01.1C",), 2e7)], [row("A", (), 3e7), row("B", ("G02.1C",), 4e7)]]
    block = build_block(("A", "B"), [0, 1], rows)
    found = {
        (e, r, s): getattr(block, name)[e, r, i]
        for e in range(2)
        for r in range(2)
        for i, s in enumerate(block.signals)
        if s in rows[e][r].signals
    }
    expected = {(e, r, s): getattr(rows[e][r], name)[i] for e in range(2) for r in range(2) for i, s in enumerate(rows[e][r].signals)}
    assert found == expected


@pytest.mark.parametrize("name", ROW_FLOATS)
def test_what_was_not_seen_is_nan(name: str) -> None:
    block = build_block(("A", "B"), [0], [[row("A", ("G01.1C",)), row("B", ("G02.1C",))]])
    assert np.isnan(getattr(block, name)[0]).tolist() == [[False, True], [True, False]]


def test_signals_stand_by_satellite_the_preferred_first() -> None:
    block = build_block(("A",), [0], [[row("A", ("G07.1C", "E02.1X", "E02.1B", "E02.1C", "E11.1C"))]])
    assert block.signals == ("E02.1C", "E02.1X", "E02.1B", "E11.1C", "G07.1C")


def test_satellites_belong_to_the_signals() -> None:
    block = build_block(("A",), [0], [[row("A", ("G07.1C", "E02.1X", "E02.1C"))]])
    assert block.satellites == ("E02", "E02", "G07")


def test_a_remembered_signal_has_a_column() -> None:
    rows = [row("A", ("G07.1C",))]
    block = build_block(("A",), [0], [rows], layout_of(rows, more_signals=("G03.1C", "G07.1C")))
    assert block.signals == ("G03.1C", "G07.1C")


def test_the_layout_before_serves_rows_with_the_same_signals() -> None:
    before = layout_of([row("A", ("G07.1C",)), row("B", ("G08.1C",))], ("G09.1C",))
    assert layout_of([row("A", ("G07.1C",), 3e7), row("B", ("G08.1C",))], ("G09.1C",), before) is before


@pytest.mark.parametrize(
    ("seen", "more"), [(("G07.1C", "G08.1C"), ()), (("G08.1C",), ()), (("G07.1C",), ("G09.1C",))], ids=["one more", "another", "remembered"]
)
def test_the_layout_before_does_not_serve_other_signals(seen: tuple[str, ...], more: tuple[str, ...]) -> None:
    rows = [row("A", seen)]
    assert layout_of(rows, more, layout_of([row("A", ("G07.1C",))])).signals == layout_of(rows, more).signals


def test_order_of_signals_in_a_row_changes_nothing() -> None:
    one = row("A", ("G01.1C", "G02.1C", "G03.1C"))
    reversed_arrays: dict[str, Any] = {name: getattr(one, name)[::-1] for name in ROW_ARRAYS}
    other = replace(one, signals=one.signals[::-1], **reversed_arrays)
    a, b = (build_block(("A",), [0], [[r]]) for r in (one, other))
    assert a.pseudorange_m.tolist() == b.pseudorange_m.tolist()


def test_each_receiver_keeps_its_own_time() -> None:
    block = build_block(("A", "B"), [10**18], [[row("A", (), receive_time_ns=10**18 + 3), row("B", (), receive_time_ns=10**18 - 5)]])
    assert block.receive_time_ns.tolist() == [[10**18 + 3, 10**18 - 5]]
