"""How corrections of soundings are asked for and answered."""

from datetime import datetime

from pydantic import Field

from app.missions.spec.systematic_errors import SystematicErrors
from app.missions.spec.water import SoundSpeed, Tide
from app.missions.views.base import View


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


class CorrectionsView(View):
    """How soundings are corrected; their raw values stay beside the corrected ones."""

    tide: Tide
    tide_table: TideTableView | None = Field(description="Its levels count in place of tide.level_m")
    sound_speed: SoundSpeed | None
    systematic_errors: SystematicErrors
    vertical_datum: str = Field(description="What corrected depths are counted from")
    accepted: int = Field(description="Soundings accepted under these corrections")
    rejected: int
