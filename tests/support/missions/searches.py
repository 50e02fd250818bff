"""Missions that search a small basin."""

from typing import Any

from app.missions.spec.mission import MissionSpec
from tests.support.missions.specs import lon_lat, rectangle

SIDE_M = 30.0


def search_json(**changes: Any) -> dict[str, Any]:
    """A basin of 30 x 30 m: a quay in the east is known, a pontoon across half of the middle is not."""
    search = {
        "goal": lon_lat(8, 25),
        "goal_radius_m": 5.0,
        "entry": lon_lat(14, 5),
        "window_s": 4000.0,
        "safety_m": 1.5,
        "scanner": {"reach_m": 10.0, "resolution_deg": 2.0},
        "obstacles": [rectangle(27, 0, 30, 30)],
        "simulated_obstacles": [rectangle(0, 14, 15, 16)],
    }
    values: dict[str, Any] = {
        "name": "Basin",
        "kind": "search",
        "area": rectangle(0, 0, SIDE_M, SIDE_M),
        "vehicles": [{"name": "boat", "kind": "sim", "depth_m": 0}],
        "limits": {"max_step_m": 4.0, "min_depth_m": 0.0, "min_altitude_m": 0.1},
        "search": search | changes.pop("search", {}),
    }
    return values | changes


def search_spec(**changes: Any) -> MissionSpec:
    return MissionSpec.model_validate(search_json(**changes))
