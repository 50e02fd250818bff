"""Where vehicles are brought home to, and when."""

from enum import StrEnum

from pydantic import Field

from app.missions.spec.base import Latitude, Longitude, Model


class Homecoming(StrEnum):
    """What becomes of a vehicle that goes on no further."""

    RETURN = "return"
    """It goes home to its recovery point."""
    STOP = "stop"
    """It stops where it is, and comes up there."""


class Recovery(Model):
    """Where vehicles are taken out of the water, and what brings them there."""

    point: tuple[Longitude, Latitude] = Field(
        description="Where vehicles are taken out of the water, [longitude, latitude]; may lie outside the area",
        examples=[[-8.7052, 41.1848]],
    )
    radius_m: float = Field(default=25.0, gt=0, le=1000, description="Who is this close to the point is home")
    on_finish: Homecoming = Field(
        default=Homecoming.RETURN,
        description="What vehicles do at the mission's end, unless finish says otherwise",
    )
    on_low_energy: Homecoming = Field(
        default=Homecoming.RETURN, description="What a vehicle does when its energy is just enough for its way home"
    )
    on_lost_link: Homecoming = Field(
        default=Homecoming.RETURN,
        description="What a vehicle does whose link was lost for long, once it is heard again",
    )
    wait_for_batteries: bool = Field(
        default=False,
        description="Whether a mission goes on while all are home with some of their way left, until one is resumed "
        "with another battery; otherwise it is finished then",
    )
