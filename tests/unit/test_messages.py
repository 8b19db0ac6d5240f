"""Messages: what is encoded comes back as it was; broken bytes are a DecodeError and nothing else; NaN never leaves."""

import math
from collections.abc import Iterator
from dataclasses import fields, replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest
from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import Message
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity import SOFTWARE
from integrity.errors import DecodeError
from integrity.events import EphemerisReceived, Event, InputLost, IonosphereReceived, ObservationsReceived, RawBytes, Tick
from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris.broadcast import Ephemeris, GeoEphemeris, GlonassEphemeris, KeplerEphemeris
from integrity.gnss.observations import ROW_ARRAYS, ObservationRow
from integrity.messages import wayside_pb2 as pb
from integrity.messages.inputs import Recorded, decode_event, encode_event, parsed
from integrity.messages.outputs import CAUSES, OUTCOMES, STATES, encode_output
from integrity.messages.snapshots import decode_snapshot, encode_snapshot
from integrity.outputs import EpochReport
from integrity.states import STATE_OF_CAUSE, Cause, Outcome, State
from integrity.station_monitor import Snapshot, StationMonitor
from recordings.simulate.constellation import IONOSPHERE, constellation
from tests.unit.streams import SITE, START_NS, epoch_of, new_monitor, reports, rows_changed, stream, ticks_only, with_more, with_values

RECEIVERS = SITE.receiver_names
int64s = st.integers(-(2**63), 2**63 - 1)
numbers = st.floats()
finite = st.floats(allow_nan=False, allow_infinity=False)
signals = st.lists(st.sampled_from([f"{s}{n:02d}.{c}" for s in "GE" for n in range(1, 9) for c in ("1C", "1X")]), unique=True, max_size=6)


def decoded_stream() -> list[Recorded]:
    return [event for event in stream(3) if not isinstance(event, RawBytes)]


@st.composite
def rows(draw: st.DrawFn) -> ObservationRow:
    names = draw(signals)
    floats = [np.array(draw(st.lists(numbers, min_size=len(names), max_size=len(names))), dtype=np.float64) for _ in range(5)]
    slip, half_cycle = (np.array(draw(st.lists(st.booleans(), min_size=len(names), max_size=len(names))), dtype=np.bool_) for _ in range(2))
    rho, carrier, doppler, cn0, lock = floats
    return ObservationRow(draw(st.text(max_size=5)), draw(int64s), tuple(names), rho, carrier, doppler, cn0, lock, slip, half_cycle)


shared: dict[str, st.SearchStrategy[Any]] = {
    "issue": st.integers(0, 1023),
    "healthy": st.booleans(),
    "accuracy_m": st.none() | finite,
    "transmission_ns": int64s,
    "toe_ns": int64s,
}


def floats_of(kind: type[Ephemeris]) -> dict[str, st.SearchStrategy[Any]]:
    return {f.name: finite for f in fields(kind) if f.type in (float, "float")}


ephemerides = st.one_of(
    *(
        st.builds(
            KeplerEphemeris,
            satellite=st.just(satellite),
            message=st.just(message),
            toc_ns=int64s,
            group_delay_2_s=st.none() | finite,
            **shared,
            **floats_of(KeplerEphemeris),
        )
        for satellite, message in [("G01", "LNAV"), ("J02", "LNAV"), ("E36", "INAV"), ("E36", "FNAV"), ("C06", "D1"), ("C02", "D2")]
    ),
    st.builds(
        GlonassEphemeris,
        satellite=st.just("R24"),
        channel=st.integers(-7, 6),
        delta_tau_n_s=st.none() | finite,
        **shared,
        **floats_of(GlonassEphemeris),
    ),
    st.builds(GeoEphemeris, satellite=st.just("S29"), **shared, **floats_of(GeoEphemeris)),
)
four = st.tuples(finite, finite, finite, finite)
events = st.one_of(
    st.builds(ObservationsReceived, int64s, rows()),
    st.builds(EphemerisReceived, int64s, ephemerides),
    st.builds(IonosphereReceived, int64s, st.builds(Klobuchar, four, four)),
    st.builds(Tick, int64s, int64s, st.none() | int64s),
    st.builds(InputLost, int64s, st.text(max_size=5), st.integers(0, 2**32 - 1)),
)


def values(event: Event) -> object:
    """What an event says, in a form that compares: rows have no equality, and NaN is not itself."""
    if not isinstance(event, ObservationsReceived):
        return event
    arrays = {name: [repr(v) for v in getattr(event.row, name).tolist()] for name in ROW_ARRAYS}
    return event.mono_ns, event.row.receiver, event.row.receive_time_ns, event.row.signals, arrays


def there_and_back(message: Message) -> Message:
    return parsed(type(message), message.SerializeToString())


@given(events)
def test_an_event_comes_back_as_it_was(event: Recorded) -> None:
    assert values(decode_event(there_and_back(encode_event(event)))) == values(event)


@pytest.mark.parametrize("event", [decoded_stream()[k] for k in (0, 1, -2, -1)], ids=lambda e: type(e).__name__)
def test_a_simulated_event_comes_back_as_it_was(event: Recorded) -> None:
    assert values(decode_event(there_and_back(encode_event(event)))) == values(event)


def test_an_output_is_not_an_input() -> None:
    with pytest.raises(DecodeError, match=r"wayside\.v1\.Health is not an input"):
        decode_event(pb.Health())


@pytest.mark.parametrize("count", [0, 3, 5])
def test_an_ionosphere_has_four_and_four_coefficients(count: int) -> None:
    with pytest.raises(DecodeError, match="four and four"):
        decode_event(pb.Ionosphere(alpha=[1e-8] * count, beta=[1e5] * 4))


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_an_ionosphere_has_finite_coefficients(value: float) -> None:
    with pytest.raises(DecodeError, match="finite"):
        decode_event(pb.Ionosphere(alpha=[1e-8, value, 0.0, 0.0], beta=[1e5] * 4))


@pytest.mark.parametrize("name", ROW_ARRAYS)
def test_arrays_that_do_not_fit_their_signals_are_refused(name: str) -> None:
    message = encode_event(decoded_stream()[-2])
    getattr(message, name).pop()
    with pytest.raises(DecodeError, match=name):
        decode_event(message)


@pytest.mark.parametrize("signal", ["", "5", "G5.1C", "g05.1c", "nonsense"])
def test_a_signal_that_is_none_is_refused(signal: str) -> None:
    message = encode_event(decoded_stream()[-2])
    assert isinstance(message, pb.Observations)
    message.signal[0] = signal
    with pytest.raises(DecodeError, match="signal"):
        decode_event(message)


# ---- snapshots


@cache
def some_snapshots() -> tuple[Snapshot, ...]:
    """Of a new monitor; waiting for a receiver; running; after a fault, with an exclusion; in silence."""
    sound = stream(12)

    def faulty(row: ObservationRow) -> ObservationRow:
        return with_more(row, "pseudorange_m", 60.0, [4]) if epoch_of(row) >= 9 else row

    found = []
    for events_fed in ((), sound[:40], sound, rows_changed(sound, faulty), (*sound, *ticks_only(sound[-1], 5))):
        monitor = new_monitor()
        monitor.feed(events_fed)
        found.append(monitor.snapshot())
    return tuple(found)


def encoded(snapshot: Snapshot) -> pb.Snapshot:
    return encode_snapshot(snapshot, RECEIVERS, 17)


@pytest.mark.parametrize("k", range(5), ids=["new", "waiting", "running", "excluding", "silent"])
def test_a_snapshot_comes_back_as_it_was(k: int) -> None:
    message = encoded(some_snapshots()[k])
    again = decode_snapshot(parsed(pb.Snapshot, message.SerializeToString()))  # type: ignore[arg-type]
    assert encoded(again).SerializeToString(deterministic=True) == message.SerializeToString(deterministic=True)


@pytest.mark.parametrize("k", range(5), ids=["new", "waiting", "running", "excluding", "silent"])
def test_a_monitor_from_decoded_bytes_decides_the_same(k: int) -> None:
    later = stream(20)[-30:]
    snapshot = some_snapshots()[k]
    again = decode_snapshot(parsed(pb.Snapshot, encoded(snapshot).SerializeToString()))  # type: ignore[arg-type]
    decisions = [
        [(r.state, r.cause, r.statistic.tolist()) for r in reports(StationMonitor(SITE, s).feed(later))] for s in (snapshot, again)
    ]
    assert repr(decisions[0]) == repr(decisions[1])


def damaged(change: str) -> pb.Snapshot:
    message = encoded(some_snapshots()[2])
    if change == "a stream is missing":
        del message.streams[2]
    elif change == "all streams are missing":
        del message.streams[:]
    elif change == "a stream is short":
        message.streams[1].pseudorange_m.pop()
    elif change == "all streams are short":
        for memory in message.streams:
            memory.cn0_baseline_dbhz.pop()
    elif change == "normal with a cause":
        message.cause = pb.DATA
    elif change == "a cause of another state":
        message.state, message.cause = pb.NOT_CONFIRMABLE, pb.SATELLITE
    elif change == "no state":
        message.state = pb.STATE_UNSPECIFIED
    elif change == "a signal stands twice":
        message.signal[1] = message.signal[0]
    return message


@pytest.mark.parametrize(
    "change",
    [
        "a stream is missing",
        "all streams are missing",
        "a stream is short",
        "all streams are short",
        "normal with a cause",
        "a cause of another state",
        "no state",
        "a signal stands twice",
    ],
)
def test_a_snapshot_whose_parts_do_not_fit_is_refused(change: str) -> None:
    with pytest.raises(DecodeError):
        decode_snapshot(damaged(change))


# ---- broken bytes


ENCODED: list[tuple[type[Message], bytes]] = [
    *((type(m), m.SerializeToString()) for m in (encode_event(decoded_stream()[k]) for k in (0, 1, -2, -1))),
    (pb.Snapshot, encoded(some_snapshots()[1]).SerializeToString()),
    (pb.Snapshot, encoded(some_snapshots()[3]).SerializeToString()),
]


def decoded(message: Message) -> object:
    return decode_snapshot(message) if isinstance(message, pb.Snapshot) else decode_event(message)


def decodes_or_refuses(message_type: type[Message], data: bytes) -> bool:
    """False for an exception that is not a DecodeError."""
    try:
        decoded(parsed(message_type, data))
    except DecodeError:
        return True
    return True


class Edit(NamedTuple):
    """One change of bytes: those from a place (a share of the length) up to a length are replaced."""

    place: float
    removed: int
    inserted: bytes


edits = st.builds(Edit, st.floats(0.0, 1.0), st.sampled_from([0, 1, 1, 1, 3, 20, 10_000]), st.binary(max_size=6))


@settings(max_examples=400, deadline=None)
@given(st.integers(0, len(ENCODED) - 1), st.lists(edits, min_size=1, max_size=4))
def test_broken_bytes_decode_or_are_refused(which: int, changes: list[Edit]) -> None:
    message_type, data = ENCODED[which]
    for change in changes:
        at = round(change.place * len(data))
        data = data[:at] + change.inserted + data[at + change.removed :]
    assert decodes_or_refuses(message_type, data)


@given(st.sampled_from([t for t, _ in ENCODED]), st.binary(max_size=200))
def test_any_bytes_decode_or_are_refused(message_type: type[Message], data: bytes) -> None:
    assert decodes_or_refuses(message_type, data)


# ---- outputs


def floats_in(message: Message) -> Iterator[float]:
    for field, value in message.ListFields():
        repeated = list(value) if field.is_repeated else [value]
        if field.type == FieldDescriptor.TYPE_MESSAGE:
            for inner in repeated:
                yield from floats_in(inner)
        elif field.type in (FieldDescriptor.TYPE_DOUBLE, FieldDescriptor.TYPE_FLOAT):
            yield from repeated


def everything_encoded(events_fed: tuple[Event, ...]) -> list[Message]:
    return [encode_output(output, SITE, SOFTWARE) for output in new_monitor().feed(events_fed)]


@pytest.mark.parametrize("value", [np.nan, 1e7, 1e300], ids=str)
@pytest.mark.parametrize("receivers", ["A", "ABC"])
def test_what_is_not_a_number_never_leaves(receivers: str, value: float) -> None:
    def change(row: ObservationRow) -> ObservationRow:
        return with_values(row, "pseudorange_m", value, [3]) if row.receiver in receivers and epoch_of(row) % 3 == 1 else row

    found = [x for message in everything_encoded(rows_changed(stream(12), change)) for x in floats_in(message)]
    assert [x for x in found if not math.isfinite(x)] == []


def test_without_ephemerides_no_number_that_is_none_leaves() -> None:
    messages = everything_encoded(tuple(e for e in stream(5) if not isinstance(e, EphemerisReceived)))
    assert [x for message in messages for x in floats_in(message) if not math.isfinite(x)] == []


def test_an_unsolved_receiver_has_no_components() -> None:
    messages = everything_encoded(tuple(e for e in stream(5) if not isinstance(e, EphemerisReceived)))
    report = next(m for m in messages if isinstance(m, pb.EpochReport))
    assert [v.HasField("east_m") for v in report.triangle] == [False, False, False]


def sound_report() -> tuple[EpochReport, pb.EpochReport]:
    report = reports(new_monitor().feed(stream(12)))[-1]
    message = encode_output(report, SITE, SOFTWARE)
    assert isinstance(message, pb.EpochReport)
    return report, message


def test_every_check_is_in_the_report() -> None:
    report, message = sound_report()
    said = [None if np.isnan(statistic) else statistic for statistic in report.statistic.tolist()]
    assert [(c.name, c.statistic if c.HasField("statistic") else None, c.threshold) for c in message.checks] == list(
        zip(report.check_names, said, report.threshold.tolist(), strict=True)
    )


def test_the_triangle_is_in_the_report() -> None:
    report, message = sound_report()
    assert [(v.receiver, v.east_m, v.north_m, v.up_m) for v in message.triangle] == [
        (name, *e) for name, e in zip(RECEIVERS, report.e_enu_m.tolist(), strict=True)
    ]


def test_every_used_signal_has_a_residual_in_the_report() -> None:
    report, message = sound_report()
    assert {r.signal for r in message.residuals if r.used} == {s for s, u in zip(report.signals, report.used, strict=True) if u}


def test_health_carries_who_and_what_was_decided_with() -> None:
    message = everything_encoded(stream(12))[-1]
    assert isinstance(message, pb.Health)
    assert (message.site, message.config_sha256, message.software) == (SITE.site_id, SITE.config_sha256, SOFTWARE)


def test_health_before_the_first_epoch_has_no_time() -> None:
    ticks = [Tick(START_NS + k * 10**9, 0, None) for k in range(5)]
    health = next(m for m in everything_encoded(tuple(ticks)) if isinstance(m, pb.Health))
    assert (health.HasField("gps_time_ns"), health.HasField("utc_ns")) == (False, False)


def test_utc_of_health_is_that_of_its_epoch() -> None:
    health = next(m for m in everything_encoded(stream(3)) if isinstance(m, pb.Health))
    # 18 leap seconds, 315964800 s from the Unix to the GPS epoch.
    assert health.utc_ns - health.gps_time_ns == (315_964_800 - 18) * 10**9


def test_no_word_has_the_number_of_unspecified_but_no_cause() -> None:
    numbers_used = [*STATES.values(), *OUTCOMES.values(), *(n for c, n in CAUSES.items() if c is not Cause.NONE)]
    assert 0 not in numbers_used


def test_every_word_has_a_number_of_its_own() -> None:
    assert [len(set(table.values())) for table in (STATES, CAUSES, OUTCOMES)] == [len(State), len(Cause), len(Outcome)]


@pytest.mark.parametrize("cause", list(Cause))
def test_every_health_of_a_snapshot_comes_back(cause: Cause) -> None:
    state = State.NORMAL if cause is Cause.NONE else STATE_OF_CAUSE[cause]
    health = replace(some_snapshots()[0].health, state=state, cause=cause, subjects=("B",), clean_epochs=3, clean_since_ns=0)
    assert decode_snapshot(encoded(replace(some_snapshots()[0], health=health))).health == health


def test_every_ephemeris_of_the_constellation_comes_back() -> None:
    sets = constellation(1, START_NS, START_NS)
    assert [decode_event(encode_event(EphemerisReceived(0, eph))) for eph in sets] == [EphemerisReceived(0, eph) for eph in sets]


def test_the_ionosphere_comes_back() -> None:
    assert decode_event(encode_event(IonosphereReceived(5, IONOSPHERE))) == IonosphereReceived(5, IONOSPHERE)
