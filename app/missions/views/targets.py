"""What is known of moving targets, as it is sent out."""

from datetime import datetime
from enum import StrEnum

from pydantic import Field

from app.missions.views.base import View


class TargetState(StrEnum):
    """How far the search for a target has come."""

    UNHEARD = "unheard"
    """No vehicle has ranged to it yet."""
    SEARCHING = "searching"
    """Heard; several places are possible, farther apart than ``tracking.accuracy_m``."""
    UNCERTAIN = "uncertain"
    """One place, not known as well as asked."""
    ACCURATE = "accurate"
    """Known as well as asked: it belongs to the set A of the papers."""


class EllipseView(View):
    """Where the target is with 95 % probability, in the plane."""

    semi_major_m: float
    semi_minor_m: float
    orientation_deg: float = Field(description="Of the longer axis, clockwise from north, 0 to 180")


class TargetView(View):
    """A moving target as an operator sees it now: foretold from the last range until this moment."""

    name: str
    state: TargetState
    accurate: bool = Field(description="Known as well as tracking.accuracy_m asks: within A")
    in_area: bool | None = Field(default=None, description="Whether it is thought to be above the area to map")
    lat_deg: float | None = None
    lon_deg: float | None = None
    east_m: float | None = None
    north_m: float | None = None
    depth_m: float | None = None
    speed_mps: float | None = Field(
        default=None, description="Over ground, horizontally; null: its ranges do not tell yet"
    )
    course_deg: float | None = Field(
        default=None, description="Clockwise from north; null: not known, or it may stand still"
    )
    sd_east_m: float | None = None
    sd_north_m: float | None = None
    sd_depth_m: float | None = None
    ellipse: EllipseView | None = None
    age_s: float | None = Field(
        default=None, description="Seconds since a range to it was used, as vehicles count them; null: never"
    )
    ranges: int = Field(description="Ranges that were used")
    rejected: int = Field(description="Ranges that were not")
    last_refusal: str = Field(default="", description="Why the last of those was not used")
    pursued_by: str | None = Field(default=None, description="The vehicle that left the mapping for it")


class TargetRangeView(View):
    """A range to a target as it was measured, and whether it was used."""

    id: int
    target: str
    vehicle: str
    time_s: float = Field(description="The vehicle's clock, Unix seconds")
    received_at: datetime
    step: int
    source: str = Field(description="What told of it: rest, sim, or an IMC message")
    range_m: float
    lat_deg: float = Field(description="Where the vehicle was")
    lon_deg: float
    depth_m: float
    used: bool
    reason: str = Field(default="", description="Why it was not used")


class TargetRangePage(View):
    """Some ranges, in the order they were judged."""

    items: list[TargetRangeView]
    next_after: int | None = Field(description="Give it as `after` for the next page; null: this is the last")
