"""What a train remembers of several stations and of its stop, to a message and back: broken parts are refused, or read as the worse."""

from dataclasses import replace

import pytest

from integrity.errors import DecodeError
from integrity.messages import wayside_pb2 as pb
from integrity.messages.verification import LastHealth, Tie, VerifierMemory
from tests.unit.track.lines import line, straight
from train_client.alarm import Alarm
from train_client.localisation.coverage import Vouched
from train_client.localisation.ground import GroundMemory
from train_client.localisation.memory import LocaliserMemory
from train_client.snapshots import decode_snapshot, encode_snapshot
from train_client.stop import Stop, StopState
from train_client.train_file import parse_train
from train_client.trust import Trust, TrustState

TRAIN = parse_train(
    '[train]\nid = "r291"\nlength_m = 40.0\n[[antenna]]\nid = "front"\nx_m = -3.0\nheight_m = 3.9\n[trust]\nstations = ["k-1"]\n', "t"
).config
TRACK = line(straight("main", "west", "east", 0.0, 100.0))
MONO_NS = 7_000_000_000_000

HEARD = GroundMemory(
    verifier=VerifierMemory(
        Tie(b"boot of station a", MONO_NS, MONO_NS + 1, 0), LastHealth(b"boot of station a", 57, b"\xff\x00", 0, 56), (b"0" * 16, b"1" * 16)
    ),
    trust=Trust(TrustState.NORMAL, 5, MONO_NS + 2, 57),
    alarm=Alarm((0, MONO_NS - 1, MONO_NS)),
    nonces=((bytes(16), 0), (b"\xff" * 16, MONO_NS)),
    challenge_at_ns=0,
    refused=3,
    missed=4,
)
ABNORMAL = GroundMemory(trust=Trust(TrustState.SATELLITE_ANOMALY, 1, 0, 0))
TWO = LocaliserMemory(
    grounds={"k-1": HEARD, "a-1": ABNORMAL, "b-1": GroundMemory()},
    vouched={"k-1": (Vouched(0, 5, {"G05.1C": 5, "E11.1C": 0}), Vouched(6, 9, {})), "a-1": (Vouched(7, 7, {"G05.1C": 6}),), "b-1": ()},
    here=("a-1", "k-1"),
    confirmed_by=("k-1",),
    stop=Stop(StopState.LATCHED, ("a-1 says SATELLITE_ANOMALY",), MONO_NS, 0, True),
)


def snapshot_of(memory: LocaliserMemory) -> pb.TrainSnapshot:
    """As it is read from a recording."""
    return pb.TrainSnapshot.FromString(encode_snapshot(memory, TRAIN, TRACK, MONO_NS).SerializeToString())


@pytest.mark.parametrize("name", ["grounds", "vouched", "here", "confirmed_by", "stop"])
def test_a_snapshot_of_two_stations_comes_back_as_it_went(name: str) -> None:
    assert getattr(decode_snapshot(snapshot_of(TWO), TRACK), name) == getattr(TWO, name)


@pytest.mark.parametrize("name", ["here", "confirmed_by"])
def test_that_nobody_vouches_is_something_else_than_that_nothing_is_known(name: str) -> None:
    memories = [replace(TWO, **{name: ()}), replace(LocaliserMemory(), **{name: None})]  # type: ignore[arg-type]
    assert [getattr(decode_snapshot(snapshot_of(memory), TRACK), name) for memory in memories] == [(), None]


@pytest.mark.parametrize("stop", [Stop(), Stop(StopState.NONE, ()), Stop(StopState.REQUESTED, ("why",), 0, None, True)])
def test_a_stop_comes_back_as_it_went(stop: Stop) -> None:
    assert decode_snapshot(snapshot_of(replace(TWO, stop=stop)), TRACK).stop == stop


@pytest.mark.parametrize("number", [pb.STOP_UNSPECIFIED, 77])
def test_a_stop_of_a_kind_not_known_is_asked_for(number: int) -> None:
    message = snapshot_of(TWO)
    message.stop.state = number  # type: ignore[assignment]
    assert decode_snapshot(message, TRACK).stop.state is StopState.REQUESTED


def test_a_snapshot_without_a_stop_asks_for_one() -> None:
    message = snapshot_of(TWO)
    message.ClearField("stop")
    assert decode_snapshot(message, TRACK).stop == Stop(reasons=())


@pytest.mark.parametrize("number", [pb.TRUST_UNSPECIFIED, pb.TRUST_CONFLICT, 77])
def test_trust_that_one_station_cannot_have_is_refused(number: int) -> None:
    message = snapshot_of(TWO)
    message.stations[1].trust = number  # type: ignore[assignment]
    with pytest.raises(DecodeError, match=f"snapshot: trust {number} in a-1: "):
        decode_snapshot(message, TRACK)


@pytest.mark.parametrize("field", ["valid_until_ns", "normals"])
def test_normal_without_what_it_rests_on_is_refused(field: str) -> None:
    message = snapshot_of(TWO)
    message.stations[0].ClearField(field)
    with pytest.raises(DecodeError, match="NORMAL needs a message that is valid, and its end"):
        decode_snapshot(message, TRACK)


def test_signals_without_their_ephemerides_are_not_vouched_for() -> None:
    message = snapshot_of(TWO)
    del message.stations[0].vouched[0].ephemeris_crc32[1:]
    assert decode_snapshot(message, TRACK).vouched["k-1"][0] == Vouched(0, 5, {})
