"""What monitors remember, to messages and back, to the last bit: a part of a snapshot.

Decoding refuses what no monitor can have remembered: arrays of other lengths, times after the last epoch, numbers beyond measure, sets that
are no orbit of the satellite. So what was decoded never breaks a monitor that goes on from it.
"""

from collections.abc import Sequence
from math import inf, isnan, nan, prod

import numpy as np

from integrity.audit import VARIANCES, AuditMemory, Ledger
from integrity.carrier_thresholds import MOST_HALF_EPOCHS
from integrity.carrier_watch import CarrierMemory
from integrity.errors import DecodeError
from integrity.events import Tick
from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.observations import BEYOND_MEASURE, Floats
from integrity.gnss.signals import TIME_SCALES
from integrity.messages import wayside_pb2 as pb
from integrity.messages.carriers import decode_carriers, encode_carriers
from integrity.messages.ephemerides import decode_ephemeris, encode_ephemeris
from integrity.monitor_memory import MonitorMemory, n_audited
from integrity.monitors.clocks import REMEMBERED, ClockMemory
from integrity.monitors.navigation import Served
from integrity.monitors.signal import GainMemory
from integrity.monitors.slow import SlowMemory, channels

_COMPARED = ("change", "range_m", "apart_m", "reissued_m", "orbit")  # of `Served`
_N_RECEIVERS = 3  # whose slow shifts are told apart


def encode_monitors(memory: MonitorMemory) -> pb.MonitorMemory:
    """The memory of all monitors."""
    return pb.MonitorMemory(
        navigation=[_encode_served(entry) for entry in memory.navigation],
        clocks=pb.ClockMemory(
            epoch_ns=memory.clocks.epoch_ns.tolist(),
            clock_m=memory.clocks.clock_m.ravel().tolist(),
            sigma_m=memory.clocks.sigma_m.ravel().tolist(),
        ),
        slow=pb.SlowMemory(epoch_ns=memory.slow.epoch_ns, u=memory.slow.u.ravel().tolist(), cusum=memory.slow.cusum.ravel().tolist()),
        gains=pb.GainMemory(epoch_ns=memory.gains.epoch_ns, usual=memory.gains.usual.tolist()),
        audit=pb.AuditMemory(ledgers=[pb.AuditLedger(**vars(ledger)) for ledger in memory.audit.ledgers], due_ns=memory.audit.due_ns),
        carriers=encode_carriers(memory.carriers),
    )


def decode_monitors(message: pb.MonitorMemory, n_receivers: int, last_epoch_ns: int | None) -> MonitorMemory:
    """The memory of all monitors of a station whose last epoch was at `last_epoch_ns` (None: it has had none); DecodeError where a message
    is not that of so many receivers, or could not have been remembered."""
    if n_receivers != _N_RECEIVERS:
        raise DecodeError(f"snapshot: memory of monitors with {n_receivers} receivers, expected {_N_RECEIVERS}")
    last_ns = last_epoch_ns or 0
    clocks, slow, gains = message.clocks, message.slow, message.gains
    n_channels, n_scales = len(channels(n_receivers)), len(TIME_SCALES)
    _expect("epochs of clocks", len(clocks.epoch_ns), REMEMBERED)
    return MonitorMemory(
        navigation=_decode_navigation(message.navigation),
        clocks=ClockMemory(
            np.array([_time_ns(t, last_ns) for t in clocks.epoch_ns], dtype=np.int64),
            _array("clocks", clocks.clock_m, (REMEMBERED, n_receivers, n_scales)),
            _array("sigmas of clocks", clocks.sigma_m, (REMEMBERED, n_scales), low=0.0),
        ),
        slow=SlowMemory(
            _time_ns(slow.epoch_ns, last_ns),
            _known(_array("slow shifts", slow.u, (n_channels, 3))),
            _known(_array("sums of slow shifts", slow.cusum, (2, n_channels, 3), low=0.0)),
        ),
        gains=GainMemory(_time_ns(gains.epoch_ns, last_ns), _array("gains", gains.usual, (n_receivers,))),
        audit=_decode_audit(message.audit, n_audited(n_receivers), last_ns),
        carriers=_decode_carriers(message, n_receivers, last_epoch_ns),
    )


def _decode_carriers(message: pb.MonitorMemory, n_receivers: int, last_epoch_ns: int | None) -> CarrierMemory:
    """Of windows as long as they were when it was written; nothing where it was written before carriers were watched."""
    half_epochs = len(message.carriers.epoch_ns) // 2
    if not message.HasField("carriers"):
        return CarrierMemory.empty(n_receivers, 1)
    if not 1 <= half_epochs <= MOST_HALF_EPOCHS:
        raise DecodeError(f"snapshot: {len(message.carriers.epoch_ns)} epochs of carriers, expected 2 to {2 * MOST_HALF_EPOCHS}")
    return decode_carriers(message.carriers, n_receivers, half_epochs, last_epoch_ns)


def encode_tick(tick: Tick | None) -> pb.Tick | None:
    """The last tick, where there was one."""
    return None if tick is None else pb.Tick(mono_ns=tick.mono_ns, utc_ns=tick.utc_ns, utc_uncertainty_ns=tick.utc_uncertainty_ns)


def _encode_served(entry: Served) -> pb.ServedSet:
    return pb.ServedSet(
        satellite=entry.satellite,
        serving=encode_ephemeris(entry.serving, 0),
        reference=None if entry.reference is None else encode_ephemeris(entry.reference, 0),
        **{name: value for name in _COMPARED if not isnan(value := getattr(entry, name))},
    )


def _decode_navigation(entries: Sequence[pb.ServedSet]) -> tuple[Served, ...]:
    satellites = [entry.satellite for entry in entries]
    if len(set(satellites)) != len(satellites):
        raise DecodeError("snapshot: two sets serve one satellite")
    return tuple(_decode_served(entry) for entry in entries)


def _decode_served(entry: pb.ServedSet) -> Served:
    reference = _decode_set(entry.reference, entry.satellite) if entry.HasField("reference") else None
    found = {name: getattr(entry, name) if entry.HasField(name) else nan for name in _COMPARED}
    for name in _COMPARED:
        if entry.HasField(name) and isnan(found[name]):
            raise DecodeError(f"snapshot: {name} of {entry.satellite} is not a number; expected one, or none")
    return Served(entry.satellite, _decode_set(entry.serving, entry.satellite), reference, **found)


def _decode_set(message: pb.Ephemeris, satellite: str) -> Ephemeris:
    ephemeris = decode_ephemeris(message)
    why = ephemeris.implausibility() if ephemeris.satellite == satellite else f"it is of {ephemeris.satellite!r}"
    if why is not None:
        raise DecodeError(f"snapshot: a set that serves {satellite!r}: {why}")
    return ephemeris


def _decode_audit(message: pb.AuditMemory, n_ledgers: int, last_ns: int) -> AuditMemory:
    _expect("audited checks", len(message.ledgers), n_ledgers)
    if message.due_ns < 0:
        raise DecodeError(f"snapshot: the next look of the audit is due at {message.due_ns} ns of GPS time, expected 0 or later")
    return AuditMemory(tuple(_decode_ledger(ledger, last_ns) for ledger in message.ledgers), message.due_ns)


def _decode_ledger(ledger: pb.AuditLedger, last_ns: int) -> Ledger:
    _expect("alternatives in a ledger", len(ledger.log_wealth), len(VARIANCES))
    known = 0.0 <= ledger.value < BEYOND_MEASURE and all(wealth < inf for wealth in (*ledger.log_wealth, ledger.most))  # NaN is not
    if not known or ledger.exceeded > ledger.looks:
        raise DecodeError(
            f"snapshot: a ledger with value {ledger.value:g}, {ledger.exceeded} of {ledger.looks} looks beyond, wealth "
            f"{list(ledger.log_wealth)}, at most {ledger.most:g}: not what an audit keeps"
        )
    return Ledger(
        _time_ns(ledger.since_ns, last_ns),
        _time_ns(ledger.look_ns, last_ns),
        ledger.value,
        ledger.looks,
        ledger.exceeded,
        tuple(ledger.log_wealth),
        ledger.most,
    )


def _expect(what: str, count: int, expected: int) -> None:
    if count != expected:
        raise DecodeError(f"snapshot: {count} {what}, expected {expected}")


def _time_ns(gps_ns: int, last_ns: int) -> int:
    if not 0 <= gps_ns <= last_ns:
        raise DecodeError(f"snapshot: a monitor remembers {gps_ns} ns of GPS time, expected 0 to the last epoch, {last_ns}")
    return gps_ns


def _array(what: str, values: Sequence[float], shape: tuple[int, ...], low: float = -BEYOND_MEASURE) -> Floats:
    """Numbers from `low` on and not beyond measure, or NaN."""
    _expect(f"numbers of {what}", len(values), prod(shape))
    array = np.array(values, dtype=np.float64).reshape(shape)
    wrong = (array < low) | (array > BEYOND_MEASURE)
    if wrong.any():
        raise DecodeError(f"snapshot: {what}: {array[wrong][0]:g}, expected {low:g} to {BEYOND_MEASURE:g}, or NaN")
    return array


def _known(array: Floats) -> Floats:
    if np.isnan(array).any():
        raise DecodeError("snapshot: a slow shift is not a number; expected one of every channel")
    return array
