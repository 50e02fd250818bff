"""What a mission of kind ``search`` looks for, in which partly known site, and until when."""

import math
from typing import Any

from pydantic import Field

from app.missions.spec.base import Latitude, Longitude, Model, PolygonGeometry

MOST_OBSTACLES = 1000
SPARE_STEPS = 3.0
"""Steps that a search may take, as a multiple of those of full length that the time window has room for."""

DEFAULTS: dict[str, Any] = {
    "planner": {"name": "rollout"},
    "limits": {"max_step_m": 3.0, "keep_out_margin_m": 2.0},
    "arrival_radius_m": 1.0,
    "speed_mps": 1.0,
}
"""What a mission of kind ``search`` takes where nothing else is said, other than a survey."""


class ScannerSpec(Model):
    """A laser scanner or an imaging sonar that looks round, on every vehicle."""

    reach_m: float = Field(default=8.0, gt=0, le=200, description="Range within which it tells of everything")
    resolution_deg: float = Field(default=0.5, ge=0.1, le=10, description="Angle between neighbouring beams")


class SearchSpec(Model):
    """A search: something near the goal is sought, the rest of the site is looked at, and all are back in time."""

    goal: tuple[Longitude, Latitude] = Field(
        description="Where it is expected, [longitude, latitude]", examples=[[-8.7033, 41.1863]]
    )
    goal_radius_m: float = Field(default=50.0, gt=0, le=10_000, description="Radius of the goal area about it")
    entry: tuple[Longitude, Latitude] = Field(
        description="Where vehicles enter, and where they are when the time is up, [longitude, latitude]",
        examples=[[-8.7046, 41.1852]],
    )
    window_s: float = Field(
        gt=0,
        le=604_800,
        description="Time from the first step in which every vehicle is back, seconds of vehicle time; pauses count",
        examples=[1800.0],
    )
    transmitter: tuple[Longitude, Latitude] | None = Field(
        default=None, description="Where the team's radio stands; null: at the entry"
    )
    transmitter_range_m: float = Field(
        default=200.0, gt=0, le=100_000, description="Farther away a vehicle is out of contact"
    )
    safety_m: float = Field(
        default=2.0,
        gt=0,
        le=100,
        description="Legs keep this far from obstacles and from what nobody has looked at; not below arrival_radius_m",
    )
    scanner: ScannerSpec = Field(default_factory=ScannerSpec)
    obstacles: list[PolygonGeometry] = Field(
        default_factory=list,
        max_length=MOST_OBSTACLES,
        description="What is known to stand there: quays on a chart, walls on a plan",
    )
    simulated_obstacles: list[PolygonGeometry] = Field(
        default_factory=list,
        max_length=MOST_OBSTACLES,
        description="What simulated vehicles meet beyond `obstacles`; planners do not know of it",
    )


def filled_in(data: Any) -> Any:
    """Return a mission's raw description with what a search has for defaults; what cannot be read is left as it is."""
    if not isinstance(data, dict) or data.get("kind") != "search" or not isinstance(data.get("search"), dict):
        return data
    filled: dict[str, Any] = DEFAULTS | data
    for name in ("planner", "limits"):
        if isinstance(filled[name], dict):
            filled[name] = DEFAULTS[name] | filled[name]
    if "budget" not in data and isinstance(limits := filled["limits"], dict):
        filled.setdefault("steps", _steps(filled["search"].get("window_s"), filled["speed_mps"], limits["max_step_m"]))
    return filled


def _steps(*numbers: Any) -> int:
    """Return enough steps for a time window at a speed; 1 where these are no figures, which others will say."""
    if not all(isinstance(n, int | float) and math.isfinite(n) and n > 0 for n in numbers):
        return 1
    window_s, speed_mps, step_m = (float(n) for n in numbers)
    return int(min(100_000, math.ceil(SPARE_STEPS * window_s * speed_mps / step_m)))
