"""Bytes of simulated receivers, read back by the decoders of the station and by pyubx2."""

import io
import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyubx2 import UBXReader

from integrity.errors import ConfigError
from integrity.events import EphemerisReceived, Event, Heard, IonosphereReceived, ObservationsReceived, RawBytes, StatusReceived, Tick
from integrity.gnss.ephemeris.broadcast import Ephemeris, KeplerEphemeris
from integrity.gnss.frames import ecef_from_geodetic
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS, parse_utc
from integrity.gnss.observations import ROW_ARRAYS, Floats, Ints, ObservationRow
from integrity.gnss.receiver_status import Jamming
from integrity.gnss.signals import satellite_of
from integrity.gnss.ubx.framing import Framer
from integrity.gnss.ubx.rawx import RXM_RAWX
from integrity.gnss.ubx.sfrbx import RXM_SFRBX, decode_sfrbx
from integrity.outputs import EpochReport
from integrity.reception import Reception
from recordings.faults import inject, parse_faults
from recordings.simulate.observations import Antenna, antennas_of, fixed, observed
from recordings.simulate.receiver import as_bytes
from tests.unit.streams import POINTS, SITE, START_NS, new_monitor, stream

ANTENNAS = antennas_of(SITE)
WEEK_END_NS = (START_NS // WEEK_NS + 1) * WEEK_NS
GPS_CHANGES_NS = parse_utc("2026-03-02T03:59:42Z")  # 04:00:00 GPS time: all satellites of the system begin new sets
GALILEO_CHANGES_NS = parse_utc("2026-03-02T03:39:42Z")


def heard(events: Iterable[Event]) -> list[Heard]:
    """What the station's reception makes of events."""
    reception = Reception(SITE.receiver_names)
    return [h for event in events for h in reception.take(event)]


def rows_of(events: Iterable[Heard | Event]) -> list[ObservationRow]:
    return [event.row for event in events if isinstance(event, ObservationsReceived)]


def sets_of(events: Iterable[Heard | Event]) -> set[Ephemeris]:
    """But for the time of transmission: words say when they were sent, a simulated set when it was first sent."""
    return {replace(event.ephemeris, transmission_ns=0) for event in events if isinstance(event, EphemerisReceived)}


def with_fault(text: str, seconds: float = 120.0) -> tuple[Event, ...]:
    events = stream(seconds)
    return inject(events, parse_faults(f"[[fault]]\n{text}", "faults", START_NS, SITE), SITE)


def bursts_of(raw: Iterable[Event], receiver: str) -> list[RawBytes]:
    return [event for event in raw if isinstance(event, RawBytes) and event.receiver == receiver]


def parsed(bursts: Iterable[RawBytes], identity: str) -> list[Any]:
    """Messages of one kind as pyubx2 reads them, every checksum looked at."""
    data = b"".join(burst.data for burst in bursts)
    return [message for _, message in UBXReader(io.BytesIO(data), quitonerror=2) if message.identity == identity]


def differences(sent: Sequence[ObservationRow], got: Sequence[ObservationRow]) -> list[str]:
    """What is not the same to the bit."""
    found = [] if len(sent) == len(got) else [f"{len(sent)} rows sent, {len(got)} read"]
    for a, b in zip(sent, got, strict=False):
        if (a.receiver, a.receive_time_ns, a.signals) != (b.receiver, b.receive_time_ns, b.signals):
            found.append(f"{a.receiver} at {a.receive_time_ns}: {a.signals} and {b.signals}")
        else:
            found += [f"{a.receiver} at {a.receive_time_ns}: {n}" for n in ROW_ARRAYS if not np.array_equal(getattr(a, n), getattr(b, n))]
    return found


@settings(max_examples=12, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 2**32),
    start_ns=st.integers(START_NS, START_NS + WEEK_NS) | st.integers(WEEK_END_NS - 40 * NS_PER_S, WEEK_END_NS),
    rate_hz=st.sampled_from([0.2, 1.0, 3.0, 10.0]),
)
def test_measurements_survive_the_trip_through_bytes_to_the_bit(seed: int, start_ns: int, rate_hz: float) -> None:
    events = observed(ANTENNAS, start_ns, max(40.0 / rate_hz, 5.0), rate_hz, seed)
    assert differences(rows_of(events), rows_of(heard(as_bytes(events, ANTENNAS)))) == []


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("start_ns", [START_NS, GPS_CHANGES_NS, WEEK_END_NS - 5 * NS_PER_S])
def test_sets_and_ionosphere_are_complete_before_the_first_measurements(start_ns: int, seed: int) -> None:
    events = observed(ANTENNAS, start_ns, 1.0, 1.0, seed)
    read = heard(as_bytes(events, ANTENNAS))
    first = next(k for k, event in enumerate(read) if isinstance(event, ObservationsReceived))
    in_row = {satellite_of(signal) for signal in rows_of(read)[0].signals}
    assert {s for s in sets_of(read[:first]) if s.satellite in in_row} == {s for s in sets_of(events) if s.satellite in in_row}
    assert {e.klobuchar for e in read[:first] if isinstance(e, IonosphereReceived)} == {
        e.klobuchar for e in events if isinstance(e, IonosphereReceived)
    }


@pytest.mark.parametrize(("system", "change_ns"), [("G", GPS_CHANGES_NS), ("E", GALILEO_CHANGES_NS)])
@pytest.mark.parametrize("seed", range(2))
def test_new_sets_arrive_within_half_a_minute_of_their_beginning(seed: int, system: str, change_ns: int) -> None:
    events = observed(ANTENNAS, change_ns - 5 * NS_PER_S, 36.0, 1.0, seed)
    in_all_rows = set.intersection(*({satellite_of(s) for s in row.signals} for row in rows_of(events)))
    sent, read = ({eph for eph in sets_of(some) if eph.satellite in in_all_rows} for some in (events, heard(as_bytes(events, ANTENNAS))))
    assert Counter(eph.satellite for eph in sent) == {s: 2 if s[0] == system else 1 for s in in_all_rows}
    assert read == sent


def test_decisions_are_those_on_the_measurements_themselves() -> None:
    events = stream(60.0)
    said = [
        [(r.gps_time_ns, r.state, r.cause, r.satellites_used.tolist()) for r in new_monitor().feed(some) if isinstance(r, EpochReport)]
        for some in (events, as_bytes(events, ANTENNAS))
    ]
    assert said[0] == said[1]


@pytest.mark.parametrize("rate_hz", [1.0, 10.0])
def test_the_last_byte_of_an_epoch_is_the_last_of_its_measurements(rate_hz: float) -> None:
    raw = as_bytes(observed(ANTENNAS, START_NS, 10.0, rate_hz, 1), ANTENNAS)
    kinds = []
    for burst in bursts_of(raw, "B"):
        framer = Framer()
        kinds.append([frame[:2] for frame in framer.feed(burst.data)])
        assert (framer.pending, framer.skipped_bytes) == (b"", 0)
    assert {(k[-1], k.count(RXM_RAWX)) for k in kinds} == {(RXM_RAWX, 1)}


def test_every_subframe_and_page_is_sent_once_when_it_has_ended() -> None:
    """30 s before the first of 60 epochs: 5 subframes and 15 pages a satellite; then one each 6 s and 2 s."""
    events = observed(ANTENNAS, START_NS, 60.0, 1.0, 1)
    in_all_rows = set.intersection(*({satellite_of(s) for s in row.signals} for row in rows_of(events) if row.receiver == "A"))
    sent: dict[str, list[tuple[int, tuple[int, ...]]]] = defaultdict(list)
    for k, burst in enumerate(bursts_of(as_bytes(events, ANTENNAS), "A")):
        for frame in Framer().feed(burst.data):
            words = decode_sfrbx(frame.payload) if frame[:2] == RXM_SFRBX else None
            if words is not None and words.satellite in in_all_rows:
                sent[words.satellite].append((k, words.words))
    counted = {s: (sum(k == 0 for k, _ in words), len(words)) for s, words in sent.items()}
    assert counted == {s: (5, 5 + 9) if s[0] == "G" else (15, 15 + 29) for s in in_all_rows}
    assert all(len(set(words)) == len(words) for s, words in sent.items() if s[0] == "G")


def test_pyubx2_reads_the_same_measurements() -> None:
    events = observed(ANTENNAS, START_NS, 70.0, 1.0, 1)
    row = rows_of(events)[-1]
    message = parsed(bursts_of(as_bytes(events, ANTENNAS), row.receiver), "RXM-RAWX")[-1]
    fields = ("gnssId", "svId", "prMes", "cpMes", "doMes", "cno", "locktime", "prValid", "cpValid", "halfCyc")
    read = [tuple(getattr(message, f"{field}_{i:02d}") for field in fields) for i in range(1, message.numMeas + 1)]
    identity = [({"G": 0, "E": 2}[signal[0]], int(signal[1:3])) for signal in row.signals]
    columns = (row.pseudorange_m, row.carrier_cycles, row.doppler_hz, row.cn0_dbhz, 1e3 * row.lock_s)
    values = zip(*(column.tolist() for column in columns), strict=True)
    assert read == [(*who, *measured, 1, 1, 1) for who, measured in zip(identity, values, strict=True)]
    assert (message.week, message.rcvTow, message.leapS) == (2408, row.receive_time_ns % WEEK_NS / NS_PER_S, 18)


def test_pyubx2_reads_where_the_receiver_is_and_when() -> None:
    """Within 2 m: the receiver's own error is below 1.4 m."""
    fix = parsed(bursts_of(as_bytes(observed(ANTENNAS, START_NS, 0.5, 10.0, 1), ANTENNAS), "C"), "NAV-PVT")[-1]
    there = ecef_from_geodetic(math.radians(fix.lat), math.radians(fix.lon), fix.height / 1e3)
    assert np.linalg.norm(there - POINTS["C"]) < 2.0
    assert (fix.year, fix.month, fix.day, fix.hour, fix.min, fix.second, fix.nano) == (2026, 3, 2, 3, 0, 0, 400_000_000)
    assert (fix.fixType, fix.gnssFixOk, fix.numSV, fix.invalidLlh) == (3, 1, 18, 0)


def test_a_moving_receiver_says_how_it_moves() -> None:
    point, up = np.array(POINTS["A"]), np.array(POINTS["A"]) / np.linalg.norm(POINTS["A"])
    east = np.cross([0.0, 0.0, 1.0], up) / np.linalg.norm(np.cross([0.0, 0.0, 1.0], up))

    def motion(gps_ns: Ints) -> tuple[Floats, Floats]:
        velocity = np.tile(30.0 * east, (len(gps_ns), 1))
        return point + (gps_ns - START_NS)[:, None] / NS_PER_S * velocity, velocity

    train = (Antenna("front", motion), Antenna("rear", fixed(POINTS["B"])))
    fix = parsed(bursts_of(as_bytes(observed(train, START_NS, 20.0, 1.0, 1), train), "front"), "NAV-PVT")[-1]
    there = ecef_from_geodetic(math.radians(fix.lat), math.radians(fix.lon), fix.height / 1e3)
    assert np.linalg.norm(there - (point + 19.0 * 30.0 * east)) < 2.0
    assert (fix.velE, fix.velN, fix.velD) == pytest.approx((30_000, 0, 0), abs=5)  # mm/s; a straight line is not east for ever
    assert fix.headMot == pytest.approx(90.0, abs=0.01)


def test_each_kind_of_message_comes_as_often_as_it_should() -> None:
    bursts = bursts_of(as_bytes(observed(ANTENNAS, START_NS, 4.0, 10.0, 1), ANTENNAS), "A")
    data = b"".join(burst.data for burst in bursts)
    counted = Counter(message.identity for _, message in UBXReader(io.BytesIO(data), quitonerror=2))
    del counted["RXM-SFRBX"]
    assert counted == {"MON-VER": 1, "MON-RF": 4, "NAV-PVT": 40, "RXM-RAWX": 40}


def test_ticks_stay_where_they_are() -> None:
    events = stream(5.0)
    kinds = [event.receiver if isinstance(event, RawBytes) else type(event).__name__ for event in as_bytes(events, ANTENNAS)]
    assert kinds == ["A", "B", "C", "Tick"] * 5
    assert [e for e in events if isinstance(e, Tick)] == [e for e in as_bytes(events, ANTENNAS) if isinstance(e, Tick)]


def test_a_receiver_that_drops_out_sends_no_byte() -> None:
    events = with_fault('kind = "receiver_drop"\nreceiver = "B"\nstart_s = 20\nduration_s = 60')
    times = {(burst.mono_ns - START_NS) // NS_PER_S for burst in bursts_of(as_bytes(events, ANTENNAS), "B")}
    assert times == {*range(20), *range(80, 120)}


def test_after_an_interruption_words_are_sent_of_half_a_minute() -> None:
    events = with_fault('kind = "receiver_drop"\nreceiver = "B"\nstart_s = 20\nduration_s = 60')
    first, *_, back = (parsed([burst], "RXM-SFRBX") for burst in bursts_of(as_bytes(events, ANTENNAS), "B")[:21])
    assert Counter((m.gnssId, m.svId) for m in back) == Counter((m.gnssId, m.svId) for m in first)


def test_a_wrong_orbit_is_in_the_words_until_the_right_one_is_sent_again() -> None:
    """In every subframe that begins from then on. Subframe 1 begins at 42, 72 and 102 s: the sets are whole at 78 and 114 s."""
    fault = 'kind = "wrong_ephemeris"\nsatellite = "G07"\nstart_s = 43\nduration_s = 40\noffset_m = 300.0\ndirection = "along"'
    events = with_fault(fault)
    sent, read = (
        [(e.mono_ns, e.ephemeris) for e in some if isinstance(e, EphemerisReceived) and e.ephemeris.satellite == "G07"]
        for some in (events, heard(as_bytes(events, ANTENNAS)))
    )
    right, wrong, again = (eph for _, eph in sent)
    from_a = [(t, eph) for t, eph in read[::3]]  # A, B and C tell
    assert [eph.issue for _, eph in from_a] == [right.issue, wrong.issue, again.issue]
    assert isinstance(right, KeplerEphemeris)
    assert isinstance(wrong, KeplerEphemeris)
    m0 = [eph.m0 for _, eph in from_a if isinstance(eph, KeplerEphemeris)]
    assert [m - right.m0 for m in m0] == pytest.approx([0.0, wrong.m0 - right.m0, 0.0], abs=math.pi * 2.0**-31)
    assert [(t - START_NS) / NS_PER_S for t, _ in from_a] == [0.0, 78.0, 114.0]


def test_an_orbit_that_no_message_can_carry_is_refused() -> None:
    fault = 'kind = "wrong_ephemeris"\nsatellite = "G07"\nstart_s = 20\nduration_s = 60\noffset_m = -9000.0\ndirection = "radial"'
    with pytest.raises(ConfigError, match=r"G07 cannot send its ephemeris: .*delta_n.*make the fault of this ephemeris smaller"):
        as_bytes(with_fault(fault), ANTENNAS)


def test_jamming_is_in_the_bytes_as_far_as_they_can_say_it() -> None:
    """C/N0 to the decibel."""
    events = with_fault('kind = "jamming"\nreceivers = ["A", "B", "C"]\nstart_s = 20\nduration_s = 60\ndrop_db = 15.0\nramp_s = 40.0')
    for sent, read in zip(rows_of(events), rows_of(heard(as_bytes(events, ANTENNAS))), strict=True):
        assert np.array_equal(read.cn0_dbhz, np.round(sent.cn0_dbhz))


def test_the_receiver_itself_notices_jamming_and_nothing_else() -> None:
    events = with_fault('kind = "jamming"\nreceivers = ["A"]\nstart_s = 20\nduration_s = 60\ndrop_db = 12.0')
    said = defaultdict(set)
    for event in heard(as_bytes(events, ANTENNAS)):
        if isinstance(event, StatusReceived) and event.status.jamming is not None:
            said[event.receiver, 20 <= (event.mono_ns - START_NS) // NS_PER_S < 80].add(event.status.jamming)
    calm = {(r, during): {Jamming.NONE_SEEN} for r in "ABC" for during in (False, True)}
    assert said == calm | {("A", True): {Jamming.WARNING}}
