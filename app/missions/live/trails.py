"""Where a mission's vehicles have been, as it is worth drawing: read once from the database, then only what is new."""

import asyncio
from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from app.arrays import FloatArray
from app.mapping.coordinates.distances import METRES_PER_DEGREE, leg_lengths_m
from app.missions.flown import is_flown
from app.storage.bulk import read_in_pieces
from app.storage.database import Database
from app.storage.queries import missions as mission_queries

TOLERANCE_M = 0.2
"""What is left out lies so near to what is drawn; vehicles know where they are less well than that."""

FEWEST_TO_THIN = 3
DIGITS = 7
"""Decimals of a degree: about a centimetre."""

Trail = list[tuple[float, float, float]]


class Trails:
    """One mission's trails, kept in memory and brought up to date when someone asks for them."""

    def __init__(self, database: Database, mission_id: str) -> None:
        self._database = database
        self._mission_id = mission_id
        self._reading = asyncio.Lock()
        self._newest_id = 0
        self._points: dict[str, FloatArray] = {}
        self._heard: dict[str, FloatArray] = {}
        self._imported: dict[str, FloatArray] = {}
        self._trails: dict[str, Trail] = {}

    async def newest(self) -> dict[str, Trail]:
        """Return each vehicle's trail as (longitude, latitude, depth), in the order of receipt.

        What a log brought later lies where the vehicle's clock puts it among what was heard.
        """
        async with self._reading:
            found: dict[str, list[FloatArray]] = {}
            newest = self._newest_id

            def take(rows: Sequence[Any]) -> None:
                nonlocal newest
                newest = rows[-1][0]
                names = np.array([row[1] for row in rows])
                places = np.array([tuple(row)[2:] for row in rows], dtype=float)
                for name in np.unique(names).tolist():
                    found.setdefault(name, []).append(places[names == name])

            query = mission_queries.positions_after(self._mission_id, self._newest_id)
            await read_in_pieces(self._database, query, take)
            if found:
                await asyncio.to_thread(self._add, found)
                self._newest_id = newest
            return dict(self._trails)

    async def read_again(self) -> None:
        """Forget what was read: points that were stored before do not count any more."""
        async with self._reading:
            self._newest_id = 0
            for known in (self._points, self._heard, self._imported, self._trails):
                known.clear()

    @property
    def length_m(self) -> float:
        """How far all vehicles went, as of the last time that someone asked for the trails."""
        return sum(_length_m(points) for points in self._points.values())

    def periods_s(self) -> dict[str, tuple[float, float]]:
        """Return the first and the last time of each trail, as of the last time that someone asked for them."""
        return {name: (float(at[:, 0].min()), float(at[:, 0].max())) for name, at in self._points.items()}

    def _add(self, found: dict[str, list[FloatArray]]) -> None:
        for vehicle, more in found.items():
            came = np.concatenate(more)
            by_log = came[:, 0] > 0
            for kept_in, part in ((self._heard, came[~by_log, 1:]), (self._imported, came[by_log, 1:])):
                kept_in[vehicle] = np.concatenate([kept_in.get(vehicle, np.zeros((0, 4))), part])
            points = in_order(self._heard[vehicle], self._imported[vehicle])
            self._points[vehicle] = points
            kept = points[worth_drawing(points[:, 1:]), 1:]
            self._trails[vehicle] = [(round(x, DIGITS), round(y, DIGITS), round(z, 2)) for x, y, z in kept.tolist()]


def in_order(heard: FloatArray, imported: FloatArray) -> FloatArray:
    """Return a way, shape (n, 4): time, longitude, latitude, depth, as the vehicle went it.

    Parameters
    ----------
    heard : (n, 4)
        Points in the order of receipt, whatever the vehicle's clock said: it may have begun anew.
    imported : (m, 4)
        Points of the vehicle's logs: each follows the newest of those heard that its clock puts before it.
    """
    if not len(imported):
        return heard
    imported = imported[np.argsort(imported[:, 0], kind="stable")]
    if not len(heard):
        return imported
    by_clock = np.argsort(heard[:, 0], kind="stable")
    before = np.searchsorted(heard[by_clock, 0], imported[:, 0], side="right")
    after = np.where(before > 0, by_clock[np.maximum(before - 1, 0)] + 1, 0)
    return np.insert(heard, after, imported, axis=0)


def _length_m(points: FloatArray) -> float:
    """Return how far was flown of a way, shape (n, 4): time, longitude, latitude, depth."""
    legs_m = leg_lengths_m(points[:, 2], points[:, 1])
    return float(legs_m[is_flown(legs_m, np.diff(points[:, 0]))].sum())


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
