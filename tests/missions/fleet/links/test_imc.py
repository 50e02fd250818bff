"""The adapter speaks the mission loop's language."""

import math
from typing import Any

import numpy as np
import pytest

from app.arrays import FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.swath.pings import Pings, placed
from app.missions.fleet.interface import (
    FaultKind,
    FaultReport,
    LinkReport,
    LinkState,
    PingReport,
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
from simulator.sonars.swath import SwathSonar
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


async def test_pings_of_a_multibeam_come_by_udp_and_keep_the_vehicle_off_the_bottom() -> None:
    swath = SwathSonar(aperture_deg=90.0, beams=64)
    async with open_sea(equipment={"sensor": "multibeam", "swath": swath}, family="slope") as sea:
        await sea.bridge.close()
        link = make_imc_link(
            ImcSettings(
                port=free_ports(1)[0], id=0x3F02, announce_ports=sea.settings.announce_ports, loopback_only=True
            ),
            sea.settings.time_scale,
        )
        events: list[Any] = []
        await link.start(events.append)
        try:
            await until(lambda: [v.state for v in link.vehicles()] == [LinkState.READY], "it is ready")
            name = link.vehicles()[0].name
            await link.engage(name)
            lat, lon = sea.floor.frame.to_geodetic(60.0, 60.0)
            await link.order(WaypointOrder("m1", 1, name, Position(lat, lon, 60.0), 1.3, 5.0, 3.0))
            await until(
                lambda: any(isinstance(e, WaypointReport) and e.status is WaypointStatus.REACHED for e in events),
                "it has arrived",
            )
            (info,) = link.vehicles()
        finally:
            await link.close()
        assert not sea.fleet.nodes[0].vehicle.collided
        assert max(e.position.depth_m for e in events if isinstance(e, VehicleReport)) > 4.0, "deeper than unknown"
        floor = sea.floor
    reports = [e for e in events if isinstance(e, PingReport)]
    assert len(reports) > 50
    assert not [e for e in events if isinstance(e, SoundingReport)]
    assert int(info.details["pings"]) > 50
    assert "Multibeam" in info.details["bottom sensors"]
    assert {(r.vehicle, r.source, len(r.angles_rad)) for r in reports} == {(name, "Multibeam", 64)}
    assert (np.diff([r.time_s for r in reports]) > 0.0).all()
    frame = LocalFrame(floor.frame.lat_deg, floor.frame.lon_deg)
    found = placed(pings_of(reports), frame)
    bottom = np.array([floor.depth_at_point(*place) for place in zip(found.east_m, found.north_m, strict=True)])
    assert len(found) > 30 * len(reports)
    assert np.median(np.abs(found.depth_m - bottom)) < 0.01
    assert np.quantile(np.abs(found.depth_m - bottom), 0.99) < 0.1


def pings_of(reports: list[PingReport]) -> Pings:
    def column(values: list[float]) -> FloatArray:
        return np.array(values)

    return Pings(
        time_s=column([r.time_s for r in reports]),
        lat_deg=column([r.position.lat_deg for r in reports]),
        lon_deg=column([r.position.lon_deg for r in reports]),
        depth_m=column([r.position.depth_m for r in reports]),
        roll_rad=column([r.roll_rad for r in reports]),
        pitch_rad=column([r.pitch_rad for r in reports]),
        heading_rad=column([r.heading_rad for r in reports]),
        position_sd_m=column([math.nan if r.position_sd_m is None else r.position_sd_m for r in reports]),
        angle_rad=np.array([r.angles_rad for r in reports]),
        range_m=np.array([r.ranges_m for r in reports]),
    )


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
