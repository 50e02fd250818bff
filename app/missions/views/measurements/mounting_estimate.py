"""How the evaluation of a patch test is asked for and answered."""

from enum import StrEnum

from pydantic import Field

from app.mapping.swath.patch_test import Known
from app.missions.spec.base import Model
from app.missions.spec.mounting import MountingSpec
from app.missions.views.base import View


class MountingParameter(StrEnum):
    """What overlapping lines may tell, by its name in a mounting."""

    ROLL = "roll_deg"
    PITCH = "pitch_deg"
    HEADING = "heading_deg"
    LATENCY = "latency_s"


class MountingEstimateRequest(Model):
    """How well lines fit each other beside the mounting; all of it may be left out."""

    position_sd_m: float = Field(
        default=0.3,
        gt=0,
        le=100,
        description="How far a line may lie aside of another one as a whole, standard deviation east and north, metres",
    )
    level_sd_m: float = Field(
        default=0.05,
        gt=0,
        le=10,
        description="How far it may lie too deep as a whole, as from the water level, standard deviation, metres",
    )


class ParameterEstimateView(View):
    """What overlapping lines tell of one parameter of a mounting."""

    name: MountingParameter
    known: Known = Field(
        description="determined; undetermined: the lines do not tell it; unsettled: the search for it does not come to "
        "rest; beside: it would be far from what counts now, where nothing is looked for"
    )
    value: float | None = Field(description="Degrees or seconds, in place of what counts now; null: not determined")
    sd: float | None = Field(description="Its standard deviation")
    proposed: bool = Field(description="Whether it is among what `proposal` changes")
    why: str = Field(description="Why it is proposed, or not, or which lines would tell it")


class PatchLineView(View):
    """A line that shares ground with others."""

    start_s: float = Field(description="The vehicle's clock, Unix seconds")
    end_s: float
    heading_deg: float = Field(description="Of the vehicle, clockwise from north")
    speed_mps: float


class MountingEstimateView(View):
    """What overlapping lines of a vehicle say of how its sonar is mounted. Nothing is changed by it."""

    vehicle: str
    applied: MountingSpec = Field(description="What counts now")
    parameters: list[ParameterEstimateView]
    proposal: MountingSpec | None = Field(
        description="What to send to PUT .../mountings/{name}; null: lines agree as well as they do now without it"
    )
    before_m: float = Field(description="RMS of lines' depths beside the mean of all in the same cell, as they are now")
    after_m: float = Field(description="With the proposal; where there is none, with all that is determined")
    significance: float = Field(description="By how many standard deviations its square became smaller")
    cells: int = Field(description="Cells that at least two lines saw")
    beams: int = Field(description="Beams that were compared; of many a part is chosen")
    lines: list[PatchLineView] = Field(description="The lines that were compared, in the order of their times")
