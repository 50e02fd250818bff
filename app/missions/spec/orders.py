"""What an operator orders vehicles to do in the middle of a mission."""

from enum import StrEnum

from pydantic import ConfigDict, Field

from app.missions.spec.base import Latitude, Longitude, Model, Name, PolygonGeometry


class OrderKind(StrEnum):
    """What a vehicle that surveys can be ordered to do."""

    GO = "go"
    """Go to a place now."""
    SKIP_LINE = "skip-line"
    """Leave out the rest of the line."""
    REPEAT_LINE = "repeat-line"
    """Fly a line again."""
    DENSER = "denser"
    """Survey a part of the area on closer lines."""


class OrderState(StrEnum):
    """How far an order has come."""

    ACCEPTED = "accepted"
    """Written down, and carried out next."""
    FLYING = "flying"
    DONE = "done"
    REPLACED = "replaced"
    """Another order came."""
    CANCELLED = "cancelled"
    FAILED = "failed"
    """It could not be carried out; the reason tells why."""


OPEN = (OrderState.ACCEPTED, OrderState.FLYING)
"""States of orders that are not over."""


class GoOrder(Model):
    """Where a vehicle is to go now."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"position": [-8.7044, 41.1854]}]})

    position: tuple[Longitude, Latitude] = Field(
        description="[longitude, latitude], inside the area, in no keep-out zone"
    )


class RepeatOrder(Model):
    """Which line a vehicle is to fly again."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"near": [-8.7044, 41.1854]}]})

    near: tuple[Longitude, Latitude] | None = Field(
        default=None, description="The line that passes this place closest, [longitude, latitude]; null: the newest"
    )


class DenserOrder(Model):
    """A part of the area to be surveyed on closer lines."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "area": {
                        "type": "Polygon",
                        "coordinates": [
                            [[-8.7048, 41.1852], [-8.7044, 41.1852], [-8.7044, 41.1855], [-8.7048, 41.1852]]
                        ],
                    },
                    "line_spacing_m": 5.0,
                }
            ]
        }
    )

    area: PolygonGeometry
    line_spacing_m: float | None = Field(
        default=None, ge=0.5, le=1000.0, description="Distance between lines, metres; null: half of the survey's own"
    )
    vehicle: Name | None = Field(default=None, description="Who flies it; null: who has the shortest way")
