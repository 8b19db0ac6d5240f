"""Whether a fix can be where the train was before, moved on: the one memory of past positions. Local evidence only ever lowers trust."""

from typing import NamedTuple

from train_client.config import TrainConfig
from train_client.outputs import Fix, MapPlace
from train_client.track.network import Place, Unreachable, shortest_way
from train_client.track.track_map import TrackMap

NS_PER_S = 1_000_000_000
REAR_FIRST_M = 20.0  # own choice: more than noise and multipath move a train that stands, less than its length
SIGMAS = 6.0  # own choice: a step may look longer than it is by so many standard deviations of a fix


class Reached(NamedTuple):
    """A confirmed place of the front end."""

    place: MapPlace
    sigma_m: float
    facing: int
    gps_time_ns: int


class ProgressMemory(NamedTuple):
    """The last confirmed place, and how far the train has gone backwards since it was furthest ahead."""

    reached: Reached | None = None
    behind_m: float = 0.0


class Progress:
    """Of one train: the last confirmed place, and how far the train has gone backwards since it was furthest ahead."""

    def __init__(self, train: TrainConfig, track: TrackMap, memory: ProgressMemory = ProgressMemory()) -> None:  # noqa: B008
        self._most_speed_mps = train.most_speed_mps
        self._track = track
        self._index = {edge.id: i for i, edge in enumerate(track.edges)}
        self._last, self._behind_m = memory

    def memory(self) -> ProgressMemory:
        """For a snapshot."""
        return ProgressMemory(self._last, self._behind_m)

    def objection(self, fix: Fix) -> str:
        """Why the fix cannot be, after the last confirmed one; empty where it can."""
        step_m = self._step_m(fix)
        if isinstance(step_m, Unreachable):
            return f"no way from the last confirmed place: {step_m.why}"
        if self._last is None or fix.sigma_m is None:
            return ""
        elapsed_s = (fix.gps_time_ns - self._last.gps_time_ns) / NS_PER_S
        allowed_m = self._most_speed_mps * elapsed_s + SIGMAS * (fix.sigma_m + self._last.sigma_m)
        if not abs(step_m) <= allowed_m:
            return f"{abs(step_m):.1f} m in {elapsed_s:.1f} s since the last confirmed place: at most {allowed_m:.1f} m can be"
        behind_m = max(0.0, self._behind_m - step_m)
        if not behind_m <= REAR_FIRST_M:
            return (
                f"runs rear first, {behind_m:.0f} m: antennas exchanged, or the cab at the other end? Correct the train file, start again"
            )
        return ""

    def confirm(self, fix: Fix) -> None:
        """The fix is where the train was: without an objection."""
        step_m = self._step_m(fix)
        assert not isinstance(step_m, Unreachable)
        assert fix.front is not None and fix.sigma_m is not None
        self._behind_m = max(0.0, self._behind_m - step_m)
        self._last = Reached(fix.front, fix.sigma_m, fix.facing, fix.gps_time_ns)

    def _step_m(self, fix: Fix) -> float | Unreachable:
        """From the last confirmed place by the shortest way, positive where the front leads: it may have come by a longer one."""
        if self._last is None or fix.front is None:
            return 0.0
        before, now = self._place(self._last.place), self._place(fix.front)
        way_m = shortest_way(self._track, before, now)
        return way_m if isinstance(way_m, Unreachable) else self._last.facing * way_m

    def _place(self, place: MapPlace) -> Place:
        return Place(self._index[place.edge], place.offset_m)
