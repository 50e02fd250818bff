"""A mission's map along a line that somebody drew."""

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from app.arrays import FloatArray
from app.mapping.coordinates.georeference import MAX_EXTENT_M
from app.mapping.layers import Layer
from app.mapping.profile import Profile, ProfileLine, beside, layer_along, line_through, profile_along
from app.missions.errors import InvalidRequestError
from app.missions.live.mission import LiveMission
from app.missions.maps.snapshot import MapSnapshot
from app.missions.views.maps.profile import ProfilePointView, ProfileView
from app.storage.bulk import read_in_pieces
from app.storage.queries import soundings as sounding_queries

MOST_POINTS = 4000
MOST_SOUNDINGS = 2000
POINTS_A_CELL = 2
"""Where no spacing is asked for."""

CELLS_BESIDE = 1.0
"""How far from the line soundings are shown where that is not asked for."""


@dataclass(frozen=True)
class ProfileRequest:
    """A line that is asked for.

    Attributes
    ----------
    line
        Longitude and latitude of its corners, two or more.
    spacing_m
        Between points; None: half a cell, or more where the line is long.
    within_m
        How far from the line soundings are taken; None: one cell.
    """

    line: Sequence[tuple[float, float]]
    spacing_m: float | None = None
    within_m: float | None = None


async def profile_of(
    live: LiveMission,
    snapshot: MapSnapshot,
    asked: ProfileRequest,
    layers: Callable[[], Sequence[Layer]] = tuple,
) -> ProfileView:
    """Return a map along a line, with the soundings beside it.

    Raises
    ------
    InvalidRequestError
        When the line is no line, too far away, does not cross the map, or would have too many points.
    """
    line = _line(snapshot, asked)
    cell_m = snapshot.built.map.grid.cell_m
    within_m = CELLS_BESIDE * cell_m if asked.within_m is None else asked.within_m
    near = await _soundings_near(live, line, within_m)

    def view() -> ProfileView:
        profile = profile_along(snapshot.built.map, line)
        if not np.isfinite(profile.depth_m).any():
            raise InvalidRequestError("line", "the line does not cross what is mapped", "Draw it over the map's cells")
        return _view(snapshot, line, profile, layers(), within_m, near)

    return await asyncio.to_thread(view)


def _line(snapshot: MapSnapshot, asked: ProfileRequest) -> ProfileLine:
    lon_deg, lat_deg = np.array(asked.line, dtype=float).T
    try:
        corners_m = np.column_stack(snapshot.facts.frame.to_local(lat_deg, lon_deg))
    except ValueError:
        raise InvalidRequestError(
            "line",
            f"the line has a corner more than {MAX_EXTENT_M / 1000:.0f} km from the mission",
            "Give each corner as longitude,latitude",
        ) from None
    pieces_m = np.hypot(*np.diff(corners_m, axis=0).T)
    length_m = float(pieces_m.sum())
    if length_m == 0.0:
        raise InvalidRequestError("line", "all corners of the line are the same place", "Give two different ones")
    usual_m = max(snapshot.built.map.grid.cell_m / POINTS_A_CELL, length_m / (MOST_POINTS - 1))
    spacing_m = usual_m if asked.spacing_m is None else asked.spacing_m
    if length_m / spacing_m > MOST_POINTS - 1 + 1e-6:
        raise InvalidRequestError(
            "spacing_m",
            f"a line of {length_m:.0f} m has more than {MOST_POINTS} points {spacing_m:g} m apart",
            f"Give a spacing of at least {length_m / (MOST_POINTS - 1):.3g} m, or none",
        )
    return line_through(corners_m, spacing_m)


async def _soundings_near(live: LiveMission, line: ProfileLine, within_m: float) -> tuple[FloatArray, int]:
    """Return soundings as rows (along, across, depth, deviation), and how many there are altogether."""
    await live.journal.flush()
    low, high = line.corners_m.min(axis=0) - within_m, line.corners_m.max(axis=0) + within_m
    query = sounding_queries.accepted_in(live.id, (low[0], low[1], high[0], high[1]))
    found: list[FloatArray] = []

    def take(rows: Sequence[Any]) -> None:
        # In the thread that reads: what is far from the line is forgotten piece by piece.
        piece = np.array([tuple(row) for row in rows], dtype=float)
        near = beside(line, piece[:, :2], within_m)
        found.append(np.column_stack([near.along_m, near.across_m, piece[near.rows, 2:4]]))

    await read_in_pieces(live.database, query, take)
    table = np.concatenate(found) if found else np.empty((0, 4))
    table = table[np.argsort(table[:, 0], kind="stable")]
    count = len(table)
    if count > MOST_SOUNDINGS:
        table = table[np.linspace(0, count - 1, MOST_SOUNDINGS).round().astype(int)]
    return table, count


def _view(
    snapshot: MapSnapshot,
    line: ProfileLine,
    profile: Profile,
    layers: Sequence[Layer],
    within_m: float,
    near: tuple[FloatArray, int],
) -> ProfileView:
    lat_deg, lon_deg = snapshot.facts.frame.to_geographic(*line.points_m.T)
    table, found = near
    grid = snapshot.built.map.grid
    return ProfileView(
        mission_id=snapshot.facts.mission_id,
        name=snapshot.facts.title,
        version=snapshot.version,
        step=snapshot.step,
        vertical_datum=snapshot.facts.vertical_datum.statement,
        length_m=line.length_m,
        spacing_m=float(line.along_m[1]),
        positions=[(lon, lat) for lon, lat in zip(lon_deg.round(7).tolist(), lat_deg.round(7).tolist(), strict=True)],
        along_m=line.along_m.round(3).tolist(),
        depth_m=_rounded(profile.depth_m),
        sd_m=_rounded(profile.sd_m),
        sounded=profile.sounded.tolist(),
        layers={layer.name: _rounded(layer_along(grid, layer.values, line)) for layer in layers},
        within_m=within_m,
        soundings=[
            ProfilePointView(along_m=along, across_m=across, depth_m=depth, sd_m=sd)
            for along, across, depth, sd in table.round(3).tolist()
        ],
        soundings_found=found,
    )


def _rounded(values: FloatArray) -> list[float | None]:
    return [value if np.isfinite(value) else None for value in np.asarray(values, float).round(4).tolist()]
