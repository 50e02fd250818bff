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

LEARNT = 0.5
"""A velocity is told once its standard deviation, along every direction, is this part of what it was before a range."""


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
        state=_state(track, tracking.accuracy_m, accurate=accurate),
        accurate=accurate,
        age_s=round(max(0.0, now_s - known.at_s), 1) if math.isfinite(known.at_s) else None,
        ranges=known.used,
        rejected=known.rejected,
        last_refusal=known.last_refusal,
        pursued_by=pursuer,
    )
    if not track.known:
        return view
    east, north, depth = (float(value) for value in track.state[:3])
    speed_mps, course_deg = _velocity(track, tracking.untold_sd_mps(name))
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
            "speed_mps": speed_mps,
            "course_deg": course_deg,
            "sd_east_m": sd[0],
            "sd_north_m": sd[1],
            "sd_depth_m": sd[2],
            "ellipse": ellipse(track.covariance[:2, :2]),
        }
    )


def _state(track: TargetTrack, accuracy_m: float, *, accurate: bool) -> TargetState:
    if not track.known:
        return TargetState.UNHEARD
    if accurate:
        return TargetState.ACCURATE
    # Who passes a target close by leaves several depths possible, at one place.
    one_place = track.single or (track.sd_m[:2] < accuracy_m).all()
    return TargetState.UNCERTAIN if one_place else TargetState.SEARCHING


def _velocity(track: TargetTrack, untold_sd_mps: float) -> tuple[float | None, float | None]:
    """Return the speed and the course of a target, degrees; None for what its ranges do not tell.

    ``untold_sd_mps``: how uncertain each component of its velocity was before any range.
    """
    velocity, covariance = track.state[3:5], track.covariance[3:5, 3:5]
    if np.sqrt(np.linalg.eigvalsh(covariance)[-1]) > LEARNT * untold_sd_mps:
        return None, None
    speed_mps = float(np.hypot(*velocity))
    moves = velocity @ np.linalg.solve(covariance, velocity) > _SCALE**2
    course_deg = round(math.degrees(math.atan2(velocity[0], velocity[1])) % 360.0, 1) if moves else None
    return round(speed_mps, 3), course_deg


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
