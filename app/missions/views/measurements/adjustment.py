"""How the adjustment of tracks is asked for and answered."""

from datetime import datetime
from typing import Literal

from pydantic import Field

from app.missions.spec.base import Latitude, Longitude, Model, Name
from app.missions.views.base import View
from app.missions.views.measurements.crossovers import PointView

MOST_FIXES = 1000


class FixRequest(Model):
    """A position of a vehicle at the surface that is known better than the one it had reckoned."""

    vehicle: Name
    time_s: float = Field(ge=0, lt=1e11, description="The vehicle's clock, Unix seconds")
    lat_deg: Latitude
    lon_deg: Longitude
    sd_m: float = Field(default=1.0, gt=0, le=100, description="Standard deviation east and north, each")
    resets: bool = Field(default=True, description="Whether the vehicle reckoned on from the fix")


class AdjustmentRequest(Model):
    """What is known beside the soundings; all of it may be left out."""

    fixes: list[FixRequest] = Field(
        default=[],
        max_length=MOST_FIXES,
        description="GPS fixes. Jumps of a vehicle's positions at the surface are taken for fixes without being named",
    )
    walk_m: float = Field(
        default=3.0, gt=0, le=1000, description="Deviation of the random walk of positions after an hour"
    )
    rate_mph: float = Field(
        default=15.0, gt=0, le=10000, description="Deviation of the slowly changing rate of their drift, metres an hour"
    )


class TrackOffsetView(View):
    """By how much a vehicle's positions were changed."""

    vehicle: str
    nodes: int
    mean_m: float = Field(description="Mean length of the change")
    max_m: float
    before_sd_m: float = Field(
        description="How uncertain its reckoned positions are by the assumed drift, east or north, at the worst"
    )
    sd_m: float = Field(description="The same of its adjusted ones")


class TieView(View):
    """A section of a track that was compared with what others sounded there."""

    number: int
    vehicle: str
    time_s: float = Field(description="The vehicle's clock in its middle, Unix seconds")
    other: str | None = Field(description="The vehicle that it was compared with most; null: it was not used")
    outcome: Literal["used", "no-overlap", "flat", "misfit", "outlier", "not-significant"] = Field(
        description="Used, or why not: others' soundings are too far, the terrain says nothing, depths differ "
        "wherever it is moved to, it contradicts the others, or no tie at all made held-out ones fit better"
    )
    before_m: float | None = Field(description="RMS of its depths less the others', unadjusted")
    after_m: float | None = Field(description="The same, adjusted")
    sd_m: tuple[float | None, float | None] = Field(
        description="How well it tells by how much to move it, in its best and its worst direction; null: not at all"
    )


class TieFeatureView(View):
    """A tie as GeoJSON."""

    type: Literal["Feature"]
    properties: TieView
    geometry: PointView


class TieFeaturesView(View):
    """Ties as GeoJSON."""

    type: Literal["FeatureCollection"]
    features: list[TieFeatureView]


class HeldOutView(View):
    """How well sections fit that were left out: RMS of their depths less the others'."""

    sections: int
    before_m: float = Field(description="Unadjusted")
    by_fixes_m: float = Field(description="Adjusted by fixes alone")
    after_m: float = Field(description="Adjusted by fixes and the other ties")
    significance: float = Field(description="How much better they fit than by fixes alone, in standard errors")


class AdjustmentView(View):
    """By how much positions of vehicles were changed for their drift; their raw positions stay."""

    applied: bool
    made_at: datetime | None = Field(description="Null: nothing is applied")
    actor: str | None
    by_ties: bool = Field(description="Whether ties were used; else fixes alone")
    fixes: int
    tracks: list[TrackOffsetView]
    ties_used: int
    ties_rejected: int
    before_m: float | None = Field(description="RMS of depths less others' over all ties, unadjusted")
    after_m: float | None = Field(description="The same, adjusted")
    held_out: HeldOutView | None = Field(description="Null: too little overlaps")
    ties: TieFeaturesView
