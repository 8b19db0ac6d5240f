"""Which stations vouch for a place: it stands in the sections of the map, several of which may lie over each other."""

from collections.abc import Iterable

from train_client.track.track_map import TrackMap


def stations_on(track: TrackMap) -> tuple[str, ...]:
    """All that vouch anywhere on the map, each once, in the order of its sections."""
    return tuple(dict.fromkeys(section.station for section in track.sections if section.station is not None))


def stations_at(track: TrackMap, places: Iterable[tuple[str, float]]) -> tuple[str, ...] | str:
    """Whose word counts for a train that is in these places (edge, offset in m): all that vouch for one of them, in the map's order.

    In words where it is not, for a place that nobody vouches for. Both ends of a section belong to it.
    """
    found: set[str] = set()
    for edge, s_m in places:
        here = {
            section.station
            for section in track.sections
            if section.station is not None and section.edge == edge and section.from_m <= s_m <= section.to_m
        }
        if not here:
            return f"by the map no station vouches for {edge} {s_m:.0f} m"
        found |= here
    return tuple(station for station in stations_on(track) if station in found)
