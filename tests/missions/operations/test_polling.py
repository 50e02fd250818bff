"""Vehicles that ask for their waypoints are told to stay where they are, too."""

import pytest

from app.missions.errors import ConflictError, InvalidRequestError
from app.missions.fleet.interface import WaypointStatus
from app.missions.live.mission import LiveMission
from app.missions.operations.history import events_after
from app.missions.operations.polling import waypoint
from app.missions.running.homecoming import call_home, hold
from app.missions.service import MissionService
from app.missions.spec.failsafes import Response
from app.missions.views.mission import Level
from tests.support.missions.harbour import Rover, act, sim_spec, until_step
from tests.support.missions.specs import lon_lat
from tests.support.waiting import until

VEHICLES = [{"name": "asks", "kind": "rest"}]


async def begun(service: MissionService) -> tuple[LiveMission, Rover]:
    """A mission whose vehicle has its first leg."""
    mission = await service.create(sim_spec(steps=1000, vehicles=VEHICLES))
    live, rover = await service.get(mission.id), Rover(service, mission.id, "asks")
    await rover.post()
    await act(service, mission.id, "start")
    await until(lambda: rover.poll(), "it has its first leg")
    return live, rover


@pytest.mark.slow
async def test_who_is_held_is_told_when_it_asks_and_gets_a_new_leg_when_it_is_sent_on(service: MissionService) -> None:
    live, rover = await begun(service)
    await until(lambda: live.team.members["asks"].ordered, "its second leg waits for it")
    await hold(live, "asks", "Ana")
    held = live.team.members["asks"]
    await until(lambda: held.withdrawal is not None and held.withdrawal.led, "it is held")
    for after in (None, rover.steps[-1]):
        with pytest.raises(ConflictError, match=r"held by Ana.*: stop and hold"):
            await waypoint(live, "asks", after_step=after)
    assert held.waits_m is None, "nobody reckons with a place that it is not sent to"
    given_up = held.legs
    await service.send_on(live, "asks", "Ana")
    await until(lambda: rover.poll(), "it gets a leg")
    assert rover.steps[-1] > given_up, "and none that was given up"
    await act(service, live.id, "abort")


@pytest.mark.slow
async def test_nobody_acknowledges_a_waypoint_that_it_was_never_given(service: MissionService) -> None:
    live, _ = await begun(service)
    member = live.team.members["asks"]
    await until(lambda: member.ordered and member.status is WaypointStatus.SENT, "its second leg waits for it")
    with pytest.raises(InvalidRequestError, match="no waypoint of step 1000: the newest is 2") as caught:
        await waypoint(live, "asks", after_step=1000)
    assert caught.value.field == "after_step"
    assert member.status is WaypointStatus.SENT
    assert await waypoint(live, "asks", after_step=2) is None
    assert member.status in (WaypointStatus.ACKNOWLEDGED, WaypointStatus.REACHED), "the newest may be what it has"
    await act(service, live.id, "abort")
    with pytest.raises(ConflictError, match="stop and hold"):
        await waypoint(live, "asks", after_step=1000)


@pytest.mark.slow
async def test_a_leg_that_is_over_is_not_handed_out_again(service: MissionService) -> None:
    mission = await service.create(sim_spec(steps=1, vehicles=[*VEHICLES, {"name": "b", "kind": "rest"}]))
    live, rover = await service.get(mission.id), Rover(service, mission.id, "asks")
    other = Rover(service, mission.id, "b", east_m=20)
    await rover.post()
    await other.post()
    await act(service, mission.id, "start")
    await until(lambda: rover.poll(), "it has its leg")
    await until(lambda: live.team.members["asks"].status == "reached", "it is there")
    assert await waypoint(live, "asks") is None
    await act(service, mission.id, "abort")


@pytest.mark.slow
async def test_who_is_home_is_told_so_and_acknowledges_it(service: MissionService) -> None:
    spec = sim_spec(steps=1000, vehicles=VEHICLES, recovery={"point": lon_lat(15.0, 4.0)})
    mission = await service.create(spec)
    live, member = await service.get(mission.id), None
    async with Rover(service, mission.id, "asks") as rover:
        await act(service, mission.id, "start")
        await until_step(service, mission.id, 2)
        member = live.team.members["asks"]
        await call_home(live, "asks", "Ana")
        await until(lambda: bool(rover.told), "it is told to stop")
    assert member.withdrawal is not None
    assert (member.withdrawal.response, member.withdrawal.over) == (Response.RETURN, True)
    assert "called home by Ana" in rover.told[-1]

    async def noted() -> bool:
        return any("is home" in event.message for event in await events_after(live, 0, 1000))

    await until(noted, "its stop is acknowledged")
    assert not [event.message for event in await events_after(live, 0, 1000) if event.level is Level.ALARM]
