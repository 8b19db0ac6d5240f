"""Solved positions of the receivers as `foxglove.LocationFix`, for the maps of MCAP viewers."""

from collections.abc import Sequence

import numpy as np

from integrity.gnss.frames import geodetic_from_ecef
from integrity.gnss.gps_time import NS_PER_S, utc_from_gps
from integrity.messages import wayside_pb2 as pb
from integrity.messages.location_fix_pb2 import LocationFix
from integrity.triangle import ReferenceTriangle


def location_fixes(reports: Sequence[pb.EpochReport], triangle: ReferenceTriangle, site_id: str) -> list[list[LocationFix]]:
    """For each report, a fix of every receiver that has a position: its surveyed point and what was solved beside it.

    Geodetic degrees and ellipsoidal metres in the frame of the site; `frame_id` is `site/receiver`, the time that of the epoch (UTC).
    """
    places = {name: r for r, name in enumerate(triangle.names)}
    solved = [(e, v) for e, report in enumerate(reports) for v in report.triangle if v.HasField("east_m")]
    e_enu_m = np.array([(v.east_m, v.north_m, v.up_m) for _, v in solved], dtype=np.float64).reshape(-1, 3)
    at = [places[v.receiver] for _, v in solved]
    pos_ecef_m = triangle.pos_ecef_m[at] + np.einsum("vij,vi->vj", triangle.enu[at], e_enu_m)
    lat_rad, lon_rad, height_m = geodetic_from_ecef(pos_ecef_m)
    found: list[list[LocationFix]] = [[] for _ in reports]
    for (e, vertex), lat, lon, height in zip(
        solved, np.degrees(lat_rad).tolist(), np.degrees(lon_rad).tolist(), height_m.tolist(), strict=True
    ):
        fix = LocationFix(latitude=lat, longitude=lon, altitude=height, frame_id=f"{site_id}/{vertex.receiver}")
        fix.timestamp.seconds, fix.timestamp.nanos = divmod(utc_from_gps(reports[e].gps_time_ns), NS_PER_S)
        found[e].append(fix)
    return found
