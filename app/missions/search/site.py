"""The site of a search on its grid, and the same as simulated vehicles meet it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt
from shapely.geometry import Polygon, box
from shapely.geometry.base import BaseGeometry

from app.arrays import BoolArray, FloatArray
from app.estimation.occupancy import OccupancyGrid, Scanner
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.coordinates.outlines import touched
from app.missions.safety.room import widened
from app.missions.spec.mission import MissionSpec
from app.missions.spec.search import SearchSpec
from simulator.obstacles.obstacles import ObstacleWorld


@dataclass(frozen=True)
class Site:
    """A search's places in the mission's frame, (2,) east and north, and its grid before the first scan."""

    grid: OccupancyGrid
    scanner: Scanner
    goal_m: FloatArray
    entry_m: FloatArray
    transmitter_m: FloatArray

    def berths(self, count: int, apart_m: float, clear_m: float, solid: BoolArray) -> FloatArray:
        """Return ``count`` places (count, 2) by the entry for simulated vehicles to begin at.

        Clear of what is known to stand there and of what they meet, ``solid`` (rows, cols), and apart from each other,
        as close as that goes; where there is no room, at the entry.
        """
        grid = self.grid
        # From centre to centre, so one half of the obstacle's cell less than to its edge.
        free = distance_transform_edt(~(grid.blueprint | solid)) * grid.cell_m >= clear_m + 0.75 * grid.cell_m
        places = grid.centres_m[free]
        away = np.hypot(*(places - self.entry_m).T)
        chosen: list[FloatArray] = []
        for place in places[np.argsort(away, kind="stable")]:
            if len(chosen) == count:
                break
            if all(np.hypot(*(place - other)) >= apart_m for other in chosen):
                chosen.append(place)
        return np.array(chosen + [self.entry_m] * (count - len(chosen)))


def site_of(spec: MissionSpec, search: SearchSpec) -> Site:
    """Return the site; its grid begins at the frame's origin and covers the area.

    A cell that a known obstacle, a keep-out zone with its margin, or the outside of the area touches is an obstacle.
    """
    frame = spec.frame()
    area = spec.local_area()
    rows, cols = _shape(area, spec.cell_m)
    zones = [spec.to_local(zone) for zone in spec.keep_out]
    margin_m = spec.limits.keep_out_margin_m
    known: list[BaseGeometry] = [Polygon(spec.to_local(obstacle)) for obstacle in search.obstacles]
    known += [Polygon(widened(zone, margin_m)) if margin_m > 0 else Polygon(zone) for zone in zones]
    outside = box(0.0, 0.0, cols * spec.cell_m, rows * spec.cell_m).difference(Polygon(area))
    blueprint = _touched(known, rows, cols, spec.cell_m)
    blueprint |= touched([_less(outside, spec.cell_m)], rows, cols, spec.cell_m)
    entry = _place(frame, search.entry)
    return Site(
        grid=OccupancyGrid.from_blueprint(blueprint, spec.cell_m),
        scanner=Scanner(search.scanner.reach_m, search.scanner.resolution_deg),
        goal_m=_place(frame, search.goal),
        entry_m=entry,
        transmitter_m=entry if search.transmitter is None else _place(frame, search.transmitter),
    )


def simulated_world(spec: MissionSpec, search: SearchSpec) -> ObstacleWorld:
    """Return what simulated vehicles meet: known obstacles, and those that nobody told the planners of."""
    rows, cols = _shape(spec.local_area(), spec.cell_m)
    known = _touched([Polygon(spec.to_local(o)) for o in search.obstacles], rows, cols, spec.cell_m)
    hidden = _touched([Polygon(spec.to_local(o)) for o in search.simulated_obstacles], rows, cols, spec.cell_m)
    site = site_of(spec, search)
    return ObstacleWorld(spec.name, known | hidden, known, spec.cell_m, site.entry_m, site.goal_m, site.transmitter_m)


def _shape(area: FloatArray, cell_m: float) -> tuple[int, int]:
    width, height = area.max(axis=0)
    return int(np.ceil(height / cell_m - 0.01)), int(np.ceil(width / cell_m - 0.01))


def _place(frame: LocalFrame, lon_lat: tuple[float, float]) -> FloatArray:
    east, north = frame.to_local(np.array(lon_lat[1]), np.array(lon_lat[0]))
    return np.array([float(east), float(north)])


def _touched(shapes: Sequence[BaseGeometry], rows: int, cols: int, cell_m: float) -> BoolArray:
    less = [_less(shape, cell_m) for shape in shapes]
    # A boom or a fence thinner than that is no less in the way.
    return touched(
        [whole if some.is_empty else some for whole, some in zip(shapes, less, strict=True)], rows, cols, cell_m
    )


def _less(shape: BaseGeometry, cell_m: float) -> BaseGeometry:
    """Return a shape without its very edge.

    Coordinates come from degrees and back: a quay that ends at a cell's border must not take the next cell, too.
    """
    return shape.buffer(-0.01 * cell_m, join_style="mitre")
