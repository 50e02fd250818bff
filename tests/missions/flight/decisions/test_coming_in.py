"""Vehicles that begin outside their area, and come into it round keep-out zones."""

import numpy as np
import pytest

from app.missions.fleet.links import sim
from app.missions.service import MissionService
from app.missions.states import MissionState
from simulator.floors.terrain import Terrain
from tests.support.missions.harbour import act, sim_spec, until_state
from tests.support.missions.specs import lon_lat, rectangle

pytestmark = pytest.mark.usefixtures("simulated_time")


@pytest.mark.slow
@pytest.mark.parametrize(
    "beside", [((62.4, 46.7), (65.1, 47.5)), ((62.5, 48.5), (64.2, 50.2)), ((55.6, 51.2), (60.7, 51.8))]
)
async def test_two_that_begin_beside_each_other_behind_a_zone_do_not_wait_for_each_other(
    beside: tuple[tuple[float, float], tuple[float, float]],
    service: MissionService,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Each of them was in the way of the other's only way in, and the mission went on for ever."""
    floor = Terrain(np.full((100, 100), 8.0), 1.0)
    monkeypatch.setattr(sim, "lay", lambda _, launch: floor.placed_at(*launch.south_west))
    spec = sim_spec(
        area=rectangle(0, 0, 25, 90),
        keep_out=[rectangle(40, 35, 50, 55)],
        vehicles=[
            {"name": name, "kind": "sim", "start": lon_lat(*place)} for name, place in zip("ab", beside, strict=True)
        ],
        steps=9,
        cell_m=5.0,
        planner={"name": "lawnmower"},
        limits={"max_step_m": 20.0, "keep_out_margin_m": 3.0, "min_separation_m": 8.0},
    )
    mission = (await service.create(spec)).id
    await act(service, mission, "start")
    view = await until_state(service, mission, MissionState.FINISHED)
    assert {str(waypoint.status) for waypoint in view.waypoints} == {"reached"}
