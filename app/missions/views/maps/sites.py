"""What is answered about sites, their surveys and what changed between them."""

from datetime import datetime

from pydantic import Field

from app.missions.spec.base import Latitude, Longitude, PolygonGeometry
from app.missions.views.base import View


class SiteView(View):
    """A site that is surveyed again and again."""

    id: str
    name: str
    area: PolygonGeometry
    cell_m: float = Field(description="Cell of the site's grid")
    yearly_change_m: float = Field(description="By how much the floor may change in a year, standard deviation")
    created_at: datetime
    updated_at: datetime
    missions: int = Field(description="Missions of the site, whatever their state")
    surveys: int = Field(description="Missions that ended, whose depths the site keeps")
    last_survey_at: datetime | None = Field(description="When the newest survey made its last sounding")


class SurveyView(View):
    """What a mission has to do with its site: a survey once it has ended."""

    mission_id: str
    name: str
    state: str | None = Field(description="Of the mission; null: it was removed, its depths are kept")
    surveyed: bool = Field(
        description="Whether the site has its depths: false until it ends, and while its map is made"
    )
    left_out: str = Field(description="Why its depths are not in the site's model; empty where they are")
    began_at: datetime | None = Field(description="First sounding")
    ended_at: datetime | None = Field(description="Last sounding")
    soundings: int = Field(description="Accepted ones, without beams of swath sonars")
    beams: int
    share_pct: float = Field(description="Of the site's cells, those that it knows")
    median_sd_m: float | None = Field(description="Standard deviation of its depths")
    min_depth_m: float | None
    max_depth_m: float | None
    changed_pct: float | None = Field(
        description="Of its cells that were known before, those where it differs from what was foretold by more than "
        "1.96 deviations: about 5 where nothing changed. null: none was known"
    )
    vertical_datum: str


class SurveyName(View):
    """A survey in short."""

    mission_id: str
    name: str
    at: datetime = Field(description="Its last sounding")


class SiteMapView(View):
    """A site's depths from all its surveys, as of a time. Rows go from south to north; null: nobody surveyed there."""

    site_id: str
    at: datetime = Field(description="As of when: what was known before is less certain by then")
    west_m: float = Field(description="Western edge of the grid in the site's local frame")
    south_m: float
    cell_m: float
    rows: int
    cols: int
    corners: list[tuple[Longitude, Latitude]] = Field(
        description="North-west, north-east, south-east and south-west corner, [longitude, latitude]"
    )
    vertical_datum: str
    known_pct: float = Field(description="Of the site's cells, those that a survey knows")
    min_depth_m: float | None
    max_depth_m: float | None
    surveys: list[SurveyName] = Field(description="What `survey` counts in, oldest first")
    depth_m: list[list[float | None]]
    sd_m: list[list[float | None]] = Field(description="Standard deviation of the depths, grown with their age")
    survey: list[list[int | None]] = Field(description="Number in `surveys` of the newest one that counts in the cell")
    count: list[list[int]] = Field(description="Surveys that count in the cell: those since it was found changed")
    sounded: list[list[bool]] = Field(
        description="Whether one of them sounded it; else its soundings support the depth"
    )


class VolumeView(View):
    """A volume with its standard deviation, cubic metres."""

    m3: float
    sd_m3: float


class ChangesView(View):
    """What changed at a site between two of its surveys, over the ground that both know."""

    site_id: str
    earlier: SurveyName
    later: SurveyName
    confidence: float = Field(description="A share of so much of unchanged ground is not called changed")
    compared_m2: float
    significant_pct: float = Field(description="Of the compared cells, those that changed significantly")
    expected_pct: float = Field(description="What chance makes of unchanged ground where deviations are right")
    deeper_pct: float = Field(description="Of the compared cells, those that are significantly deeper now")
    shoaler_pct: float
    lost: VolumeView = Field(description="Volume that is gone where it is significantly deeper")
    gained: VolumeView = Field(description="Volume that was added where it is significantly shoaler")
    net: VolumeView = Field(description="Gained less lost, over all compared cells, significant or not")
    mean_m: float | None = Field(description="Later depth less earlier depth: positive where it is deeper now")
    rms_m: float | None
    median_sd_m: float | None = Field(description="Standard deviation of a difference")
    least_m: float | None
    largest_m: float | None
    last_colour_m: float = Field(
        description="Difference of the last colour of changes.png, deeper now; that of the first is its negative"
    )
    corners: list[tuple[Longitude, Latitude]] = Field(description="Of changes.png, as those of a map")
    vertical_datum: str
    notes: list[str] = Field(description="What has to be known to read it, in words")
