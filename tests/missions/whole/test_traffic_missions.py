"""Ships come while vehicles are at sea: heard over a real socket, told of, and waited for below."""

import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator, Callable
from typing import Any

import pytest

from app.missions.operations.history import events_after
from app.missions.operations.maps.features import Kind, features_of
from app.missions.service import MissionService
from app.missions.spec.mission import MissionSpec
from app.missions.states import MissionState
from app.missions.traffic.sources import UdpSource
from app.missions.views.mission import Level, MissionView
from app.missions.views.traffic import TrafficMessage
from tests.support.missions.ais import named, position
from tests.support.missions.harbour import Harbour, act, sim_spec, until_state, until_step, view_of
from tests.support.missions.specs import FRAME, lon_lat
from tests.support.waiting import until

MMSI = 211000001
HOME = lon_lat(15.0, 4.0)


@contextlib.asynccontextmanager
async def ship_at(service: MissionService, place: Callable[[], tuple[float, float]]) -> AsyncIterator[None]:
    """Have a ship tell every moment where it is, longitude and latitude."""
    [source] = service.traffic.sources
    assert isinstance(source, UdpSource)
    await until(lambda: not source.trouble, "the port is open")

    async def tell() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            while True:
                lon, lat = place()
                for line in (position(MMSI, lat, lon), *named(MMSI, "EVA")):
                    sender.sendto(line + b"\r\n", ("127.0.0.1", source.port))
                await asyncio.sleep(0.1)

    telling = asyncio.create_task(tell())
    try:
        await until(lambda: service.traffic.ship_list.get(MMSI), "the ship is heard")
        yield
    finally:
        telling.cancel()
        await asyncio.gather(telling, return_exceptions=True)


async def listening(harbour: Harbour, **ais: Any) -> MissionService:
    values = {"udp_address": "127.0.0.1", "udp_port": 0, "cpa_m": 100.0, "near_surface_m": 1.0}
    return await harbour.open(ais=values | ais)


async def lines(service: MissionService, mission: MissionView) -> list[tuple[Level, str]]:
    live = await service.get(mission.id)
    return [(event.level, event.message) for event in await events_after(live, 0, 1000)]


async def said(service: MissionService, mission: MissionView, words: str) -> bool:
    return any(words in line for _, line in await lines(service, mission))


async def test_a_ship_that_comes_close_is_an_alarm_and_is_over_when_it_left(harbour_closed: Harbour) -> None:
    service = await listening(harbour_closed, near_surface_m=10.0)
    mission = await service.create(sim_spec("a", steps=1000))
    place = [HOME]
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 1)
    async with ship_at(service, lambda: place[0]):
        await until(lambda: said(service, mission, "the ship EVA (cargo) comes to"), "it is told")
        [level] = [level for level, line in await lines(service, mission) if "EVA (cargo) comes to" in line]
        assert level is Level.ALARM
        [ship] = service.ships().ships
        assert (ship.mmsi, ship.name, ship.length_m, ship.draught_m) == (MMSI, "EVA", 30.0, 3.0)
        assert ship.closest is not None
        assert (ship.closest.vehicle, ship.closest.alarm) == ("a", True)
        live = await service.get(mission.id)
        message = live.ships.message()
        assert message is not None
        assert [one.mmsi for one in message.ships] == [MMSI]
        [row] = await service.rows(mission.id)
        [feature] = await features_of(live, service.maps, Kind.TRAFFIC, row)
        assert feature.properties["closest_vehicle"] == "a"
        assert feature.geometry["coordinates"] == pytest.approx(HOME, abs=1e-4)
        place[0] = lon_lat(15.0, 400.0)
        await until(lambda: said(service, mission, "traffic is over"), "it is over")
    assert (await view_of(service, mission.id)).state is MissionState.RUNNING
    await act(service, mission.id, "abort")


async def test_watchers_see_ships_where_something_listens(harbour_closed: Harbour) -> None:
    service = await listening(harbour_closed)
    mission = await service.create(sim_spec("a"))
    live = await service.get(mission.id)
    async with ship_at(service, lambda: HOME):
        with live.broadcaster.subscribe() as subscription:
            live.feed.start()
            async with asyncio.timeout(60):
                async for message in subscription:
                    if isinstance(message, TrafficMessage) and message.ships:
                        break
    assert [ship.name for ship in message.ships] in (["EVA"], [""])


async def test_vehicles_wait_below_for_a_ship_over_their_home(harbour_closed: Harbour) -> None:
    service = await listening(harbour_closed)
    recovery = {"point": HOME}
    mission = await service.create(sim_spec("a", steps=2, recovery=recovery, failsafes={"traffic": "hold"}))
    place = [HOME]
    async with ship_at(service, lambda: place[0]):
        await act(service, mission.id, "start")
        await until(lambda: said(service, mission, "a waits below for ships to pass"), "it waits")
        live = await service.get(mission.id)
        member = live.team.get("a")
        assert member is not None
        came = member.report
        await until(lambda: member.report is not came and member.report is not None, "it reported since")
        assert member.report is not None
        assert member.report.position.depth_m > 1.0, "below"
        assert live.header.state is MissionState.RUNNING
        place[0] = lon_lat(15.0, 400.0)
        ended = await until_state(service, mission.id, MissionState.FINISHED)
    [vehicle] = ended.vehicles
    assert vehicle.depth_m is not None
    assert vehicle.depth_m < 1.5, "it has come up"
    assert vehicle.lat_deg is not None
    assert vehicle.lon_deg is not None
    east, north = FRAME.to_local(vehicle.lat_deg, vehicle.lon_deg)
    home_east, home_north = FRAME.to_local(HOME[1], HOME[0])
    assert abs(east - home_east) < 25.0
    assert abs(north - home_north) < 25.0


async def test_nobody_waits_for_ever(harbour_closed: Harbour) -> None:
    service = await listening(harbour_closed, hold_s=60.0)
    recovery = {"point": HOME}
    mission = await service.create(sim_spec("a", steps=2, recovery=recovery, failsafes={"traffic": "hold"}))
    async with ship_at(service, lambda: HOME):
        await act(service, mission.id, "start")
        await until_state(service, mission.id, MissionState.FINISHED)
    assert await said(service, mission, "a waited 60 s for ships to pass, and comes up")


async def test_own_ships_are_no_cause_for_an_alarm(harbour_closed: Harbour) -> None:
    service = await listening(harbour_closed, near_surface_m=10.0, own_mmsi=[MMSI])
    mission = await service.create(sim_spec("a", steps=3))
    async with ship_at(service, lambda: HOME):
        await act(service, mission.id, "start")
        await until_state(service, mission.id, MissionState.FINISHED)
        [ship] = service.ships().ships
    assert ship.own
    assert not await said(service, mission, "comes to")


def test_no_mission_brings_vehicles_up_under_ships() -> None:
    with pytest.raises(ValueError, match="brings vehicles up where ships are"):
        sim_spec("a", failsafes={"traffic": "surface"})
    assert isinstance(sim_spec("a", failsafes={"traffic": "hold"}), MissionSpec)


async def test_without_a_receiver_nothing_is_shown(service: MissionService) -> None:
    mission = await service.create(sim_spec("a"))
    assert (await service.get(mission.id)).ships.message() is None
    assert service.ships().sources == []
