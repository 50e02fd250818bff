"""Searches that can be tried without a vehicle: a harbour basin and ACCESS13's car parks, as missions."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import Polygon, box

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.coordinates.outlines import outlines
from simulator.obstacles.car_parks import car_park, harbour_basin
from simulator.obstacles.obstacles import ObstacleWorld

PLACE = (41.1848, -8.7062)
"""Latitude and longitude of the south-western corner."""
SITES = ("harbour", "car-park-1", "car-park-2", "car-park-3")
CAR_PARK = "car-park-"


def example(site: str = "harbour", *, seed: int = 0, vehicles: int = 1, window_s: float = 1800.0) -> dict[str, Any]:
    """Return the description of a search with simulated vehicles, as it is posted to ``/api/v1/missions``.

    Raises
    ------
    ValueError
        For a site that there is not.
    """
    if site not in SITES:
        raise ValueError(f"site is {site!r}; it must be one of {', '.join(SITES)}")
    world = car_park(int(site[-1]), seed) if site.startswith(CAR_PARK) else harbour_basin(seed)
    frame = LocalFrame(*PLACE)
    width, height = world.size_m
    ring = np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height], [0.0, 0.0]])
    entry, goal = _positions(frame, np.array([world.entry_m, world.goal_m]))
    return {
        "name": f"Search of a {world.name}",
        "kind": "search",
        "area": _polygon(frame, ring),
        "vehicles": [{"name": f"boat-{k + 1}", "kind": "sim", "depth_m": 0} for k in range(vehicles)],
        "limits": {"max_step_m": 3.0, "min_depth_m": 0.0, "min_altitude_m": 0.5},
        "search": {
            "goal": goal,
            "goal_radius_m": 30.0,
            "entry": entry,
            "window_s": window_s,
            "safety_m": 1.5,
            "scanner": {"reach_m": 12.0, "resolution_deg": 1.0},
            "obstacles": _obstacles(frame, world, world.known),
            "simulated_obstacles": _obstacles(frame, world, world.solid & ~world.known),
        },
        "seed": seed,
    }


def _obstacles(frame: LocalFrame, world: ObstacleWorld, cells: NDArray[np.bool_]) -> list[dict[str, Any]]:
    shapes = [part for outline in outlines(cells, 0.0, 0.0, world.cell_m) for part in _without_holes(outline)]
    return [_polygon(frame, np.asarray(polygon.exterior.coords)) for polygon in shapes]


def _without_holes(outline: Polygon) -> list[Polygon]:
    """Cut a polygon until no part has a hole: a mission's polygons have none."""
    if not outline.interiors:
        return [outline]
    west, south, east, north = outline.bounds
    middle = round(outline.interiors[0].centroid.x)
    halves = [
        outline.intersection(box(*sides)) for sides in ((west, south, middle, north), (middle, south, east, north))
    ]
    parts = [part for half in halves for part in getattr(half, "geoms", [half]) if isinstance(part, Polygon)]
    return [piece for part in parts for piece in _without_holes(part)]


def _polygon(frame: LocalFrame, ring_m: NDArray[np.float64]) -> dict[str, Any]:
    return {"type": "Polygon", "coordinates": [_positions(frame, ring_m)]}


def _positions(frame: LocalFrame, en_m: NDArray[np.float64]) -> list[list[float]]:
    lat, lon = frame.to_geographic(en_m[:, 0], en_m[:, 1])
    return [[round(float(x), 8), round(float(y), 8)] for x, y in zip(lon, lat, strict=True)]
