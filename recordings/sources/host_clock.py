"""The clocks of this machine: the monotonic one, and UTC with what the kernel knows of its error. Source: adjtimex(2), Linux."""

import ctypes
import time

from integrity.config import HostClock
from integrity.events import Tick

STA_UNSYNC = 0x40
TIME_ERROR = 5


class _Timex(ctypes.Structure):
    """The beginning of `struct timex`; the rest is room."""

    _fields_ = (
        ("modes", ctypes.c_uint),
        ("offset", ctypes.c_long),
        ("freq", ctypes.c_long),
        ("maxerror", ctypes.c_long),  # us
        ("esterror", ctypes.c_long),
        ("status", ctypes.c_int),
        ("room", ctypes.c_byte * 256),
    )


def mono_now_ns() -> int:
    """The monotonic clock, which never steps."""
    return time.monotonic_ns()


def tick(host_clock: HostClock, mono_ns: int) -> Tick:
    """The tick at a moment that has just passed. Nobody vouches for UTC where the site says "none", or nothing disciplines the clock."""
    ago_ns = mono_now_ns() - mono_ns
    return Tick(mono_ns, time.time_ns() - ago_ns, None if host_clock == "none" else _uncertainty_ns())


def _uncertainty_ns() -> int | None:
    timex = _Timex()
    state = ctypes.CDLL(None, use_errno=True).adjtimex(ctypes.byref(timex))
    if state in (-1, TIME_ERROR) or timex.status & STA_UNSYNC:
        return None
    return int(timex.maxerror) * 1000
