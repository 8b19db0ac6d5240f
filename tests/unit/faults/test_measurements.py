"""RXM-RAWX as a multi-frequency receiver sends it, with a fault in it: L2 and E5 follow L1, what has no place in the fault stays."""

import numpy as np
import pytest
from numpy.typing import NDArray

from integrity.events import Event, RawBytes
from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.ubx.framing import Framer, frame_bytes
from integrity.gnss.ubx.rawx import RAWX_DTYPE, RAWX_HEADER, RXM_RAWX
from recordings.faults.kinds import Jamming, ReceiverBias, ReceiverFreeze, SatelliteRamp, SatelliteStep, Spoofing
from tests.unit.faults.raw import BYTES, framed, with_fault

OTHER_HZ = {(0, 3): 1_227.6e6, (0, 7): 1_176.45e6, (2, 5): 1_207.14e6}  # L2 CL, L5 Q, E5b I
GLONASS, BEIDOU = 6, 3
Table = NDArray[np.void]


def with_other_signals(events: tuple[Event, ...]) -> tuple[Event, ...]:
    """Each satellite on its other frequencies too, G07 with a carrier but no range on L5; and a satellite of two other systems."""
    return tuple(
        RawBytes(e.mono_ns, e.receiver, b"".join(_more(f) for f in Framer().feed(e.data))) if isinstance(e, RawBytes) else e for e in events
    )


def _more(frame: tuple[int, int, bytes]) -> bytes:
    if frame[:2] != RXM_RAWX:
        return frame_bytes(*frame)
    m = measurements(frame[2])
    more = [m]
    for (gnss_id, sig_id), hertz in OTHER_HZ.items():
        there = m[m["gnss_id"] == gnss_id].copy()
        there["sig_id"], there["cno_dbhz"] = sig_id, 40
        there["cp_cycles"] *= hertz / 1_575.42e6
        there["trk_stat"][(there["sv_id"] == 7) & (sig_id == 7)] &= ~1 & 0xFF
        more.append(there)
    for gnss_id in (GLONASS, BEIDOU):
        other = m[:1].copy()
        other["gnss_id"], other["sv_id"] = gnss_id, 7
        more.append(other)
    everything = np.concatenate(more)
    tow_s, week, leap_s, _, state, version = RAWX_HEADER.unpack_from(frame[2])
    return frame_bytes(*RXM_RAWX, RAWX_HEADER.pack(tow_s, week, leap_s, len(everything), state, version) + everything.tobytes())


def measurements(payload: bytes) -> Table:
    table: Table = np.frombuffer(payload, RAWX_DTYPE, offset=RAWX_HEADER.size)
    return table


EVENTS = with_other_signals(BYTES)


def tables(events: tuple[Event, ...], receiver: str = "B") -> list[Table]:
    return [measurements(frame.payload) for frame in framed(events, receiver)[0] if frame[:2] == RXM_RAWX]


BEFORE = tables(EVENTS)


def of(table: Table, gnss_id: int, sig_id: int) -> Table:
    found: Table = table[(table["gnss_id"] == gnss_id) & (table["sig_id"] == sig_id)]
    return found


@pytest.mark.parametrize(("gnss_id", "sig_id"), OTHER_HZ)
def test_other_frequencies_of_a_satellite_move_by_the_same_metres(gnss_id: int, sig_id: int) -> None:
    after = tables(with_fault(EVENTS, ReceiverBias(receiver="B", offset_enu_m=(40.0, 30.0, 0.0))))
    on_l1 = of(after[50], gnss_id, 0)["pr_m"] - of(BEFORE[50], gnss_id, 0)["pr_m"]
    was, now = of(BEFORE[50], gnss_id, sig_id), of(after[50], gnss_id, sig_id)
    ranged = was["trk_stat"] & 1 == 1
    assert np.ptp(on_l1) > 10.0
    assert (now["pr_m"] - was["pr_m"])[ranged] == pytest.approx(on_l1[ranged], abs=1e-6)
    assert (now["cp_cycles"] - was["cp_cycles"]) * SPEED_OF_LIGHT_MPS / OTHER_HZ[gnss_id, sig_id] == pytest.approx(on_l1, abs=1e-6)


def test_the_doppler_of_other_frequencies_goes_by_their_wavelength() -> None:
    """Doppler is a float of 32 bits: 0.25 mHz at 5 kHz."""
    after = tables(with_fault(EVENTS, SatelliteRamp(satellite="G07", rate_mps=2.0)))
    was, now = (next(m for m in of(table[50], 0, 3) if m["sv_id"] == 7) for table in (BEFORE, after))
    assert now["do_hz"] - was["do_hz"] == pytest.approx(-2.0 * 1_227.6e6 / SPEED_OF_LIGHT_MPS, abs=5e-4)


def test_a_range_that_the_receiver_does_not_vouch_for_stays() -> None:
    after = tables(with_fault(EVENTS, SatelliteStep(satellite="G07", size_m=30.0)))
    was, now = (next(m for m in of(table[50], 0, 7) if m["sv_id"] == 7) for table in (BEFORE, after))
    assert now["pr_m"] == was["pr_m"]
    assert now["cp_cycles"] != was["cp_cycles"]


@pytest.mark.parametrize("gnss_id", [GLONASS, BEIDOU])
def test_other_systems_stay_even_under_the_same_number(gnss_id: int) -> None:
    after = tables(with_fault(EVENTS, SatelliteStep(satellite="G07", size_m=30.0)))
    assert all(np.array_equal(a[a["gnss_id"] == gnss_id], b[b["gnss_id"] == gnss_id]) for a, b in zip(after, BEFORE, strict=True))


def test_only_the_satellite_concerned_is_touched() -> None:
    after = tables(with_fault(EVENTS, SatelliteStep(satellite="G07", size_m=30.0)))
    touched = {(int(m["gnss_id"]), int(m["sv_id"])) for a, b in zip(after, BEFORE, strict=True) for m in a[a != b]}
    assert touched == {(0, 7)}


def test_what_is_acquired_anew_is_so_on_all_frequencies() -> None:
    after = tables(with_fault(EVENTS, Spoofing(receivers=("A", "B", "C"), coherent=False)))
    for sig_id in (0, 3, 7):
        assert [set(of(after[k], 0, sig_id)["locktime_ms"].tolist()) for k in (40, 43)] == [{0}, {3000}]


def test_jamming_takes_signals_around_l1_out_and_leaves_the_others() -> None:
    after = tables(with_fault(EVENTS, Jamming(receivers=("B",), drop_db=15.0)))[50]
    assert 0 < len(of(after, 0, 0)) < len(of(BEFORE[50], 0, 0))
    assert np.array_equal(of(after, 0, 3), of(BEFORE[50], 0, 3))


def test_jamming_is_written_in_whole_decibels() -> None:
    after = tables(with_fault(EVENTS, Jamming(receivers=("B",), drop_db=4.6)))[50]
    assert set((of(BEFORE[50], 0, 0)["cno_dbhz"].astype(int) - of(after, 0, 0)["cno_dbhz"]).tolist()) <= {4, 5}


def test_a_frozen_receiver_repeats_all_frequencies() -> None:
    after = tables(with_fault(EVENTS, ReceiverFreeze(receiver="B")))
    assert np.array_equal(after[60], BEFORE[39])


def test_what_a_fault_does_not_name_in_a_measurement_stays() -> None:
    after = tables(with_fault(EVENTS, ReceiverBias(receiver="B", offset_enu_m=(40.0, 30.0, 0.0))))
    same = [name for name in RAWX_DTYPE.names or () if name not in ("pr_m", "cp_cycles", "do_hz")]
    assert all(np.array_equal(a[same], b[same]) for a, b in zip(after, BEFORE, strict=True))
