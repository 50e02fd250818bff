"""Swath sonars: what one can do, and how well the sea floor is to be covered by them."""

from pydantic import Field

from app.missions.spec.base import Model


class SwathSonarSpec(Model):
    """A multibeam sonar, looking down, across the vehicle's heading."""

    aperture_deg: float = Field(
        default=120.0, ge=10, le=170, description="Angle between its outermost beams, half of it to each side, degrees"
    )
    beams: int = Field(default=256, ge=2, le=4096, description="How many beams a ping has, at equal angles")
    rate_hz: float = Field(default=5.0, gt=0, le=50, description="Pings a second, Hz")
    range_m: float = Field(default=100.0, gt=0, le=2000, description="Longest slant range, metres")


class CoverageSpec(Model):
    """How full coverage by swath sonars is to be, where the planner is `swath`, and lines across all others."""

    overlap_pct: float = Field(
        default=6.0,
        ge=0,
        le=80,
        description="Share of half a swath that the next one sounds again, at least; more where position is uncertain",
    )
    crosslines_pct: float = Field(
        default=5.0,
        ge=0,
        le=50,
        description="Length of lines across all others, flown last, as a share of those; by what both measured where "
        "they cross a survey is judged. Also where planner `lawnmower` is given the distance of lines. 0: none",
    )
    cell_of_depth: float | None = Field(
        default=None,
        gt=0,
        le=1,
        description="Cells by depth, in files with cells of several sizes: each depth has the smallest of cell_m, "
        "twice and four times as much, and so on, that is at least this share of it, for example 0.05. null: one size",
    )
