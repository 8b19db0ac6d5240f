"""What a train records and publishes: events come back as they went, and a position never says more than is known."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from google.protobuf.message import Message
from hypothesis import given
from hypothesis import strategies as st

from integrity.errors import DecodeError
from integrity.events import InputLost, RawBytes, Tick
from integrity.messages import wayside_pb2 as pb
from recordings.channels import TRAIN_TOPICS, is_input, raw_topic, topic_of
from recordings.reader import read_recording
from recordings.writer import RecordingWriter
from tests.unit.track.lines import line, straight
from train_client.events import ChallengeAnswered, ChallengeSent, HealthReceived, StopReleased, TrainEvent
from train_client.messages import STATUS, STOP, TRUST, decode_event, encode_event, encode_position, encode_started
from train_client.outputs import AntennaFix, Confirmed, Fix, MapPlace, PositionReport, StationReport, Status
from train_client.stop import Stop, StopState
from train_client.train_file import parse_train
from train_client.trust import WORST_FIRST, TrustState

TRAIN = parse_train(
    '[train]\nid = "r291"\nlength_m = 40.0\n[[antenna]]\nid = "front"\nx_m = -3.0\nheight_m = 3.9\n[trust]\nstations = ["k-1"]\n', "t"
).config
TRACK = replace(line(straight("main", "west", "east", 0.0, 100.0)), id="sample", version=1, sha256="5" * 64)
MONO_NS, GPS_NS = 7_000_000_000_000, 1_456_000_000_000_000_000
ANTENNA = AntennaFix("front", MapPlace("main", 47.0), 0.4, 1.1, 9, 5.5, 30.0, "")
NO_PLACE = AntennaFix("rear", None, None, None, 2, None, None, "too few satellites")
FIX = Fix(
    gps_time_ns=GPS_NS,
    front=MapPlace("main", 50.0),
    rear=MapPlace("main", 10.0),
    sigma_m=0.3,
    facing=-1,
    antennas=(ANTENNA, NO_PLACE),
    distance_m=18.2,
    distance_expected_m=18.15,
    used=("G05.1C",),
    unused=(("G07.1C", "not monitored"),),
    reasons=(),
)
LAST = Confirmed(MapPlace("main", 49.0), GPS_NS - 10**9)
STATION = StationReport("k-1", TrustState.NORMAL, 57, 1_999_999_999, 2, False)
REPORT = PositionReport(5, MONO_NS, Status.VALID, (), FIX, TrustState.NORMAL, ("k-1",), (STATION,), Stop(StopState.NONE, ()), LAST)

EVENTS: list[TrainEvent] = [
    HealthReceived(MONO_NS, "wayside/v1/k-1/health", b"\x00\xff" * 30),
    HealthReceived(MONO_NS + 1, "", b""),
    ChallengeSent(MONO_NS + 2, "k-1", bytes(range(16))),
    ChallengeAnswered(MONO_NS + 3, "k-1", bytes(range(16)), b"\xff\x00"),
    ChallengeAnswered(MONO_NS + 4, "k-1", bytes(16), b"", "no such place"),
    InputLost(MONO_NS + 5, "front", 7),
    Tick(MONO_NS + 6, GPS_NS, 1_000_000),
    Tick(MONO_NS + 7, GPS_NS, None),
    Tick(MONO_NS + 8, GPS_NS, 0),
    StopReleased(MONO_NS + 9),
]


def encoded(report: PositionReport) -> pb.TrainPosition:
    """As it is read by who receives it."""
    message = pb.TrainPosition.FromString(encode_position(report, TRAIN, TRACK).SerializeToString())
    assert isinstance(message, pb.TrainPosition)
    return message


@pytest.mark.parametrize("event", EVENTS, ids=lambda event: f"{type(event).__name__} {event.mono_ns - MONO_NS}")
def test_an_event_comes_back_as_it_went(event: TrainEvent) -> None:
    message = encode_event(event)
    assert decode_event(type(message).FromString(message.SerializeToString())) == event


def test_bytes_of_receivers_are_no_message() -> None:
    with pytest.raises(TypeError, match="bytes of receiver front are recorded as they came"):
        encode_event(RawBytes(1, "front", b""))


@pytest.mark.parametrize("message", [pb.Health(), pb.TrainPosition(), pb.TrainStarted(), pb.Observations()], ids=lambda m: type(m).__name__)
def test_what_is_no_input_of_a_train_is_refused(message: Message) -> None:
    with pytest.raises(DecodeError, match=r"\A\S+ is (no input of a train|not an input)\Z"):
        decode_event(message)


# Positions


def test_a_position_says_where_the_train_is_and_what_it_rests_on() -> None:
    expected = pb.TrainPosition(
        train="r291",
        sequence=5,
        mono_ns=MONO_NS,
        gps_time_ns=GPS_NS,
        status=pb.POSITION_VALID,
        front=pb.TrackPlace(edge="main", offset_m=50.0),
        rear=pb.TrackPlace(edge="main", offset_m=10.0),
        sigma_m=0.3,
        facing=-1,
        trust=pb.TRUST_NORMAL,
        site="k-1",
        health_sequence=57,
        valid_for_ms=1999,  # the millisecond that has begun is not promised
        antennas=[
            pb.AntennaFix(
                antenna="front",
                place=pb.TrackPlace(edge="main", offset_m=47.0),
                sigma_m=0.4,
                tpdop=1.1,
                satellites=9,
                residual=5.5,
                residual_threshold=30.0,
            ),
            pb.AntennaFix(antenna="rear", satellites=2, why="too few satellites"),
        ],
        distance_m=18.2,
        distance_expected_m=18.15,
        unused=[pb.UnusedSatellite(signal="G07.1C", why="not monitored")],
        last_confirmed=pb.TrackPlace(edge="main", offset_m=49.0),
        last_confirmed_gps_ns=GPS_NS - 10**9,
        refused_messages=2,
        map_id="sample",
        map_version="1",
        map_sha256="5" * 64,
        config_sha256=TRAIN.config_sha256,
        software=encoded(REPORT).software,
        stations=[pb.StationTrust(site="k-1", trust=pb.TRUST_NORMAL, health_sequence=57, valid_for_ms=1999, refused_messages=2)],
        vouching=["k-1"],
        stop=pb.STOP_NONE,
    )
    assert encoded(REPORT) == expected


@pytest.mark.parametrize("status, known", [(Status.UNKNOWN, []), (Status.PROVISIONAL, ["front", "rear", "sigma_m"])])
def test_unknown_has_no_place_whatever_the_fix(status: Status, known: list[str]) -> None:
    message = encoded(replace(REPORT, status=status, reasons=("why",)))
    assert [name for name in ("front", "rear", "sigma_m") if message.HasField(name)] == known


@pytest.mark.parametrize("missing", ["front", "rear", "sigma_m"])
def test_half_a_place_is_none(missing: str) -> None:
    message = encoded(replace(REPORT, status=Status.PROVISIONAL, fix=replace(FIX, **{missing: None})))  # type: ignore[arg-type]
    assert [name for name in ("front", "rear", "sigma_m") if message.HasField(name)] == []


@pytest.mark.parametrize("missing", ["distance_m", "distance_expected_m"])
def test_half_a_distance_is_none(missing: str) -> None:
    message = encoded(replace(REPORT, fix=replace(FIX, **{missing: None})))  # type: ignore[arg-type]
    assert [name for name in ("distance_m", "distance_expected_m") if message.HasField(name)] == []


def test_without_a_fix_nothing_of_an_epoch_is_said() -> None:
    silent = replace(STATION, health_sequence=None, valid_for_ns=None)
    bare = replace(REPORT, status=Status.UNKNOWN, fix=None, stations=(silent,), last_confirmed=None)
    names = {field.name for field, _ in encoded(bare).ListFields()}
    always = {"train", "sequence", "mono_ns", "trust", "site", "refused_messages", "software", "stations", "vouching", "stop"}
    assert names == always | {"map_id", "map_version", "map_sha256", "config_sha256"}


def test_the_first_sequence_and_the_first_offset_are_there_though_they_are_zero() -> None:
    start = MapPlace("main", 0.0)
    message = encoded(
        replace(REPORT, stations=(replace(STATION, health_sequence=0, valid_for_ns=0),), fix=replace(FIX, front=start, rear=start))
    )
    found = [message.HasField("health_sequence"), message.HasField("valid_for_ms"), message.HasField("front"), message.HasField("rear")]
    assert found == [True] * 4


@pytest.mark.parametrize("state", TrustState)
def test_each_trust_has_a_word_of_its_own(state: TrustState) -> None:
    assert pb.TrustState.Name(encoded(replace(REPORT, trust=state)).trust) == f"TRUST_{state.value}"


@pytest.mark.parametrize("status", Status)
def test_each_status_has_a_word_of_its_own(status: Status) -> None:
    assert pb.PositionStatus.Name(encoded(replace(REPORT, status=status)).status) == f"POSITION_{status.value}"


def test_nothing_known_reads_as_unknown_without_trust() -> None:
    empty = pb.TrainPosition()
    assert (empty.status, empty.trust in TRUST.values()) == (STATUS[Status.UNKNOWN], False)


def test_a_validity_that_has_just_run_out_can_be_said() -> None:
    assert encoded(replace(REPORT, stations=(replace(STATION, valid_for_ns=-1),))).valid_for_ms == 0


# Several stations, and the stop

OTHER = StationReport("a-1", TrustState.NORMAL, 912, 1_500_000_000, 3, True, 4)


def of_two(here: StationReport, other: StationReport, vouching: tuple[str, ...] = ("k-1", "a-1")) -> PositionReport:
    return replace(REPORT, trust=min((here.trust, other.trust), key=WORST_FIRST.index), vouching=vouching, stations=(here, other))


def test_a_position_tells_of_each_station_in_the_order_of_the_train_file() -> None:
    silent = StationReport("k-1", TrustState.NO_COMMS, None, None, 2, False)
    assert list(encoded(of_two(silent, OTHER)).stations) == [
        pb.StationTrust(site="k-1", trust=pb.TRUST_NO_COMMS, refused_messages=2),
        pb.StationTrust(
            site="a-1",
            trust=pb.TRUST_NORMAL,
            health_sequence=912,
            valid_for_ms=1500,
            refused_messages=3,
            security_alarm=True,
            missed_messages=4,
        ),
    ]


def test_where_all_are_normal_the_one_that_runs_out_first_is_named_with_its_message() -> None:
    message = encoded(of_two(STATION, OTHER))
    assert (message.site, message.health_sequence, message.valid_for_ms) == ("a-1", 912, 1500)


@pytest.mark.parametrize("turned", [False, True])
def test_the_worst_of_them_is_named_and_nothing_is_valid_any_longer(turned: bool) -> None:
    stale = StationReport("k-1", TrustState.STALE, 57, None, 2, False)
    message = encoded(of_two(OTHER, stale) if turned else of_two(stale, OTHER))
    assert (message.site, message.health_sequence, message.HasField("valid_for_ms")) == ("k-1", 57, False)


def test_in_a_conflict_the_one_that_says_no_is_named() -> None:
    abnormal = StationReport("k-1", TrustState.SATELLITE_ANOMALY, 58, None, 2, False)
    message = encoded(replace(of_two(OTHER, abnormal), trust=TrustState.CONFLICT))
    assert (message.trust, message.site, message.HasField("valid_for_ms")) == (pb.TRUST_CONFLICT, "k-1", False)


@pytest.mark.parametrize("trust", [TrustState.STALE, TrustState.SATELLITE_ANOMALY])
def test_a_station_whose_word_does_not_count_here_is_not_named(trust: TrustState) -> None:
    elsewhere = StationReport("a-1", trust, 912, None, 0, False)
    message = encoded(replace(REPORT, stations=(elsewhere, STATION)))
    assert (message.site, message.valid_for_ms, list(message.vouching)) == ("k-1", 1999, ["k-1"])


def test_a_station_that_the_map_names_and_the_train_does_not_follow_is_the_worst() -> None:
    message = encoded(replace(REPORT, trust=TrustState.NO_COMMS, vouching=("k-1", "x-1")))
    assert (message.site, message.HasField("health_sequence"), message.HasField("valid_for_ms")) == ("x-1", False, False)


def test_where_nobody_vouches_one_that_is_listened_to_is_named() -> None:
    message = encoded(replace(of_two(STATION, OTHER, ()), trust=TrustState.NO_COMMS))
    assert (message.site in {"k-1", "a-1"}, list(message.vouching), message.HasField("valid_for_ms")) == (True, [], False)


def test_refused_messages_of_all_stations_are_counted() -> None:
    assert encoded(of_two(STATION, OTHER)).refused_messages == 5


@pytest.mark.parametrize("state", StopState)
def test_each_state_of_the_stop_has_a_word_of_its_own(state: StopState) -> None:
    assert pb.StopState.Name(encoded(replace(REPORT, stop=Stop(state, ("why",)))).stop) == f"STOP_{state.value}"


@pytest.mark.parametrize("since_ns", [None, 0, MONO_NS])
def test_a_stop_says_why_and_since_when_where_that_is_known(since_ns: int | None) -> None:
    message = encoded(replace(REPORT, stop=Stop(StopState.LATCHED, ("a-1 says SATELLITE_ANOMALY", "and more"), since_ns, MONO_NS)))
    since = message.stop_since_mono_ns if message.HasField("stop_since_mono_ns") else None
    assert (list(message.stop_reasons), since) == (["a-1 says SATELLITE_ANOMALY", "and more"], since_ns)


def test_nothing_known_reads_as_a_stop_that_is_asked_for() -> None:
    assert pb.TrainPosition().stop not in STOP.values()


# Numbers


def numbers(message: Message) -> list[float]:
    """Every float in it, whatever it is in."""
    found = []
    for field, value in message.ListFields():
        for each in value if isinstance(value, Sequence) and not isinstance(value, str | bytes) else [value]:
            if isinstance(each, float):
                found.append(each)
            elif field.message_type is not None:
                found += numbers(each)
    return found


NUMBERS = ("sigma_m", "distance_m", "distance_expected_m", "offset_m", "antenna sigma_m", "tpdop", "residual", "residual_threshold")


def spoiled(name: str, value: float) -> PositionReport:
    if name == "offset_m":
        return replace(REPORT, fix=replace(FIX, front=MapPlace("main", value)))
    if name in ("sigma_m", "distance_m", "distance_expected_m"):
        return replace(REPORT, fix=replace(FIX, **{name: value}))  # type: ignore[arg-type]
    antenna = replace(ANTENNA, **{name.removeprefix("antenna "): value})  # type: ignore[arg-type]
    return replace(REPORT, fix=replace(FIX, antennas=(antenna,)))


@pytest.mark.parametrize("name", NUMBERS)
def test_a_position_never_holds_a_number_that_is_none(name: str) -> None:
    found = [number for value in (math.nan, math.inf) for number in numbers(encoded(spoiled(name, value)))]
    assert all(map(math.isfinite, found))


# The recording


def messages() -> list[tuple[Message, int]]:
    started = encode_started(TRAIN, "[train]\n", "{}", {"k-1": (bytes(32), b"\xff" * 32), "a-1": (b"\x01" * 32,)}, GPS_NS, MONO_NS)
    listed: list[tuple[Message, int]] = [(started, MONO_NS), (pb.TrainSnapshot(mono_ns=MONO_NS, sequence=3), MONO_NS)]
    listed += [(encode_event(event), event.mono_ns) for event in EVENTS]
    listed.append((encode_position(REPORT, TRAIN, TRACK), MONO_NS + 9))
    return listed


def write(path: Path, listed: Sequence[tuple[Message, int]]) -> None:
    with RecordingWriter(path, "wayside test", GPS_NS, MONO_NS, {}, receivers=TRAIN.antenna_ids, topics=TRAIN_TOPICS) as writer:
        for message, mono_ns in listed:
            writer.write(message, mono_ns)
        writer.write_raw("front", b"\xb5\x62", MONO_NS + 10)


def test_there_is_a_message_of_every_topic() -> None:
    assert {topic_of(message) for message, _ in messages()} == set(TRAIN_TOPICS)


def test_every_message_is_read_as_it_was_written(tmp_path: Path) -> None:
    write(tmp_path / "x.mcap", messages())
    entries = read_recording(tmp_path / "x.mcap").entries
    expected = [(topic_of(message), message.SerializeToString(deterministic=True)) for message, _ in messages()]
    assert [(entry.topic, entry.data) for entry in entries] == [*expected, (raw_topic("front"), b"\xb5\x62")]


def test_the_inputs_of_a_recording_are_the_events_in_order(tmp_path: Path) -> None:
    write(tmp_path / "x.mcap", messages())
    inputs = [e.message for e in read_recording(tmp_path / "x.mcap").entries if is_input(e.topic)]
    assert [decode_event(message) for message in inputs if isinstance(message, Message)] == EVENTS


def test_a_recording_names_the_keys_of_each_station_in_order() -> None:
    started, _ = messages()[0]
    assert isinstance(started, pb.TrainStarted)
    assert [(key.site, key.public_key) for key in started.trusted_keys] == [
        ("a-1", b"\x01" * 32),
        ("k-1", bytes(32)),
        ("k-1", b"\xff" * 32),
    ]


texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=9)
times_ns = st.integers(-(2**63), 2**63 - 1)


@given(
    st.builds(HealthReceived, times_ns, texts, st.binary())
    | st.builds(ChallengeSent, times_ns, texts, st.binary())
    | st.builds(ChallengeAnswered, times_ns, texts, st.binary(), st.binary(), texts)
    | st.builds(InputLost, times_ns, texts, st.integers(0, 2**32 - 1))
    | st.builds(Tick, times_ns, times_ns, st.none() | st.integers(0, 2**63 - 1))
)
def test_any_event_comes_back_as_it_went(event: TrainEvent) -> None:
    message = encode_event(event)
    assert decode_event(type(message).FromString(message.SerializeToString())) == event
