"""The whole memory of a localiser to a message and back."""

from collections.abc import Iterable

from integrity.errors import DecodeError
from integrity.messages import wayside_pb2 as pb
from integrity.messages.ephemerides import decode_ephemeris, encode_ephemeris
from integrity.messages.snapshots import decode_snapshot as decode_station
from integrity.messages.snapshots import encode_snapshot as encode_station
from integrity.messages.verification import LastHealth, Tie, VerifierMemory
from integrity.station_monitor import Snapshot
from integrity.stream_memory import StreamMemory
from train_client.alarm import Alarm
from train_client.config import TrainConfig
from train_client.localisation.coverage import Vouched
from train_client.localisation.fixes import FixMemory
from train_client.localisation.ground import GroundMemory
from train_client.localisation.memory import LocaliserMemory
from train_client.localisation.progress import ProgressMemory, Reached
from train_client.messages import STOP, TRUST
from train_client.outputs import Confirmed, MapPlace
from train_client.stop import Stop, StopState
from train_client.track.network import Place
from train_client.track.track_map import TrackMap
from train_client.trust import Trust

_TRUST_OF = {number: state for state, number in TRUST.items()}
_STOP_OF = {number: state for state, number in STOP.items()}


def encode_snapshot(memory: LocaliserMemory, train: TrainConfig, track: TrackMap, mono_ns: int) -> pb.TrainSnapshot:
    """A snapshot taken at `mono_ns`."""
    receivers = Snapshot(
        StreamMemory.empty(len(train.antennas)), reception=memory.reception, assembler=memory.assembler, ephemerides=memory.ephemerides
    )
    reached, before, confirmed = memory.progress.reached, memory.fixes.before, memory.confirmed
    return pb.TrainSnapshot(
        mono_ns=mono_ns,
        receivers=encode_station(receivers, train.antenna_ids, mono_ns),
        told=[pb.ToldEphemeris(antenna=antenna, ephemeris=encode_ephemeris(eph, 0)) for antenna, eph in memory.told],
        segment=memory.fixes.segment or (),
        first_antenna=None if before is None else pb.TrackPlace(edge=track.edges[before[0].edge_index].id, offset_m=before[0].s_m),
        facing=0 if before is None else before[1],
        unsolved=memory.fixes.unsolved,
        reached=None
        if reached is None
        else pb.Reached(place=_place(reached.place), sigma_m=reached.sigma_m, facing=reached.facing, gps_time_ns=reached.gps_time_ns),
        behind_m=memory.progress.behind_m,
        stations=[_encode_station(site, of, memory.vouched.get(site, ())) for site, of in memory.grounds.items()],
        stop=pb.StopMemory(
            state=STOP[memory.stop.state],
            reasons=memory.stop.reasons,
            since_ns=memory.stop.since_ns,
            lost_ns=memory.stop.lost_ns,
            valid_again=memory.stop.valid_again,
        ),
        vouching=memory.here,
        vouching_confirmed=memory.confirmed_by,
        placed=memory.confirmed_by is not None,
        last_mono_ns=memory.mono_ns,
        sequence=memory.sequence,
        last_confirmed=None if confirmed is None else _place(confirmed.place),
        last_confirmed_gps_ns=0 if confirmed is None else confirmed.gps_time_ns,
    )


def decode_snapshot(message: pb.TrainSnapshot, track: TrackMap) -> LocaliserMemory:
    """The memory that a message records; DecodeError where it is of another map, or its parts do not fit each other."""
    receivers = decode_station(message.receivers)
    return LocaliserMemory(
        reception=receivers.reception,
        told=tuple((told.antenna, decode_ephemeris(told.ephemeris)) for told in message.told),
        assembler=receivers.assembler,
        ephemerides=receivers.ephemerides,
        fixes=FixMemory(tuple(message.segment) or None, _before(message, track), message.unsolved),
        progress=ProgressMemory(_reached(message.reached) if message.HasField("reached") else None, message.behind_m),
        grounds={of.site: _ground(of) for of in message.stations},
        vouched={of.site: tuple(_vouched(v) for v in of.vouched) for of in message.stations},
        here=tuple(message.vouching) if message.stations else None,
        confirmed_by=tuple(message.vouching_confirmed) if message.placed else None,
        stop=_stop(message.stop),
        mono_ns=message.last_mono_ns if message.HasField("last_mono_ns") else None,
        sequence=message.sequence,
        confirmed=Confirmed(_map_place(message.last_confirmed), message.last_confirmed_gps_ns)
        if message.HasField("last_confirmed")
        else None,
    )


def _encode_station(site: str, memory: GroundMemory, vouched: Iterable[Vouched]) -> pb.StationMemory:
    tie, last, trust = memory.verifier.tie, memory.verifier.last, memory.trust
    return pb.StationMemory(
        site=site,
        vouched=[
            pb.Vouched(
                from_gps_ns=v.from_ns,
                to_gps_ns=v.to_ns,
                signals=sorted(v.signals),
                ephemeris_crc32=[v.signals[s] for s in sorted(v.signals)],
            )
            for v in vouched
        ],
        tie=None if tie is None else pb.ClockTie(**tie._asdict()),
        last_health=None if last is None else pb.LastHealth(**last._asdict()),
        superseded=memory.verifier.superseded,
        trust=TRUST[trust.state],
        normals=trust.normals,
        valid_until_ns=trust.valid_until_ns,
        trust_sequence=trust.sequence,
        nonces=[pb.SentNonce(nonce=nonce, mono_ns=sent_ns) for nonce, sent_ns in memory.nonces],
        challenge_at_ns=memory.challenge_at_ns,
        refused_messages=memory.refused,
        missed_messages=memory.missed,
        alarming_mono_ns=memory.alarm.mono_ns,
    )


def _ground(message: pb.StationMemory) -> GroundMemory:
    """DecodeError where its parts do not fit each other."""
    try:
        trust = Trust(
            _TRUST_OF[message.trust],
            message.normals,
            message.valid_until_ns if message.HasField("valid_until_ns") else None,
            message.trust_sequence if message.HasField("trust_sequence") else None,
        )
    except (KeyError, ValueError) as error:
        raise DecodeError(f"snapshot: trust {message.trust} in {message.site}: {error}") from None
    return GroundMemory(
        verifier=VerifierMemory(_tie(message), _last(message), tuple(message.superseded)),
        trust=trust,
        alarm=Alarm(tuple(message.alarming_mono_ns)),
        nonces=tuple((sent.nonce, sent.mono_ns) for sent in message.nonces),
        challenge_at_ns=message.challenge_at_ns if message.HasField("challenge_at_ns") else None,
        refused=message.refused_messages,
        missed=message.missed_messages,
    )


def _stop(message: pb.StopMemory) -> Stop:
    """What is not known asks for a stop."""
    return Stop(
        _STOP_OF.get(message.state, StopState.REQUESTED),
        tuple(message.reasons),
        message.since_ns if message.HasField("since_ns") else None,
        message.lost_ns if message.HasField("lost_ns") else None,
        message.valid_again,
    )


def _before(message: pb.TrainSnapshot, track: TrackMap) -> tuple[Place, int] | None:
    if not message.HasField("first_antenna"):
        return None
    index = track.edge_index.get(message.first_antenna.edge)
    if index is None:
        raise DecodeError(f"snapshot: edge {message.first_antenna.edge!r} is not on map {track.id}: give the map that was recorded with")
    return Place(index, message.first_antenna.offset_m), message.facing


def _tie(message: pb.StationMemory) -> Tie | None:
    tie = message.tie
    return Tie(tie.boot_id, tie.sent_mono_ns, tie.received_mono_ns, tie.issued_mono_ns) if message.HasField("tie") else None


def _last(message: pb.StationMemory) -> LastHealth | None:
    last = message.last_health
    if not message.HasField("last_health"):
        return None
    return LastHealth(last.boot_id, last.sequence, last.data, last.gps_time_ns if last.HasField("gps_time_ns") else None, last.told)


def _reached(reached: pb.Reached) -> Reached:
    return Reached(_map_place(reached.place), reached.sigma_m, reached.facing, reached.gps_time_ns)


def _place(place: MapPlace) -> pb.TrackPlace:
    return pb.TrackPlace(edge=place.edge, offset_m=place.offset_m)


def _map_place(place: pb.TrackPlace) -> MapPlace:
    return MapPlace(place.edge, place.offset_m)


def _vouched(message: pb.Vouched) -> Vouched:
    """Nothing is vouched for where it does not stand with which ephemerides."""
    told = len(message.signals) == len(message.ephemeris_crc32)
    signals = dict(zip(message.signals, message.ephemeris_crc32, strict=True)) if told else {}
    return Vouched(message.from_gps_ns, message.to_gps_ns, signals)
