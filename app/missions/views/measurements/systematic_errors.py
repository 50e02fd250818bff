"""How systematic errors are proposed."""

from enum import StrEnum

from pydantic import Field

from app.missions.spec.systematic_errors import SystematicErrors
from app.missions.views.base import View


class ErrorKind(StrEnum):
    """What may be wrong."""

    DEPTH = "depth"
    WATER_LEVEL = "water_level"
    ROLL_OFFSET = "roll_offset"
    SOUND_SPEED = "sound_speed"


class SystematicErrorView(View):
    """One error, as the survey shows it beside those that are taken out already."""

    kind: ErrorKind = Field(
        description="depth: a vehicle's depths beside the mean of those that cross each other; water_level: the "
        "largest residual beside the tide; roll_offset and sound_speed: of a swath sonar"
    )
    vehicle: str | None = Field(description="Null: of all")
    unit: str
    found: float = Field(description="What is left in soundings as they are corrected now")
    sd: float = Field(description="Its standard deviation, from leaving lines or pieces of tracks out")
    significance: float = Field(description="How many standard deviations it is from zero")
    observations: int = Field(description="Crossings, or beams, that tell of it")
    rms_before_m: float = Field(description="RMS of the differences it was found in")
    rms_after_m: float = Field(description="What would be left of them")
    proposed: bool = Field(description="Whether it is large and sure enough to be taken out")
    why: str = Field(description="Why it is proposed, or not")


class SystematicErrorsView(View):
    """What a survey shows of systematic errors."""

    applied: SystematicErrors = Field(description="What is taken out of soundings now")
    errors: list[SystematicErrorView]
    unknown: list[str] = Field(description="What cannot be told, and why")
    proposal: SystematicErrors | None = Field(
        description="What to send to PUT .../systematic-errors to take out what is proposed, what is applied included; "
        "null: nothing is proposed"
    )
