"""Everything that a mission tells of the world is near its area; a mistake there is told by its name."""

from typing import Any

import pytest
from pydantic import ValidationError

from app.missions.errors import InvalidRequestError
from app.missions.service import MissionService
from app.missions.spec.mission import MissionSpec
from app.missions.spec.vehicle import VehicleSpec
from app.storage.database import Database
from app.storage.models import MissionRow
from tests.support.missions.harbour import Harbour, sim_spec
from tests.support.missions.specs import lon_lat, rectangle, spec_json


def swapped(polygon: dict[str, Any]) -> dict[str, Any]:
    return polygon | {"coordinates": [[[lat, lon] for lon, lat in ring] for ring in polygon["coordinates"]]}


ZONE = swapped(rectangle(5, 5, 10, 10))
SEARCH = {"goal": lon_lat(20, 20), "goal_radius_m": 5.0, "entry": lon_lat(2, 2), "window_s": 600.0}


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"keep_out": [rectangle(5, 5, 10, 10), ZONE]}, "keep_out.1"),
        ({"kind": "search", "search": SEARCH | {"obstacles": [ZONE]}}, "search.obstacles.0"),
        ({"kind": "search", "search": SEARCH | {"simulated_obstacles": [ZONE]}}, "search.simulated_obstacles.0"),
        ({"kind": "search", "search": SEARCH | {"transmitter": lon_lat(5, 5)[::-1]}}, "search.transmitter"),
    ],
)
def test_latitude_and_longitude_swapped_are_told_by_field(changes: dict[str, Any], name: str) -> None:
    described = spec_json(vehicles=[{"name": "a", "kind": "sim"}]) | changes
    if "search" in changes:
        described = {key: value for key, value in described.items() if key not in ("steps", "planner", "limits")}
    with pytest.raises(ValidationError, match=f"{name} is at .* nowhere near the area"):
        MissionSpec.model_validate(described)


def test_the_corner_that_is_far_away_is_told() -> None:
    ring = [lon_lat(5, 5), lon_lat(10, 5), (8.0, 41.0), lon_lat(5, 5)]
    with pytest.raises(ValidationError, match=r"keep_out\.0 is at \[8\.0, 41\.0\], nowhere near the area"):
        sim_spec(keep_out=[{"coordinates": [ring]}])


def test_an_area_across_the_line_of_180_degrees_is_refused() -> None:
    ring = [[179.999, 10.0], [-179.999, 10.0], [-179.999, 10.002], [179.999, 10.002], [179.999, 10.0]]
    with pytest.raises(ValidationError, match="crosses 180 degrees"):
        sim_spec(area={"type": "Polygon", "coordinates": [ring]})


async def test_who_joins_with_a_recovery_point_far_away_is_refused(service: MissionService) -> None:
    live = await service.get((await service.create(sim_spec("a"))).id)
    far = VehicleSpec.model_validate({"name": "b", "kind": "sim", "recovery_point": lon_lat(5, 5)[::-1]})
    with pytest.raises(InvalidRequestError, match="nowhere near the area") as caught:
        await service.team_changes.join(live, far, "Ana")
    assert caught.value.field == "recovery_point"
    assert [member.name for member in live.team] == ["a"]


async def test_a_mission_that_cannot_be_read_hides_no_other_and_keeps_no_service_from_starting(
    harbour: Harbour, database: Database
) -> None:
    good, bad = [(await harbour.service.create(sim_spec(name))).id for name in ("a", "b")]
    async with database.writing() as session:
        row = await session.get_one(MissionRow, bad)
        row.spec = row.spec | {"of_a_newer_version": True}
        for stored in (row, await session.get_one(MissionRow, good)):
            stored.state = "paused"
    service = await harbour.reopen()
    assert [summary.id for summary in await service.missions()] == [good]
