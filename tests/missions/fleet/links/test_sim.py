"""Vehicles in this process: what they tell of their energy and of the current."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from app.missions.fleet.interface import (
    FaultKind,
    FaultReport,
    FleetEvent,
    LinkState,
    PingReport,
    Position,
    RangeReport,
    SoundingReport,
    VehicleRefusedError,
    VehicleReport,
    WaypointOrder,
    WaypointReport,
    WaypointStatus,
)
from app.missions.fleet.links.sim import FORSAKEN_S, SimFleetLink
from app.missions.fleet.links.simulated.launch import MOST_CELLS, FloorPatch, Launch, lay
from app.missions.settings import SimulationSettings
from app.missions.spec.swath import SwathSonarSpec
from app.missions.spec.targets import TargetSpec
from app.missions.spec.vehicle import Sensor, VehicleSpec
from simulator.floors import seafloors
from simulator.floors.terrain import Terrain
from simulator.floors.terrain_files import save_npz
from simulator.sonars.swath import SwathSonar
from simulator.targets import RangingNoise
from simulator.vehicles.battery import BatterySpec
from tests.support.missions.specs import LAT, LON
from tests.support.waiting import until

FLOOR = seafloors.generate("harbour", 0, origin=(LAT, LON))
NAME = "s"
PATCH = FloorPatch((LAT, LON), 100.0, 100.0)


def launch(battery: BatterySpec) -> Launch:
    start = FLOOR.frame.to_geodetic(50, 5)
    return Launch(NAME, "m", Sensor.SINGLE_BEAM, PATCH, start=start, noise=0.005, battery=battery)


def order(step: int, east_m: float, north_m: float, speed_mps: float = 1.0) -> WaypointOrder:
    lat, lon = FLOOR.frame.to_geodetic(east_m, north_m)
    return WaypointOrder("m", step, NAME, Position(lat, lon, 1.0), speed_mps, 4.0, 1.0)


def has_arrived(events: list[FleetEvent], step: int = 1) -> bool:
    reached = [e for e in events if isinstance(e, WaypointReport) and e.status is WaypointStatus.REACHED]
    return step in [report.step for report in reached]


def test_the_floor_of_a_large_area_has_wider_cells() -> None:
    """At 1 m that of 20 km x 20 km took all memory of the machine, and with it the service."""
    large = FloorPatch((LAT, LON), 5000.4, 2000.0)
    floor = lay(SimulationSettings(family="flat"), large)
    assert floor.z_m.size <= MOST_CELLS
    assert floor.cell_m == 2
    assert 0 < floor.width_m - large.width_m <= 2
    assert 0 < floor.height_m - large.height_m <= 2
    assert lay(SimulationSettings(family="flat"), PATCH).cell_m == 1


async def test_it_tells_its_energy_and_the_current() -> None:
    link = SimFleetLink(SimulationSettings(current_mps=(0.1, -0.2)), 20.0)
    link.launch(launch(BatterySpec(endurance_min=100.0, level_pct=50.0)))
    (info,) = link.vehicles()
    assert info.report is not None
    assert info.report.battery_pct == 50.0
    assert info.report.energy_left_s == 3000.0
    assert info.report.current_mps == (0.1, -0.2)


async def test_who_comes_later_ranges_to_a_target_where_it_is_by_now() -> None:
    lat, lon = FLOOR.frame.to_geodetic(20, 80)
    tag = {"start": (lon, lat), "depth_m": 1.0, "course_deg": 90.0, "speed_mps": 0.3}
    target = TargetSpec.model_validate({"name": "tag", "simulated": tag})
    exact = RangingNoise(0.0, 0.0)
    link, events = SimFleetLink(SimulationSettings(), 20.0), list[FleetEvent]()
    link._sink = events.append
    first = replace(launch(BatterySpec()), targets=(target,), ranging=exact)
    link.launch(first)
    link._live_through(link._deployed[NAME], 100.0)
    link.launch(replace(first, vehicle="t"))
    for deployed in link._deployed.values():
        link._live_through(deployed, 4.0)
    for name in (NAME, "t"):
        found = [e for e in events if isinstance(e, RangeReport) and e.vehicle == name][-1]
        here, since_s = (
            link._deployed[name].body.true_position,
            104.0 - (link._deployed[name].body.time_s - found.time_s),
        )
        away = np.hypot(np.hypot(20.0 + 0.3 * since_s - here.east_m, 80.0 - here.north_m), 1.0 - here.depth_m)
        assert found.range_m == pytest.approx(away, abs=0.5)


async def test_one_that_is_asked_to_be_fast_is() -> None:
    """An ASV beside AUVs, say."""
    events: list[FleetEvent] = []
    link = SimFleetLink(SimulationSettings(), 20.0)
    await link.start(events.append)
    try:
        link.launch(launch(BatterySpec(nominal_mps=2.5)))
        await link.engage(NAME)
        await link.order(order(1, 50, 95, speed_mps=2.5))
        await until(lambda: has_arrived(events), "it has arrived")
    finally:
        await link.close()
    speeds = [e.speed_mps for e in events if isinstance(e, VehicleReport) and e.speed_mps is not None]
    assert max(speeds) == pytest.approx(2.5, abs=0.1)


async def test_one_whose_report_cannot_be_taken_in_holds_nobody_up() -> None:
    events: list[FleetEvent] = []
    refused: list[FleetEvent] = []

    def sink(event: FleetEvent) -> None:
        if event.vehicle == "other" and len(refused) < 3:
            refused.append(event)
            raise ValueError("not to be taken in")
        events.append(event)

    link = SimFleetLink(SimulationSettings(), 20.0)
    await link.start(sink)
    try:
        link.launch(replace(launch(BatterySpec()), vehicle="other", start=None))
        link.launch(launch(BatterySpec()))
        await link.engage(NAME)
        await link.order(order(1, 50, 40))
        await until(lambda: has_arrived(events), "it has arrived", 60.0)
        await until(lambda: any(e.vehicle == "other" for e in events), "the other one lives, too", 60.0)
    finally:
        await link.close()
    assert len(refused) == 3


async def test_one_that_joins_others_under_way_is_put_to_sea_far_from_them() -> None:
    link = SimFleetLink(SimulationSettings(), 1.0)
    await link.start(lambda _event: None)
    try:
        places = []
        for name, mission in (("a", "m"), ("b", "m"), ("c", "other"), ("late", "m")):
            if name == "late":
                await link.engage("a")
                await link.order(replace(order(1, 50, 80), vehicle="a"))
            link.launch(replace(launch(BatterySpec()), vehicle=name, mission_id=mission, start=None))
            at = link.true_position(name)
            places.append(FLOOR.frame.to_local(at.lat_deg, at.lon_deg)[0])
    finally:
        await link.close()
    first, second, third, late = places
    assert second == pytest.approx(first + 15.0, abs=0.1)
    assert third == pytest.approx(second + 15.0, abs=0.1)
    assert late > 80.0


async def test_what_breaks_is_told_and_when_it_is_mended() -> None:
    events: list[FleetEvent] = []
    link = SimFleetLink(SimulationSettings(), 1.0)
    await link.start(events.append)
    try:
        link.launch(launch(BatterySpec()))
        link.mend(NAME, FaultKind.LEAK)
        link.fail(NAME, FaultKind.LEAK, "water in the nose")
        (info,) = link.vehicles()
        assert [(fault.kind, fault.reason) for fault in info.faults] == [(FaultKind.LEAK, "water in the nose")]
        link.mend(NAME, FaultKind.LEAK)
        assert link.vehicles()[0].faults == ()
    finally:
        await link.close()
    assert [event.over for event in events if isinstance(event, FaultReport)] == [False, True]


async def test_one_without_energy_goes_nowhere_until_it_is_charged() -> None:
    events: list[FleetEvent] = []
    link = SimFleetLink(SimulationSettings(), 50.0)
    await link.start(events.append)
    try:
        link.launch(launch(BatterySpec(endurance_min=2.0, level_pct=10.0)))
        await link.engage(NAME)
        await link.order(order(1, 50, 80))
        await until(
            lambda: any(isinstance(e, VehicleReport) and e.battery_pct == 0.0 and e.speed_mps == 0.0 for e in events),
            "it lies still",
        )
        assert not has_arrived(events)
        link.recharge(NAME, 100.0)
        await link.order(order(2, 50, 20))
        await until(lambda: has_arrived(events, 2), "it has arrived")
    finally:
        await link.close()


@pytest.mark.slow
@pytest.mark.parametrize("current", [(0.5, 0.0), (-0.35, 0.35), (0.0, -0.5)])
async def test_it_arrives_against_and_across_half_its_speed(current: tuple[float, float]) -> None:
    events: list[FleetEvent] = []
    link = SimFleetLink(SimulationSettings(current_mps=current), 50.0)
    await link.start(events.append)
    goals = [(50, 60), (80, 60), (20, 60), (20, 20)]
    try:
        link.launch(launch(BatterySpec()))
        await link.engage(NAME)
        for step, (east, north) in enumerate(goals):
            await link.order(order(step, east, north))
            await until(partial(has_arrived, events, step), f"step {step} is reached")
    finally:
        await link.close()
    told: dict[int, Position] = {}
    here = Position(LAT, LON, 0.0)
    for event in events:
        if isinstance(event, VehicleReport):
            here = event.position
        elif isinstance(event, WaypointReport) and event.status is WaypointStatus.REACHED:
            told[event.step] = here
    assert list(told) == list(range(len(goals))), "each once, in order"
    for step, goal in enumerate(goals):
        at = FLOOR.frame.to_local(told[step].lat_deg, told[step].lon_deg)
        assert np.hypot(*np.subtract(at, goal)) <= 4.0 + 0.1, "within the radius in which it has arrived"


async def test_it_climbs_over_a_bank_and_goes_down_behind_it(tmp_path: Path) -> None:
    events: list[FleetEvent] = []
    # A bank 60 m from the south, and deep water behind it.
    bank = np.interp(np.arange(101.0), [0.0, 25.0, 70.0, 75.0, 101.0], [9.0, 9.0, 4.0, 9.0, 9.0])
    floor = Terrain(np.tile(bank[:, None], (1, 101)), 1.0)
    save_npz(floor, tmp_path / "bank.npz")
    link = SimFleetLink(SimulationSettings(terrain=tmp_path / "bank.npz"), 50.0)
    await link.start(events.append)
    try:
        link.launch(launch(BatterySpec()))
        await link.engage(NAME)
        lat, lon = FLOOR.frame.to_geodetic(50, 95)
        await link.order(WaypointOrder("m", 1, NAME, Position(lat, lon, 7.0), 1.0, 4.0, 1.0))
        await until(lambda: has_arrived(events), "it has arrived")
    finally:
        await link.close()
    reports = [event for event in events if isinstance(event, VehicleReport)]
    assert min(e.altitude_m for e in reports if e.altitude_m is not None) > 0.5, "a failsafe would bring it up for good"
    assert min(e.position.depth_m for e in reports[len(reports) // 3 :]) < 3.2
    assert reports[-1].position.depth_m > 4.5, "behind the bank it goes down again, to its place among the others"


async def test_a_multibeam_tells_of_whole_pings() -> None:
    events: list[FleetEvent] = []
    link = SimFleetLink(SimulationSettings(), 20.0)
    await link.start(events.append)
    try:
        sonar = SwathSonar(aperture_deg=90.0, beams=32, rate_hz=2.0)
        link.launch(replace(launch(BatterySpec()), sensor=Sensor.MULTIBEAM, noise=0.0, swath=sonar))
        await link.engage(NAME)
        await link.order(order(1, 50, 40))
        await until(lambda: has_arrived(events), "it has arrived")
    finally:
        await link.close()
    pings = [event for event in events if isinstance(event, PingReport)]
    assert not [event for event in events if isinstance(event, SoundingReport)]
    times = [ping.time_s for ping in pings]
    np.testing.assert_allclose(np.diff(times), 0.5, atol=1e-3)
    assert {(ping.vehicle, ping.source, len(ping.angles_rad)) for ping in pings} == {(NAME, "Multibeam", 32)}
    assert {ping.ranges_m.dtype for ping in pings} == {np.dtype(np.float32)}
    below = [float(np.nanmin(ping.ranges_m)) for ping in pings]
    assert min(below) > 0.5


def test_the_sonar_that_a_mission_describes_is_the_one_that_is_simulated() -> None:
    assert SwathSonar(**SwathSonarSpec().model_dump()) == SwathSonar()
    vehicle = VehicleSpec(name=NAME, sensor=Sensor.MULTIBEAM, sonar=SwathSonarSpec(beams=64))
    assert vehicle.sonar is not None
    with pytest.raises(ValidationError, match="only a multibeam is described by it"):
        VehicleSpec(name=NAME, sensor=Sensor.DVL, sonar=SwathSonarSpec())
    with pytest.raises(ValidationError, match="aperture_deg"):
        SwathSonarSpec(aperture_deg=180.0)


@pytest.mark.slow
async def test_out_of_reach_it_tells_nothing_takes_no_orders_and_comes_up_after_a_while() -> None:
    events: list[FleetEvent] = []
    link = SimFleetLink(SimulationSettings(), 20.0)
    await link.start(events.append)
    try:
        link.launch(launch(BatterySpec()))
        await link.engage(NAME)
        await link.order(order(1, 50.0, 95.0))
        await until(lambda: link.true_position(NAME).depth_m > 0.5, "it is under way")
        link.silence(NAME)
        assert [info.state for info in link.vehicles()] == [LinkState.LOST]
        assert not link.is_adrift(NAME), "it goes on with its waypoint for a while"
        for refused in (link.engage(NAME), link.order(order(2, 10.0, 10.0))):
            with pytest.raises(VehicleRefusedError):
                await refused
        assert not (await link.stop(NAME)).acknowledged
        heard, before = len(events), link.battery_pct(NAME)
        await until(lambda: (link.vehicles()[0].age_s or 0.0) * 20.0 > FORSAKEN_S + 20.0, "it is silent for long")
        assert len(events) == heard
        assert link.battery_pct(NAME) < before, "it lives on"
        assert link.is_adrift(NAME)
        await until(lambda: link.true_position(NAME).depth_m < 0.2, "it has come up")
        link.reach(NAME)
        assert [info.state for info in link.vehicles()] == [LinkState.READY]
        await link.engage(NAME)
        assert link.is_adrift(NAME), "heard again, it has no waypoint yet"
        await link.order(order(3, 50.0, 40.0))
        assert not link.is_adrift(NAME)
        reached = [WaypointStatus.REACHED]
        await until(
            lambda: [e.status for e in events if isinstance(e, WaypointReport) and e.step == 3][2:] == reached,
            "it goes on",
        )
    finally:
        await link.close()


def test_who_joins_is_launched_where_nobody_is() -> None:
    link = SimFleetLink(SimulationSettings(family="slope"), time_scale=1.0)
    for name in ("one", "two", "three"):
        link.launch(replace(launch(BatterySpec()), vehicle=name, start=None))
    link.put_away("one")
    link.launch(replace(launch(BatterySpec()), vehicle="four", start=None))
    at = [link.true_position(name) for name in ("two", "three", "four")]
    places = {(round(place.lat_deg, 6), round(place.lon_deg, 6)) for place in at}
    assert len(places) == 3
