"""Simulated receivers that send RTCM 3: decoded events become the messages that a caster would have passed on.

Each epoch is a burst: every half minute message 1006 and the ephemerides in force of all satellites seen, others when they begin, and
MSM7 last. RTCM has no message of the ionosphere's coefficients: who listens to nothing else has none.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from integrity.config import Protocol
from integrity.errors import ConfigError
from integrity.events import EphemerisReceived, Event, ObservationsReceived, RawBytes
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import ObservationRow
from integrity.gnss.rtcm.framing import frame_bytes
from integrity.gnss.rtcm.msm_writer import encode_row
from integrity.gnss.rtcm.navigation import encode_ephemeris
from integrity.gnss.rtcm.station import AntennaPosition, encode_position
from integrity.gnss.signals import satellite_of
from recordings.simulate.observations import Antenna
from recordings.simulate.receiver import as_bytes

REPEAT_NS = 30 * NS_PER_S
MSM7 = 7


def as_sent(events: Sequence[Event], antennas: Sequence[Antenna], protocols: Mapping[str, Protocol]) -> tuple[Event, ...]:
    """`receiver.as_bytes`, or RTCM of the receivers whose protocol it is."""
    return as_bytes(as_rtcm(events, [antenna for antenna in antennas if protocols[antenna.receiver] == "rtcm3"]), antennas)


def as_rtcm(events: Sequence[Event], antennas: Sequence[Antenna]) -> tuple[Event, ...]:
    """Each row of these antennas as RawBytes; all other events stay. Antennas that stand still, by their station numbers 1, 2, ..."""
    casters = {antenna.receiver: _Sender(number, antenna) for number, antenna in enumerate(antennas, 1)}
    sky: dict[str, list[tuple[int, KeplerEphemeris]]] = {}
    out: list[Event] = []
    for event in events:
        if isinstance(event, EphemerisReceived) and isinstance(event.ephemeris, KeplerEphemeris):
            sky.setdefault(event.ephemeris.satellite, []).append((event.mono_ns, event.ephemeris))
        if isinstance(event, ObservationsReceived) and event.row.receiver in casters:
            out.append(RawBytes(event.mono_ns, event.row.receiver, casters[event.row.receiver].burst(event.row, sky)))
        else:
            out.append(event)
    return tuple(out)


class _Sender:
    """One receiver, and what it has told."""

    def __init__(self, station: int, antenna: Antenna) -> None:
        self._station = station
        self._antenna = antenna
        self._told: dict[str, KeplerEphemeris] = {}
        self._repeat_ns = 0

    def burst(self, row: ObservationRow, sky: Mapping[str, Sequence[tuple[int, KeplerEphemeris]]]) -> bytes:
        """What is sent with a row."""
        t_ns = row.receive_time_ns
        messages = []
        if t_ns >= self._repeat_ns:
            self._repeat_ns = (t_ns // REPEAT_NS + 1) * REPEAT_NS
            self._told.clear()
            messages.append(self._position(t_ns))
        for satellite in dict.fromkeys(satellite_of(signal) for signal in row.signals):
            begun = [eph for from_ns, eph in sky.get(satellite, ()) if from_ns <= t_ns]
            if begun and self._told.get(satellite) != begun[-1]:
                self._told[satellite] = begun[-1]
                messages.append(_ephemeris(begun[-1]))
        return b"".join(frame_bytes(message) for message in [*messages, *encode_row(row, MSM7, self._station)])

    def _position(self, t_ns: int) -> bytes:
        x_m, y_m, z_m = (float(x) for x in self._antenna.motion(np.array([t_ns]))[0][0])
        return encode_position(AntennaPosition(self._station, True, x_m, y_m, z_m, 0.0))


def _ephemeris(ephemeris: KeplerEphemeris) -> bytes:
    try:
        return encode_ephemeris(ephemeris)
    except ValueError as error:
        raise ConfigError(f"{ephemeris.satellite} cannot send its ephemeris: {error}; make the fault of this ephemeris smaller") from None
