"""What a decoded value can be: the bounds that the decoders promise, written down once more, and times that can be."""

import math
import re
from collections.abc import Iterable, Mapping

import numpy as np

from integrity.gnss.ephemeris.broadcast import Ephemeris, KeplerEphemeris
from integrity.gnss.gps_time import WEEK_NS
from integrity.gnss.observations import ObservationRow
from integrity.gnss.receiver_status import ReceiverStatus

SATELLITE = re.compile(
    r"G(0[1-9]|[12]\d|3[0-2])|E(0[1-9]|[12]\d|3[0-6])|C(0[1-9]|[1-5]\d|6[0-3])|R(0[1-9]|[12]\d|3[0-2])|J(0[1-9]|10)|S([2-4]\d|5[0-8])"
)
SIGNAL = re.compile(r"[GERCJS]\d\d\.[1-9][A-Z]")
Bounds = Mapping[str, tuple[float, float]]
LIGHT_MS_M = 299_792.458
UBX: Bounds = {
    "pseudorange_m": (1.0e7, 5.5e7),
    "carrier_cycles": (-1.0e9, 1.0e9),
    "doppler_hz": (-30_000.0, 30_000.0),
    "cn0_dbhz": (0.0, 63.0),
    "lock_s": (0.0, 64.5),
}
RTCM: Bounds = {
    "pseudorange_m": (33.0 * LIGHT_MS_M - 600.0, 255.0 * LIGHT_MS_M + 600.0),  # DF397, and half a millisecond of a cell
    "carrier_cycles": (3.8e7, 4.13e8),  # 33 to 255 ms of 1176 to 1606 MHz
    "doppler_hz": (-43_900.0, 43_900.0),  # DF399 and DF404 at 1606 MHz
    "cn0_dbhz": (0.0625, 63.9375),  # DF403, DF408
    "lock_s": (0.0, 67_108.864),  # DF407
}
RINEX: Bounds = {
    "pseudorange_m": (1.0e7, 1.0e8),
    "carrier_cycles": (-1.0e10, 1.0e10),  # F14.3
    "doppler_hz": (-1.0e10, 1.0e10),
    "cn0_dbhz": (1e-9, 70.0),
    "lock_s": (1.0, 0.0),  # RINEX does not tell
}


def assert_rows_in_range(rows: Iterable[ObservationRow], bounds: Bounds) -> None:
    """Names, times and numbers; a signal without range and carrier is not told of."""
    for row in rows:
        assert all(SIGNAL.fullmatch(signal) for signal in row.signals), row.signals
        assert 0 <= row.receive_time_ns < 5300 * WEEK_NS, row.receive_time_ns  # 2081
        for name, (least, most) in bounds.items():
            values = getattr(row, name)
            right = np.isnan(values) | ((values >= least) & (values <= most))
            assert right.all(), f"{name} = {values[~right]} of {row.signals}"
        assert np.all(np.isfinite(row.pseudorange_m) | np.isfinite(row.carrier_cycles))


def assert_satellites(names: Iterable[str]) -> None:
    for name in names:
        assert SATELLITE.fullmatch(name), name


def assert_sets_in_range(sets: Iterable[Ephemeris]) -> None:
    """Plausible as the store says, and of a satellite that there is."""
    for eph in sets:
        assert eph.implausibility() is None, eph
        assert SATELLITE.fullmatch(eph.satellite), eph
        assert max(abs(eph.toe_ns), abs(eph.transmission_ns)) < 1 << 62, eph
        assert eph.accuracy_m is None or 0.0 <= eph.accuracy_m <= 6144.0, eph
        assert 0 <= eph.issue < 1024, eph
        assert not isinstance(eph, KeplerEphemeris) or 3600.0 <= eph.fit_half_s <= 73.0 * 3600.0, eph


def assert_finite(values: Iterable[float]) -> None:
    assert all(math.isfinite(value) for value in values)


def assert_status_in_range(status: ReceiverStatus) -> None:
    assert status.lat_rad is None or abs(status.lat_rad) <= math.pi / 2
    assert status.lon_rad is None or abs(status.lon_rad) <= math.pi
    assert status.height_m is None or -1000.0 <= status.height_m <= 80_000.0
    assert status.agc is None or 0.0 <= status.agc <= 1.0
    assert status.model is None or status.model.isprintable()
