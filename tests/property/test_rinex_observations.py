"""Reading many lines side by side gives what reading one by one does, to the bit, whatever the lines hold.

Also of Compact RINEX, in whatever way it is damaged: it is refused, or gives numbers that an orbit can have.
"""

import math
import re
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from integrity.errors import DecodeError
from integrity.gnss.observations import same_measurements
from recordings.rinex import observation
from recordings.rinex.columns import FIELD_BYTES, Fields, read_fields, whole_numbers
from recordings.rinex.epochs import segments_of
from recordings.rinex.observation import ObservationFile, read_observations
from tests.property.test_rinex import OBSERVATIONS, damaged
from tests.unit.rinex.test_hatanaka import COMPACT, FIRST, HEADER, later

FIELD = re.compile(r" *-?\d*\.\d{3}", re.ASCII)
NUMBER = st.one_of(
    st.floats(-1e8, 1e9).map(lambda x: f"{x:14.3f}"),
    st.floats(-20.0, 20.0).map(lambda x: f"{x:14.3f}"),
    st.integers(-999, 999).map(lambda n: f"{'-' if n < 0 else ''}.{abs(n):03d}".rjust(14)),
    st.just(" " * 14),
    st.text(" -.0123456789x\xff", min_size=14, max_size=14),
)


@st.composite
def written(draw: st.DrawFn) -> str:
    """A field, perhaps with one byte changed, and the two digits after it."""
    number = draw(NUMBER)
    if draw(st.booleans()):
        at = draw(st.integers(0, 13))
        number = number[:at] + draw(st.sampled_from(" -.0123456789+eE\t\x00\xff:/")) + number[at + 1 :]
    return number + draw(st.text(" 0123456789", min_size=2, max_size=2))


def as_python_reads(text: str) -> tuple[float, bool]:
    """The number in the columns of a line, NaN for none, and whether something else stands there."""
    columns = text[:14]
    if not columns.strip(" "):
        return math.nan, False
    if len(columns) < 14 or not FIELD.fullmatch(columns):
        return math.nan, True
    return float(columns) or math.nan, False


@given(st.lists(written(), min_size=1, max_size=6), st.floats(0.0, 1.0))
@example(["  1234567 .000  "], 1.0)
@example(["     123  .456  "], 1.0)
@example(["           456  "], 1.0)
@example(["       - 1.234  "], 1.0)
@example(["      --12.345  "], 1.0)
@example(["          >123  "], 1.0)
@example(["          3123  "], 1.0)
def test_numbers_in_columns_are_those_that_python_reads(fields: list[str], ended: float) -> None:
    line = "".join(fields)
    line = line[: round(ended * len(line))]
    data = np.frombuffer(line.encode("latin-1") + b"7" * FIELD_BYTES * (len(fields) + 1), dtype=np.uint8)
    shape = (1, len(fields))
    out = Fields(np.empty(shape), np.empty(shape, dtype=np.bool_), np.empty(shape, dtype=np.uint8))
    read_fields(data, np.array([0]), np.array([len(line)]), out)
    expected = [as_python_reads(line[FIELD_BYTES * k : FIELD_BYTES * (k + 1)]) for k in range(len(fields))]
    np.testing.assert_array_equal(out.value[0], [value for value, _ in expected])
    assert out.wrong[0].tolist() == [wrong for _, wrong in expected]
    assert bytes(out.indicator[0]).decode("latin-1") == "".join(line[FIELD_BYTES * k + 14 :][:1] or " " for k in range(len(fields)))


@given(st.one_of(st.integers(-(10**16), 10**16).map(str), st.text("-0123456789& x", max_size=18)))
def test_whole_numbers_are_those_that_python_reads(text: str) -> None:
    data = np.frombuffer(b" " * FIELD_BYTES + text.encode() + b" ", dtype=np.uint8)
    number, whole = whole_numbers(data, np.array([FIELD_BYTES]), np.array([FIELD_BYTES + len(text)]), 15)
    expected = re.fullmatch(r"-?[0-9]{1,15}", text) is not None
    assert bool(whole[0]) == expected
    assert not expected or number[0] == int(text)


def read(data: bytes) -> ObservationFile | None:
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "damaged"
        path.write_bytes(data)
        try:
            return read_observations(path, "A")
        except DecodeError:
            return None


def one_by_one(*arguments: Any) -> Any:
    segments = segments_of(*arguments)
    return segments._replace(plain=np.zeros_like(segments.plain))


@settings(deadline=None)  # it writes and reads files
@given(damaged(OBSERVATIONS))
def test_epochs_read_side_by_side_are_those_read_one_by_one(data: bytes) -> None:
    together = read(data)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(observation, "segments_of", one_by_one)
        apart = read(data)
    assert (together is None) == (apart is None)
    if together and apart:
        assert together.problems == apart.problems
        assert [same_measurements(a, b) for a, b in zip(together.rows, apart.rows, strict=True)] == [True] * len(apart.rows)


EPOCHS = "".join(later(f"{k}", f"{k * 7919 % 100 - 50} {k} {k * 100} {'&' if k % 2 else '5'}", f"{k}") for k in range(1, 10))
COMPACT_FILE = (COMPACT + HEADER + FIRST + EPOCHS + FIRST).encode()


def test_the_compact_file_is_whole_before_it_is_damaged() -> None:
    file = read(COMPACT_FILE)
    assert file is not None
    assert (len(file.rows), file.problems) == (11, {})


@settings(deadline=None)  # it writes and reads a file
@given(damaged([COMPACT_FILE]))
def test_damaged_compact_files_are_refused_or_possible(data: bytes) -> None:
    file = read(data)
    for row in file.rows if file else ():
        assert 0 <= row.receive_time_ns < 2**63
        assert ((row.pseudorange_m >= 1e7) & (row.pseudorange_m <= 1e8)).all()
        assert not np.isinf([row.carrier_cycles, row.doppler_hz]).any()
        assert (np.isnan(row.cn0_dbhz) | ((row.cn0_dbhz > 0.0) & (row.cn0_dbhz <= 70.0))).all()
