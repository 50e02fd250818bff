"""How soundings and grids from elsewhere are brought in, and what is answered about them."""

from datetime import datetime
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from app.mapping.s44 import Order
from app.missions.views.base import View


class ImportOptions(BaseModel):
    """What a file does not say by itself."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    filename: str = Field(
        min_length=1,
        max_length=200,
        pattern=r"^[^/\\\x00-\x1f\x7f]+$",
        description="Its name; the ending says what it is: .xyz, .csv, .txt (also with .gz), .asc, .tif, .nc or .bag",
        examples=["harbour_2019.xyz"],
    )
    source: str = Field(default="", max_length=500, description="Where it comes from, kept with the mission")
    crs: str | None = Field(
        default=None,
        min_length=1,
        max_length=2000,
        description="What positions are in where the file does not say: EPSG:4326, EPSG:32629, WKT, or local for the "
        "mission's own frame",
    )
    positive: Literal["down", "up"] | None = Field(
        default=None, description="Which way values grow: down for depths, up for heights; default: what the file says"
    )
    sd_m: float | None = Field(
        default=None, gt=0, le=1000, description="Standard deviation of the depths that state none, metres"
    )
    order: Order | None = Field(
        default=None, description="In place of sd_m: the S-44 order surveyed to; its largest TVU is assumed"
    )
    datum_offset_m: float = Field(
        default=0.0, ge=-200, le=200, description="Added to every depth to bring it to the mission's datum"
    )


class ImportView(View):
    """Soundings from elsewhere that a mission began with. They are not among its own."""

    id: str
    filename: str
    source: str
    site: str | None = Field(default=None, description="The site whose depths these are; null: they came as a file")
    sha256: str = Field(description="Of the file")
    created_at: datetime
    found: int = Field(description="Depths in the file")
    taken: int = Field(description="Those in or near the area, as they count in the map")
    min_depth_m: float
    max_depth_m: float
    median_sd_m: float
    notes: list[str] = Field(description="What was assumed or done, in words")
    replayed: bool = Field(default=False, description="True: the same file was imported before, nothing changed")


class ReferenceView(View):
    """The grid that a mission's map is compared with."""

    filename: str
    source: str
    created_at: datetime
    cells: int = Field(description="Cells of the map's grid that it knows")
    notes: list[str]
