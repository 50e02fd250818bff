"""What all parts of a mission's description share."""

from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, FailFast, Field, field_validator
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


def _is_no_longer_than_taken(ring: object) -> object:
    if isinstance(ring, list | tuple) and len(ring) > MAX_POSITIONS:
        raise ValueError(f"the ring has {len(ring)} positions, at most {MAX_POSITIONS} are taken: simplify it")
    return ring


# Looked at before its positions are, and no further than to the first that is wrong.
Ring = Annotated[list[tuple[Longitude, Latitude]], FailFast(), BeforeValidator(_is_no_longer_than_taken)]


def cell_count(size_m: FloatArray, cell_m: float) -> float:
    """Return how many cells cover a rectangle (east, north); infinite for cells that are too small to be counted."""
    with np.errstate(over="ignore"):
        return float(np.prod(np.ceil(size_m / cell_m)))


class PolygonGeometry(Model):
    """A GeoJSON polygon: one closed outer ring of [longitude, latitude] positions, no holes."""

    type: Literal["Polygon"] = "Polygon"
    coordinates: list[Ring] = Field(
        min_length=1,
        max_length=1,
        description="One ring of [longitude, latitude]; the last position repeats the first",
        examples=[[[[-8.705, 41.185], [-8.7038, 41.185], [-8.7038, 41.1859], [-8.705, 41.1859], [-8.705, 41.185]]]],
    )

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
