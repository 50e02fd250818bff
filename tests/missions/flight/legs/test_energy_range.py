"""How ways home are flown: no deeper than the known bottom allows on each piece of them."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from shapely import LineString, Polygon

from app.exploration.core.bottom import Bottom
from app.missions.fleet.interface import Position, VehicleReport, WaypointOrder
from app.missions.flight.legs.energy_range import EnergyRange
from app.missions.flight.way_home.onboard_way import positions
from app.missions.service import MissionService
from app.missions.task.constraints import make_constraints
from tests.support.missions.harbour import sim_spec
from tests.support.missions.specs import lon_lat


async def test_each_piece_of_a_way_keeps_its_height_above_the_bottom(service: MissionService) -> None:
    """A shoal beside the straight line to a corner is on the piece before it; its depth counts for no other piece."""
    limits = {"min_depth_m": 6.0, "max_depth_m": 20.0, "min_altitude_m": 1.0, "max_step_m": 20.0}
    view = await service.create(sim_spec("a", side_m=100.0, limits=limits))
    live = await service.get(view.id)
    depth = np.full((10, 10), 30.0)
    depth[8:, 4:6] = 4.0
    bottom = Bottom(0.0, 0.0, 10.0, depth)
    energy_range = EnergyRange(live, make_constraints(live.spec), cast("Any", SimpleNamespace(bottom=bottom)))
    way = np.array([[5.0, 95.0], [95.0, 95.0], [95.0, 5.0]])
    member = live.team.members["a"]
    assert energy_range.depths_m(member, np.array([5.0, 5.0]), way) == [6.0, 3.0, 6.0]


@pytest.mark.parametrize(
    ("start", "end", "first"), [((30.0, 20.0), (70.0, 20.0), True), ((5.0, 20.0), (5.0, 60.0), False)]
)
async def test_a_vehicle_that_is_left_alone_on_a_leg_comes_home_round_zones_from_anywhere_on_it(
    service: MissionService, start: tuple[float, float], end: tuple[float, float], first: bool
) -> None:
    """Its way from where it was asked for does not do: seen in still water, one went through a zone after a kill."""
    zone = [(40.0, 40.0), (60.0, 40.0), (60.0, 60.0), (40.0, 60.0), (40.0, 40.0)]
    ring = [lon_lat(*corner) for corner in zone]
    view = await service.create(
        sim_spec(
            "a",
            side_m=100.0,
            keep_out=[{"type": "Polygon", "coordinates": [ring]}],
            recovery={"point": lon_lat(50.0, 95.0)},
        )
    )
    live = await service.get(view.id)
    bottom = Bottom(0.0, 0.0, 10.0, np.full((10, 10), 30.0))
    committing = SimpleNamespace(bottom=bottom, followed_to_m=lambda _member, end_m: end_m)
    energy_range = EnergyRange(live, make_constraints(live.spec), cast("Any", committing))
    member = live.team.members["a"]
    lon, lat = lon_lat(*start)
    member.report = VehicleReport("a", 0.0, Position(lat, lon, 2.0))
    order = WaypointOrder(live.id, 1, "a", Position(lat, lon, 2.0), 1.0, 3.0, min_altitude_m=1.0)
    member.set_order(order, np.array(end))
    way = energy_range.way_left_alone(member)
    assert way is not None
    assert bool(np.hypot(*(way[0] - end)) < 1e-9) is first
    obstacle = Polygon(zone)
    begins = np.array(start) + np.linspace(0.0, 1.0, 41)[:, None] * (np.array(end) - np.array(start))
    for begin in begins:
        assert not LineString([begin, *way]).intersects(obstacle)
    np.testing.assert_allclose(way[-1], (50.0, 95.0), atol=0.01)


async def test_vehicles_go_home_at_depths_apart_where_the_water_is_too_shallow_for_their_own(
    service: MissionService,
) -> None:
    limits = {"min_depth_m": 6.0, "max_depth_m": 20.0, "min_altitude_m": 1.0, "max_step_m": 20.0}
    view = await service.create(sim_spec("a", "b", side_m=100.0, limits=limits))
    live = await service.get(view.id)
    bottom = Bottom(0.0, 0.0, 10.0, np.full((10, 10), 4.0))
    energy_range = EnergyRange(live, make_constraints(live.spec), cast("Any", SimpleNamespace(bottom=bottom)))
    here, way = np.array([5.0, 5.0]), np.array([[95.0, 5.0]])
    depths = {name: energy_range.depths_m(live.team.members[name], here, way) for name in ("a", "b")}
    assert depths == {"a": [2.0], "b": [3.0]}
    # And on board, too: along the way below, up only at its place.
    places = positions(live.spec, way, depths["b"])
    assert [place.depth_m for place in places] == [3.0, 0.0]
    assert (places[0].lat_deg, places[0].lon_deg) == (places[1].lat_deg, places[1].lon_deg)
