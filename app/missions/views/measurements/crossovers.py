"""What is answered about how well a survey agrees with itself."""

from typing import Literal

from pydantic import Field

from app.mapping.s44 import Order
from app.missions.spec.base import Latitude, Longitude
from app.missions.views.base import View


class AgreementView(View):
    """Differences of depths that should be the same, metres."""

    count: int
    mean_m: float
    median_m: float
    sd_m: float | None = Field(description="Standard deviation of a sample; null: there is one difference")
    rms_m: float
    p95_m: float = Field(description="95 % quantile of the absolute differences")
    max_m: float = Field(description="Largest absolute difference")
    within_pct: float = Field(description="Share that is not larger than the order's largest TVU")


class VehiclesAgreementView(AgreementView):
    """Differences where two vehicles cross, or one crosses its own way."""

    vehicles: tuple[str, str] = Field(
        description="Depths of the first minus those of the second; twice the same: the later minus the earlier"
    )


class LineAgreementView(AgreementView):
    """Differences of a line to all that cross it: its depths minus theirs."""

    vehicle: str
    line: int = Field(description="Among the vehicle's lines, from 1")
    crossline: bool
    start_s: float = Field(description="The vehicle's clock at its begin, Unix seconds")
    length_m: float
    heading_deg: float


class AngleAgreementView(View):
    """Beams of crosslines minus the grid of the main lines, for one bin of beam angles."""

    from_deg: float = Field(description="From straight down in the vehicle, positive to starboard")
    to_deg: float
    count: int
    mean_m: float
    sd_m: float | None
    within_pct: float


class HistogramView(View):
    """Counts of differences; the outer bins hold those beyond the ends, too."""

    edges_m: list[float] = Field(description="One more than there are counts")
    counts: list[int]


class CrossingView(View):
    """A place where two lines cross."""

    number: int = Field(description="1 is the worst beside what the order allows")
    vehicles: tuple[str, str]
    lines: tuple[int, int]
    times_s: tuple[float, float] = Field(description="The vehicles' clocks, Unix seconds")
    depths_m: tuple[float, float]
    difference_m: float = Field(description="First minus second")
    predicted_sd_m: float = Field(description="As the soundings' standard deviations predict it")
    angle_deg: float = Field(description="Between the lines, 0 to 90")
    within: bool = Field(description="Whether it is not larger than the order's largest TVU")
    outlier: bool = Field(description="Whether it is larger than that, or than three robust standard deviations")
    lat_deg: Latitude
    lon_deg: Longitude


class PointView(View):
    """A GeoJSON point."""

    type: Literal["Point"]
    coordinates: tuple[Longitude, Latitude]


class CrossingFeatureView(View):
    """A crossing as GeoJSON."""

    type: Literal["Feature"]
    properties: CrossingView
    geometry: PointView


class CrossingFeaturesView(View):
    """Crossings as GeoJSON, worst first."""

    type: Literal["FeatureCollection"]
    features: list[CrossingFeatureView]


class CrossoversView(View):
    """How well a survey agrees with itself where its lines cross."""

    version: int = Field(description="Of the map that was newest when this was computed")
    order: Order
    lines: int
    length_km: float = Field(description="Of all lines")
    crosslines: int = Field(description="Lines across the dominant direction that cross others, flown as such or not")
    crosslines_km: float
    crosslines_pct: float = Field(description="Share of the length of all lines")
    statistics: AgreementView | None = Field(description="Of all crossings; null: there is none")
    at_crosslines: AgreementView | None = Field(description="Of those where a crossline crosses a main line")
    normalised_rms: float | None = Field(
        description="RMS of the differences over what the soundings' standard deviations predict: 1 is as predicted; "
        "null: there is no crossing"
    )
    by_vehicles: list[VehiclesAgreementView]
    by_line: list[LineAgreementView] = Field(description="Lines that cross others, largest RMS first")
    lines_left_off: int = Field(description="Lines that `by_line` has no place for")
    beams: AngleAgreementView | None = Field(
        description="Crosslines' beams of all angles minus the grid of the main lines; null: swath sonars have none"
    )
    by_angle: list[AngleAgreementView] = Field(description="The same for each bin of beam angles")
    histogram: HistogramView
    outliers: int = Field(description="Crossings beyond the order's largest TVU, or far from the others")
    left_off: int = Field(description="Crossings that `features` has no place for; `crossovers.csv` has all")
    features: CrossingFeaturesView
