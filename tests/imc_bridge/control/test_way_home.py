"""A way home on board: stored, replaced, armed and disarmed, and flown when nobody is heard any more."""

import asyncio
import math
from itertools import pairwise
from typing import Any

import imcpy
import numpy as np
import pytest

from imc_bridge import Bridge, BridgeSettings, LinkChange, NodeState, RefusedError, Waypoint, WaypointStatus
from imc_bridge.control.altitude_guard import AltitudeGuard
from imc_bridge.control.depth_layers import DepthLayer
from imc_bridge.control.plans import HOME_RADIUS_M
from imc_bridge.control.way_home import guarded, home_plan
from imc_bridge.nodes.node import Node
from simulator.dune.node import FakeDune
from simulator.dune.plan import PlanState
from tests.support.imc.sea import Sea, open_sea
from tests.support.waiting import until

TIMEOUT_S = 60.0
HOME_M = (20.0, 20.0)


def way(sea: Sea, *places: tuple[float, float], depth_m: float = 0.0) -> list[Waypoint]:
    return [sea.waypoint(k, east, north, depth_m) for k, (east, north) in enumerate(places)]


def dune(sea: Sea) -> FakeDune:
    return sea.fleet.nodes[0]


def on_board(sea: Sea, name: str = "lostcomms") -> Any:
    return dune(sea).database.plans.get(name)


def said(sea: Sea) -> str:
    (node,) = sea.bridge.nodes()
    return node.way_home


async def at_home(sea: Sea, home: tuple[float, float] = HOME_M) -> None:
    vehicle = dune(sea).vehicle
    await until(
        lambda: vehicle.position.horizontal_distance_m(*home) < 15.0 and vehicle.position.depth_m < 0.3, "it is home"
    )


def test_the_plan_goes_from_place_to_place_and_stays_at_the_last() -> None:
    places = [Waypoint("home", k, 41.185 + k * 1e-3, -8.705, 1.5, speed_mps=1.1) for k in range(3)]
    plan = imcpy.Packet.deserialize(imcpy.Packet.serialize(home_plan("lostcomms", "bathyfleet home", places)))
    assert plan.plan_id == "lostcomms"
    names = [item.maneuver_id for item in plan.maneuvers]
    assert names == [*(f"bathyfleet home {k}" for k in (1, 2, 3)), "bathyfleet home end"]
    assert plan.start_man_id == names[0]
    assert [(t.source_man, t.dest_man) for t in plan.transitions] == list(pairwise(names))
    *gotos, end = (item.data for item in plan.maneuvers)
    assert [math.degrees(goto.lat) for goto in gotos] == pytest.approx([41.185, 41.186, 41.187])
    assert [(goto.z, goto.speed) for goto in gotos] == [(1.5, pytest.approx(1.1))] * 3
    assert (end.z, end.duration, end.lat) == (0.0, 0, gotos[-1].lat)
    assert end.radius == HOME_RADIUS_M, "others wait beside it"


def test_its_depths_are_those_that_the_bottom_allows() -> None:
    guard = AltitudeGuard(20.0, 30.0, unknown_bottom_depth_m=2.0)
    node = Node(0x101, "a", BridgeSettings(), 0.0)
    places = [Waypoint("home", k, 41.185 + k * 0.02, -8.705, 9.0, min_altitude_m=3.0) for k in range(2)]
    assert [place.depth_m for place in guarded(places, guard, node, 0.0)] == [2.0, 2.0]
    # A shoal of 7 m, 1.4 km along the second leg: farther than the guard looks at once.
    for k in range(200):
        for _ in range(3):
            lat = 41.185 + k * 1e-4
            guard.add(0.0, lat, -8.705, 7.0 if lat > 41.198 else 40.0)
    assert [place.depth_m for place in guarded(places, guard, node, 0.0)] == [9.0, 4.0]
    # And on to where nothing is known.
    places[1] = Waypoint("home", 1, 41.225, -8.705, 9.0, min_altitude_m=3.0)
    assert [place.depth_m for place in guarded(places, guard, node, 0.0)] == [9.0, 2.0]


def test_vehicles_of_a_team_go_home_at_depths_apart_where_the_bottom_is_not_known() -> None:
    guard = AltitudeGuard(20.0, 30.0, unknown_bottom_depth_m=2.0)
    node = Node(0x101, "a", BridgeSettings(), 0.0)
    found = []
    for rank, cruise_m in enumerate(team := (4.0, 6.0, 8.0)):
        layer = DepthLayer(team, rank, 1.0)
        places = [Waypoint("home", k, 41.185 + k * 1e-3, -8.705, depth_m) for k, depth_m in enumerate((cruise_m, 0.0))]
        found.append([place.depth_m for place in guarded(places, guard, node, 0.0, layer)])
    assert np.diff([first for first, _ in found]) == pytest.approx([2 / 3, 2 / 3])
    assert [last for _, last in found] == [0.0] * 3
    assert found[-1][0] == 2.0
    assert found[0][0] > 0.5, "not at the surface, where others wait"


async def test_it_is_stored_replaced_and_removed() -> None:
    async with open_sea(lost_comms_s=TIMEOUT_S) as sea:
        (name,) = await sea.ready()
        assert said(sea) == ""
        await sea.bridge.keep_way_home(name, way(sea, (50, 40), HOME_M))
        assert len(on_board(sea).maneuvers) == 3
        assert said(sea) == "kept on board, started after 60 s without a console"
        await sea.bridge.keep_way_home(name, way(sea, HOME_M))
        assert len(on_board(sea).maneuvers) == 2
        there = on_board(sea)
        await sea.bridge.keep_way_home(name, way(sea, HOME_M))
        assert on_board(sea) is there, "it is not stored twice"
        await sea.bridge.drop_way_home(name)
        assert on_board(sea) is None
        assert said(sea) == ""
        await sea.bridge.drop_way_home(name)


async def test_it_is_stored_under_the_name_that_the_vehicle_expects_and_in_spite_of_losses() -> None:
    async with open_sea(loss=0.1, lost_comms_s=TIMEOUT_S, lost_comms_plan="lost_comms") as sea:
        (name,) = await sea.ready()
        await until(lambda: sea.bridge.nodes()[0].entities, "its entities are known")
        await sea.bridge.keep_way_home(name, way(sea, HOME_M))
        assert on_board(sea, "lost_comms") is not None


async def test_without_the_supervisor_it_is_refused() -> None:
    async with open_sea() as sea:
        (name,) = await sea.ready()
        await until(lambda: sea.bridge.nodes()[0].entities, "its entities are known")
        with pytest.raises(RefusedError, match="LostComms is not enabled") as refused:
            await sea.bridge.keep_way_home(name, way(sea, HOME_M))
        assert "supervisors" in refused.value.remedy.casefold()
        assert on_board(sea) is None
        with pytest.raises(RefusedError, match="0 places"):
            await sea.bridge.keep_way_home(name, [])
        with pytest.raises(RefusedError, match="never heard of"):
            await sea.bridge.keep_way_home("nobody", way(sea, HOME_M))


async def test_a_silent_vehicle_is_not_waited_for_and_gets_it_when_it_is_heard_again() -> None:
    async with open_sea(lost_comms_s=TIMEOUT_S) as sea:
        (name,) = await sea.ready()
        await sea.vanish()
        await until(lambda: sea.state(name) is NodeState.LOST, "it is lost")
        with pytest.raises(RefusedError, match="out of reach"):
            await sea.bridge.keep_way_home(name, way(sea, HOME_M))
        await sea.launch()
        await until(lambda: on_board(sea) is not None and said(sea).startswith("kept"), "it has it")


@pytest.mark.slow
async def test_when_the_console_dies_the_vehicle_goes_home_and_the_next_one_takes_it_over() -> None:
    async with open_sea(family="flat", lost_comms_s=TIMEOUT_S) as sea:
        (name,) = await sea.ready()
        await sea.bridge.engage(name)
        await sea.bridge.keep_way_home(name, way(sea, (40, 60), HOME_M))
        sea.bridge.goto(name, sea.waypoint(1, 70, 70, 2.0))
        await sea.reached(name, 1)
        bridge = sea.bridge
        assert bridge._task is not None
        bridge._task.cancel()
        await asyncio.gather(bridge._task, return_exceptions=True)
        bridge._task = None
        bridge.transport.close()
        await at_home(sea)
        assert dune(sea).plan.plan_control_state().plan_id == "lostcomms"
        again: Bridge = await sea.connect()
        await until(lambda: "goes home" in again.nodes()[0].reason if again.nodes() else False, "it is heard")
        assert sea.state(name) is NodeState.IN_PLAN
        assert again.nodes()[0].goes_home
        await until(lambda: any(change.goes_home for change in sea.of(LinkChange)), "that is told")
        await again.engage(name)
        await until(lambda: not again.nodes()[0].goes_home, "it is ours again")
        sea.bridge.goto(name, sea.waypoint(2, 50, 50, 1.0))
        await sea.reached(name, 2)
        assert sea.statuses(name, 2)[-1] is WaypointStatus.REACHED


async def test_a_vehicle_on_its_way_home_can_be_stopped() -> None:
    async with open_sea(family="flat", lost_comms_s=TIMEOUT_S) as sea:
        (name,) = await sea.ready()
        await sea.bridge.keep_way_home(name, way(sea, (90, 90)))
        request = imcpy.PlanControl()
        request.plan_id = "lostcomms"
        dune(sea).plan.on_plan_control(request, dune(sea).vehicle.time_s)
        await until(lambda: "goes home" in sea.bridge.nodes()[0].reason, "it goes")
        assert (await sea.bridge.stop(name)).acknowledged
        assert dune(sea).plan.plan_state is PlanState.READY


@pytest.mark.slow
async def test_a_stopped_vehicle_stays_where_it_is_until_it_is_engaged_again() -> None:
    async with open_sea(family="flat", lost_comms_s=TIMEOUT_S) as sea:
        (name,) = await sea.ready()
        await sea.bridge.engage(name)
        await sea.bridge.keep_way_home(name, way(sea, HOME_M))
        await sea.bridge.stop(name)
        await until(lambda: on_board(sea) is None, "it is disarmed")
        assert said(sea) == "disarmed while it is stopped"
        begun_s = dune(sea).vehicle.time_s
        await until(lambda: dune(sea).vehicle.time_s > begun_s + 2.0 * TIMEOUT_S, "time has passed")
        assert dune(sea).plan.plan_state is PlanState.READY
        await sea.bridge.engage(name)
        await until(lambda: on_board(sea) is not None and said(sea).startswith("kept"), "it is armed again")


@pytest.mark.slow
async def test_a_restart_on_board_and_a_closing_bridge_leave_it_armed() -> None:
    async with open_sea(family="flat", lost_comms_s=TIMEOUT_S) as sea:
        (name,) = await sea.ready()
        await sea.bridge.engage(name)
        await sea.bridge.keep_way_home(name, way(sea, HOME_M))
        dune(sea).crash()
        supervisor = dune(sea).lost_comms
        assert supervisor is not None
        assert not supervisor.active
        await until(lambda: supervisor.active, "the supervisor knows of it again")
        await until(lambda: sea.bridge.nodes()[0].state is NodeState.IN_PLAN, "it follows again")
        await sea.bridge.close()
        await at_home(sea)
