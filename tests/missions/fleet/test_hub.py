"""Links together: commands go to the right one, events to the mission that claimed the vehicle."""

from collections.abc import AsyncIterator
from typing import Any

import pytest

from app.missions.errors import ConflictError
from app.missions.fleet.hub import FleetHub
from app.missions.fleet.interface import (
    FleetEvent,
    LinkCapabilities,
    LinkState,
    Position,
    VehicleRefusedError,
    VehicleReport,
    WaypointOrder,
)
from app.missions.fleet.links.rest import RestFleetLink
from app.missions.fleet.links.sim import SimFleetLink
from app.missions.settings import SimulationSettings
from app.missions.spec.vehicle import VehicleKind, VehicleSpec
from app.missions.team import Team
from tests.support.missions.specs import LAT, LON

A = (VehicleKind.REST, "a")
HERE = Position(LAT, LON, 1.0)


def report(name: str = "a") -> VehicleReport:
    return VehicleReport(name, 1.0, HERE)


@pytest.fixture
async def rest() -> RestFleetLink:
    return RestFleetLink()


@pytest.fixture
async def hub(rest: RestFleetLink) -> AsyncIterator[Any]:
    hub = FleetHub([rest, SimFleetLink(SimulationSettings(), 10.0)])
    await hub.start()
    yield hub
    await hub.close()


async def test_events_reach_the_mission_that_claimed_the_vehicle_and_no_other(
    hub: FleetHub, rest: RestFleetLink
) -> None:
    first: list[FleetEvent] = []
    second: list[FleetEvent] = []
    hub.claim(A, "m1", first.append, name="One")
    hub.claim((VehicleKind.REST, "b"), "m2", second.append, name="Two")
    hub.claim((VehicleKind.SIM, "a"), "m2", second.append, name="Two")
    rest.heard(report())
    assert report() in first
    assert second == []
    hub.release(A, "m1")
    rest.heard(report())
    assert first.count(report()) == 1


async def test_a_vehicle_belongs_to_one_mission_at_a_time(hub: FleetHub) -> None:
    hub.claim(A, "m1", lambda _: None, name="One")
    hub.claim(A, "m1", lambda _: None, name="One")
    with pytest.raises(ConflictError, match=r"'a' takes part in mission 'One' \(m1\)") as caught:
        hub.claim(A, "m2", lambda _: None, name="Two")
    assert "DELETE" in caught.value.remedy
    hub.release(A, "m2")
    assert hub.claimed_by(A) == "m1"
    hub.release(A, "m1")
    hub.claim(A, "m2", lambda _: None, name="Two")
    assert hub.claimed_by(A) == "m2"


async def test_what_is_known_of_a_vehicle(hub: FleetHub, rest: RestFleetLink) -> None:
    assert hub.info(A).state is LinkState.UNKNOWN
    assert "not heard since the service was started" in hub.info(A).reason
    rest.heard(report())
    assert (hub.info(A).state, hub.info(A).report) == (LinkState.READY, report())
    hub.claim(A, "m1", lambda _: None, name="One")
    assert [(info.name, owner) for info, owner in hub.vehicles()] == [("a", "m1")]


async def test_vehicles_of_a_kind_that_is_switched_off_are_refused_with_a_remedy(hub: FleetHub) -> None:
    key = (VehicleKind.IMC, "lauv")
    assert "switched off in the settings" in hub.info(key).reason
    with pytest.raises(VehicleRefusedError, match="switched off") as caught:
        await hub.engage(key)
    assert caught.value.remedy
    with pytest.raises(VehicleRefusedError, match="switched off"):
        await hub.order(key, WaypointOrder("m", 1, "lauv", HERE, 1.0, 3.0, 1.0))
    receipt = await hub.stop(key)
    assert not receipt.acknowledged
    assert "switched off" in receipt.detail


async def test_a_link_says_itself_what_its_vehicles_can_do() -> None:
    class Craft(RestFleetLink):
        kind = "imc"
        capabilities = LinkCapabilities(simulated=True, circles_m=7.0)

    hub = FleetHub([Craft(), RestFleetLink()])
    team = Team(hub.capabilities)
    members = [team.join(VehicleSpec(name=kind, kind=VehicleKind(kind)), 0) for kind in ("imc", "rest", "neptus")]
    assert [member.capabilities.circles_m for member in members] == [7.0, 0.0, 0.0]
    assert "launched when its mission starts" in hub.info(members[0].key).reason
    assert "not heard since the service was started" in hub.info(members[1].key).reason
    # Nobody comes over a link that is switched off: no mission may wait for that.
    assert [member.capabilities.ready_before_start for member in members] == [False, False, True]
    assert list(hub.polled) == [VehicleKind.IMC, VehicleKind.REST]


async def test_one_links_trouble_does_not_keep_the_others_from_closing() -> None:
    class Broken(RestFleetLink):
        async def close(self) -> None:
            await super().close()
            raise OSError("socket gone")

    sim = SimFleetLink(SimulationSettings(), 10.0)
    hub = FleetHub([Broken(), sim])
    await hub.start()
    await hub.close()
    assert sim._task is not None
    assert sim._task.done()


async def test_ways_home_go_to_links_that_keep_them(hub: FleetHub) -> None:
    assert not hub.capabilities(VehicleKind.REST).keeps_way_home
    with pytest.raises(VehicleRefusedError, match="keep no way home"):
        await hub.keep_way_home(A, [HERE], 1.0)
    await hub.drop_way_home(A)
    with pytest.raises(VehicleRefusedError, match="switched off"):
        await hub.keep_way_home((VehicleKind.IMC, "a"), [HERE], 1.0)
