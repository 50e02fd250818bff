"""What operators are shown of a mission's targets."""

import math

import numpy as np
from shapely import contains_xy
from shapely.geometry import Polygon

from app.arrays import FloatArray
from app.estimation.targets import TargetTrack
from app.mapping.coordinates.georeference import LocalFrame
from app.missions.targets.filters import TargetFilters, TargetKnowledge
from app.missions.views.targets import EllipseView, TargetState, TargetView

PROBABILITY = 0.95
_SCALE = math.sqrt(-2.0 * math.log(1.0 - PROBABILITY))


def target_views(
    tracking: TargetFilters, frame: LocalFrame, area: FloatArray, now_s: float, pursuers: dict[str, str]
) -> list[TargetView]:
    """Return every target foretold for now; ``pursuers`` are the vehicles that went after targets, by target."""
    if not tracking.known:
        return []
    polygon = Polygon(area)
    return [
        _view(name, known, tracking, tracking.at(name, now_s), frame, polygon, now_s, pursuers.get(name))
        for name, known in tracking.known.items()
    ]


def _view(
    name: str,
    known: TargetKnowledge,
    tracking: TargetFilters,
    track: TargetTrack,
    frame: LocalFrame,
    polygon: Polygon,
    now_s: float,
    pursuer: str | None,
) -> TargetView:
    accurate = tracking.accurate(track)
    view = TargetView(
        name=name,
        state=_state(track, accurate=accurate),
        accurate=accurate,
        age_s=round(max(0.0, now_s - known.at_s), 1) if math.isfinite(known.at_s) else None,
        ranges=known.used,
        rejected=known.rejected,
        last_refusal=known.last_refusal,
        pursued_by=pursuer,
    )
    if not track.known:
        return view
    east, north, depth, east_rate, north_rate, _ = (float(value) for value in track.state)
    try:
        lat, lon = frame.to_geographic(np.array(east), np.array(north))
    except ValueError:
        # A filter without ranges may drift off the map; then only its figures are told.
        return view
    sd = [round(float(value), 3) for value in track.sd_m]
    return view.model_copy(
        update={
            "in_area": bool(contains_xy(polygon, east, north)),
            "lat_deg": float(lat),
            "lon_deg": float(lon),
            "east_m": round(east, 3),
            "north_m": round(north, 3),
            "depth_m": round(max(depth, 0.0), 3),
            "speed_mps": round(math.hypot(east_rate, north_rate), 3),
            "course_deg": round(math.degrees(math.atan2(east_rate, north_rate)) % 360.0, 1),
            "sd_east_m": sd[0],
            "sd_north_m": sd[1],
            "sd_depth_m": sd[2],
            "ellipse": ellipse(track.covariance[:2, :2]),
        }
    )


def _state(track: TargetTrack, *, accurate: bool) -> TargetState:
    if not track.known:
        return TargetState.UNHEARD
    if accurate:
        return TargetState.ACCURATE
    return TargetState.UNCERTAIN if track.single else TargetState.SEARCHING


def ellipse(covariance: FloatArray) -> EllipseView:
    """Return the ellipse that holds a place with 95 % probability, from its covariance (2, 2) of east and north."""
    variance, axes = np.linalg.eigh(covariance)
    minor, major = _SCALE * np.sqrt(np.maximum(variance, 0.0))
    east, north = axes[:, 1]
    return EllipseView(
        semi_major_m=round(float(major), 3),
        semi_minor_m=round(float(minor), 3),
        orientation_deg=round(math.degrees(math.atan2(east, north)) % 180.0, 1),
    )
