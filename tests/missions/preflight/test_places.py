"""What the checklist says of where vehicles are."""

from datetime import timedelta

import pytest

from app.missions.clock import now
from app.missions.fleet.interface import Position, VehicleReport
from app.missions.preflight.survey import preflight
from app.missions.service import MissionService
from tests.support.missions.harbour import sim_spec
from tests.support.missions.specs import LAT, LON


@pytest.mark.parametrize(
    ("place", "status", "words"),
    [
        ((LAT + 1e-4, LON + 1e-4), "ok", "in the area"),
        ((LAT - 0.01, LON + 1e-4), "warning", "it is 1111 m from the area"),
        ((0.0, 0.0), "warning", "km from the area"),
        ((-LAT, LON), "warning", "km from the area"),
    ],
    ids=["in it", "a kilometre away", "without a fix", "on the other side of the world"],
)
async def test_it_says_how_far_from_the_area_a_vehicle_is(
    service: MissionService, place: tuple[float, float], status: str, words: str
) -> None:
    live = await service.get((await service.create(sim_spec("a"))).id)
    told_at = now() - timedelta(seconds=1)
    live.team.members["a"].report = VehicleReport("a", told_at.timestamp(), Position(*place, 0.0))
    [check] = [one for one in preflight(live).checks if one.id == "place.a"]
    assert check.status == status
    assert words in check.message
    away_km = check.message.removeprefix("it is ").removesuffix(" km from the area")
    if away_km.isdigit():
        assert 100 < int(away_km) <= 20004
