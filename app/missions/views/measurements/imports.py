"""How soundings and grids from elsewhere are brought in, and what is answered about them."""

from datetime import datetime
from enum import StrEnum
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from app.mapping.s44 import Order
from app.missions.spec.base import Name, PolygonGeometry
from app.missions.views.base import View
from app.missions.views.measurements.soundings import LogImportView


class ImportOptions(BaseModel):
    """What a file does not say by itself."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    filename: str = Field(
        min_length=1,
        max_length=200,
        pattern=r"^[^/\\\x00-\x1f\x7f]+$",
        description="Its name; the ending says what it is: .xyz, .csv, .txt (also with .gz), .asc, .tif, .nc, .bag, "
        ".h5 (S-102), .000 (ENC cell), .gsf or .kmall (multibeam sonars)",
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
    datum_offset_m: float | None = Field(
        default=None,
        ge=-200,
        le=200,
        description="Added to every depth to bring it to the mission's datum, 0 where that is the file's; has to be "
        "said where the file states another one",
    )


class LogOptions(BaseModel):
    """Which log is sent, and whose."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    filename: str = Field(
        min_length=1,
        max_length=200,
        pattern=r"^[^/\\\x00-\x1f\x7f]+$",
        description="Its name; .gsf and .kmall are files of a multibeam, everything else is read as a log of DUNE "
        "(Data.lsf, Data.lsf.gz)",
        examples=["Data.lsf.gz"],
    )
    vehicle: Name | None = Field(
        default=None,
        description="Name of the vehicle; default: the one that the log announces, which a multibeam's file does not",
    )


class LogState(StrEnum):
    """How far the import of a log is."""

    WAITING = "waiting"
    READING = "reading"
    DONE = "done"
    FAILED = "failed"
    TAKEN_BACK = "taken-back"
    """Nothing of it counts any more: somebody stopped reading it, or took it back."""


class ZoneOptions(BaseModel):
    """Where what a chart shows is asked for."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    west_deg: float = Field(ge=-180, le=180, description="Western end of the area")
    south_deg: float = Field(ge=-90, le=90, description="Southern end of the area")
    east_deg: float = Field(ge=-180, le=180, description="Eastern end of the area")
    north_deg: float = Field(ge=-90, le=90, description="Northern end of the area")
    margin_m: float = Field(
        default=10.0, ge=0, le=1000, description="How much all of it is enlarged, beside how well its place is known"
    )


class DrawingOptions(BaseModel):
    """What a file with lines and areas does not say by itself."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    filename: str = Field(
        min_length=1,
        max_length=200,
        pattern=r"^[^/\\\x00-\x1f\x7f]+$",
        description="Its name; the ending says what it is: .geojson, .json, .kml, .kmz, .gpx, .dxf, .zip (a "
        "shapefile), .csv or .txt (name and position in each row), or .lnw (Hypack)",
        examples=["lines_2026.lnw"],
    )
    crs: str | None = Field(
        default=None,
        min_length=1,
        max_length=2000,
        description="What positions are in where the file does not say: EPSG:32629, EPSG:4326 or WKT",
    )
    margin_m: float = Field(
        default=50.0, ge=1, le=2000, description="How far the area around the lines reaches beyond them"
    )


class DrawnLineView(View):
    """A line of a file; with name and coordinates it is one of a mission's `survey_lines`."""

    name: str = Field(description="What the file calls it, else its number; no other line is called so")
    coordinates: list[tuple[float, float]] = Field(description="[longitude, latitude], WGS 84")
    length_m: float


class DrawnAreaView(View):
    """An area of a file: a polygon, or a line that ends where it began."""

    name: str
    area: PolygonGeometry = Field(description="For a mission's `area` or its `keep_out`")
    area_m2: float


class DrawingView(View):
    """The lines and areas of a file, in its order."""

    lines: list[DrawnLineView]
    areas: list[DrawnAreaView]
    around: PolygonGeometry | None = Field(
        description="The smallest convex area around the lines with a margin, for a mission's `area` where no other is "
        "given; null: there are no lines, or they lie far apart"
    )
    notes: list[str] = Field(description="What was assumed or left out, in words")


class ProposedZoneView(View):
    """What a chart shows to keep out of. It is a proposal: nothing keeps out of it before a mission has it."""

    object: str = Field(description="The chart's class, as LNDARE, OBSTRN, RESARE or PONTON")
    reason: str = Field(description="What it is, in words")
    name: str = Field(description="What the chart calls it; it may be empty")
    depth_m: float | None = Field(description="Least depth over it, as charted; null: not known")
    position_m: float = Field(description="How far off it may be; its outline is enlarged by that")
    zone: PolygonGeometry = Field(description="For a mission's `keep_out`")


class ProposedZonesView(View):
    """What a chart shows to keep out of, the nearest to the middle of the area first."""

    zones: list[ProposedZoneView]
    notes: list[str] = Field(description="What was assumed or left out, in words")


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


class LogView(View):
    """A vehicle's own log: what came of it, or how far its import is."""

    id: str
    file: str = Field(description="Its name")
    vehicle: str | None = Field(description="Whose it is; null: the log has not said so yet")
    sha256: str = Field(description="Of the file")
    state: LogState
    created_at: datetime = Field(description="When it was sent; of one from the command line when it had been imported")
    actor: str = Field(description="Who sent it")
    read_bytes: int | None = Field(default=None, description="How far reading has come; null: it is long over")
    size_bytes: int | None = Field(default=None, description="Of the file; null: it is not known any more")
    result: LogImportView | None = Field(default=None, description="What came of it, when it is done")
    problem: str = Field(default="", description="Why it failed; what was stored before stays, and is not stored twice")
    remedy: str = Field(default="", description="What to do about it")
    taken_back_at: datetime | None = Field(default=None, description="When it was; null: it counts, or never did")
    taken_back_by: str = Field(default="", description="Who took it back")
    can_be_taken_back: bool = Field(
        description="Whether DELETE stops its reading or takes it back; false: it is taken back, nothing is stored of "
        "it, or an earlier version did not note what it brought"
    )
