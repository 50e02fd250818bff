"""What is answered about a search."""

import base64
from datetime import datetime
from typing import Literal

from pydantic import Field

from app.mapping.georeference import LocalFrame
from app.missions.members import Team
from app.missions.search.state import Search
from app.missions.spec_base import Latitude, Longitude
from app.missions.view_base import View


class SearchProgress(View):
    """How a search stands."""

    version: int = Field(description="Scans that the site's grid was made of")
    explored_pct: float = Field(description="Share of the site's open cells that were looked at and are free")
    goal_pct: float = Field(description="The same within the goal area")
    found_cells: int = Field(description="Cells with an obstacle that is on no plan")
    left_s: float = Field(description="Vehicle time until everybody has to be back; negative: too late")
    began_at: datetime | None = Field(description="When the time began to run: at the first step")
    back: list[str] = Field(description="Vehicles at the entry")
    out_of_contact: list[str] = Field(description="Vehicles farther from the transmitter than it reaches")


class SearchMessage(View):
    """How a search stands: its grid can be fetched anew."""

    type: Literal["search"] = "search"
    search: SearchProgress


class SearchGridView(View):
    """A search's site: what is known of each cell."""

    mission_id: str
    version: int = Field(description="Scans that it was made of")
    west_m: float
    south_m: float
    cell_m: float
    rows: int
    cols: int
    corners: list[tuple[Longitude, Latitude]] = Field(
        description="[longitude, latitude] of the grid's corners: north-west, north-east, south-east, south-west"
    )
    cells: str = Field(
        description="One byte per cell, rows from south to north, each from west to east, in base64. 1: explored and "
        "free, 2: not explored, 3: obstacle known beforehand, 4: obstacle found"
    )


def progress_of(search: Search | None, team: Team, frame: LocalFrame) -> SearchProgress | None:
    """Return how a search stands; None when the mission is none."""
    if search is None:
        return None
    places = {member.name: member.place_m(frame) for member in team if member.report is not None}
    radius_m = search.home_radius_m(len(list(team)))
    figures = search.figures
    return SearchProgress(
        version=search.version,
        explored_pct=100.0 * figures.explored_part,
        goal_pct=100.0 * figures.explored_goal_part,
        found_cells=figures.found_cells,
        left_s=search.left_s(),
        began_at=search.began_at,
        back=[name for name, place in places.items() if search.way_to_entry_m(place) <= radius_m],
        out_of_contact=[name for name, place in places.items() if not search.contact(place)],
    )


def grid_view(search: Search, mission_id: str, frame: LocalFrame) -> SearchGridView:
    """Return the site as JSON shows it."""
    grid = search.grid
    rows, cols = grid.blueprint.shape
    west, south = grid.west_m, grid.south_m
    east, north = west + cols * grid.cell_m, south + rows * grid.cell_m
    corners = [frame.to_geographic(*place) for place in ((west, north), (east, north), (east, south), (west, south))]
    return SearchGridView(
        mission_id=mission_id,
        version=search.version,
        west_m=west,
        south_m=south,
        cell_m=grid.cell_m,
        rows=rows,
        cols=cols,
        corners=[(float(lon), float(lat)) for lat, lon in corners],
        cells=base64.b64encode(grid.states.tobytes()).decode(),
    )
