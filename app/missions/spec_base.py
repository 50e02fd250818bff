"""What all parts of a mission's description share."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator
from shapely.geometry import Polygon
from shapely.validation import explain_validity

Latitude = Annotated[float, Field(ge=-90, le=90, description="Latitude, WGS84 degrees")]
Longitude = Annotated[float, Field(ge=-180, le=180, description="Longitude, WGS84 degrees")]
Name = Annotated[str, Field(min_length=1, max_length=64, pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$")]


class Model(BaseModel):
    """Base: unknown fields are refused, so that a misspelt limit is an error and not a default."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class PolygonGeometry(Model):
    """A GeoJSON polygon: one closed outer ring of [longitude, latitude] positions, no holes."""

    type: Literal["Polygon"] = "Polygon"
    coordinates: list[list[tuple[Longitude, Latitude]]] = Field(
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
        if len(ring) > 1000:
            raise ValueError(f"the ring has {len(ring)} positions, at most 1000 are taken: simplify it")
        polygon = Polygon(ring)
        if not polygon.is_valid:
            raise ValueError(f"the ring crosses or touches itself ({explain_validity(polygon)}): draw a simple polygon")
        return rings

    @property
    def ring(self) -> list[tuple[float, float]]:
        """The outer ring without its closing position, as (longitude, latitude)."""
        return self.coordinates[0][:-1]
