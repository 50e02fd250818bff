"""Lines that a mission is to fly, as a line plan gives them."""

from typing import Annotated

from pydantic import BeforeValidator, FailFast, Field, field_validator

from app.missions.spec.base import SHOWN_PATTERN, Latitude, Longitude, Model, plain_positions

MOST_LINES = 2000
MOST_CORNERS = 20_000
"""Of all lines of a mission."""
MOST_LINES_KM = 5000.0
"""Of all lines of a mission."""

LineName = Annotated[str, Field(min_length=1, max_length=64, pattern=SHOWN_PATTERN)]
Corners = Annotated[list[tuple[Longitude, Latitude]], FailFast(), BeforeValidator(plain_positions)]


class SurveyLine(Model):
    """A line, straight or with bends as the middle of a channel has them."""

    name: LineName = Field(description="What the plan calls it, as its number; no other line is called so")
    coordinates: Corners = Field(
        min_length=2,
        description="Two or more [longitude, latitude], flown from one to the next; heights are left out",
        examples=[[[-8.7049, 41.1851], [-8.7039, 41.1851]]],
    )
    keep_direction: bool = Field(
        default=False, description="Fly it as it is drawn; false: in the direction that takes less way"
    )

    @field_validator("name")
    @classmethod
    def _is_printable(cls, name: str) -> str:
        if not name.isprintable():
            raise ValueError("it has characters that cannot be shown: leave them out")
        return name.strip()

    @field_validator("coordinates")
    @classmethod
    def _has_a_length(cls, corners: list[tuple[float, float]]) -> list[tuple[float, float]]:
        if len(set(corners)) < 2:
            raise ValueError("all its positions are the same: give two that differ")
        return corners
