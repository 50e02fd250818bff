"""What is answered about a map along a line."""

from pydantic import Field

from app.missions.spec.base import Latitude, Longitude
from app.missions.views.base import View


class ProfilePointView(View):
    """A sounding near the line."""

    along_m: float
    across_m: float = Field(description="To starboard of the line; negative: to port")
    depth_m: float
    sd_m: float


class ProfileView(View):
    """The map along a line, point by point; null outside the area or where unknown. All lists are equally long."""

    mission_id: str
    name: str
    version: int = Field(description="Of the map")
    step: int
    vertical_datum: str = Field(description="What depths are counted from")
    length_m: float
    spacing_m: float = Field(description="Between two points")
    positions: list[tuple[Longitude, Latitude]] = Field(description="[longitude, latitude] of the points")
    along_m: list[float]
    depth_m: list[float | None]
    sd_m: list[float | None] = Field(description="Standard deviation: the largest of the cells that a point is between")
    sounded: list[bool] = Field(description="Whether the point's cell was sounded; else its depth is interpolated")
    layers: dict[str, list[float | None]] = Field(
        default_factory=dict, description="Further layers that were asked for, by name"
    )
    within_m: float = Field(description="How far from the line its `soundings` lie at most")
    soundings: list[ProfilePointView] = Field(description="Accepted ones of single beams, in the order of the line")
    soundings_found: int = Field(description="So many there are; where more than are listed, evenly chosen ones are")
