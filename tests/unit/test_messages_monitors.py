"""What monitors remember as messages: back to the last bit, monitors go on from it as they would have, broken bytes are refused."""

from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from functools import cache
from math import inf, nan
from struct import pack
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity import audit
from integrity.carrier_watch import CarrierMemory
from integrity.errors import DecodeError
from integrity.events import EphemerisReceived, Tick
from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import BEYOND_MEASURE, Floats, Ints
from integrity.gnss.signals import TIME_SCALES
from integrity.messages import wayside_pb2 as pb
from integrity.messages.inputs import decode_event, parsed
from integrity.messages.monitors import decode_monitors, encode_monitors, encode_tick
from integrity.monitor_memory import MonitorMemory, n_audited
from integrity.monitors import clocks, signal, slow
from integrity.monitors.clocks import ClockMemory
from integrity.monitors.navigation import Served
from integrity.monitors.signal import GainMemory
from integrity.monitors.slow import SlowMemory
from tests.unit.streams import LIMITS, SITE, START_NS, stream
from tests.unit.watched_carriers import sights_of, watched

H = LIMITS.carriers.motion.half_epochs
R, K = 3, len(TIME_SCALES)
AUDITED = audit.audited_checks(SITE, LIMITS)
LAST_NS = START_NS + 60 * NS_PER_S
SETS = [event.ephemeris for event in stream() if isinstance(event, EphemerisReceived)]

int64s = st.integers(-(2**63), 2**63 - 1)
uint64s = st.integers(0, 2**64 - 1)
times_ns = st.integers(0, LAST_NS)
measured = st.floats(-BEYOND_MEASURE, BEYOND_MEASURE)
measured_or_none = measured | st.just(nan)
positive = st.floats(0.0, BEYOND_MEASURE, exclude_max=True)


def arrays(shape: tuple[int, ...], numbers: st.SearchStrategy[float]) -> st.SearchStrategy[Floats]:
    n = int(np.prod(shape))
    return st.lists(numbers, min_size=n, max_size=n).map(lambda listed: np.array(listed, dtype=np.float64).reshape(shape))


def served(eph: Ephemeris, with_reference: bool, found: list[float]) -> Served:
    return Served(eph.satellite, eph, replace(eph, issue=eph.issue + 1) if with_reference else None, *found)


@st.composite
def ledgers(draw: st.DrawFn) -> audit.Ledger:
    looks = draw(uint64s)
    wealth = st.floats(max_value=1e300) | st.just(-inf)
    return audit.Ledger(
        since_ns=draw(times_ns),
        look_ns=draw(times_ns),
        value=draw(positive),
        looks=looks,
        exceeded=draw(st.integers(0, looks)),
        log_wealth=draw(st.tuples(wealth, wealth, wealth)),
        most=draw(wealth),
    )


@cache
def carriers_after(epochs: int) -> CarrierMemory:
    """What is remembered of carriers after so many sound epochs."""
    return watched(SITE, sights_of(SITE, stream(float(epochs)))).memory if epochs else CarrierMemory.empty(R, H)


sets = st.lists(st.sampled_from(SETS), unique_by=lambda eph: eph.satellite, max_size=4)
found = st.lists(st.floats(allow_nan=False) | st.just(nan), min_size=5, max_size=5)
entries = sets.flatmap(lambda chosen: st.tuples(*(st.builds(served, st.just(eph), st.booleans(), found) for eph in chosen)))
audits = st.builds(audit.AuditMemory, st.tuples(*[ledgers()] * len(AUDITED)), st.integers(0, 2**63 - 1))
memories = st.builds(
    MonitorMemory,
    entries,
    st.builds(
        ClockMemory,
        st.tuples(times_ns, times_ns).map(lambda t: np.array(t, dtype=np.int64)),
        arrays((2, R, K), measured_or_none),
        arrays((2, K), positive | st.just(nan)),
    ),
    st.builds(SlowMemory, times_ns, arrays((6, 3), measured), arrays((2, 6, 3), positive)),
    st.builds(GainMemory, times_ns, arrays((R,), measured_or_none)),
    audits,
    st.builds(carriers_after, st.sampled_from([0, 1, 40])),
)


def bits(of: object) -> object:
    """All of a value in a form that compares to the last bit; NaN is NaN."""
    if isinstance(of, np.ndarray):
        return of.shape, of.dtype.str, [bits(x) for x in of.ravel().tolist()]
    if isinstance(of, float):
        return "NaN" if of != of else pack("<d", of)
    if isinstance(of, tuple):
        return [bits(x) for x in of]
    if is_dataclass(of):
        return {f.name: bits(getattr(of, f.name)) for f in fields(of)}
    return type(of), of


def there_and_back(memory: MonitorMemory) -> MonitorMemory:
    message = parsed(pb.MonitorMemory, encode_monitors(memory).SerializeToString())
    assert isinstance(message, pb.MonitorMemory)
    return decode_monitors(message, R, LAST_NS)


@settings(max_examples=60, deadline=None)
@given(memories)
def test_a_memory_comes_back_to_the_last_bit(memory: MonitorMemory) -> None:
    assert bits(there_and_back(memory)) == bits(memory)


def test_nothing_remembered_comes_back_without_a_last_epoch() -> None:
    empty = MonitorMemory.empty(R, H)
    assert bits(decode_monitors(encode_monitors(empty), R, None)) == bits(empty)


@given(int64s, int64s, st.none() | int64s)
def test_a_tick_comes_back_as_it_was(mono_ns: int, utc_ns: int, uncertainty_ns: int | None) -> None:
    tick = Tick(mono_ns, utc_ns, uncertainty_ns)
    message = encode_tick(tick)
    assert message is not None
    assert decode_event(parsed(pb.Tick, message.SerializeToString())) == tick


def test_as_many_checks_are_audited_as_a_memory_has_ledgers_for() -> None:
    assert n_audited(R) == len(AUDITED)


# ---- monitors that go on


class Epochs:
    """Seconds of what monitors are given: clocks that drift, displacements, gains, statistics of checks."""

    def __init__(self, n: int) -> None:
        rng = np.random.default_rng(3)
        self.epoch_ns: Ints = START_NS + np.arange(n) * NS_PER_S
        self.clock_m = rng.normal(0.0, 1.0, (n, R, K)) + 50.0 * np.arange(n)[:, None, None]
        self.clock_m[:, :, 3] = nan
        self.sigma_m = np.full((n, K), 0.5)
        self.e_enu_m = rng.normal(0.0, 0.5, (n, R, 3)) + np.array([0.8, 0.0, 0.0])
        self.var_d = np.full((n, 3), 0.25)
        self.gain = 0.5 + rng.normal(0.0, 0.05, (n, R))
        self.statistic = rng.chisquare(2.0, (n, len(LIMITS.names)))

    def decided(self, memory: MonitorMemory, e: slice) -> tuple[MonitorMemory, object]:
        """The memory after some epochs, and what monitors say of them."""
        of_clocks, shown_by_clocks = clocks.advance(memory.clocks, self.epoch_ns[e], self.clock_m[e], self.sigma_m[e])
        of_slow, shown_by_slow = slow.advance(memory.slow, self.epoch_ns[e], self.e_enu_m[e], self.var_d[e], LIMITS.slow)
        of_gains, drop = signal.advance(memory.gains, self.epoch_ns[e], self.gain[e])
        audited = memory.audit
        for t_ns, statistic in zip(self.epoch_ns[e].tolist(), self.statistic[e], strict=True):
            audited = audit.advance(audited, t_ns, statistic, True, 9, AUDITED)
        after = replace(memory, clocks=of_clocks, slow=of_slow, gains=of_gains, audit=audited)
        return after, (shown_by_clocks, shown_by_slow, drop, audit.broken(audited))


@cache
def remembered() -> MonitorMemory:
    """After ten minutes, so that the audit has looked."""
    memory, _ = Epochs(600).decided(MonitorMemory.empty(R, H), slice(0, 600))
    first = SETS[0]
    return replace(memory, carriers=carriers_after(40), navigation=(Served(first.satellite, first, first, nan, nan, nan, nan, 0.3),))


def test_monitors_go_on_from_bytes_as_they_would_have() -> None:
    epochs = Epochs(900)
    memory, _ = epochs.decided(MonitorMemory.empty(R, H), slice(0, 600))
    message = encode_monitors(memory)
    again = decode_monitors(message, R, int(epochs.epoch_ns[599]))
    (after, shown), (after_again, shown_again) = (epochs.decided(m, slice(600, 900)) for m in (memory, again))
    assert bits((shown_again, after_again)) == bits((shown, after))


# ---- broken messages


LATER_NS = START_NS + 600 * NS_PER_S


def drop(name: str) -> Callable[[Any], None]:
    """The last number of an array is missing."""

    def change(message: Any) -> None:
        part, array = name.split(".")
        getattr(getattr(message, part), array).pop()

    return change


def put(name: str, value: float, k: int | None = None) -> Callable[[Any], None]:
    """Another number in the place of one."""

    def change(message: Any) -> None:
        *path, last = name.split(".")
        for part in path:
            message = message[int(part)] if part.isdecimal() else getattr(message, part)
        if k is None:
            setattr(message, last, value)
        else:
            getattr(message, last)[k] = value

    return change


def put_all(name: str, values: list[int]) -> Callable[[Any], None]:
    """Other numbers in the place of all."""

    def change(message: Any) -> None:
        part, array = name.split(".")
        getattr(getattr(message, part), array)[:] = values

    return change


def twice(message: Any) -> None:
    message.navigation.add().CopyFrom(message.navigation[0])


def without_set(message: Any) -> None:
    message.navigation[0].ClearField("serving")


DAMAGES: dict[str, Callable[[Any], None]] = {
    "an epoch of clocks is missing": drop("clocks.epoch_ns"),
    "a clock is missing": drop("clocks.clock_m"),
    "a sigma is missing": drop("clocks.sigma_m"),
    "a slow shift is missing": drop("slow.u"),
    "a sum is missing": drop("slow.cusum"),
    "a gain is missing": drop("gains.usual"),
    "a ledger is missing": drop("audit.ledgers"),
    "an alternative is missing": lambda message: message.audit.ledgers[0].log_wealth.pop(),
    "a clock of the future": put("clocks.epoch_ns", LATER_NS + 1, 1),
    "a slow shift of the future": put("slow.epoch_ns", LATER_NS + 1),
    "a gain from before time": put("gains.epoch_ns", -1),
    "a look of the future": put("audit.ledgers.2.look_ns", LATER_NS + 1),
    "a first look of the future": put("audit.ledgers.2.since_ns", LATER_NS + 1),
    "a look due before time": put("audit.due_ns", -1),
    "no window of carriers": put_all("carriers.epoch_ns", []),
    "windows of carriers without end": put_all("carriers.epoch_ns", [0] * 1000),
    "a carrier of the future": put("carriers.epoch_ns", LATER_NS + 1, -1),
    "an infinite clock": put("clocks.clock_m", inf, 0),
    "a negative sigma": put("clocks.sigma_m", -1.0, 0),
    "an unknown slow shift": put("slow.u", nan, 0),
    "an unknown sum": put("slow.cusum", nan, 0),
    "a negative sum": put("slow.cusum", -1.0, 0),
    "a gain beyond measure": put("gains.usual", 1e300, 0),
    "an unknown value": put("audit.ledgers.0.value", nan),
    "unlimited wealth": put("audit.ledgers.0.log_wealth", inf, 0),
    "unknown wealth": put("audit.ledgers.0.most", nan),
    "more looks beyond than looks": put("audit.ledgers.0.exceeded", 10**6),
    "a satellite served twice": twice,
    "a set of another satellite": put("navigation.0.satellite", "G31"),  # type: ignore[arg-type]
    "no set": without_set,
    "no orbit": put("navigation.0.serving.sqrt_a", nan),
    "no orbit of the reference": put("navigation.0.reference.e", 0.9),
    "a change that is not a number": put("navigation.0.change", nan),
}


def sound_message() -> pb.MonitorMemory:
    return encode_monitors(remembered())


def test_the_message_that_is_damaged_is_sound() -> None:
    assert bits(decode_monitors(sound_message(), R, LATER_NS)) == bits(remembered())


@pytest.mark.parametrize("damage", DAMAGES)
def test_what_no_monitor_can_have_remembered_is_refused(damage: str) -> None:
    message = sound_message()
    DAMAGES[damage](message)
    with pytest.raises(DecodeError):
        decode_monitors(message, R, LATER_NS)


def test_a_memory_from_before_carriers_were_watched_remembers_none() -> None:
    message = sound_message()
    message.ClearField("carriers")
    assert bits(decode_monitors(message, R, LATER_NS).carriers) == bits(CarrierMemory.empty(R, 1))


@pytest.mark.parametrize("n_receivers", [0, 2, 4])
def test_a_memory_of_another_number_of_receivers_is_refused(n_receivers: int) -> None:
    with pytest.raises(DecodeError, match="receivers"):
        decode_monitors(sound_message(), n_receivers, LATER_NS)
