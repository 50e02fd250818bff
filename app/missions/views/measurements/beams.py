"""How beams of swath sonars are chosen, shown, and said to count or not."""

from datetime import datetime
from typing import Annotated, Self

from pydantic import Field, model_validator

from app.missions.spec.base import FieldError, Model, Name, PolygonGeometry
from app.missions.views.base import View
from app.missions.views.measurements.soundings import Ruling, SoundingState

MOST_NAMED = 200_000
"""Beams that can be named one by one at once."""

Time = Annotated[float, Field(ge=0, le=4e9)]
Depth = Annotated[float, Field(ge=-100, le=12_000)]


class BeamSelection(Model):
    """Which beams of a mission's swath sonars are meant: those that fulfil all that is stated."""

    area: PolygonGeometry | None = Field(default=None, description="They met the bottom in here")
    vehicle: Name | None = Field(default=None, description="They are of this vehicle")
    from_s: Time | None = Field(default=None, description="Not before this time of the vehicle's clock, Unix seconds")
    until_s: Time | None = Field(default=None, description="Not after this time of the vehicle's clock, Unix seconds")
    least_depth_m: Depth | None = Field(
        default=None, description="Not shoaler than this, metres below the datum, as corrected now"
    )
    most_depth_m: Depth | None = Field(
        default=None, description="Not deeper than this, metres below the datum, as corrected now"
    )
    least_angle_deg: float | None = Field(
        default=None,
        ge=0,
        lt=90,
        description="Outer beams: at least so far to either side from straight down in the vehicle, degrees",
    )

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        for low, high in (("from_s", "until_s"), ("least_depth_m", "most_depth_m")):
            least, most = getattr(self, low), getattr(self, high)
            if least is not None and most is not None and least > most:
                raise FieldError(low, f"{least:g} is above {high} {most:g}: swap them")
        return self

    @property
    def is_of_all(self) -> bool:
        """Whether nothing is stated."""
        return self == BeamSelection()


class BeamPointsRequest(BeamSelection):
    """Which beams are asked for as points."""

    limit: int = Field(
        default=50_000,
        ge=1,
        le=MOST_NAMED,
        description="Most points in the answer. Of more beams those of every second ping, or fourth, and so on come; "
        "where one ping has more, some of its beams",
    )


class NamedBeams(Model):
    """Some beams of one ping."""

    vehicle: Name
    time_s: Time = Field(description="Time of the ping by the vehicle's clock, Unix seconds, to the last digit")
    beams: list[Annotated[int, Field(ge=0, lt=4096)]] = Field(
        min_length=1, max_length=4096, description="Their places in the ping, the first of which is 0"
    )


class BeamRulingRequest(Model):
    """Which beams an operator decides about, by what they have in common or one by one."""

    selection: BeamSelection | None = Field(default=None, description="By what they have in common")
    pings: list[NamedBeams] = Field(default=[], max_length=MOST_NAMED, description="One by one")
    note: str = Field(default="", max_length=500, description="Why; kept in the log")

    @model_validator(mode="after")
    def _either(self) -> Self:
        if (self.selection is None) == (not self.pings):
            raise ValueError("name beams either by a selection or by pings: give one of the two")
        if self.selection is not None and self.selection.is_of_all:
            raise FieldError(
                "selection", "it states nothing and would be all beams: state an area, a vehicle or a limit"
            )
        if sum(len(ping.beams) for ping in self.pings) > MOST_NAMED:
            raise FieldError(
                "pings", f"at most {MOST_NAMED} beams are taken at once: send them in parts, or as a selection"
            )
        return self


class BeamPoints(View):
    """Beams as points, column by column, in the order in which vehicles and their pings came."""

    total: int = Field(description="Beams of the selection that met the bottom; where `every` is 1 all are here")
    every: int = Field(description="Pings of which one was taken: 1, 2, 4, …")
    lon_deg: list[float]
    lat_deg: list[float]
    depth_m: list[float] = Field(description="Below the datum, as corrected now")
    state: list[int] = Field(description="Places in `states`")
    ping: list[int] = Field(description="Places in `time_s` and `vehicle`")
    beam: list[int] = Field(description="Place in the ping, the first of which is 0")
    time_s: list[float] = Field(description="Of each ping, by the vehicle's clock, Unix seconds")
    vehicle: list[int] = Field(description="Of each ping, places in `vehicles`")
    states: list[SoundingState]
    vehicles: list[str]


class BeamEditView(View):
    """What an operator once said of some beams."""

    id: int
    ruling: Ruling
    beams: int = Field(description="How many these are")
    vehicles: list[str] = Field(description="Whose they are")
    selection: BeamSelection | None = Field(description="What was asked for; null: each beam was named")
    made_at: datetime
    actor: str
    note: str


class BeamEditsView(View):
    """All that operators said of a mission's beams, oldest first: of each beam the last word counts."""

    rejected: int = Field(description="Beams that do not count")
    restored: int = Field(description="Beams that count whatever their neighbours are like")
    edits: list[BeamEditView]
