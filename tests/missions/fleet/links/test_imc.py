"""The adapter speaks the mission loop's language."""

from typing import Any

import pytest

from app.missions.fleet.interface import (
    FaultKind,
    FaultReport,
    LinkReport,
    LinkState,
    Position,
    SoundingReport,
    VehicleRefusedError,
    VehicleReport,
    WaypointOrder,
    WaypointReport,
    WaypointStatus,
)
from app.missions.fleet.links.imc import ImcFleetLink, make_imc_link
from app.missions.settings import ImcSettings
from tests.support.imc.sea import open_sea
from tests.support.ports import free_ports
from tests.support.waiting import until


async def test_one_waypoint_from_engaging_to_stopping() -> None:
    async with open_sea() as sea:
        await sea.bridge.close()
        link = make_imc_link(
            ImcSettings(
                port=free_ports(1)[0], id=0x3F02, announce_ports=sea.settings.announce_ports, loopback_only=True
            ),
            sea.settings.time_scale,
        )
        assert isinstance(link, ImcFleetLink)
        assert link.kind == "imc"
        events: list[Any] = []
        await link.start(events.append)
        try:
            await until(lambda: [v.state for v in link.vehicles()] == [LinkState.READY], "it is ready")
            (info,) = link.vehicles()
            assert (info.kind, info.imc_id, info.details["operation mode"]) == ("imc", 0x0101, "service")
            lat, lon = sea.floor.frame.to_geodetic(50.0, 40.0)
            order = WaypointOrder("m1", 3, info.name, Position(lat, lon, 1.5), 1.3, 5.0, 2.0)
            with pytest.raises(VehicleRefusedError, match="not engaged"):
                await link.order(order)
            await link.engage(info.name)
            assert link.vehicles()[0].state is LinkState.ENGAGED
            await link.order(order)

            def reports() -> list[WaypointReport]:
                return [event for event in events if isinstance(event, WaypointReport)]

            await until(lambda: len(reports()) == 3, "it has arrived")
            assert [(r.mission_id, r.step, r.status) for r in reports()] == [
                ("m1", 3, WaypointStatus.SENT),
                ("m1", 3, WaypointStatus.ACKNOWLEDGED),
                ("m1", 3, WaypointStatus.REACHED),
            ]
            assert (await link.stop(info.name)).acknowledged
        finally:
            await link.close()
        states = [e.state for e in events if isinstance(e, LinkReport)]
        assert states[0] is LinkState.HEARD
        assert LinkState.ENGAGED in states
        assert states[-1] is LinkState.READY
        assert any(isinstance(e, VehicleReport) for e in events)
        sounding = next(e for e in events if isinstance(e, SoundingReport))
        assert sounding.footprint.depth_m == pytest.approx(sounding.vehicle_depth_m + sounding.range_m)


async def test_unknown_vehicle_is_refused() -> None:
    async with open_sea() as sea:
        await sea.bridge.close()
        link = ImcFleetLink(sea.settings)
        await link.start(lambda event: None)
        try:
            with pytest.raises(VehicleRefusedError, match="never heard of") as caught:
                await link.engage("nobody")
            assert caught.value.remedy
            assert not (await link.stop("nobody")).acknowledged
        finally:
            await link.close()


async def test_a_way_home_is_kept_on_board() -> None:
    async with open_sea(lost_comms_s=60.0) as sea:
        (name,) = await sea.ready()
        await sea.bridge.close()
        link = ImcFleetLink(sea.settings)
        assert link.capabilities.keeps_way_home
        await link.start(lambda event: None)
        try:
            await until(lambda: [v.state for v in link.vehicles()] == [LinkState.READY], "it is ready")
            lat, lon = sea.floor.frame.to_geodetic(20.0, 20.0)
            await link.keep_way_home(name, [Position(lat, lon, 0.0)], 1.1)
            (plan,) = sea.fleet.nodes[0].database.plans.values()
            assert plan.maneuvers[0].data.speed == pytest.approx(1.1)
            assert link.vehicles()[0].details["way home"].startswith("kept on board")
            await link.drop_way_home(name)
            assert not sea.fleet.nodes[0].database.plans
            with pytest.raises(VehicleRefusedError, match="never heard of"):
                await link.keep_way_home("nobody", [Position(lat, lon, 0.0)], 1.1)
            with pytest.raises(VehicleRefusedError, match="never heard of"):
                await link.drop_way_home("nobody")
        finally:
            await link.close()


async def test_faults_on_board_are_told() -> None:
    async with open_sea() as sea:
        await sea.bridge.close()
        link = ImcFleetLink(sea.settings)
        events: list[Any] = []
        await link.start(events.append)
        try:
            await until(lambda: [v.state for v in link.vehicles()] == [LinkState.READY], "it is ready")
            sea.fleet.nodes[0].fail("leak")
            await until(lambda: any(isinstance(event, FaultReport) for event in events), "the leak is told")
            (fault,) = (event for event in events if isinstance(event, FaultReport))
            assert (fault.kind, fault.over) == (FaultKind.LEAK, False)
            assert link.vehicles()[0].faults == (fault,)
        finally:
            await link.close()
