"""What a train decides on and what comes out, to messages and back. What is not known is left out: absent, never NaN."""

from collections.abc import Mapping
from math import isfinite

from google.protobuf.message import Message

from integrity import SOFTWARE
from integrity.errors import DecodeError
from integrity.events import InputLost, RawBytes, Tick
from integrity.messages import wayside_pb2 as pb
from integrity.messages.inputs import decode_event as decode_common
from integrity.messages.inputs import encode_event as encode_common
from integrity.messages.verification import NS_PER_MS
from train_client.config import TrainConfig
from train_client.events import ChallengeAnswered, ChallengeSent, HealthReceived, StopReleased, TrainEvent
from train_client.outputs import AntennaFix, MapPlace, PositionReport, StationReport, Status
from train_client.stop import StopState
from train_client.track.track_map import TrackMap
from train_client.trust import WORST_FIRST, TrustState

TRUST = {
    TrustState.NORMAL: pb.TRUST_NORMAL,
    TrustState.SATELLITE_ANOMALY: pb.TRUST_SATELLITE_ANOMALY,
    TrustState.NOT_CONFIRMABLE: pb.TRUST_NOT_CONFIRMABLE,
    TrustState.STALE: pb.TRUST_STALE,
    TrustState.NO_COMMS: pb.TRUST_NO_COMMS,
    TrustState.CONFLICT: pb.TRUST_CONFLICT,
}
STOP = {StopState.NONE: pb.STOP_NONE, StopState.REQUESTED: pb.STOP_REQUESTED, StopState.LATCHED: pb.STOP_LATCHED}
STATUS = {
    Status.UNKNOWN: pb.POSITION_UNKNOWN,
    Status.PROVISIONAL: pb.POSITION_PROVISIONAL,
    Status.VALID: pb.POSITION_VALID,
}


def encode_event(event: TrainEvent) -> Message:
    """The message that records an event; bytes of receivers are recorded as they came."""
    match event:
        case HealthReceived():
            return pb.HealthReceived(mono_ns=event.mono_ns, key_expr=event.key_expr, data=event.data)
        case ChallengeSent():
            return pb.ChallengeSent(mono_ns=event.mono_ns, site=event.site, nonce=event.nonce)
        case ChallengeAnswered():
            return pb.ChallengeAnswered(mono_ns=event.mono_ns, site=event.site, nonce=event.nonce, data=event.data, error=event.error)
        case StopReleased():
            return pb.StopReleased(mono_ns=event.mono_ns)
        case InputLost() | Tick():
            return encode_common(event)
        case RawBytes():
            raise TypeError(f"bytes of receiver {event.receiver} are recorded as they came")


def decode_event(message: Message) -> TrainEvent:
    """The event that a message records; DecodeError where it cannot be one."""
    if isinstance(message, pb.HealthReceived):
        return HealthReceived(message.mono_ns, message.key_expr, message.data)
    if isinstance(message, pb.ChallengeSent):
        return ChallengeSent(message.mono_ns, message.site, message.nonce)
    if isinstance(message, pb.ChallengeAnswered):
        return ChallengeAnswered(message.mono_ns, message.site, message.nonce, message.data, message.error)
    if isinstance(message, pb.StopReleased):
        return StopReleased(message.mono_ns)
    event = decode_common(message)
    if isinstance(event, InputLost | Tick):
        return event
    raise DecodeError(f"{message.DESCRIPTOR.full_name} is no input of a train")


def encode_started(
    train: TrainConfig, train_toml: str, map_json: str, keys: Mapping[str, tuple[bytes, ...]], gps_ns: int, mono_ns: int
) -> pb.TrainStarted:
    """The first message of a train's recording."""
    return pb.TrainStarted(
        train=train.train_id,
        software=SOFTWARE,
        config_sha256=train.config_sha256,
        train_toml=train_toml,
        map_json=map_json,
        trusted_keys=[pb.TrustedKey(site=site, public_key=key) for site, trusted in sorted(keys.items()) for key in trusted],
        gps_time_ns=gps_ns,
        mono_ns=mono_ns,
    )


def encode_position(report: PositionReport, train: TrainConfig, track: TrackMap) -> pb.TrainPosition:
    """What a train publishes of where it is."""
    fix, confirmed = report.fix, report.last_confirmed
    worst = _worst(report)
    message = pb.TrainPosition(
        train=train.train_id,
        sequence=report.sequence,
        mono_ns=report.mono_ns,
        status=STATUS[report.status],
        reasons=report.reasons,
        facing=0 if fix is None else fix.facing,
        trust=TRUST[report.trust],
        site=worst.site,
        health_sequence=worst.health_sequence,
        valid_for_ms=_whole_ms(worst.valid_for_ns) if report.trust is TrustState.NORMAL else None,
        stations=[_station(station) for station in report.stations],
        vouching=report.vouching,
        stop=STOP[report.stop.state],
        stop_reasons=report.stop.reasons,
        stop_since_mono_ns=report.stop.since_ns,
        last_confirmed=_place(None if confirmed is None else confirmed.place),
        last_confirmed_gps_ns=None if confirmed is None else confirmed.gps_time_ns,
        refused_messages=sum(station.refused_messages for station in report.stations),
        map_id=track.id,
        map_version=str(track.version),
        map_sha256=track.sha256,
        config_sha256=train.config_sha256,
        software=SOFTWARE,
    )
    if fix is not None:
        message.gps_time_ns = fix.gps_time_ns
        message.antennas.extend(_antenna(antenna) for antenna in fix.antennas)
        message.unused.extend(pb.UnusedSatellite(signal=signal, why=why) for signal, why in fix.unused)
        distance_m, expected_m, sigma_m = (_finite(x) for x in (fix.distance_m, fix.distance_expected_m, fix.sigma_m))
        if distance_m is not None and expected_m is not None:
            message.distance_m, message.distance_expected_m = distance_m, expected_m
        front, rear = _place(fix.front), _place(fix.rear)
        if report.status is not Status.UNKNOWN and front is not None and rear is not None and sigma_m is not None:
            message.front.CopyFrom(front)
            message.rear.CopyFrom(rear)
            message.sigma_m = sigma_m
        else:
            message.status = pb.POSITION_UNKNOWN
    return message


def _worst(report: PositionReport) -> StationReport:
    """The station that trust is no better than here; where all are NORMAL the one whose word runs out first."""
    known = {station.site: station for station in report.stations}
    unheard = {site: StationReport(site, TrustState.NO_COMMS, None, None, 0, False) for site in report.vouching}
    here = [(unheard | known)[site] for site in report.vouching] or report.stations
    return min(here, key=lambda station: (WORST_FIRST.index(station.trust), station.valid_for_ns or 0))


def _station(report: StationReport) -> pb.StationTrust:
    return pb.StationTrust(
        site=report.site,
        trust=TRUST[report.trust],
        health_sequence=report.health_sequence,
        valid_for_ms=_whole_ms(report.valid_for_ns),
        refused_messages=report.refused_messages,
        security_alarm=report.security_alarm,
        missed_messages=report.missed_messages,
    )


def _whole_ms(left_ns: int | None) -> int | None:
    return None if left_ns is None else max(0, left_ns) // NS_PER_MS


def _antenna(fix: AntennaFix) -> pb.AntennaFix:
    return pb.AntennaFix(
        antenna=fix.antenna,
        place=_place(fix.place),
        sigma_m=_finite(fix.sigma_m),
        tpdop=_finite(fix.tpdop),
        satellites=fix.satellites,
        residual=_finite(fix.residual),
        residual_threshold=_finite(fix.residual_threshold),
        why=fix.why,
    )


def _place(place: MapPlace | None) -> pb.TrackPlace | None:
    return None if place is None or _finite(place.offset_m) is None else pb.TrackPlace(edge=place.edge, offset_m=place.offset_m)


def _finite(number: float | None) -> float | None:
    """The number, if it is one."""
    return number if number is not None and isfinite(number) else None
