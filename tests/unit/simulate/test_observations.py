from dataclasses import replace

import numpy as np
import pytest

from integrity.config import IntegrityConfig, ReceiverConfig, SiteConfig
from integrity.events import EphemerisReceived, Event, IonosphereReceived, ObservationsReceived, Tick
from integrity.gnss.atmosphere import klobuchar_delay_m
from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris.states import satellite_states
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS, gps_from_week, utc_from_gps
from integrity.gnss.observations import Floats, Ints, ObservationBlock, build_block
from integrity.gnss.positioning import Points, Prefit, points_at, positions, prefit, state_time_ns
from integrity.gnss.signals import L1_HZ, TIME_SCALES, time_scale_index
from integrity.outputs import EpochReport
from integrity.states import State
from integrity.station_monitor import StationMonitor
from recordings.simulate.constellation import IONOSPHERE
from recordings.simulate.errors import NOMINAL
from recordings.simulate.observations import Antenna, Motion, antennas_of, fixed, observed, simulate

POINTS_ECEF_M = {  # 90 to 110 m apart, near 35.7 N 139.5 E
    "A": (-3942993.018, 3367676.187, 3701350.868),
    "B": (-3943053.937, 3367583.183, 3701369.207),
    "C": (-3942971.855, 3367612.318, 3701423.545),
}
SITE = SiteConfig(
    site_id="simulated",
    frame="ITRF2020",
    frame_epoch=2026.0,
    epoch_interval_ns=NS_PER_S,
    host_clock="none",
    receivers=tuple(ReceiverConfig(name, point) for name, point in POINTS_ECEF_M.items()),
    integrity=IntegrityConfig(),
    valid_for_ms=3000,
    config_sha256="",
)
POINTS = points_at(np.array(list(POINTS_ECEF_M.values())))
EXACT = replace(  # clocks stay: they are solved for
    NOMINAL,
    satellite_m=0.0,
    ionosphere=0.0,
    noise_m=0.0,
    noise_low_m=0.0,
    multipath_m=0.0,
    multipath_low_m=0.0,
    carrier_m=0.0,
    range_rate_mps=0.0,
    cn0_db=0.0,
)
START_NS = gps_from_week(2408, 86_400.0 + 3 * 3600.0 + 18.0)  # 2026-03-02T03:00:00Z
BEFORE_CHANGE_NS = gps_from_week(2408, 86_400.0 + 4 * 3600.0 - 30.0)  # 30 s before all GPS satellites change their ephemerides
WAVELENGTH_M = SPEED_OF_LIGHT_MPS / L1_HZ


def rows_of(events: tuple[Event, ...], receiver: str) -> list[ObservationsReceived]:
    return [event for event in events if isinstance(event, ObservationsReceived) and event.row.receiver == receiver]


def seen_from_the_points(
    events: tuple[Event, ...], receivers: tuple[str, ...] = SITE.receiver_names, points: Points = POINTS
) -> tuple[ObservationBlock, EphemerisStore, np.ndarray, Prefit]:
    """The measurements with the satellite states of the ephemerides that had arrived, as the station would use them."""
    store, arrived = EphemerisStore(), []
    for event in events:
        if isinstance(event, EphemerisReceived):
            store.add(event.ephemeris)
        elif isinstance(event, Tick):
            arrived.append(len(store.ephemerides))
    rows = [[event.row for event in rows_of(events, name)] for name in receivers]
    epoch_ns = [row.receive_time_ns for row in rows[0]]
    block = build_block(receivers, epoch_ns, list(zip(*rows, strict=True)))
    index = store.choose(block.satellites, block.epoch_ns, np.array(arrived))
    states = satellite_states(store.ephemerides, index, state_time_ns(block.epoch_ns))
    return block, store, index, prefit(block, states, points, IONOSPHERE)


@pytest.mark.parametrize("start_ns", [START_NS, BEFORE_CHANGE_NS, START_NS + 560 * NS_PER_S, WEEK_NS * 2409 - 30 * NS_PER_S])
@pytest.mark.parametrize("seed", [1, 2])
def test_without_errors_the_surveyed_points_are_found(seed: int, start_ns: int) -> None:
    """Below 5 mm, also across the end of the week; ranges are rounded to 1/1024 m. Below 0.3 m by sets that follow, rounded elsewhere."""
    block, store, index, at_points = seen_from_the_points(simulate(SITE, start_ns, 60.0, 1.0, seed, EXACT))
    states = satellite_states(store.ephemerides, index, state_time_ns(block.epoch_ns))
    used = np.isfinite(block.pseudorange_m)
    system_of = np.array([time_scale_index(s) for s in block.satellites])
    solution = positions(block, states, POINTS, IONOSPHERE, at_points, np.ones(used.shape), used, system_of, len(TIME_SCALES))
    at_first = (index == index[0]).all(axis=1)
    assert np.abs(solution.e_enu_m[at_first]).max() < 0.005
    assert np.abs(solution.e_enu_m).max() < 0.3


@pytest.mark.parametrize("seed", [1, 2])
def test_no_satellite_steps_where_its_set_changes(seed: int) -> None:
    """Third differences of ranges from epoch to epoch, but for the receiver's clock, are those of rounding to 1/1024 m: 8 half steps."""
    block, _, index, _ = seen_from_the_points(simulate(SITE, BEFORE_CHANGE_NS, 60.0, 1.0, seed, EXACT))
    assert (index != index[0]).any()
    third_m = np.diff(block.pseudorange_m, n=3, axis=0)
    assert np.nanmax(np.abs(third_m - np.nanmedian(third_m, axis=-1, keepdims=True))) <= 2 * 8 * 0.5 / 1024


@pytest.mark.parametrize("seed", range(4))
def test_without_errors_every_range_is_the_broadcast_model(seed: int) -> None:
    """But for the receivers' clocks: half a millimetre of rounding, and above 15 deg less than another one of the model's linear terms."""
    *_, at_points = seen_from_the_points(simulate(SITE, START_NS, 30.0, 1.0, seed, EXACT))
    residual_m = np.where(at_points.el_rad > np.radians(15.0), at_points.residual_m, np.nan)
    clock_m = np.nanmedian(residual_m, axis=2, keepdims=True)
    assert np.nanmax(np.abs(residual_m - clock_m)) < 0.0015


def test_clocks_of_receivers_are_in_their_ranges() -> None:
    """Up to 0.3 ms, 90 km, and not the same."""
    *_, at_points = seen_from_the_points(simulate(SITE, START_NS, 1.0, 1.0, 1, EXACT))
    clock_m = np.nanmedian(at_points.residual_m, axis=2)[0]
    assert np.abs(clock_m).max() < 90_000.0
    assert np.abs(np.diff(np.sort(clock_m))).min() > 100.0


def test_carrier_follows_the_code_but_for_the_ionosphere() -> None:
    """Code minus carrier changes by twice the change of the delay; 20 minutes; both are rounded to less than 1 mm."""
    block, _, _, at_points = seen_from_the_points(simulate(SITE, START_NS, 1200.0, 1.0 / 30.0, 1, EXACT))
    ends = [0, -1]
    difference_m = np.diff((block.pseudorange_m - WAVELENGTH_M * block.carrier_cycles)[ends], axis=0)
    tow_s = (block.epoch_ns % WEEK_NS / NS_PER_S)[:, None, None]
    lat, lon = POINTS.lat_rad[..., None], POINTS.lon_rad[..., None]
    delay_m = klobuchar_delay_m(tow_s, lat, lon, at_points.az_rad, np.maximum(at_points.el_rad, 0.05), IONOSPHERE)
    twice_m = 2.0 * np.diff(delay_m[ends], axis=0)
    both = np.isfinite(difference_m)
    assert np.abs(twice_m[both]).max() > 0.1
    assert np.abs(difference_m - twice_m)[both].max() < 0.003


@pytest.mark.parametrize("seed", range(3))
def test_doppler_is_the_rate_of_the_carrier(seed: int) -> None:
    """Central differences over two seconds; 1 mHz of rounding, and above 30 deg 2 mHz (0.4 mm/s) of delays that the Doppler leaves out."""
    steady = replace(EXACT, clock_noise_m=0.0)
    block, _, _, at_points = seen_from_the_points(simulate(SITE, START_NS, 10.0, 1.0, seed, steady))
    rate_hz = 0.5 * (block.carrier_cycles[2:] - block.carrier_cycles[:-2])
    high = at_points.el_rad[1:-1] > np.radians(30.0)
    assert np.abs(block.doppler_hz[1:-1] + rate_hz)[high].max() < 0.003


def test_nothing_is_observed_below_the_cut_off() -> None:
    block, _, _, at_points = seen_from_the_points(simulate(SITE, START_NS, 3600.0, 1.0 / 60.0, 1))
    seen = np.isfinite(block.pseudorange_m)
    assert np.array_equal(seen, np.degrees(at_points.el_rad) >= 5.0)
    assert not seen.all()


def test_lock_time_counts_from_the_first_epoch_in_sight() -> None:
    block, *_ = seen_from_the_points(simulate(SITE, START_NS, 3600.0, 1.0 / 60.0, 1))
    first = np.isfinite(block.pseudorange_m).argmax(axis=0)
    assert first.max() > 0
    tracked_s = np.minimum(60.0 * (np.arange(60)[:, None, None] - first), 64.5)  # a u-blox receiver counts no further
    seen = np.isfinite(block.lock_s)
    assert np.array_equal(block.lock_s[seen], tracked_s[seen])


def test_a_slip_is_possible_where_tracking_begins() -> None:
    block, *_ = seen_from_the_points(simulate(SITE, START_NS, 3600.0, 1.0 / 60.0, 1))
    assert np.array_equal(block.slip, block.lock_s == 0.0)
    assert block.slip[1:].any()


def test_measurements_have_the_resolution_of_a_receiver() -> None:
    row = rows_of(simulate(SITE, START_NS, 1.0, 1.0, 1), "A")[0].row
    for values, per_unit in ((row.pseudorange_m, 1024), (row.carrier_cycles, 1024), (row.doppler_hz, 1024), (row.cn0_dbhz, 1)):
        assert np.array_equal(np.round(values * per_unit) / per_unit, values)


def test_events_come_in_the_order_of_a_station() -> None:
    """The ionosphere, the ephemerides in force, then for each epoch three rows and a tick."""
    events = simulate(SITE, START_NS, 5.0, 1.0, 1)
    before = [event for event in events if isinstance(event, EphemerisReceived)]
    assert isinstance(events[0], IonosphereReceived)
    assert list(events[1 : 1 + len(before)]) == before
    kinds = [event.row.receiver if isinstance(event, ObservationsReceived) else type(event).__name__ for event in events[1 + len(before) :]]
    assert kinds == ["A", "B", "C", "Tick"] * 5


def test_an_ephemeris_enters_when_it_is_transmitted() -> None:
    events = simulate(SITE, BEFORE_CHANGE_NS, 60.0, 1.0, 1)
    arrivals = [event for event in events if isinstance(event, EphemerisReceived)]
    assert {event.mono_ns for event in arrivals if event.ephemeris.satellite[0] == "G"} == {
        BEFORE_CHANGE_NS,
        BEFORE_CHANGE_NS + 30 * NS_PER_S,
    }
    assert all(event.mono_ns == max(event.ephemeris.transmission_ns, BEFORE_CHANGE_NS) for event in arrivals)


def test_monotonic_time_never_goes_back() -> None:
    times = [event.mono_ns for event in simulate(SITE, BEFORE_CHANGE_NS, 60.0, 0.4, 1)]
    assert times == sorted(times)


def test_a_tick_has_the_utc_of_its_epoch() -> None:
    ticks = [event for event in simulate(SITE, START_NS, 2.0, 1.0, 1) if isinstance(event, Tick)]
    assert ticks == [Tick(t, utc_from_gps(t), None) for t in (START_NS, START_NS + NS_PER_S)]


@pytest.mark.parametrize(
    ("start_s", "duration_s", "rate_hz", "epochs_s"),
    [
        (18.0, 3.0, 1.0, [18, 19, 20]),
        (18.0, 12.0, 0.2, [20, 25]),
        (20.0, 5.0, 0.2, [20]),
        (18.5, 0.4, 1.0, []),
        (18.0, 0.3, 5.0, [18, 18.2]),
    ],
)
def test_epochs_are_those_of_the_grid_from_start_to_end(start_s: float, duration_s: float, rate_hz: float, epochs_s: list[float]) -> None:
    hour_ns = START_NS - 18 * NS_PER_S
    events = simulate(SITE, hour_ns + round(start_s * NS_PER_S), duration_s, rate_hz, 1)
    assert [(event.row.receive_time_ns - hour_ns) / NS_PER_S for event in rows_of(events, "B")] == epochs_s


def test_a_seed_gives_the_same_measurements_again() -> None:
    one, other = (rows_of(simulate(SITE, START_NS, 3.0, 1.0, 5), "C")[-1].row for _ in range(2))
    assert np.array_equal(one.pseudorange_m, other.pseudorange_m)


def test_another_seed_gives_another_sky() -> None:
    one, other = (rows_of(simulate(SITE, START_NS, 1.0, 1.0, seed), "A")[0].row for seed in (5, 6))
    assert one.signals != other.signals


def test_a_receiver_measures_the_same_whoever_stands_beside_it() -> None:
    alone = rows_of(simulate(replace(SITE, receivers=SITE.receivers[1:2]), START_NS, 3.0, 1.0, 5), "B")[-1].row
    among = rows_of(simulate(SITE, START_NS, 3.0, 1.0, 5), "B")[-1].row
    assert np.array_equal(alone.carrier_cycles, among.carrier_cycles)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_site_without_faults_is_normal_once_it_has_started(seed: int) -> None:
    """With the default error model, across a change of the Galileo ephemerides."""
    outputs = StationMonitor(SITE).feed(simulate(SITE, START_NS + 400 * NS_PER_S, 300.0, 1.0, seed))
    states = [output.state for output in outputs if isinstance(output, EpochReport)]
    assert set(states[30:]) == {State.NORMAL}


EAST = POINTS.enu[0, 0, 0]
SPEED_MPS, ACCELERATION_MPS2 = 60.0, 0.8
CLOCK_OF_THE_TRAIN = "rx"


def departing(start_ecef_m: tuple[float, float, float]) -> Motion:
    """East, faster and faster."""

    def motion(gps_ns: Ints) -> tuple[Floats, Floats]:
        t_s = ((gps_ns - START_NS) / NS_PER_S)[:, None]
        speed_mps = SPEED_MPS + ACCELERATION_MPS2 * t_s
        return np.array(start_ecef_m) + 0.5 * (SPEED_MPS + speed_mps) * t_s * EAST, speed_mps * EAST

    return motion


TRAIN = (
    Antenna("front", departing(POINTS_ECEF_M["A"]), CLOCK_OF_THE_TRAIN),
    Antenna("rear", departing(POINTS_ECEF_M["B"]), CLOCK_OF_THE_TRAIN),
)
NAMES = tuple(antenna.receiver for antenna in TRAIN)


def clocks_and_residuals(events: tuple[Event, ...]) -> tuple[Floats, Floats]:
    """Of the train: what the receivers' clocks add (E, 2, 1), and what is left of signals above 15 deg where the antennas truly were."""
    epoch_ns = np.array([event.row.receive_time_ns for event in rows_of(events, NAMES[0])])
    moved = [antenna.motion(epoch_ns) for antenna in TRAIN]
    pos, vel = (np.stack(parts, axis=1) for parts in zip(*moved, strict=True))
    clock_m = np.zeros((len(epoch_ns), len(TRAIN), 1))
    for _ in range(2):  # the clocks tell when the antennas were where
        *_, at_points = seen_from_the_points(events, NAMES, points_at(pos - vel * clock_m / SPEED_OF_LIGHT_MPS))
        residual_m = np.where(at_points.el_rad > np.radians(15.0), at_points.residual_m, np.nan)
        clock_m = np.nanmedian(residual_m, axis=2, keepdims=True)
    return clock_m, residual_m - clock_m


@pytest.mark.parametrize("seed", range(3))
def test_a_moving_antenna_measures_from_where_it_is(seed: int) -> None:
    """As the fixed ones do. In 0.3 ms, which clocks are off, the train runs 2 cm."""
    _, residual_m = clocks_and_residuals(observed(TRAIN, START_NS, 20.0, 1.0, seed, EXACT))
    assert np.nanmax(np.abs(residual_m)) < 0.0015


def test_antennas_of_one_clock_have_the_same_bias() -> None:
    """Rounding and the model's linear terms aside; own clocks are kilometres apart."""
    clock_m, _ = clocks_and_residuals(observed(TRAIN, START_NS, 3.0, 1.0, 1, EXACT))
    assert np.abs(np.diff(clock_m, axis=1)).max() < 0.002


def test_antennas_have_clocks_of_their_own_unless_told_otherwise() -> None:
    own = tuple(replace(antenna, clock=None) for antenna in TRAIN)
    clock_m, _ = clocks_and_residuals(observed(own, START_NS, 3.0, 1.0, 1, EXACT))
    assert np.abs(np.diff(clock_m, axis=1)).min() > 100.0


def test_doppler_of_a_moving_antenna_is_the_rate_of_its_carrier() -> None:
    """As that of the fixed ones; the motion alone makes 300 Hz."""
    steady = replace(EXACT, clock_noise_m=0.0)
    nearby = points_at(POINTS.pos_ecef_m[:, :2])
    block, _, _, at_points = seen_from_the_points(observed(TRAIN, START_NS, 10.0, 1.0, 1, steady), NAMES, nearby)
    rate_hz = 0.5 * (block.carrier_cycles[2:] - block.carrier_cycles[:-2])
    high = at_points.el_rad[1:-1] > np.radians(30.0)
    assert np.abs(block.doppler_hz[1:-1] + rate_hz)[high].max() < 0.003


def test_a_fixed_receiver_measures_the_same_while_a_train_passes() -> None:
    alone = rows_of(simulate(SITE, START_NS, 3.0, 1.0, 5), "B")[-1].row
    beside = rows_of(observed((*TRAIN, *antennas_of(SITE)), START_NS, 3.0, 1.0, 5), "B")[-1].row
    assert np.array_equal(alone.carrier_cycles, beside.carrier_cycles)


def test_what_stands_still_has_no_velocity() -> None:
    pos, vel = fixed(POINTS_ECEF_M["C"])(np.array([START_NS, START_NS + 1]))
    assert (pos.tolist(), vel.tolist()) == ([list(POINTS_ECEF_M["C"])] * 2, [[0.0] * 3] * 2)
