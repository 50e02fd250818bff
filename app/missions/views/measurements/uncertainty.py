"""What is answered about where the uncertainty of soundings comes from."""

from pydantic import Field

from app.mapping.s44 import Order
from app.missions.views.base import View


class ShareView(View):
    """What something adds to the uncertainty of a beam, standard deviations in metres."""

    angle_deg: float = Field(description="Of the beam from straight down")
    vertical_m: float = Field(description="Of the depth")
    horizontal_m: float = Field(description="Of the place, east and north together")


class ComponentView(View):
    """A source of error."""

    name: str = Field(description="Of its field in the mission's `uncertainty`; tide: `tide.sd_m`")
    title: str
    unit: str
    sd: float = Field(description="Its standard deviation, in its unit")
    shares: list[ShareView]


class TotalView(View):
    """A beam's total propagated uncertainty, 95 %."""

    angle_deg: float = Field(description="Of the beam from straight down")
    tvu_m: float
    thu_m: float


class AllowedView(View):
    """What an order of IHO S-44 allows at the depth, 95 %."""

    order: Order
    tvu_m: float
    thu_m: float


class UncertaintyBudgetView(View):
    """Where the uncertainty of a swath sonar's soundings comes from, over level ground, for single beams."""

    depth_m: float = Field(description="Mean depth of the map")
    below_sonar_m: float = Field(description="That minus the depth at which the highest vehicle travels")
    components: list[ComponentView]
    totals: list[TotalView]
    allowed: list[AllowedView]
