"""Where the train of the demo really is."""

from dataclasses import dataclass

import numpy as np

from train_client.simulate.line import SAMPLE_JOINT_M, Line, sample_line, sample_place
from train_client.simulate.motion import Run, sample_run


@dataclass(frozen=True, eq=False)
class Truth:
    """Running distances along the sample line, m."""

    line: Line
    run: Run

    def front_m(self, gps_ns: int) -> float:
        """Of the front end at a GPS time."""
        return float(self.run.front(np.array([gps_ns]))[0][0])

    def running_m(self, edge: str, offset_m: float) -> float:
        """Of a place of the sample map."""
        return offset_m + (SAMPLE_JOINT_M if edge == sample_place(SAMPLE_JOINT_M)[0] else 0.0)

    def error_m(self, edge: str, offset_m: float, gps_ns: int) -> float:
        """How far ahead of the front end a place is."""
        return self.running_m(edge, offset_m) - self.front_m(gps_ns)


def truth_from(start_ns: int) -> Truth:
    """The run of the samples, with its first epoch at a GPS time."""
    line = sample_line()
    return Truth(line, sample_run(line, start_ns))
