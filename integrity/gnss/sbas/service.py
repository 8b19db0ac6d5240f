"""Service areas of type 27: how much worse a UDRE is at a place, delta UDRE.

Source: RTCA DO-229D, A.4.4.13.
"""

from typing import NamedTuple

from integrity.gnss.sbas.contents import Area, Service

# Factor by delta UDRE indicator. Table A-19.
DELTA_UDRE = (1.0, 1.1, 1.25, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 20.0, 30.0, 40.0, 50.0, 100.0)


class ServiceSet(NamedTuple):
    """Messages with one IODS, by number."""

    iods: int
    messages: dict[int, Service]

    @property
    def complete(self) -> bool:
        """Whether all that were announced have come."""
        return len(self.messages) == max((one.messages for one in self.messages.values()), default=0)


class Services(NamedTuple):
    """The last complete set, and the messages of the one that is being received after it."""

    complete: ServiceSet | None = None
    arriving: ServiceSet | None = None

    def with_message(self, service: Service) -> "Services":
        """After one more message."""
        known = self.complete
        if known is not None and known.iods == service.iods:
            return Services(ServiceSet(service.iods, known.messages | {service.number: service}), None)
        before = self.arriving.messages if self.arriving is not None and self.arriving.iods == service.iods else {}
        arriving = ServiceSet(service.iods, before | {service.number: service})
        return Services(arriving, None) if arriving.complete else Services(known, arriving)

    def delta_udre(self, lat_deg: float, lon_deg: float) -> float | None:
        """Factor at a place; None while no set is complete.

        A set that is not complete can only raise it: which area it leaves out is not known yet.
        """
        if self.complete is None:
            return None
        factor = _factor(self.complete, lat_deg, lon_deg, None)
        return factor if self.arriving is None else max(factor, _factor(self.arriving, lat_deg, lon_deg, factor))


def _factor(services: ServiceSet, lat_deg: float, lon_deg: float, otherwise: float | None) -> float:
    """Of the areas around the place those with the highest priority decide, and of these the smallest factor; where there are none, what is
    said of the outside, or `otherwise`."""
    inside = [
        (-one.priority, DELTA_UDRE[one.inside])
        for one in services.messages.values()
        if any(contains(area, lat_deg, lon_deg) for area in one.areas)
    ]
    if inside:
        return min(inside)[1]
    return max(DELTA_UDRE[one.outside] for one in services.messages.values()) if otherwise is None else otherwise


def contains(area: Area, lat_deg: float, lon_deg: float) -> bool:
    """Whether a place is in an area, its border included.

    Coordinate 3 has the latitude of coordinate 1 and the longitude of coordinate 2; a square has coordinate 4 with those of 2 and 1.
    Borders are straight in latitude and longitude and less than 180 degrees long.
    """
    width = _turned(area.lon2_deg - area.lon1_deg)
    height = area.lat2_deg - area.lat1_deg
    if width == 0.0 or height == 0.0:
        return False
    x, y = _turned(lon_deg - area.lon1_deg) / width, (lat_deg - area.lat1_deg) / height
    within = 0.0 <= x <= 1.0 and 0.0 <= y <= 1.0
    return within if area.square else within and y <= x


def _turned(angle_deg: float) -> float:
    """Between -180 and 180 degrees."""
    return (angle_deg + 180.0) % 360.0 - 180.0
