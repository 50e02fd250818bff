"""The water that soundings go through: its level, and how fast sound is in it."""

from itertools import pairwise
from typing import Annotated

from pydantic import FailFast, Field, field_validator

from app.mapping.water.vertical import LOWEST_ASTRONOMICAL_TIDE, check_depth_datum
from app.missions.spec.base import Model

ProfileDepth = Annotated[float, Field(ge=0, le=12_000)]
ProfileSpeed = Annotated[float, Field(ge=1300, le=1700)]

NO_TIDE = "none applied"


class Tide(Model):
    """Water level correction: depth below the datum = sounded depth - level + datum_offset_m."""

    level_m: float = Field(
        default=0.0,
        ge=-20,
        le=20,
        description="Water level above the zero of the tide gauge or table (chart datum), metres",
    )
    source: str = Field(
        default=NO_TIDE,
        max_length=200,
        description="Where the level comes from, kept with the product",
    )
    sd_m: float = Field(
        default=0.0,
        ge=0,
        le=10,
        description="Standard deviation of the level; it counts in every cell's TVU estimate",
    )
    datum_epsg: int = Field(
        default=LOWEST_ASTRONOMICAL_TIDE,
        ge=1024,
        le=999_999,
        description="EPSG code of the depth datum that products state once a tide is applied, for example 5861 "
        "(LAT depth) or 5715 (MSL depth)",
    )
    datum_offset_m: float = Field(
        default=0.0,
        ge=-100,
        le=100,
        description="How far that datum lies above the zero that levels count from; added to every depth",
    )

    @property
    def is_unnamed(self) -> bool:
        """Whether nobody said where the level comes from."""
        return self.source == NO_TIDE

    @property
    def is_applied(self) -> bool:
        """Whether a level was stated, be it zero."""
        return self.level_m != 0.0 or self.datum_offset_m != 0.0 or not self.is_unnamed

    @field_validator("datum_epsg")
    @classmethod
    def _is_a_depth_datum(cls, epsg: int) -> int:
        check_depth_datum(epsg)
        return epsg


class SoundSpeed(Model):
    """Sound speed correction: every beam is followed through the profile for the time that its sonar measured."""

    assumed_mps: float = Field(default=1500.0, ge=1300, le=1700, description="Speed that is set in the sonars, m/s")
    profile: Annotated[list[tuple[ProfileDepth, ProfileSpeed]], FailFast()] = Field(
        min_length=1,
        max_length=2000,
        description="Measured speeds as [depth in m, speed in m/s], from top to bottom; one pair: the same everywhere",
        examples=[[[0.0, 1512.3], [5.0, 1509.8], [20.0, 1506.1]]],
    )
    source: str = Field(default="", max_length=200, description="Where the profile comes from, kept with the product")

    @field_validator("profile")
    @classmethod
    def _depths_ascend(cls, profile: list[tuple[float, float]]) -> list[tuple[float, float]]:
        for index, (above, below) in enumerate(pairwise(depth for depth, _ in profile)):
            if below <= above:
                raise ValueError(f"entry {index + 1} is at {below:g} m, not below the {above:g} m of the one before it")
        return profile
