"""How corrections of soundings are asked for and answered."""

from datetime import datetime

from pydantic import Field

from app.mapping.s44 import Order
from app.mapping.water.casts import CastRule
from app.missions.spec.base import Latitude, Longitude
from app.missions.spec.mounting import MountingSpec
from app.missions.spec.systematic_errors import SystematicErrors
from app.missions.spec.water import ProfileDepth, ProfileSpeed, SoundSpeed, Tide
from app.missions.views.base import View
from app.missions.views.measurements.soundings import MeasuredCastView


class TideCorrection(Tide):
    """A mission's tide: a constant level, or a table of high and low waters or observed levels in its place."""

    table: str | None = Field(
        default=None,
        max_length=8_000_000,
        description="Text of a table: a line 'YYYY/MM/DD hh:mm:ss.sss level' (.tid) or '2026-11-30T11:00:00Z 1.0' per "
        "high or low water, or per observed level. Times without a zone or an offset are UTC; blanks, a tab, a comma "
        "or a semicolon before the level, in metres. A half cosine leads from one extreme to the next, observed levels "
        "run smoothly; soundings beyond the table, or in a gap of it, are rejected until a table covers them. Null: "
        "level_m",
    )
    table_name: str = Field(default="", max_length=200, description="Its name; default: the harbour that it states")


class TideTableView(View):
    """A tide table in short."""

    name: str
    first: datetime = Field(description="Time of the first entry")
    last: datetime = Field(description="Time of the last entry")
    entries: int
    sha256: str = Field(description="Of the table as it was sent")
    utc_assumed: bool = Field(description="Whether it states no zone for some of its times, which are taken for UTC")


class MountingView(View):
    """How the sonar of one vehicle is mounted."""

    vehicle: str
    stated: MountingSpec = Field(description="As the vehicle was described when it joined")
    corrected: MountingSpec | None = Field(description="What counts in place of that; null: what is stated counts")


class CorrectionsView(View):
    """How soundings are corrected; their raw values stay beside the corrected ones."""

    tide: Tide
    tide_table: TideTableView | None = Field(description="Its levels count in place of tide.level_m")
    sound_speed: SoundSpeed | None
    systematic_errors: SystematicErrors
    mountings: list[MountingView] = Field(description="How sonars are mounted, a line for each vehicle")
    rejected_beams: int = Field(description="Beams of swath sonars that operators took out")
    restored_beams: int = Field(description="Beams that count because operators say so, whatever their neighbours")
    vertical_datum: str = Field(description="What corrected depths are counted from")
    accepted: int = Field(description="Soundings accepted under these corrections")
    rejected: int


class CastView(View):
    """A sound speed cast, and what it corrects."""

    name: str
    source: str
    time: datetime | None
    position: tuple[Longitude, Latitude] | None
    profile: list[tuple[ProfileDepth, ProfileSpeed]]
    soundings: int = Field(description="Accepted soundings of single beams that it corrects")
    pings: int = Field(description="Accepted pings of swath sonars that it corrects")
    first: datetime | None = Field(description="Time of the first of them; null: it corrects none")
    last: datetime | None = Field(description="Time of the last of them")
    farthest_h: float | None = Field(description="How far one of them is away from it in time at most, hours")


class VehicleCastView(MeasuredCastView):
    """A sound speed cast that a vehicle measured, as it sent it or as its log has it."""

    vehicle: str
    file: str | None = Field(default=None, description="The log's name; null: it was sent")
    probe: str | None = Field(default=None, description="What measured it; null: a log does not keep that")


class CastChangeView(View):
    """By how much a depth differs between two casts that follow each other in time."""

    before: str
    after: str
    difference_m: float = Field(description="Of the depth of the outer beam, from the one profile to the other")
    is_large: bool = Field(description="Whether that is more than `limit_m` of the list")


class CastsView(View):
    """A mission's sound speed casts in the order of their times, and how well they fit what was sounded."""

    assumed_mps: float = Field(description="Speed that is set in the sonars")
    rule: CastRule
    within_h: float
    casts: list[CastView]
    far_h: float = Field(description="Soundings farther away in time from their cast than this are counted, hours")
    far_soundings: int = Field(description="Soundings of single beams that are farther away")
    far_pings: int = Field(description="Pings of swath sonars that are farther away")
    order: Order = Field(description="Order of IHO S-44 that differences between casts are compared with")
    angle_deg: float = Field(description="Of the outer beam that they are compared for, from straight down")
    sonar_m: float | None = Field(description="Depth that it is sent from")
    depth_m: float | None = Field(description="The map's deepest cell, where it meets the bottom; null: no map yet")
    limit_m: float | None = Field(description="Half the order's largest TVU at that depth")
    changes: list[CastChangeView] = Field(description="From each cast to the next; empty: there is no map yet")
