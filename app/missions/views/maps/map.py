"""What is answered about a map, its quality and its products."""

from enum import StrEnum

from pydantic import Field

from app.mapping.layers import Fit, Palette
from app.mapping.s44 import Order
from app.missions.spec.base import Latitude, Longitude
from app.missions.views.base import View


class MapView(View):
    """The map as JSON: row 0 is south, column 0 is west, null outside the area or where unknown."""

    mission_id: str
    version: int = Field(description="Grows with every new map; 0: no sounding yet")
    step: int
    west_m: float
    south_m: float
    cell_m: float
    rows: int
    cols: int
    corners: list[tuple[Longitude, Latitude]] = Field(
        description="[longitude, latitude] of the grid's corners: north-west, north-east, south-east, south-west"
    )
    vertical_datum: str = Field(description="What depths are counted from")
    min_depth_m: float | None
    max_depth_m: float | None
    model: str
    depth_m: list[list[float | None]]
    sd_m: list[list[float | None]]
    count: list[list[int]]
    sounded: list[list[bool]]
    layers: dict[str, list[list[float | None]]] = Field(
        default_factory=dict, description="Further layers that were asked for, by name"
    )


class LayerView(View):
    """A layer of the map: what its values say and how it is shown."""

    name: str
    title: str
    meaning: str = Field(description="What its values say, compared with Order 1a where with one of IHO S-44")
    unit: str = Field(description="By its name in UDUNITS; 1: a number")
    palette: Palette
    fit: Fit
    range: tuple[float, float] | None = Field(
        description="Values of the first and the last colour; null: they follow the data as `fit` says"
    )
    classes: tuple[str, ...] = Field(
        description="Words for the values 0, 1, 2 and so on, where there are no others; else empty"
    )
    scale: int | None = Field(description="Tiles hold whole numbers, the value times this; null: no tile has it")
    in_every_tile: bool = Field(description="Tiles have it without being asked for it by `layer`")
    in_json: bool = Field(description="The map's JSON has it when asked for it by `layer`")
    in_pictures: bool = Field(description="It can be seen as `map.overlay.png`")
    in_files: bool = Field(description="Files with every layer have it")
    of_depths: bool = Field(description="Its values are as sure as the depths: guessed where those are")
    absence: str = Field(description="Why a mission may have no such layer; empty: each has it")
    remedy: str


class ConformityView(View):
    """How the estimates of TVU and THU stand beside one order of IHO S-44; no order is claimed by it."""

    order: Order
    cells_pct: float = Field(description="Share of the cells whose TVU estimate stays within the order's largest")
    sounded_pct: float | None = Field(description="The same among the sounded cells; null: none is")
    horizontal_pct: float | None = Field(
        description="Share of the cells whose THU estimate stays within the order's largest, of those that have one; "
        "null: none has"
    )
    statement: str = Field(examples=["TVU estimate meets Order 1a in 83.2 % of cells"])


class DifferenceView(View):
    """Map minus reference grid over the cells that both know."""

    rmse_m: float
    l2_norm: float = Field(description="Euclidean norm of all differences; grows with the number of cells")
    bias_m: float
    p95_m: float = Field(description="95th percentile of the absolute difference")
    max_m: float
    cells: int


class QualityView(View):
    """How good the map is, as far as it can be told."""

    version: int = Field(description="Of the map")
    vertical_datum: str
    common_sd_m: float = Field(description="Standard deviation of what all soundings share, counted in every TVU")
    tvu: list[ConformityView]
    difference: DifferenceView | None = Field(description="To the reference grid; null: there is none that it meets")


class FileOption(StrEnum):
    """What may be asked of a file, by the name of REST's parameter."""

    ORDER = "order"
    INTERVAL = "interval_m"
    CRS = "crs"
    VEHICLE = "vehicle"
    LANGUAGE = "lang"


class ProductView(View):
    """A file that can be downloaded."""

    name: str = Field(description="Its name for bathyfleet export", examples=["tif"])
    title: str
    media_type: str
    href: str = Field(description="Path on this service")
    needs_map: bool = Field(description="Whether a first map is needed")
    options: list[FileOption] = Field(description="Which of the parameters of its path make a difference to it")
