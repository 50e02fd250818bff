"""The water that soundings go through: its level, and how fast sound is in it."""

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from itertools import pairwise
from typing import Annotated, Self

from pydantic import FailFast, Field, field_validator, model_validator

from app.mapping.water.casts import CastRule
from app.mapping.water.vertical import LOWEST_ASTRONOMICAL_TIDE, check_depth_datum
from app.missions.spec.base import FieldError, Latitude, Longitude, Model

ProfileDepth = Annotated[float, Field(ge=0, le=12_000)]
ProfileSpeed = Annotated[float, Field(ge=1300, le=1700)]

NO_TIDE = "none applied"

MOST_CASTS, MOST_DEPTHS = 200, 50_000
"""Of one mission: its description, which goes out whole, is to stay of a sensible length."""

FIRST_YEAR, LAST_YEAR = 1970, 2200

MOST_NAME = 100
NAMED = re.compile(r"[^/\x00-\x1f\x7f]*[^\W_][^/\x00-\x1f\x7f]*")
"""Names of casts are part of addresses: neither empty nor dots alone."""
UNNAMED = {"/", "\x7f", *map(chr, range(32))}
"""What a name must not hold."""


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


class CastDescription(Model):
    """One sound speed cast: the speeds that were measured on a way through the water, when and where."""

    profile: Annotated[list[tuple[ProfileDepth, ProfileSpeed]], FailFast()] = Field(
        min_length=1,
        max_length=2000,
        description="Measured speeds as [depth in m, speed in m/s], from top to bottom; one pair: the same everywhere",
        examples=[[[0.0, 1512.3], [5.0, 1509.8], [20.0, 1506.1]]],
    )
    source: str = Field(default="", max_length=200, description="Where the profile comes from, kept with the product")
    time: datetime | None = Field(
        default=None,
        description="When the cast was taken, UTC where no offset is given; null: not known, which only one that is "
        "alone may be",
    )
    position: tuple[Longitude, Latitude] | None = Field(
        default=None,
        description="Where, [longitude, latitude]; null: not known, which the rule nearest_in_distance_within_time "
        "does not allow for several casts",
    )

    @field_validator("profile")
    @classmethod
    def _depths_ascend(cls, profile: list[tuple[float, float]]) -> list[tuple[float, float]]:
        for index, (above, below) in enumerate(pairwise(depth for depth, _ in profile)):
            if below <= above:
                raise ValueError(f"entry {index + 1} is at {below:g} m, not below the {above:g} m of the one before it")
        return profile

    @field_validator("time")
    @classmethod
    def _is_utc(cls, time: datetime | None) -> datetime | None:
        if time is None:
            return None
        if not FIRST_YEAR <= time.year <= LAST_YEAR:
            raise ValueError(f"{time.isoformat()} is no time of a cast: give one from {FIRST_YEAR} to {LAST_YEAR}")
        return time.replace(tzinfo=UTC) if time.tzinfo is None else time.astimezone(UTC)


class Cast(CastDescription):
    """One of a mission's sound speed casts."""

    name: str = Field(
        default="",
        max_length=MOST_NAME,
        description="Its name among the mission's casts, without '/'; default: made of the source",
    )

    @model_validator(mode="after")
    def _has_a_name(self) -> Self:
        if not self.name:
            made = "".join(" " if sign in UNNAMED else sign for sign in self.source[:MOST_NAME]).strip()
            object.__setattr__(self, "name", made if NAMED.fullmatch(made) else "profile")
        elif not NAMED.fullmatch(self.name):
            raise FieldError(
                "name", f"{self.name!r} is no name of a cast: one line with a letter or figure, without '/'"
            )
        return self


class CastRules(Model):
    """Which of several casts corrects a ping."""

    rule: CastRule = Field(
        default=CastRule.NEAREST_IN_TIME,
        description="Which of several casts corrects a ping: the one nearest in time, or, of those within within_h, "
        "the one nearest to the vehicle (to the sounding, for single beams); where none is within that, the nearest "
        "in time",
    )
    within_h: float = Field(
        default=4.0,
        gt=0,
        le=8760,
        description="With rule nearest_in_distance_within_time: how far a cast may be away in time, hours",
    )


class NewCasts(Model):
    """Sound speed casts that are added to those that a mission has."""

    casts: list[Cast] = Field(
        min_length=1,
        max_length=MOST_CASTS,
        description="All of them are taken or none; one of a name that there is replaces that cast",
    )
    assumed_mps: ProfileSpeed | None = Field(
        default=None,
        description="Speed that is set in the sonars, m/s, for a mission's first casts; where it has casts it has to "
        "be theirs. Null: theirs, or 1500",
    )


class SoundSpeed(Cast, CastRules):
    """Sound speed correction: every beam is followed through a cast's profile for the time that its sonar measured.

    It is a cast itself; ``further`` ones make it several, of which ``rule`` gives each ping its own.
    """

    assumed_mps: float = Field(default=1500.0, ge=1300, le=1700, description="Speed that is set in the sonars, m/s")
    further: list[Cast] = Field(
        default_factory=list,
        max_length=MOST_CASTS - 1,
        description="Further casts; then each needs its own time and name and, with rule "
        "nearest_in_distance_within_time, a position",
    )

    @model_validator(mode="after")
    def _casts_can_be_told_apart(self) -> Self:
        casts = self.casts
        depths = sum(len(cast.profile) for cast in casts)
        if depths > MOST_DEPTHS:
            raise FieldError(
                "further",
                f"{len(casts)} casts have {depths} depths, at most {MOST_DEPTHS} are taken: thin their profiles",
            )
        names = set()
        for number, cast in enumerate(casts):
            own = f"further.{number - 1}." if number else ""
            if cast.name in names:
                raise FieldError(f"{own}name", f"two casts are called {cast.name!r}: give each a name of its own")
            names.add(cast.name)
            if len(casts) > 1 and cast.time is None:
                raise FieldError(
                    f"{own}time",
                    f"cast {cast.name!r} has no time: each of several needs one, so that pings find theirs",
                )
            if len(casts) > 1 and cast.position is None and self.rule is CastRule.NEAREST_IN_DISTANCE:
                raise FieldError(
                    f"{own}position",
                    f"cast {cast.name!r} has no position: {self.rule.value} needs one of each; give it, or choose "
                    f"{CastRule.NEAREST_IN_TIME.value}",
                )
        return self

    @classmethod
    def of(cls, casts: Sequence[Cast], rules: CastRules, assumed_mps: float) -> "SoundSpeed":
        """Return what some casts, one or more, and their rules make. Raises ValidationError."""
        first, *rest = (cast.model_dump() for cast in casts)
        return cls(**first, rule=rules.rule, within_h=rules.within_h, assumed_mps=assumed_mps, further=rest)

    @property
    def casts(self) -> tuple[Cast, ...]:
        """Return all casts."""
        own = Cast.model_construct(**{name: getattr(self, name) for name in Cast.model_fields})
        return (own, *self.further)

    @property
    def statement(self) -> str:
        """Return in words what ranges are corrected by, for products."""
        if not self.further:
            return self.source.strip() or "profile"
        times = sorted(cast.time for cast in self.casts if cast.time is not None)
        within = f" {self.within_h:g} h" if self.rule is CastRule.NEAREST_IN_DISTANCE else ""
        return (
            f"{len(self.casts)} casts from {times[0]:%Y-%m-%d %H:%M} to {times[-1]:%Y-%m-%d %H:%M} UTC, "
            f"{self.rule.spoken}{within}"
        )
