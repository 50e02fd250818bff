"""What the checklist says of the area."""

from typing import Any

import pytest

from app.missions.preflight.survey import preflight
from app.missions.service import MissionService
from tests.support.missions.harbour import sim_spec


@pytest.mark.parametrize(
    ("fast", "limits", "words"),
    [
        ({}, {}, "up to 10 m outside"),
        ({"speed_mps": 2.5}, {}, "up to 20 m outside"),
        ({"turn_radius_m": 3.0}, {}, "up to 10 m outside"),
        ({"speed_mps": 2.5}, {"border_margin_m": 15.0}, "up to 5 m outside"),
        ({"speed_mps": 2.5}, {"border_margin_m": 20.0}, ""),
    ],
    ids=["as fast as the mission", "a faster one", "the other one turns wider", "less by the margin", "none"],
)
async def test_it_says_how_far_turns_lead_outside(
    service: MissionService, fast: dict[str, Any], limits: dict[str, float], words: str
) -> None:
    vehicles = [{"name": "a", "kind": "sim"} | fast, {"name": "b", "kind": "sim"}]
    spec = sim_spec(side_m=100.0, vehicles=vehicles, speed_mps=1.2, limits={"max_step_m": 20.0} | limits)
    live = await service.get((await service.create(spec)).id)
    [check] = [one for one in preflight(live).checks if one.id == "area"]
    assert check.status == "ok"
    assert words in check.message
    assert bool(words) == ("outside" in check.message)
