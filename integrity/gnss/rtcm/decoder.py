"""From RTCM 3 messages to measurements, ephemerides and positions: stateful, for one receiver.

The measurements of an epoch come in one message or more for each system; all of them make one row. Messages of another time end it, and
so does the one that says that no more follow. What cannot be (masks, lengths or times that contradict themselves, a signal told twice,
a set that makes no sense) is refused and counted.

Times are told without their week, those of GLONASS as day of the week and time of day of Moscow, those of BeiDou in BDT. They are taken
to be next to `near_ns`, else to the epoch before, else to what an ephemeris says of its week; without any, nothing can be dated.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import compress

import numpy as np

from integrity.errors import DecodeError
from integrity.gnss.ephemeris.broadcast import Ephemeris, KeplerEphemeris
from integrity.gnss.gps_time import (
    BDT_BEHIND_GPS_NS,
    DAY_S,
    GLONASS_AHEAD_OF_UTC_NS,
    NS_PER_S,
    WEEK_NS,
    WEEK_S,
    gps_from_utc,
    leap_seconds_at_gps,
    utc_from_gps,
)
from integrity.gnss.navigation.bits import nearest_ns
from integrity.gnss.observations import ROW_ARRAYS, Floats, ObservationRow
from integrity.gnss.rtcm.framing import message_number
from integrity.gnss.rtcm.locks import Locks, SignalLock
from integrity.gnss.rtcm.measurements import measured
from integrity.gnss.rtcm.msm import MSM_NUMBERS, MsmHeader, header_of
from integrity.gnss.rtcm.navigation import ephemeris_of, glonass_channel_of, week_middle_ns
from integrity.gnss.rtcm.navigation_tables import EPHEMERIS_NUMBERS
from integrity.gnss.rtcm.station import STATION_NUMBERS, AntennaPosition, position_of
from integrity.gnss.signals import GLONASS_CHANNELS

NS_PER_MS = NS_PER_S // 1000
MOSCOW_DAY_BITS = 27  # of the time of a GLONASS message, below the day of the week
UNKNOWN_DAY = 7
MOST_MESSAGES = 32  # of one epoch: six systems, of each several parts
GLONASS_SLOTS = 24
GLONASS_EPHEMERIS = 1020
UNIX_TO_SUNDAY_NS = 3 * DAY_S * NS_PER_S  # 1970-01-04, a Sunday

Decoded = ObservationRow | Ephemeris | AntennaPosition


@dataclass(frozen=True)
class RtcmMemory:
    """What a decoder remembers: a new one with it goes on exactly as the old.

    `near_ns` is the last time that was known, `epoch_ns` that of the last measurements; `open_messages` are those of an epoch that waits
    for more. `channels` are of GLONASS slots.
    """

    near_ns: int | None = None
    epoch_ns: int | None = None
    open_messages: tuple[bytes, ...] = ()
    channels: tuple[tuple[int, int], ...] = ()
    locks: tuple[SignalLock, ...] = ()
    told: tuple[Ephemeris, ...] = ()
    refused: int = 0
    undated: int = 0


class RtcmDecoder:
    """One receiver's messages in the order in which they came.

    `refused` counts messages that contradict themselves or others, `undated` those whose week was not known.
    """

    def __init__(self, receiver: str, memory: RtcmMemory = RtcmMemory()) -> None:
        """DecodeError for a memory that no decoder made."""
        self._receiver = receiver
        self._near_ns, self._epoch_ns = memory.near_ns, memory.epoch_ns
        self._messages, self._headers = list(memory.open_messages), _headers_of(memory)
        self._channels = _channels_of(memory)
        self._locks = Locks(memory.locks)
        self._told = {_kind_of(eph): eph for eph in memory.told}
        self.refused, self.undated = memory.refused, memory.undated

    def memory(self) -> RtcmMemory:
        """For a snapshot."""
        return RtcmMemory(
            near_ns=self._near_ns,
            epoch_ns=self._epoch_ns,
            open_messages=tuple(self._messages),
            channels=tuple((int(slot), int(self._channels[slot])) for slot in np.flatnonzero(~np.isnan(self._channels))),
            locks=self._locks.memory(),
            told=tuple(self._told.values()),
            refused=self.refused,
            undated=self.undated,
        )

    def take(self, message: bytes, near_ns: int | None) -> list[Decoded]:
        """What a message completes or tells; mostly nothing. `near_ns` is a GPS time within half a week, None where it is not known.

        Nothing is raised, whatever the bytes; messages of other numbers are passed over.
        """
        number = message_number(message)
        if number in MSM_NUMBERS:
            return list(self._observations(message, near_ns if near_ns is not None else self._near_ns))
        if number in EPHEMERIS_NUMBERS:
            return list(self._ephemeris(message, number, near_ns if near_ns is not None else self._near_ns))
        if number in STATION_NUMBERS:
            position = position_of(message)
            self.refused += position is None
            return [] if position is None else [position]
        return []

    def _observations(self, message: bytes, near_ns: int | None) -> Iterable[ObservationRow]:
        """One row or two: of an epoch that this message shows to be over, and of its own."""
        header = header_of(message)
        if header is None:
            self.refused += 1
            return
        if near_ns is None:
            self.undated += 1
            return
        open_ns = self._epoch_ns if self._messages else None
        time_ns = _time_ns(header, near_ns, self._epoch_ns, open_ns)
        if open_ns is not None and header.system == "C" and time_ns == open_ns + BDT_BEHIND_GPS_NS:
            time_ns = open_ns  # more was announced, and here it is: before RTCM 10403.2, senders wrote GPS time where BDT belongs
        if time_ns is None or (time_ns == open_ns and not self._belongs(header)):
            self.refused += 1
            return
        if open_ns is not None and time_ns != open_ns:
            yield self._row(open_ns)
        self._near_ns = self._epoch_ns = time_ns
        self._messages.append(message)
        self._headers.append(header)
        if not header.more:
            yield self._row(time_ns)

    def _belongs(self, header: MsmHeader) -> bool:
        """Whether a message may be one of the open epoch's: of the same station, with other signals, and not of too many."""
        told = {signal for before in self._headers if before.system == header.system for signal in before.signals}
        return header.station == self._headers[0].station and told.isdisjoint(header.signals) and len(self._messages) < MOST_MESSAGES

    def _row(self, time_ns: int) -> ObservationRow:
        """The row of the open epoch, which is over; signals with neither range nor carrier are left out."""
        found = measured(self._messages, tuple(header.masks for header in self._headers), self._channels)
        self._messages, self._headers = [], []
        self._channels[found.slot] = found.channel
        self._channels[0] = np.nan  # of all others
        slip = self._locks.slips(found.signals, time_ns, found.lock_s)
        row = ObservationRow(
            self._receiver,
            time_ns,
            found.signals,
            pseudorange_m=found.pseudorange_m,
            carrier_cycles=found.carrier_cycles,
            doppler_hz=found.doppler_hz,
            cn0_dbhz=found.cn0_dbhz,
            lock_s=found.lock_s,
            slip=slip,
            half_cycle=found.half_cycle,
        )
        kept = ~(np.isnan(found.pseudorange_m) & np.isnan(found.carrier_cycles))
        if np.count_nonzero(kept) == len(kept):
            return row
        columns = {name: getattr(row, name)[kept] for name in ROW_ARRAYS}
        return replace(row, signals=tuple(compress(row.signals, kept)), **columns)

    def _ephemeris(self, message: bytes, number: int | None, near_ns: int | None) -> Iterable[Ephemeris]:
        """A set that says anything new but the time of its transmission."""
        if number == GLONASS_EPHEMERIS:
            slot_channel = glonass_channel_of(message)
            if slot_channel is not None:
                self._channels[slot_channel[0]] = slot_channel[1]
        elif near_ns is None:
            self._near_ns = near_ns = week_middle_ns(message)
        if near_ns is None:
            self.undated += 1
            return
        ephemeris = ephemeris_of(message, near_ns, self._epoch_ns)
        if ephemeris is None:
            self.refused += 1
            return
        last = self._told.get(_kind_of(ephemeris))
        if last is None or replace(last, transmission_ns=ephemeris.transmission_ns) != ephemeris:
            self._told[_kind_of(ephemeris)] = ephemeris
            yield ephemeris


def _headers_of(memory: RtcmMemory) -> list[MsmHeader]:
    headers = [header_of(message) if message_number(message) in MSM_NUMBERS else None for message in memory.open_messages]
    if None in headers or (headers and memory.epoch_ns is None):
        raise DecodeError(
            f"open messages {headers} at {memory.epoch_ns} in a snapshot: no MSM of one time; it is damaged: start without it"
        )
    return [header for header in headers if header is not None]


def _channels_of(memory: RtcmMemory) -> Floats:
    """By slot, (25,); NaN where not known."""
    channels = np.full(GLONASS_SLOTS + 1, np.nan)
    for slot, channel in memory.channels:
        if not (1 <= slot <= GLONASS_SLOTS and channel in GLONASS_CHANNELS):
            raise DecodeError(f"channel {channel} of GLONASS slot {slot} in a snapshot: there is none; it is damaged: start without it")
        channels[slot] = channel
    return channels


def _kind_of(eph: Ephemeris) -> tuple[str, str]:
    """What is told apart: satellites, and of Galileo both messages."""
    return eph.satellite, eph.message if isinstance(eph, KeplerEphemeris) else ""


def _time_ns(header: MsmHeader, near_ns: int, epoch_ns: int | None, open_ns: int | None) -> int | None:
    """GPS time of a message; None where it has none."""
    if header.system == "R":
        return _glonass_time_ns(header.time, near_ns, epoch_ns, open_ns)
    if header.time >= WEEK_S * 1000:
        return None
    behind_ns = BDT_BEHIND_GPS_NS if header.system == "C" else 0
    return nearest_ns(header.time * NS_PER_MS + behind_ns, near_ns, WEEK_NS)


def _glonass_time_ns(time: int, near_ns: int, epoch_ns: int | None, open_ns: int | None) -> int | None:
    """GPS time of a day of the week and a time of day in ms, of Moscow; of a day not told that of the last epoch.

    A leap second reads like the second after it. Of the two, it is the one of the epoch that waits for more.
    """
    day, ms = time >> MOSCOW_DAY_BITS, time & (1 << MOSCOW_DAY_BITS) - 1
    if ms >= DAY_S * 1000 or (day == UNKNOWN_DAY and epoch_ns is None):
        return None
    of_day_ns = ms * NS_PER_MS - GLONASS_AHEAD_OF_UTC_NS
    if day == UNKNOWN_DAY and epoch_ns is not None:
        utc_ns = nearest_ns(of_day_ns, utc_from_gps(epoch_ns), DAY_S * NS_PER_S)
    else:
        utc_ns = nearest_ns(UNIX_TO_SUNDAY_NS + day * DAY_S * NS_PER_S + of_day_ns, utc_from_gps(near_ns), WEEK_NS)
    gps_ns = gps_from_utc(utc_ns)
    in_leap_second = leap_seconds_at_gps(gps_ns - NS_PER_S) < leap_seconds_at_gps(gps_ns)
    return gps_ns - NS_PER_S if in_leap_second and gps_ns - NS_PER_S == open_ns else gps_ns
