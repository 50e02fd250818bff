"""What is answered about a search."""

from datetime import datetime
from typing import Literal

from pydantic import Field

from app.missions.spec.base import Latitude, Longitude
from app.missions.views.base import View


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
