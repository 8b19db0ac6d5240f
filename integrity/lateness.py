"""When an epoch was measured, by the station's own clock: validity runs from then, not from when its bytes were read.

Theory of operation. An epoch of GPS time t that is complete at m of the monotonic clock came with the offset m - t, which is what parts
the two clocks plus the time it was on its way. The least offset is that of the fastest, so an epoch was measured at t plus the least
offset, or before that by what the fastest takes. A station that stood still, or a link that held bytes back, thus makes nothing younger.

The least is that of the last 10 to 20 minutes of epochs (of GPS time, which runs on while the station stands still): the clocks part by
0.1 s in that time where the station's is wrong by 100 ppm, which makes an epoch seem older, never younger. What is late for longer than
that counts as on time.
"""

from typing import NamedTuple

from integrity.gnss.gps_time import NS_PER_S

WINDOW_NS = 600 * NS_PER_S
LATE_NS = NS_PER_S // 2  # worth a word


class Fastest(NamedTuple):
    """Least offsets, monotonic minus GPS time in ns: of the window of epochs that begins at `since_gps_ns`, and of the one before it."""

    since_gps_ns: int
    offset_ns: int
    offset_before_ns: int

    def measured_mono_ns(self, epoch_ns: int) -> int:
        """The latest that an epoch can have been measured, by the monotonic clock, had it come as the fastest did."""
        return epoch_ns + min(self.offset_ns, self.offset_before_ns)


def after_epoch(before: Fastest | None, epoch_ns: int, mono_ns: int) -> Fastest:
    """With an epoch of GPS time `epoch_ns`, later than all before, that was complete at `mono_ns`."""
    offset_ns = mono_ns - epoch_ns
    if before is None:
        return Fastest(epoch_ns, offset_ns, offset_ns)
    if epoch_ns - before.since_gps_ns >= WINDOW_NS:
        return Fastest(epoch_ns, offset_ns, before.offset_ns)
    return before._replace(offset_ns=min(before.offset_ns, offset_ns))


def late(mono_ns: int, measured_mono_ns: int) -> tuple[str, ...]:
    """In words, where an epoch took long."""
    late_ns = mono_ns - measured_mono_ns
    return (f"the epoch came {late_ns / NS_PER_S:.1f} s later than others: valid from when it was measured",) if late_ns >= LATE_NS else ()
