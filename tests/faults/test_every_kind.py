"""Every kind of fault, in measurements and in the bytes of both protocols, through the monitor: whatever it decides, it decides."""

from collections.abc import Sequence

import pytest

from integrity.events import Event
from integrity.outputs import EpochReport, HealthReport, Output
from integrity.states import State
from integrity.station_monitor import StationMonitor
from recordings.faults import inject
from recordings.faults.kinds import KINDS, Effect
from tests.unit.faults.everywhere import MEASURED, MSM, RAWX, RTCM_SITE, fault
from tests.unit.streams import SITE

TABLES: dict[str, dict[str, object]] = {
    "satellite_step": {"satellite": "G07", "size_m": 20.0},
    "satellite_ramp": {"satellite": "E11", "rate_mps": 0.5},
    "satellite_acceleration": {"satellite": "C25", "rate_mps2": 0.1},
    "code_carrier_divergence": {"satellite": "J02", "rate_mps": 0.1},
    "code_bias": {"satellite": "G07", "size_m": 20.0, "receivers": ("A", "B")},
    "low_power": {"satellite": "R02", "drop_db": 6.0},
    "wrong_ephemeris": {"satellite": "G07", "offset_m": 700.0, "direction": "along"},
    "constellation_clock": {"system": "Galileo", "size_m": 30.0},
    "constellation_frame": {"system": "GPS", "offset_ecef_m": (20.0, 0.0, -20.0)},
    "iono_front": {"slope_mm_per_km": 400.0, "width_km": 50.0, "speed_mps": 500.0, "azimuth_deg": 70.0, "edge_km": 0.0},
    "receiver_bias": {"receiver": "B", "offset_enu_m": (9.0, -12.0, 0.0)},
    "receiver_ramp": {"receiver": "B", "rate_mps": 1.0},
    "receiver_noise": {"receiver": "B", "factor": 10.0},
    "receiver_freeze": {"receiver": "B"},
    "receiver_drop": {"receiver": "B"},
    "receiver_clock_jump": {"receiver": "B", "size_m": 299_792.458},
    "receiver_duplicate": {"receiver": "B"},
    "antenna_moved": {"receiver": "C", "offset_enu_m": (0.0, 1.0, 0.0)},
    "multipath": {"receiver": "B", "satellites": ("G07", "E11"), "amplitude_m": 5.0, "period_s": 10.0},
    "two_receivers": {"receivers": ("A", "B"), "offset_enu_m": (9.0, -12.0, 0.0)},
    "jamming": {"receivers": ("A", "B", "C"), "drop_db": 12.0},
    "spoofing": {"receivers": ("A", "B", "C"), "coherent": False},
    "meaconing": {"from_receiver": "A", "to_receivers": ("B", "C"), "delay_m": 300.0},
    "corrupt_bytes": {"receiver": "B", "rate": 0.001},
    "delay": {"receiver": "B", "seconds": 2.5},
}
ONLY_WITH_BYTES = ("corrupt_bytes",)
ONLY_WITHOUT = ("wrong_ephemeris",)  # these bytes say orbits before the fault alone
HARMLESS = ("receiver_clock_jump", "constellation_clock")


def effect_of(kind: str) -> Effect:
    return KINDS[kind].model_validate(TABLES[kind])


def decided(events: Sequence[Event], kind: str, rtcm: bool) -> list[Output]:
    site = RTCM_SITE if rtcm else SITE
    return StationMonitor(site).feed(inject(events, [fault(effect_of(kind))], site))


def test_all_kinds_are_here() -> None:
    assert TABLES.keys() == KINDS.keys()


@pytest.mark.parametrize("kind", [kind for kind in TABLES if kind not in ONLY_WITH_BYTES])
def test_the_monitor_decides_measurements_with_every_fault(kind: str) -> None:
    found = [out for out in decided(MEASURED, kind, False) if isinstance(out, HealthReport)]
    assert len(found) >= 10
    assert found[-1].mono_ns >= MEASURED[-1].mono_ns


@pytest.mark.parametrize("rtcm", [False, True], ids=["ubx", "rtcm"])
@pytest.mark.parametrize("kind", [kind for kind in TABLES if kind not in ONLY_WITHOUT])
def test_the_monitor_decides_bytes_with_every_fault(kind: str, rtcm: bool) -> None:
    found = [out for out in decided(MSM if rtcm else RAWX, kind, rtcm) if isinstance(out, HealthReport)]
    assert len(found) >= 10


@pytest.mark.parametrize("kind", HARMLESS)
def test_a_clock_that_steps_stops_nothing(kind: str) -> None:
    """Of a receiver by a millisecond, of a constellation by 30 m: no position moves."""
    for events, rtcm in ((MEASURED, False), (RAWX, False), (MSM, True)):
        states = [out.state for out in decided(events, kind, rtcm) if isinstance(out, EpochReport)]
        assert set(states[7:]) == {State.NORMAL}
