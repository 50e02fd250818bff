"""Where vehicles wait to be taken out of the water, and at which depths they go there, so that none meets another."""

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from app.arrays import FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.missions.spec.mission import MissionSpec
from app.missions.spec.recovery import Recovery
from app.missions.spec.vehicle import VehicleKind, VehicleSpec
from imc_bridge.control.depth_layers import DepthLayer
from imc_bridge.control.plans import HOME_RADIUS_M

STOPS_WITHIN_M = 2.0
"""A simulated vehicle that comes from no deeper than it floats up from is at rest this close to where it arrived."""


def layer_of(name: str, cruise_m: dict[str, float], spacing_m: float) -> DepthLayer:
    """Return a vehicle's layer among those that travel at these depths, by name; of equals the first is above."""
    order = sorted(cruise_m, key=lambda one: cruise_m[one])
    return DepthLayer(tuple(cruise_m[one] for one in order), order.index(name), spacing_m)


def home_of(vehicle: VehicleSpec, slot: int, spec: MissionSpec, team: Sequence[VehicleSpec]) -> FloatArray | None:
    """Return where a vehicle comes home to, (2,): its own berth about the recovery point; None where it has none.

    ``team`` are all that take part now, those that joined later too.
    """
    recovery = spec.recovery_of(vehicle)
    if recovery is None:
        return None
    point_m = point_of(recovery, spec)
    # A point of its own is nobody else's.
    if vehicle.recovery_point is not None:
        return point_m
    sharing = sum(other.recovery_point is None for other in team)
    return berth_m(point_m, slot, sharing, berth_spacing_m(spec, team))


def point_of(recovery: Recovery, spec: MissionSpec) -> FloatArray:
    """Return a recovery point in the mission's frame, (2,)."""
    return np.array(_local(recovery.point, spec.frame()))


@lru_cache(maxsize=256)
def _local(point: tuple[float, float], frame: LocalFrame) -> tuple[float, float]:
    """Return a point (longitude, latitude) in a frame: asked for again and again."""
    lon, lat = point
    east, north = frame.to_local(np.array(lat), np.array(lon))
    return float(east), float(north)


def berth_m(home_m: FloatArray, slot: int, sharing: int, spacing_m: float) -> FloatArray:
    """Return where a vehicle waits to be taken out of the water, (2,): each has a place of its own about the point.

    Who shares the point with nobody waits at the point itself. Others wait in the places of a triangular grid with the
    point in the middle of one of its triangles, the nearest first.

    Parameters
    ----------
    slot
        The vehicle's number in its team.
    sharing
        How many vehicles the mission brings to this point.
    spacing_m
        Least distance between two places, see :func:`berth_spacing_m`.
    """
    if sharing < 2 and slot == 0:
        return home_m
    return np.asarray(home_m + spacing_m * _places(slot + 1)[slot])


def berth_spacing_m(spec: MissionSpec, team: Sequence[VehicleSpec]) -> float:
    """Return how far apart a team waits: what two of it need to stay in their places, and the separation."""
    sharing = [vehicle for vehicle in team if vehicle.recovery_point is None]
    room_m = max((room_of_m(vehicle, spec) for vehicle in sharing or team), default=HOME_RADIUS_M)
    return 2.0 * room_m + spec.limits.min_separation_m


def room_of_m(vehicle: VehicleSpec, spec: MissionSpec) -> float:
    """Return how far from its place a vehicle may be while it waits there."""
    if vehicle.kind is VehicleKind.SIM:
        return spec.arrival_radius_m + STOPS_WITHIN_M
    return max(HOME_RADIUS_M, spec.arrival_radius_m, vehicle.turn_radius_m or 0.0)


def is_home(here_m: FloatArray, place_m: FloatArray, point_m: FloatArray, room_m: float, radius_m: float) -> bool:
    """Whether a vehicle is home: within the radius of the recovery point, or of its place where that is farther off.

    Parameters
    ----------
    here_m, place_m, point_m : (2,)
        Where it is, where it is to wait, and the point.
    room_m
        How far from its place it may be while it waits.
    """
    outside = math.dist(place_m, point_m) + room_m > radius_m
    return math.dist(here_m, place_m if outside else point_m) <= radius_m


@lru_cache(maxsize=128)
def _places(count: int) -> FloatArray:
    """Return the places of a triangular grid of spacing 1 about the middle of a triangle, (count, 2), nearest first."""
    reach = math.ceil(math.sqrt(count)) + 2
    a, b = (index.ravel() for index in np.meshgrid(np.arange(-reach, reach + 1), np.arange(-reach, reach + 1)))
    grid = np.column_stack([a + 0.5 * b - 0.5, math.sqrt(0.75) * b - math.sqrt(1.0 / 12.0)])
    # Rounded: places that are as far as others keep their order on every machine.
    away, course = np.round(np.hypot(*grid.T), 9), np.round(np.arctan2(*grid.T) % (2 * math.pi), 9)
    places = np.asarray(grid[np.lexsort([course, away])[:count]], dtype=np.float64)
    places.flags.writeable = False
    return places


def farthest_m(spec: MissionSpec, slots: Sequence[int], team: Sequence[VehicleSpec]) -> float:
    """Return how far from a shared recovery point the farthest of a team's vehicles, by slot, may be while it waits."""
    spacing_m = berth_spacing_m(spec, team)
    room_m = 0.5 * (spacing_m - spec.limits.min_separation_m)
    places = [berth_m(np.zeros(2), slot, len(slots), spacing_m) for slot in slots]
    return max((float(np.hypot(*place)) for place in places), default=0.0) + room_m
