"""Vehicles of different missions, and those that no mission leads: ours give way to them, too."""

import asyncio
import math
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

import pytest

from app.missions.fleet.interface import LinkCapabilities, LinkState, Position, VehicleInfo, VehicleReport
from app.missions.flight.legs.commit import NO_LEG
from app.missions.flight.legs.other_vehicles import UNHEARD_S, OtherVehicles
from app.missions.operations.history import events_after
from app.missions.service import MissionService
from app.missions.spec.vehicle import VehicleKind
from tests.support.missions.harbour import sim_spec
from tests.support.missions.placed import Place, PlacedVehicles
from tests.support.missions.specs import FRAME

WEST, EAST = (5.0, 30.0, 3.0), (50.0, 30.0, 3.0)
AT_SEA = LinkCapabilities(circles_m=10.0)
LIMITS = {"max_step_m": 20.0, "min_separation_m": 5.0}

Scene = Callable[..., Awaitable[PlacedVehicles]]


@pytest.fixture
async def scene(service: MissionService, monkeypatch: pytest.MonkeyPatch) -> Scene:
    """Make missions of vehicles at sea that know of each other."""
    others = OtherVehicles(service.hub, 1.0)

    async def make(*names: str, capabilities: LinkCapabilities = AT_SEA, **changes: object) -> PlacedVehicles:
        spec = sim_spec(*names, **({"side_m": 60.0, "limits": LIMITS} | changes))
        live = await service.get((await service.create(spec)).id)
        placed = PlacedVehicles(live, service.hub, monkeypatch, others)
        for member in live.team:
            member.capabilities = capabilities
        return placed

    return make


@dataclass
class Heard:
    """A vehicle that this service hears of, and no mission leads."""

    name: str = "stranger"
    place: Place = EAST
    speed_mps: float | None = 1.0
    heading_deg: float | None = 270.0
    age_s: float = 0.0
    time_s: float = 100.0

    @property
    def info(self) -> VehicleInfo:
        lat, lon = map(float, FRAME.to_geographic(self.place[0], self.place[1]))
        heading_rad = None if self.heading_deg is None else math.radians(self.heading_deg)
        report = VehicleReport(self.name, self.time_s, Position(lat, lon, self.place[2]), heading_rad, self.speed_mps)
        return VehicleInfo(self.name, VehicleKind.IMC, LinkState.READY, age_s=self.age_s, report=report)


def hear(service: MissionService, monkeypatch: pytest.MonkeyPatch, *vehicles: Heard) -> None:
    monkeypatch.setattr(service.hub, "vehicles", lambda: [(vehicle.info, None) for vehicle in vehicles])


async def test_of_two_missions_vehicles_that_head_for_each_other_one_gives_way(scene: Scene) -> None:
    one, other = await scene("a", name="Harbour"), await scene("b", name="Quay")
    one.put("a", WEST, EAST)
    other.put("b", EAST, WEST)
    with one.others.flown(one.giving_way.led), one.others.flown(other.giving_way.led):
        for _ in range(2):
            for it in (one, other):
                await it.giving_way.look()
        orders = one.ordered + other.ordered
        [waits] = {order.vehicle: order for order in orders}.values()
        gives, passes = (one, other) if waits.vehicle == "a" else (other, one)
        assert waits.step == NO_LEG
        assert abs(gives.where_m(waits)[1] - 30.0) > LIMITS["min_separation_m"], "off the other one's way"
        name = passes.live.spec.name
        [said] = [event.message for event in await events_after(gives.live) if "gives way" in event.message]
        assert name in said
        assert not [event for event in await events_after(passes.live) if "gives way" in event.message]

        # It goes on when the other one is past.
        [giving], [passing] = list(gives.live.team), list(passes.live.team)
        gives.put(giving.name, (*gives.where_m(waits), 3.0), EAST)
        past = (58.0, 30.0, 3.0) if passing.name == "a" else (1.0, 30.0, 3.0)
        passes.put(passing.name, past, past)
        await gives.giving_way.look()
        assert giving.waits_m is None


async def test_the_more_careful_mission_says_how_far_apart(scene: Scene) -> None:
    one, other = await scene("a"), await scene("b", limits=LIMITS | {"min_separation_m": 12.0})
    one.put("a", WEST, EAST)
    other.put("b", (50.0, 39.0, 3.0), (5.0, 39.0, 3.0))
    with one.others.flown(one.giving_way.led), one.others.flown(other.giving_way.led):
        await one.giving_way.look()
        await other.giving_way.look()
    assert len(one.ordered + other.ordered) == 1


@pytest.mark.parametrize("which", [0, 1])
async def test_who_can_be_led_aside_gives_way_to_another_missions_that_cannot(scene: Scene, which: int) -> None:
    polls = LinkCapabilities()
    missions = [await scene(name, capabilities=polls if k == which else AT_SEA) for k, name in enumerate("ab")]
    missions[0].put("a", WEST, EAST)
    missions[1].put("b", EAST, WEST)
    others = missions[0].others
    with others.flown(missions[0].giving_way.led), others.flown(missions[1].giving_way.led):
        for it in missions:
            await it.giving_way.look()
    assert {order.vehicle for it in missions for order in it.ordered} == {"ba"[which]}


@pytest.mark.parametrize("which", [0, 1])
async def test_a_mission_that_keeps_nobody_apart_has_nobody_led_aside(scene: Scene, which: int) -> None:
    """It would never send them on."""
    careless = LIMITS | {"min_separation_m": 0.0}
    missions = [await scene(name, limits=careless if k == which else LIMITS) for k, name in enumerate("ab")]
    missions[0].put("a", WEST, EAST)
    missions[1].put("b", EAST, WEST)
    others = missions[0].others
    with others.flown(missions[0].giving_way.led), others.flown(missions[1].giving_way.led):
        await missions[1 - which].giving_way.look()
    assert {order.vehicle for it in missions for order in it.ordered} == {"ba"[which]}


@pytest.mark.parametrize(
    ("heard", "meets"),
    [
        (Heard(), True),
        (Heard(age_s=20.0, place=(70.0, 30.0, 3.0)), True),
        (Heard(place=(50.0, 30.0, 5.0)), False),
        (Heard(heading_deg=90.0), False),
        (Heard(speed_mps=0.0), False),
        (Heard(speed_mps=None), False),
        (Heard(heading_deg=None), False),
        (Heard(age_s=UNHEARD_S + 1.0), False),
        (Heard(place=(50.0, 60_000.0, 3.0)), False),
        (Heard(name="a"), False),
    ],
    ids=[
        "head-on",
        "heard a while ago",
        "below",
        "away",
        "stands",
        "tells no speed",
        "tells no heading",
        "not heard for long",
        "far away",
        "the same vehicle, heard by another link",
    ],
)
async def test_a_vehicle_that_no_mission_leads_is_given_way_to(
    service: MissionService, monkeypatch: pytest.MonkeyPatch, scene: Scene, heard: Heard, meets: bool
) -> None:
    one = await scene("a")
    one.put("a", WEST, EAST)
    hear(service, monkeypatch, heard)
    await one.giving_way.look()
    assert [order.vehicle for order in one.ordered] == ["a"] * meets
    said = [event.message for event in await events_after(one.live) if "gives way" in event.message]
    assert said == ["a gives way to stranger, which no mission leads"] * meets


@pytest.mark.usefixtures("simulated_time")
@pytest.mark.parametrize(("turn_deg", "meets"), [(0.0, True), (-5.0, False)], ids=["straight on", "it circles"])
async def test_one_that_circles_comes_no_nearer_than_its_circle(
    service: MissionService, monkeypatch: pytest.MonkeyPatch, scene: Scene, turn_deg: float, meets: bool
) -> None:
    """Where a vehicle that circles heads is not where it goes."""
    one = await scene("a")
    one.put("a", WEST, (5.5, 30.0, 3.0))
    hear(service, monkeypatch, Heard(place=(46.0, 30.0, 3.0), heading_deg=270.0 - turn_deg))
    await one.giving_way.look()
    assert not one.ordered
    await asyncio.sleep(1.0)
    one.put("a", WEST, EAST, anew=True)
    hear(service, monkeypatch, Heard(place=(45.0, 30.0, 3.0), heading_deg=270.0, time_s=101.0))
    await one.giving_way.look()
    assert [order.vehicle for order in one.ordered] == ["a"] * meets


async def test_simulated_vehicles_meet_nobody_elses(
    service: MissionService, monkeypatch: pytest.MonkeyPatch, scene: Scene
) -> None:
    one = await scene("a", capabilities=LinkCapabilities(simulated=True))
    one.put("a", WEST, EAST)
    hear(service, monkeypatch, Heard())
    await one.giving_way.look()
    assert not one.ordered
