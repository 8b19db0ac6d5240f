"""Broadcast ephemerides to messages and back, as they were: whether one is plausible is decided by who uses it."""

from dataclasses import fields
from typing import Any

from integrity.errors import DecodeError
from integrity.gnss.ephemeris.broadcast import MESSAGES, Ephemeris, GeoEphemeris, GlonassEphemeris, KeplerEphemeris, KeplerMessage
from integrity.messages import wayside_pb2 as pb

_NAMED = ("message", "accuracy_m", "group_delay_2_s", "delta_tau_n_s")  # not copied as they are
_SHARED = ("satellite", "issue", "healthy", "transmission_ns", "toe_ns", "fit_half_s")
_KEPLER = tuple(f.name for f in fields(KeplerEphemeris) if f.name not in _NAMED)
_GLONASS = tuple(f.name for f in fields(GlonassEphemeris) if f.name not in (*_NAMED, *_SHARED))
_GEO = tuple(f.name for f in fields(GeoEphemeris) if f.name not in (*_NAMED, *_SHARED))


def encode_ephemeris(ephemeris: Ephemeris, mono_ns: int) -> pb.Ephemeris:
    """One broadcast set."""
    of: dict[str, Any]
    match ephemeris:
        case KeplerEphemeris():
            of = _values(ephemeris, _KEPLER) | {"message": ephemeris.message, "group_delay_2_s": ephemeris.group_delay_2_s}
        case GlonassEphemeris():
            orbit = pb.GlonassOrbit(delta_tau_n_s=ephemeris.delta_tau_n_s, **_values(ephemeris, _GLONASS))
            of = _values(ephemeris, _SHARED) | {"glonass": orbit}
        case GeoEphemeris():
            of = _values(ephemeris, _SHARED) | {"geo": pb.GeoOrbit(**_values(ephemeris, _GEO))}
    return pb.Ephemeris(mono_ns=mono_ns, accuracy_m=ephemeris.accuracy_m, **of)


def decode_ephemeris(message: pb.Ephemeris) -> Ephemeris:
    """One broadcast set; DecodeError for a navigation message that is not one of the satellite's system."""
    accuracy_m = message.accuracy_m if message.HasField("accuracy_m") else None
    if message.HasField("glonass"):
        orbit = message.glonass
        delta_tau_n_s = orbit.delta_tau_n_s if orbit.HasField("delta_tau_n_s") else None
        return GlonassEphemeris(accuracy_m=accuracy_m, delta_tau_n_s=delta_tau_n_s, **_values(message, _SHARED), **_values(orbit, _GLONASS))
    if message.HasField("geo"):
        return GeoEphemeris(accuracy_m=accuracy_m, **_values(message, _SHARED), **_values(message.geo, _GEO))
    return KeplerEphemeris(
        message=_kepler_message(message),
        accuracy_m=accuracy_m,
        group_delay_2_s=message.group_delay_2_s if message.HasField("group_delay_2_s") else None,
        **_values(message, _KEPLER),
    )


def _kepler_message(message: pb.Ephemeris) -> KeplerMessage:
    known = MESSAGES.get(message.satellite[:1], ())
    if known and message.message == pb.NAVIGATION_MESSAGE_UNSPECIFIED:
        return known[0]
    for name in known:
        if pb.NavigationMessage.Value(name) == message.message:
            return name
    raise DecodeError(f"ephemeris of {message.satellite!r}: navigation message {message.message}, expected one of {MESSAGES}")


def _values(of: object, names: tuple[str, ...]) -> dict[str, Any]:
    return {name: getattr(of, name) for name in names}
