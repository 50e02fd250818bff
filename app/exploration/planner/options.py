"""What can be set about a planner; declared once, shown by the command line, REST and the dashboard."""

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from app.exploration.core.objective import Terms
from app.exploration.pcao.model import PcaoModel

OF_EVERY_PLANNER = frozenset({"turn_radius_m", "cruise_depth_m"})
"""Options that concern how vehicles fly, whoever plans."""

OF_CAO = frozenset(
    ("regressors", "objective", "contribution", "degree", "candidates", "window", "alpha", "alpha_decay", "alpha_floor")
) | {"search", "accuracy_sd_m"}
"""What CAO reads; in surveys `rollout` is CAO, too."""


class PlannerOptions(BaseModel):
    """Settings of the planners; each reads those that GET /api/v1/planners lists for it."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    regressors: Literal["map", "polynomial"] = Field(
        "map",
        description="What CAO's estimator is linear in: predictions from the current map, or powers of raw positions.",
    )
    objective: Terms = Field(
        "full",
        description="What CAO measures after each step where landmarks are seen: AURO15's objective up to one of its "
        "terms, or MED13's cost.",
    )
    contribution: Literal["team", "vehicle"] = Field(
        "vehicle",
        description="What CAO learns from where landmarks are seen: the team's objective, or for each vehicle the "
        "difference that its last move made to it.",
    )
    degree: int = Field(1, ge=1, le=3, description="Highest power of a vehicle's position in polynomial regressors.")
    candidates: int = Field(48, ge=4, le=10_000, description="Candidates per vehicle that CAO weighs in a step (N).")
    window: int | None = Field(
        None,
        ge=2,
        le=1000,
        description="Past steps to which CAO fits its estimator (L + T_h); by default 30, with polynomials 15.",
    )
    alpha: float = Field(1.0, gt=0, le=10, description="First size of random moves, as a fraction of the largest step.")
    alpha_decay: float = Field(
        0.6,
        gt=0.5,
        le=1.0,
        description="Exponent of the decay of alpha; above 0.5 the squares have a finite sum.",
    )
    alpha_floor: float = Field(0.2, ge=0, le=1, description="Least alpha, so that random moves never die out.")
    search: int = Field(4000, ge=0, le=100_000, description="Changes tried when a survey plan is made anew.")
    turn_radius_m: float = Field(
        0.0, ge=0, le=1000, description="Radius of the tightest circle that vehicles fly; survey plans pay for turns."
    )
    cruise_depth_m: float | None = Field(
        None, ge=0, description="Depth at which vehicles survey; by default the depth at which each joined."
    )
    line_spacing_m: float | None = Field(
        None,
        ge=0.5,
        le=1000,
        description="Distance from line to line. The mission ends when all lines are flown, or with its budget; by "
        "default lines are as close as the budget allows.",
    )
    line_heading_deg: float | None = Field(
        None,
        ge=0,
        lt=360,
        description="Course of the lines, clockwise from true north; by default that of the area's longer side, or "
        "what the planner finds better.",
    )
    keep_line_order: bool = Field(
        False,
        description="With survey_lines: fly them in the order in which they are given, though another one is shorter.",
    )
    rollouts: int = Field(300, ge=0, le=100_000, description="Changes to the team's plan that a rollout step tries.")
    tries: int = Field(0, ge=0, le=10_000, description="Real tries per step of OSARSES (only in simulation).")
    accuracy_sd_m: float = Field(
        0.02, gt=0, description="Standard deviation below which a landmark counts as accurately estimated."
    )
    model: PcaoModel | None = Field(
        None,
        description="What pcao flies with: the content of a model file that bathyfleet train wrote; without one, the "
        "controller that ships with bathyfleet.",
    )
