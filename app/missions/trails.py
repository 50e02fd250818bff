"""Where a mission's vehicles have been, as it is worth drawing: read once from the database, then only what is new."""

import asyncio

import numpy as np
import shapely
from numpy.typing import NDArray

from app.missions.journal import METRES_PER_DEGREE
from app.storage import missions as mission_queries
from app.storage.database import Database

TOLERANCE_M = 0.2
"""What is left out lies so near to what is drawn; vehicles know where they are less well than that."""

FEWEST_TO_THIN = 3
DIGITS = 7
"""Decimals of a degree: about a centimetre."""

Trail = list[tuple[float, float, float]]
FloatArray = NDArray[np.float64]


class Trails:
    """One mission's trails, kept in memory and brought up to date when someone asks for them."""

    def __init__(self, database: Database, mission_id: str) -> None:
        self._database = database
        self._mission_id = mission_id
        self._reading = asyncio.Lock()
        self._newest_id = 0
        self._points: dict[str, FloatArray] = {}
        self._trails: dict[str, Trail] = {}

    async def newest(self) -> dict[str, Trail]:
        """Return each vehicle's trail as (longitude, latitude, depth), in the order of the vehicle's clock."""
        async with self._reading:
            async with self._database.reading() as session:
                rows = await mission_queries.positions_after(session, self._mission_id, self._newest_id)
            if rows:
                self._newest_id = rows[-1].id
                found: dict[str, list[tuple[float, float, float, float]]] = {}
                for row in rows:
                    found.setdefault(row.vehicle, []).append((row.time_s, row.lon_deg, row.lat_deg, row.depth_m))
                await asyncio.to_thread(self._add, found)
            return dict(self._trails)

    def _add(self, found: dict[str, list[tuple[float, float, float, float]]]) -> None:
        for vehicle, more in found.items():
            points = np.array(more)
            known = self._points.get(vehicle)
            if known is not None:
                points = np.concatenate([known, points])
            # A log that is read in later brings what was before.
            points = points[np.argsort(points[:, 0], kind="stable")]
            self._points[vehicle] = points
            kept = points[worth_drawing(points[:, 1:]), 1:]
            self._trails[vehicle] = [(round(x, DIGITS), round(y, DIGITS), round(z, 2)) for x, y, z in kept.tolist()]


def worth_drawing(places: FloatArray, tolerance_m: float = TOLERANCE_M) -> NDArray[np.intp]:
    """Return which places of a way, shape (n, 3): longitude, latitude, depth, show its course and its depths."""
    count = len(places)
    if count < FEWEST_TO_THIN:
        return np.arange(count)
    metres = (places[:, :2] - places[0, :2]) * METRES_PER_DEGREE
    metres[:, 0] *= np.cos(np.radians(places[0, 1]))
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(metres, axis=0).T))])
    # Each brings the other points that lie up to its tolerance beside its line, and so moves it: half for each.
    course = _kept(metres, tolerance_m / 2)
    depths = _kept(np.column_stack([along, places[:, 2]]), tolerance_m / 2)
    return np.union1d(course, depths)


def _kept(line: FloatArray, tolerance_m: float) -> NDArray[np.intp]:
    # The third coordinate goes through unchanged: it says which point this was.
    numbered = shapely.linestrings(np.column_stack([line, np.arange(len(line), dtype=float)]))
    left = shapely.simplify(numbered, tolerance_m, preserve_topology=False)
    return shapely.get_coordinates(left, include_z=True)[:, 2].astype(np.intp)
