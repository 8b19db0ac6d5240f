"""One station as a train counts it."""

import pytest

from integrity.messages import wayside_pb2 as pb
from tests.unit.train import ride
from train_client.localisation.ground import Ground, GroundMemory


@pytest.mark.parametrize(
    ("before", "after"), [(0, 38), (5, 43), (2**64 - 1 - 38, 2**64 - 1), (2**64 - 38, 2**64 - 1), (2**64 - 1, 2**64 - 1)]
)
def test_what_never_came_is_counted_as_far_as_a_message_can_tell(before: int, after: int) -> None:
    station = ride.Ground()
    ground = Ground(ride.SITE, [ride.KEY.public], ride.a_train(), ride.MAP.sha256, GroundMemory(missed=before))
    for step, sequence in enumerate((1, 40)):
        station.sequence = sequence - 1
        at_ns = ride.START_NS + step * ride.STEP_NS
        [health] = station.health(at_ns, at_ns, ride.nothing_special, step)
        assert not ground.health(health).refusal
    assert ground.missed == after
    assert pb.StationTrust(missed_messages=ground.missed).missed_messages == after
