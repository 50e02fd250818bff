"""A vehicle that got out of reach, or whose plan cannot be ended at once, comes back without anyone's help."""

from collections.abc import Callable

import imcpy
import pytest

from app.missions.fleet.links.imc import ImcFleetLink
from app.missions.operations.history import events_after
from app.missions.service import MissionService
from app.missions.settings import ImcSettings, ServiceSettings
from app.missions.spec.mission import MissionSpec
from app.missions.states import MissionState
from imc_bridge import Bridge, LinkChange, NodeState, RefusedError, WaypointStatus
from tests.support.imc.sea import Sea, open_sea
from tests.support.missions.harbour import Harbour, act, view_of
from tests.support.waiting import until

COMMANDS = {message().msg_id.to_bytes(2, "little") for message in (imcpy.PlanControl, imcpy.Abort)}
REFERENCE = imcpy.Reference().msg_id.to_bytes(2, "little")


class Deaf:
    """Keeps a bridge's messages from going out, or what comes from being taken in."""

    def __init__(self, bridge: Bridge) -> None:
        self._bridge = bridge
        self._send, self._hear = bridge.transport.send, bridge._receiver._take_packet

    def mute(self, kinds: set[bytes]) -> None:
        """Lose what is sent of these kinds."""
        self._bridge.transport.send = lambda packet, address: packet[2:4] in kinds or self._send(packet, address)

    def deafen(self) -> None:
        """Lose everything that comes in."""
        self._bridge._receiver._take_packet = lambda packet, address: None

    def hear(self) -> None:
        """Take in again what comes."""
        self._bridge._receiver._take_packet = self._hear

    def speak(self) -> None:
        """Send again."""
        self._bridge.transport.send = self._send


@pytest.mark.slow
async def test_a_vehicle_that_goes_on_with_our_plan_is_asked_until_it_hears() -> None:
    async with open_sea() as sea:
        (name,) = await sea.ready()
        await sea.bridge.engage(name)
        sea.bridge.goto(name, sea.waypoint(0, 50, 95, 1.0))
        await until(lambda: WaypointStatus.ACKNOWLEDGED in sea.statuses(name, 0), "it was acknowledged")
        go_on_for_ever(sea)
        link = Deaf(sea.bridge)
        link.mute(COMMANDS | {REFERENCE})
        link.deafen()
        await until(lambda: WaypointStatus.REFUSED in sea.statuses(name, 0), "it was given up")
        link.hear()
        await until(lambda: sea.state(name) is NodeState.IN_PLAN, "it is heard again, in our plan")
        for _ in range(2):
            with pytest.raises(RefusedError, match="executes our plan"):
                await sea.bridge.engage(name)
            assert not sea.bridge.intervention(name), "nobody wanted it so: it may be engaged again"
        link.speak()
        await until(lambda: sea.state(name) is NodeState.READY, "our plan is stopped though nobody engages it")
        await sea.bridge.engage(name)
        sea.bridge.goto(name, sea.waypoint(1, 50, 40, 1.0))
        await sea.reached(name, 1)


@pytest.mark.slow
async def test_a_mission_goes_on_by_itself_when_its_vehicle_hears_again(
    make_settings: Callable[..., ServiceSettings],
) -> None:
    speed = 10.0
    async with open_sea(connected=False, speed=speed) as sea:
        imc = ImcSettings(port=sea.settings.port, announce_ports=sea.settings.announce_ports, loopback_only=True)
        harbour = Harbour(make_settings)
        service = await harbour.open(imc=imc, time_scale=speed)
        await sea.launch()
        try:
            name = sea.fleet.nodes[0].name
            bridge = bridge_of(service)
            mission = await service.create(mission_over(sea, name, steps=3))

            async def ready() -> bool:
                return any(v.name == name and v.link == "ready" for v in await service.vehicles())

            async def said(words: str) -> bool:
                return any(words in event.message for event in await events_after(await service.get(mission.id)))

            async def step() -> int:
                return (await view_of(service, mission.id)).progress.step

            async def under_way() -> bool:
                return await step() >= 1

            async def ended() -> bool:
                return (await view_of(service, mission.id)).state in (
                    MissionState.FINISHED,
                    MissionState.FAILED,
                )

            await until(ready, "the vehicle is ready")
            await act(service, mission.id, "start", actor="tester")
            await until(under_way, "it is under way")
            link = Deaf(bridge)
            link.mute(COMMANDS | {REFERENCE})
            link.deafen()
            go_on_for_ever(sea)
            await until(lambda: said(f"{name} is lost: silent for"), "the operator is told")
            await until(lambda: not bridge.nodes()[0].engaged, "it was given up")
            link.hear()
            await until(lambda: said("executes our plan"), "engaging it again did not succeed")
            link.speak()
            await until(ended, "the mission has ended")
            view = await view_of(service, mission.id)
            assert (view.state, view.progress.step) == (MissionState.FINISHED, 3), view.reason
        finally:
            await harbour.close()


async def test_a_bridge_that_was_held_up_blames_no_vehicle() -> None:
    async with open_sea() as sea:
        (name,) = await sea.ready()
        await sea.bridge.engage(name)
        sea.bridge.goto(name, sea.waypoint(0, 50, 70, 1.0))
        await until(lambda: WaypointStatus.ACKNOWLEDGED in sea.statuses(name, 0), "it was acknowledged")
        clock, leap = sea.bridge._clock, [0.0]
        sea.bridge._clock = sea.bridge._receiver._clock = lambda: clock() + leap[0]
        # 20 s at once, 400 s of the vehicle's: as if the machine had stood still.
        leap[0] = 20.0
        await sea.reached(name, 0)
        assert NodeState.LOST not in {change.state for change in sea.of(LinkChange)}
        assert WaypointStatus.REFUSED not in sea.statuses(name, 0)


def go_on_for_ever(sea: Sea) -> None:
    """Let the vehicle's plan not end though references cease, which gives the test its time."""
    maneuver = sea.fleet.nodes[0].plan.maneuver
    assert maneuver is not None
    maneuver.failure = lambda now_s: None


def bridge_of(service: MissionService) -> Bridge:
    """The bridge of a service's IMC link."""
    return next(link._bridge for link in service.hub._links.values() if isinstance(link, ImcFleetLink))


def mission_over(sea: Sea, name: str, steps: int) -> MissionSpec:
    """A mission over most of a sea's floor."""
    corners = [sea.floor.frame.to_geodetic(*place) for place in ((5, 5), (95, 5), (95, 95), (5, 95), (5, 5))]
    return MissionSpec.model_validate(
        {
            "name": "Coming back",
            "area": {"type": "Polygon", "coordinates": [[[lon, lat] for lat, lon in corners]]},
            "vehicles": [{"name": name, "kind": "imc"}],
            "steps": steps,
            "cell_m": 5.0,
            "limits": {"max_step_m": 60.0, "min_depth_m": 1.0, "max_depth_m": 2.0},
            "planner": {"name": "random"},
        }
    )
