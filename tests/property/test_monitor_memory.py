"""Whatever bytes stand where the memory of monitors should: they are refused, or monitors go on from what they say."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity import audit
from integrity.carrier_watch import watch
from integrity.errors import DecodeError
from integrity.events import EphemerisReceived
from integrity.gnss.ephemeris.states import Ephemerides
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.positioning import points_at
from integrity.gnss.signals import TIME_SCALES
from integrity.messages import wayside_pb2 as pb
from integrity.messages.inputs import parsed
from integrity.messages.monitors import decode_monitors
from integrity.monitor_memory import MonitorMemory
from integrity.monitors import clocks, navigation, signal, slow
from integrity.satellite_watch import SatelliteMemory
from tests.unit.streams import LIMITS, SITE, TRIANGLE, stream
from tests.unit.test_messages_monitors import LATER_NS, H, sound_message
from tests.unit.watched_carriers import sights_of

AUDITED = audit.audited_checks(SITE, LIMITS)
SOUND = sound_message().SerializeToString()
SETS = Ephemerides([event.ephemeris for event in stream() if isinstance(event, EphemerisReceived)])
POINTS = points_at(TRIANGLE.pos_ecef_m)
AT_NS = np.array([LATER_NS + NS_PER_S])
CLOCK_M, SIGMA_M = np.zeros((1, 3, len(TIME_SCALES))), np.ones((1, len(TIME_SCALES)))


def goes_on(memory: MonitorMemory) -> None:
    """One epoch later; warnings are errors."""
    clocks.advance(memory.clocks, AT_NS, CLOCK_M, SIGMA_M)
    slow.advance(memory.slow, AT_NS, np.ones((1, 3, 3)), np.ones((1, 3)), LIMITS.slow)
    signal.advance(memory.gains, AT_NS, np.full((1, 3), 0.5))
    audit.broken(audit.advance(memory.audit, int(AT_NS[0]), np.ones(len(LIMITS.names)), True, 9, AUDITED))
    table = {entry.satellite: entry for entry in memory.navigation}
    most = LIMITS["ephemeris"], LIMITS["orbit"]
    satellites = [eph.satellite for eph in SETS]
    [sight] = sights_of(SITE, stream(1.0))
    later = replace(sight, block=replace(sight.block, epoch_ns=AT_NS))
    watch(SatelliteMemory(table, memory.carriers).of_windows(H, 3).carriers, later, POINTS, LIMITS.carriers)
    navigation.advance(table, satellites, SETS, np.arange(len(SETS))[None], AT_NS, TRIANGLE.pos_ecef_m.mean(axis=0), *most)


def refused_or_goes_on(data: bytes) -> bool:
    try:
        message = parsed(pb.MonitorMemory, data)
        assert isinstance(message, pb.MonitorMemory)
        memory = decode_monitors(message, 3, LATER_NS)
    except DecodeError:
        return False
    goes_on(memory)
    return True


def test_sound_bytes_go_on() -> None:
    assert refused_or_goes_on(SOUND)


@settings(max_examples=400, deadline=None)
@given(st.lists(st.tuples(st.integers(0, len(SOUND) - 1), st.integers(1, 255)), min_size=1, max_size=3))
def test_flipped_bits_are_refused_or_monitors_go_on(flips: list[tuple[int, int]]) -> None:
    data = bytearray(SOUND)
    for at, pattern in flips:
        data[at] ^= pattern
    refused_or_goes_on(bytes(data))


@settings(max_examples=200, deadline=None)
@given(st.integers(0, len(SOUND)), st.sampled_from([0, 1, 3, 8, 40, 10_000]), st.binary(max_size=8))
def test_cut_and_spliced_bytes_are_refused_or_monitors_go_on(at: int, removed: int, inserted: bytes) -> None:
    refused_or_goes_on(SOUND[:at] + inserted + SOUND[at + removed :])


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=200))
def test_any_bytes_are_refused_or_monitors_go_on(data: bytes) -> None:
    refused_or_goes_on(data)
