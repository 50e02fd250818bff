"""What all parts of a mission's description share."""

from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, FailFast, Field, field_validator, model_validator
from shapely.geometry import Polygon
from shapely.validation import explain_validity

from app.arrays import FloatArray

NOT_BLANK = r"\S"
SHOWN_PATTERN = r"^[^\r\n]*\S[^\r\n]*$"
"""Something to be seen, in one line: names are subjects of messages and headings of reports."""

Latitude = Annotated[float, Field(ge=-90, le=90, description="Latitude, WGS84 degrees")]
Longitude = Annotated[float, Field(ge=-180, le=180, description="Longitude, WGS84 degrees")]
Name = Annotated[str, Field(min_length=1, max_length=64, pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$")]
ShownName = Annotated[
    str,
    Field(
        min_length=1,
        max_length=120,
        pattern=SHOWN_PATTERN,
        description="Shown to people; need not be unique",
    ),
]

MAX_POSITIONS = 1000


HALF_ROUND_DEG = 180.0
"""An area that is wider crosses the line at which longitudes begin anew."""


class FieldError(ValueError):
    """What is wrong with one field beside others.

    ``field`` is its path from the model that says so, for example ``recovery.point``.
    """

    def __init__(self, field: str, message: str) -> None:
        super().__init__(message)
        self.field = field


class Model(BaseModel):
    """Base: unknown fields are refused, so that a misspelt limit is an error and not a default."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


def plain_positions(places: object) -> object:
    """Return positions without the heights that some programs add."""
    if isinstance(places, list | tuple) and len(places) > MAX_POSITIONS:
        raise ValueError(f"there are {len(places)} positions, at most {MAX_POSITIONS} are taken: simplify it")
    if isinstance(places, list | tuple):
        return [place[:2] if isinstance(place, list | tuple) and len(place) == 3 else place for place in places]
    return places


def _plain_ring(ring: object) -> object:
    if isinstance(ring, list | tuple) and len(ring) > MAX_POSITIONS:
        raise ValueError(f"the ring has {len(ring)} positions, at most {MAX_POSITIONS} are taken: simplify it")
    return plain_positions(ring)


# Looked at before its positions are, and no further than to the first that is wrong.
Ring = Annotated[list[tuple[Longitude, Latitude]], FailFast(), BeforeValidator(_plain_ring)]


def cell_count(size_m: FloatArray, cell_m: float) -> float:
    """Return how many cells cover a rectangle (east, north); infinite for cells that are too small to be counted."""
    with np.errstate(over="ignore"):
        return float(np.prod(np.ceil(size_m / cell_m)))


class PolygonGeometry(Model):
    """A GeoJSON polygon: one closed outer ring of [longitude, latitude] positions, no holes.

    A Feature of one and a MultiPolygon of one part are taken as that polygon; heights are left out.
    """

    type: Literal["Polygon"] = "Polygon"
    coordinates: list[Ring] = Field(
        min_length=1,
        max_length=1,
        description="One ring of [longitude, latitude]; the last position repeats the first",
        examples=[[[[-8.705, 41.185], [-8.7038, 41.185], [-8.7038, 41.1859], [-8.705, 41.1859], [-8.705, 41.185]]]],
    )

    @model_validator(mode="before")
    @classmethod
    def _as_programs_write_it(cls, data: object) -> object:
        """Take the polygon out of a Feature, and out of a MultiPolygon that is one polygon."""
        if isinstance(data, dict) and data.get("type") == "Feature":
            data = data.get("geometry")
            if data is None:
                raise FieldError("geometry", "the Feature has no geometry: give one with a Polygon")
        if isinstance(data, dict) and data.get("type") == "MultiPolygon":
            parts = data.get("coordinates")
            if not isinstance(parts, list | tuple) or len(parts) != 1:
                count = len(parts) if isinstance(parts, list | tuple) else "no"
                raise FieldError("coordinates", f"the MultiPolygon has {count} parts: give one polygon")
            data = {**data, "type": "Polygon", "coordinates": parts[0]}
        return data

    @field_validator("coordinates")
    @classmethod
    def _is_a_simple_ring(cls, rings: list[list[tuple[float, float]]]) -> list[list[tuple[float, float]]]:
        ring = rings[0]
        if len(ring) < 4 or ring[0] != ring[-1]:
            raise ValueError(
                "the ring needs at least 4 positions and must end where it began: repeat the first position as the last"
            )
        polygon = Polygon(ring)
        if not polygon.is_valid:
            raise ValueError(f"the ring crosses or touches itself ({explain_validity(polygon)}): draw a simple polygon")
        return rings

    @property
    def ring(self) -> list[tuple[float, float]]:
        """The outer ring without its closing position, as (longitude, latitude)."""
        return self.coordinates[0][:-1]
