"""How a search stands, as it is told to whoever watches."""

import base64
from datetime import datetime

from app.mapping.coordinates.georeference import LocalFrame
from app.missions.search.state import Search
from app.missions.team import Team
from app.missions.views.search import SearchGridView, SearchProgress


def progress_of(
    search: Search | None, team: Team, frame: LocalFrame, ended_at: datetime | None = None
) -> SearchProgress | None:
    """Return how a search stands, or how it stood when it ended; None when the mission is none."""
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
        left_s=search.left_s(ended_at),
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
