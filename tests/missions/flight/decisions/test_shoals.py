"""Surveys over areas with shoals that nobody knew of, and over which vehicles cannot go."""

import asyncio

import numpy as np
import pytest

from app.missions.fleet.links import sim
from app.missions.service import MissionService
from app.missions.states import MissionState
from benchmarks.missions.unknown_shoals import longest_stay
from simulator.floors.terrain import Terrain
from tests.support.missions.harbour import act, sim_spec, until_state

pytestmark = pytest.mark.usefixtures("simulated_time")

SIDE_M = 80
SHOALS = ((24.0, 50.0, 9.0), (52.0, 28.0, 11.0), (60.0, 66.0, 6.0))
"""East, north and radius, metres; half a metre deep."""


def shoals() -> Terrain:
    """Six metres deep, rising to the shoals with a slope of one in two."""
    middle = np.arange(0.5, SIDE_M + 10.0)
    east, north = np.meshgrid(middle, middle)
    depth_m = np.full(east.shape, 6.0)
    for x, y, radius_m in SHOALS:
        beside_m = np.clip(np.hypot(east - x, north - y) - radius_m, 0.0, None)
        depth_m = np.minimum(depth_m, 0.5 + 0.5 * beside_m)
    return Terrain(depth_m, 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("planner", ["lawnmower", "cao"])
async def test_a_survey_goes_round_shoals_and_maps_the_ground_between_them(
    planner: str, service: MissionService, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Vehicles stood before a shoal on their line for minutes, each of which took its share of their way."""
    monkeypatch.setattr(sim, "lay", lambda _, launch: shoals().placed_at(*launch.south_west))
    spec = sim_spec(
        "a",
        "b",
        side_m=SIDE_M,
        budget={"minutes": 12},
        cell_m=4.0,
        planner={"name": planner},
        limits={"max_step_m": 20},
    )
    mission = (await service.create(spec)).id
    live = await service.get(mission)
    await act(service, mission, "start")
    places: dict[str, list[tuple[float, float]]] = {"a": [], "b": []}
    while live.header.state == MissionState.RUNNING:
        for member in live.team.plannable:
            # What is compiled for a planner in a thread of its own takes time, where nobody compiled it before.
            if member.report is not None and member.legs:
                east_m, north_m = member.place_m(live.frame)
                places[member.name].append((float(east_m), float(north_m)))
        await asyncio.sleep(1.0 / service.settings.time_scale)
    await until_state(service, mission, MissionState.FINISHED)
    for name, way in places.items():
        assert longest_stay(way) < 90, name
    await live.map.build()
    assert (live.progress().coverage_pct or 0.0) > 60.0
