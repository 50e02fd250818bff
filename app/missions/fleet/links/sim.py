"""Vehicles simulated inside the service, over a sea floor laid under each mission's area."""

import asyncio
import math
import threading
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import structlog

from app.compiled.cache import RAYS, wait_for_compiling
from app.missions.clock import now
from app.missions.fleet.interface import (
    BeamGeometry,
    Deployment,
    EventSink,
    FaultKind,
    FaultReport,
    FleetEvent,
    FleetLink,
    LinkCapabilities,
    LinkReport,
    LinkState,
    PingReport,
    Position,
    RangeReport,
    ScanReport,
    SoundingReport,
    StopReceipt,
    VehicleInfo,
    VehicleRefusedError,
    VehicleReport,
    WaypointOrder,
    WaypointReport,
    WaypointStatus,
)
from app.missions.settings import SimulationSettings
from app.missions.spec.swath import SwathSonarSpec
from app.missions.spec.targets import TargetSpec
from app.missions.spec.vehicle import Sensor
from simulator.equipment import Equipment
from simulator.floors.seafloors import generate
from simulator.floors.terrain import Terrain
from simulator.floors.terrain_files import load_terrain
from simulator.obstacles.obstacles import ObstacleWorld
from simulator.obstacles.scanning import Scan, Scanning
from simulator.sonars.raycasting import warm_up
from simulator.sonars.sensors import SensorKind, SonarNoise
from simulator.sonars.swath import SwathSonar, SwathSounder
from simulator.targets import Ranging, RangingNoise, Target
from simulator.targets import TargetSpec as SimulatedTarget
from simulator.vehicles.battery import Battery, BatterySpec
from simulator.vehicles.vehicle import BOAT, STEP_S
from simulator.world import BeamReturn, LocalPosition, SimulatedVehicle, SwathPing

TICK_S = 0.05
PIECE_S = 2.0
"""Vehicles live so many of their seconds one after the other."""
PAUSE_S = 0.01
"""For so long at most others wait for that."""
MOST_AT_ONCE_S = 0.5
"""Seconds of the wall clock that are made up for."""

log = structlog.get_logger(__name__)

PASSED_WITHIN_M = 8.0
"""A vehicle that passes its waypoint at most this far to the side has arrived, as for those led over IMC."""
REPORT_PERIOD_S = 0.5
"""Time between position reports on the vehicle's clock, as often as DUNE sends EstimatedState."""

LAUNCH_MARGIN_M = 2.0
LAUNCH_SPACING_M = 6.0
KEPT_TERRAINS = 32
FORSAKEN_S = 60.0
"""A vehicle that is out of reach for so long gives its waypoint up, as DUNE does: its motor is off and it comes up."""
SILENT = "out of reach"
AGROUND = "ran into an obstacle and lies there"
SENSORS = {
    Sensor.SINGLE_BEAM: SensorKind.SINGLE,
    Sensor.DVL: SensorKind.DVL,
    Sensor.MULTIBEAM: SensorKind.MULTIBEAM,
}


@dataclass(frozen=True)
class Lookout:
    """What a vehicle that searches meets, in the frame of the area's south-western corner, and how it looks round."""

    world: ObstacleWorld
    reach_m: float
    resolution_deg: float


SCAN_NOISE_M = 0.02


@dataclass(frozen=True)
class Launch:
    """Where and how a simulated vehicle comes into the world.

    Attributes
    ----------
    vehicle, sensor
        Its name and its sonar.
    mission_id
        Whose it is.
    south_west
        Latitude and longitude of the sea floor's corner.
    width_m, height_m
        Extent of a generated sea floor.
    start
        Latitude and longitude; None: in the south-western corner, beside those already there.
    noise
        Standard deviation of a range as a fraction of it; 0: without any error.
    swath
        What its sonar can do when that is a multibeam.
    targets, ranging
        What moves about there, and how well it ranges to that.
    lookout
        For a search: then it is a boat that can stop and turn on the spot.
    battery
    """

    vehicle: str
    mission_id: str
    sensor: Sensor
    south_west: tuple[float, float]
    width_m: float
    height_m: float
    start: tuple[float, float] | None
    noise: float
    swath: SwathSonar = SwathSonar()  # noqa: RUF009 - frozen
    targets: tuple[TargetSpec, ...] = ()
    ranging: RangingNoise = RangingNoise()  # noqa: RUF009 - frozen
    lookout: Lookout | None = None
    battery: BatterySpec = BatterySpec()  # noqa: RUF009 - frozen


class _Swimmer:
    def __init__(
        self,
        mission_id: str,
        body: SimulatedVehicle,
        terrain: Terrain,
        ranging: Ranging,
        scanning: Scanning | None = None,
    ) -> None:
        self.mission_id = mission_id
        self.body = body
        self.ranging = ranging
        self.scanning = scanning
        self.aground = False
        self.silent_since_s: float | None = None
        """Since when it is out of reach, by its clock."""
        self.adrift = False
        """Whether it gave its waypoint up meanwhile."""
        self.terrain = terrain
        self.state = LinkState.READY
        self.order: WaypointOrder | None = None
        self.reached = False
        self.raised = False
        self.reported_s = -math.inf
        self.report: VehicleReport | None = None
        self.faults: dict[FaultKind, FaultReport] = {}

    @property
    def battery(self) -> Battery:
        if self.body.battery is None:
            raise ValueError(f"{self.body.name} has no battery")
        return self.body.battery

    def position(self, place: LocalPosition) -> Position:
        lat, lon = self.terrain.frame.to_geodetic(place.east_m, place.north_m)
        return Position(lat, lon, place.depth_m)

    def make_report(self) -> VehicleReport:
        state = self.body.state
        self.reported_s = state.time_s
        self.report = VehicleReport(
            vehicle=self.body.name,
            time_s=state.time_s,
            position=self.position(state.position),
            heading_rad=state.heading_rad,
            speed_mps=state.speed_mps,
            altitude_m=state.altitude_m if math.isfinite(state.altitude_m) else None,
            battery_pct=self.battery.level_pct,
            battery_confidence_pct=self.battery.spec.confidence_pct,
            energy_left_s=self.battery.time_left_s(),
            position_sd_m=math.sqrt(state.position_variance_m2),
            current_mps=self.body.vehicle.current,
        )
        return self.report

    def begin(self, order: WaypointOrder) -> None:
        self.order, self.reached, self.raised, self.adrift = order, False, False, False
        self.head_for(order, order.position, order.position.depth_m)

    def head_for(self, order: WaypointOrder, place: Position, depth_m: float) -> None:
        east, north = self.terrain.frame.to_local(place.lat_deg, place.lon_deg)
        self.body.go_to(
            east,
            north,
            depth_m,
            order.speed_mps,
            arrival_radius_m=order.arrival_radius_m,
            pass_within_m=None if order.lead is None else PASSED_WITHIN_M,
        )


class SimFleetLink(FleetLink):
    """The fleet interface for vehicles simulated in this process.

    Parameters
    ----------
    time_scale
        How much faster than the wall clock they live.
    battery
        Of every vehicle that a mission deploys; its nominal speed is the one that the mission asks for, its endurance
        the vehicle's own where that is stated.
    """

    kind = "sim"
    capabilities = LinkCapabilities(simulated=True, scans=True)

    def __init__(
        self,
        settings: SimulationSettings,
        time_scale: float,
        *,
        battery: BatterySpec | None = None,
    ) -> None:
        self._settings = settings
        self._battery = battery or BatterySpec(consumption_factor=settings.consumption_factor)
        self._time_scale = time_scale
        self._told_of_pace = False
        self._terrains: dict[tuple[float, float, float, float], Terrain] = {}
        self._swimmers: dict[str, _Swimmer] = {}
        self._sink: EventSink = lambda _event: None
        self._task: asyncio.Task[None] | None = None
        self._ending = threading.Event()

    async def start(self, sink: EventSink) -> None:
        """Let time pass from now on."""
        self._sink = sink
        self._ending.clear()
        self._task = asyncio.create_task(self._live())

    async def close(self) -> None:
        """Stop every vehicle and let time stand still."""
        self._ending.set()
        for name in self._swimmers:
            await self.stop(name)
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)

    def deploy(self, deployment: Deployment) -> None:
        """Launch a vehicle where its mission has it begin."""
        vehicle, mission, world = deployment.vehicle, deployment.mission, deployment.world()
        frame, size = mission.frame(), mission.local_area().max(axis=0)
        launch = Launch(
            vehicle=vehicle.name,
            mission_id=deployment.mission_id,
            sensor=vehicle.sensor,
            south_west=(frame.origin_lat_deg, frame.origin_lon_deg),
            width_m=float(size[0]),
            height_m=float(size[1]),
            start=(vehicle.start[1], vehicle.start[0]) if vehicle.start is not None else deployment.berth(),
            noise=mission.sounding_noise,
            swath=SwathSonar(**(vehicle.sonar or SwathSonarSpec()).model_dump()),
            targets=tuple(mission.targets),
            ranging=RangingNoise(
                relative_sd=mission.tracking.range_noise,
                sd_m=mission.tracking.range_sd_m,
                hearing_m=mission.tracking.hearing_m or math.inf,
            ),
            lookout=None
            if world is None or mission.search is None
            else Lookout(world, mission.search.scanner.reach_m, mission.search.scanner.resolution_deg),
            battery=replace(
                self._battery,
                nominal_mps=mission.speed_of(vehicle),
                endurance_min=vehicle.endurance_min or self._battery.endurance_min,
            ),
        )
        try:
            self.launch(launch)
        except ValueError as error:
            raise VehicleRefusedError(vehicle.name, f"cannot be launched: {error}", "change its start") from error

    def withdraw(self, deployment: Deployment) -> None:
        """Put a vehicle away, unless another mission has it."""
        there = self._swimmers.get(deployment.vehicle.name)
        if there is not None and there.mission_id == deployment.mission_id:
            self.put_away(deployment.vehicle.name)

    def launch(self, launch: Launch) -> None:
        """Bring a vehicle into the world; nothing happens when it is there already for the same mission.

        One that another mission left there is put away: it is over that one's sea floor, with that one's sonar.
        Raises ValueError when the start lies outside of the sea floor.
        """
        there = self._swimmers.get(launch.vehicle)
        if there is not None and there.mission_id == launch.mission_id:
            return
        self.put_away(launch.vehicle)
        terrain = self._terrain(launch)
        seed = [self._settings.seed, *launch.vehicle.encode()]
        started_s = now().timestamp()
        moving = [target for target in launch.targets if target.simulated is not None]
        targets = [Target(_simulated(target, terrain), terrain, started_s) for target in moving]
        body = SimulatedVehicle(
            launch.vehicle,
            terrain,
            (*self._start(launch, terrain), 0.0),
            np.random.default_rng(seed),
            Equipment(
                sensor=SENSORS[launch.sensor],
                noise=SonarNoise(relative_sd=launch.noise),
                swath=launch.swath or SwathSonar(),
                drift_m2ps=self._settings.drift_m2ps,
                limits=None if launch.lookout is None else BOAT,
                battery=launch.battery,
            ),
            current=self._settings.current_mps,
            start_time_s=started_s,
        )
        ranging = Ranging(targets, launch.ranging, np.random.default_rng([*seed, 1]), started_s)
        scanning = None
        if launch.lookout is not None:
            out = launch.lookout
            noise = np.random.default_rng([*seed, 2])
            scanning = Scanning(out.world, out.reach_m, out.resolution_deg, SCAN_NOISE_M, noise, started_s)
        swimmer = _Swimmer(launch.mission_id, body, terrain, ranging, scanning)
        swimmer.make_report()
        self._swimmers[launch.vehicle] = swimmer

    def recharge(self, vehicle: str, level_pct: float = 100.0) -> None:
        """Fill a vehicle's battery up to a level."""
        self._swimmers[vehicle].battery.recharge(level_pct)

    def fail(self, vehicle: str, kind: FaultKind, reason: str) -> None:
        """Let something break on board."""
        swimmer = self._swimmers[vehicle]
        fault = swimmer.faults[kind] = FaultReport(vehicle, swimmer.body.time_s, kind, reason)
        self._sink(fault)

    def mend(self, vehicle: str, kind: FaultKind) -> None:
        """Repair what is broken on board; nothing happens when that is not."""
        swimmer = self._swimmers[vehicle]
        fault = swimmer.faults.pop(kind, None)
        if fault is not None:
            self._sink(replace(fault, time_s=swimmer.body.time_s, over=True))

    def silence(self, vehicle: str) -> None:
        """Take a vehicle out of reach: what it tells meanwhile is lost, and it takes no orders."""
        swimmer = self._swimmers[vehicle]
        if swimmer.silent_since_s is None and not swimmer.aground:
            swimmer.silent_since_s = swimmer.body.time_s
            swimmer.state = LinkState.LOST
            self._sink(LinkReport(vehicle, LinkState.LOST, SILENT))

    def reach(self, vehicle: str) -> None:
        """Bring a vehicle back within reach; nothing happens when it is."""
        swimmer = self._swimmers[vehicle]
        if swimmer.silent_since_s is not None and not swimmer.aground:
            swimmer.silent_since_s = None
            swimmer.state = LinkState.READY
            self._sink(swimmer.make_report())
            self._sink(LinkReport(vehicle, LinkState.READY))

    def swims(self, vehicle: str) -> bool:
        """Whether a vehicle is in the world."""
        return vehicle in self._swimmers

    def is_adrift(self, vehicle: str) -> bool:
        """Whether a vehicle gave its waypoint up as nobody heard it, and has none yet: the current takes it along."""
        return self._swimmers[vehicle].adrift

    def true_position(self, vehicle: str) -> Position:
        """Return where a vehicle is, whatever it takes itself to be."""
        swimmer = self._swimmers[vehicle]
        return swimmer.position(swimmer.body.true_position)

    def battery_pct(self, vehicle: str) -> float:
        """Return what a vehicle's battery really holds."""
        return self._swimmers[vehicle].battery.level_pct

    def put_away(self, vehicle: str) -> None:
        """Take a vehicle out of the world; nothing happens when it is not there."""
        self._swimmers.pop(vehicle, None)

    def _terrain(self, launch: Launch) -> Terrain:
        """Return the sea floor of a mission's area; its vehicles share one, which takes a while to lay."""
        key = (*launch.south_west, launch.width_m, launch.height_m)
        if key not in self._terrains:
            while len(self._terrains) >= KEPT_TERRAINS:
                del self._terrains[next(iter(self._terrains))]
            self._terrains[key] = _lay(self._settings, launch)
        return self._terrains[key]

    def _start(self, launch: Launch, terrain: Terrain) -> tuple[float, float]:
        if launch.start is not None:
            return terrain.frame.to_local(*launch.start)
        there = sum(1 for s in self._swimmers.values() if s.terrain.frame.definition == terrain.frame.definition)
        spacing = min(LAUNCH_SPACING_M, terrain.width_m / 4)
        return LAUNCH_MARGIN_M + (there * spacing) % (terrain.width_m - LAUNCH_MARGIN_M), LAUNCH_MARGIN_M

    def vehicles(self) -> Sequence[VehicleInfo]:
        """Every vehicle that was launched."""
        return [
            VehicleInfo(
                name,
                self.kind,
                s.state,
                AGROUND if s.aground else "" if s.silent_since_s is None else SILENT,
                age_s=0.0 if s.silent_since_s is None else (s.body.time_s - s.silent_since_s) / self._time_scale,
                report=s.report,
                faults=tuple(s.faults.values()),
            )
            for name, s in self._swimmers.items()
        ]

    async def engage(self, vehicle: str) -> None:
        """Let a vehicle follow. Raises VehicleRefusedError when it was not launched."""
        swimmer = self._swimmers.get(vehicle)
        if swimmer is None:
            raise VehicleRefusedError(vehicle, "is not in the water", "add it to a mission as a vehicle of kind sim")
        if swimmer.aground:
            raise VehicleRefusedError(vehicle, AGROUND, "take it out of the mission")
        if swimmer.silent_since_s is not None:
            raise VehicleRefusedError(vehicle, f"is {SILENT}", "wait until it is heard again")
        if swimmer.state is not LinkState.ENGAGED:
            swimmer.state = LinkState.ENGAGED
            self._sink(LinkReport(vehicle, LinkState.ENGAGED))

    async def order(self, order: WaypointOrder) -> None:
        """Send a vehicle to a waypoint."""
        swimmer = self._swimmers.get(order.vehicle)
        if swimmer is None or swimmer.state is not LinkState.ENGAGED:
            raise VehicleRefusedError(order.vehicle, "does not follow this service", "engage it first")
        swimmer.begin(order)
        for status in (WaypointStatus.SENT, WaypointStatus.ACKNOWLEDGED):
            self._sink(WaypointReport(order.vehicle, order.mission_id, order.step, status))

    async def stop(self, vehicle: str, *, timeout_s: float = 3.0) -> StopReceipt:
        """Switch a vehicle's motor off."""
        swimmer = self._swimmers.get(vehicle)
        if swimmer is not None and swimmer.silent_since_s is not None:
            return StopReceipt(vehicle, acknowledged=False, detail=f"it is {SILENT}")
        if swimmer is None or swimmer.state is not LinkState.ENGAGED:
            return StopReceipt(vehicle, acknowledged=True, detail="was not following")
        swimmer.body.stop()
        swimmer.order = None
        swimmer.state = LinkState.READY
        self._sink(LinkReport(vehicle, LinkState.READY))
        return StopReceipt(vehicle, acknowledged=True, detail="motor off")

    def _warm_up(self) -> None:
        if wait_for_compiling(RAYS, ending=self._ending):
            warm_up()

    async def _live(self) -> None:
        # Nobody waits for that whose vehicles are real.
        await asyncio.to_thread(self._warm_up)
        loop = asyncio.get_running_loop()
        then_s = loop.time()
        while True:
            await asyncio.sleep(TICK_S)
            now_s = loop.time()
            # What this machine cannot simulate in time is left out: vehicles live slower then, and hold nobody up.
            late_s = now_s - then_s - MOST_AT_ONCE_S
            if late_s > 0 and self._swimmers and not self._told_of_pace:
                self._told_of_pace = True
                log.warning("simulated vehicles live slower than asked for", late_s=round(late_s, 2))
            left_s = min(now_s - then_s, MOST_AT_ONCE_S) * self._time_scale
            then_s = now_s
            while left_s > 0.0:
                for swimmer in list(self._swimmers.values()):
                    for event in self._advance(swimmer, min(left_s, PIECE_S)):
                        self._sink(event)
                    if loop.time() - now_s > PAUSE_S:
                        await asyncio.sleep(0)
                        now_s = loop.time()
                left_s -= PIECE_S

    def _advance(self, swimmer: _Swimmer, passed_s: float) -> list[FleetEvent]:
        events: list[FleetEvent] = []
        soundings, scans = _lived(swimmer, passed_s)
        events += scans
        if swimmer.scanning is not None and swimmer.scanning.collided and not swimmer.aground:
            swimmer.aground = True
            swimmer.body.stop()
            swimmer.order = None
            swimmer.state = LinkState.HEARD
            events.append(LinkReport(swimmer.body.name, LinkState.HEARD, AGROUND))
        if swimmer.silent_since_s is not None:
            self._live_unheard(swimmer, swimmer.silent_since_s)
            return []
        order = swimmer.order
        if order is not None:
            events += soundings
            self._keep_clear_of_bottom(swimmer, order)
        events += _ranges(swimmer)
        if swimmer.body.time_s - swimmer.reported_s >= REPORT_PERIOD_S:
            events.append(swimmer.make_report())
        if order is not None and not swimmer.reached and swimmer.body.arrived:
            swimmer.reached = True
            if order.lead is not None:
                # Until it is sent on it flies straight ahead, as far as there is room.
                swimmer.head_for(order, order.lead, order.lead.depth_m)
            # The loop plans from the last report: it must be the place of arrival.
            events.append(swimmer.make_report())
            events.append(WaypointReport(order.vehicle, order.mission_id, order.step, WaypointStatus.REACHED))
        return events

    def _live_unheard(self, swimmer: _Swimmer, since_s: float) -> None:
        """Let a vehicle that is out of reach go on with its waypoint for a while."""
        _ranges(swimmer)
        if swimmer.order is not None:
            self._keep_clear_of_bottom(swimmer, swimmer.order)
            if swimmer.body.time_s - since_s >= FORSAKEN_S:
                swimmer.body.stop()
                swimmer.order = None
                swimmer.adrift = True

    def _keep_clear_of_bottom(self, swimmer: _Swimmer, order: WaypointOrder) -> None:
        state = swimmer.body.state
        too_low = state.altitude_m < order.min_altitude_m
        if too_low and not swimmer.raised and not swimmer.reached:
            swimmer.raised = True
            swimmer.head_for(order, order.position, max(0.0, swimmer.body.bottom_m - order.min_altitude_m))


def _lay(settings: SimulationSettings, launch: Launch) -> Terrain:
    if settings.terrain is not None:
        terrain = load_terrain(settings.terrain)
        return terrain if terrain.origin_lat_deg is not None else terrain.placed_at(*launch.south_west)
    # Whole cells that cover the area to its border and a little more.
    return generate(
        settings.family,
        settings.seed,
        width_m=math.ceil(launch.width_m + 1e-3),
        height_m=math.ceil(launch.height_m + 1e-3),
        origin=launch.south_west,
    )


def _simulated(target: TargetSpec, terrain: Terrain) -> SimulatedTarget:
    asked = target.simulated
    if asked is None:
        raise ValueError(f"target {target.name} is a real one")
    lon, lat = asked.start
    place = (*terrain.frame.to_local(lat, lon), asked.depth_m)
    return SimulatedTarget(target.called, place, math.radians(asked.course_deg), asked.speed_mps)


def _lived(swimmer: _Swimmer, passed_s: float) -> tuple[list[FleetEvent], list[FleetEvent]]:
    """Let time pass, and return what was sounded and scanned.

    One that looks round does so on its way, and not only where it is in the end.
    """
    scanning, body = swimmer.scanning, swimmer.body
    if scanning is None:
        return _sounded(swimmer, passed_s), []
    soundings: list[FleetEvent] = []
    scans: list[FleetEvent] = []
    while passed_s > 0.0 and not scanning.collided:
        soundings += _sounded(swimmer, min(passed_s, STEP_S))
        passed_s -= STEP_S
        scan = scanning.step(body.time_s, body.true_position)
        if scan is not None:
            scans.append(_scan(swimmer, scan, scanning))
    return soundings, scans


def _sounded(swimmer: _Swimmer, passed_s: float) -> list[FleetEvent]:
    body = swimmer.body
    if isinstance(body.sonar, SwathSounder):
        return [_ping(swimmer, ping) for ping in body.advance_swath(passed_s)]
    return [_sounding(swimmer, m) for m in body.advance(passed_s) if m.valid]


def _scan(swimmer: _Swimmer, scan: Scan, scanning: Scanning) -> ScanReport:
    return ScanReport(
        vehicle=swimmer.body.name,
        time_s=scan.time_s,
        position=swimmer.position(swimmer.body.position),
        first_bearing_deg=0.0,
        bearing_step_deg=scanning.resolution_deg,
        reach_m=scanning.reach_m,
        ranges_m=tuple(scan.ranges_m.tolist()),
        source="sim",
    )


def _ranges(swimmer: _Swimmer) -> list[FleetEvent]:
    body = swimmer.body
    return [
        RangeReport(
            vehicle=body.name,
            time_s=body.time_s,
            target=target,
            range_m=range_m,
            position=swimmer.position(body.position),
            source="sim",
            position_sd_m=math.sqrt(body.state.position_variance_m2),
        )
        for target, range_m in swimmer.ranging.step(body.time_s, body.true_position)
    ]


def _sounding(swimmer: _Swimmer, measurement: BeamReturn) -> SoundingReport:
    if measurement.footprint is None:
        raise ValueError("a measurement without a return has no footprint")
    sonar = swimmer.position(measurement.position)
    return SoundingReport(
        vehicle=measurement.vehicle,
        time_s=measurement.time_s,
        footprint=swimmer.position(measurement.footprint),
        vehicle_depth_m=measurement.position.depth_m,
        range_m=measurement.range_m,
        source=measurement.source,
        beam=measurement.beam,
        position_sd_m=math.sqrt(swimmer.body.state.position_variance_m2),
        beam_geometry=BeamGeometry(sonar.lat_deg, sonar.lon_deg),
    )


def _ping(swimmer: _Swimmer, ping: SwathPing) -> PingReport:
    return PingReport(
        vehicle=ping.vehicle,
        time_s=ping.time_s,
        position=swimmer.position(ping.position),
        roll_rad=ping.roll_rad,
        pitch_rad=ping.pitch_rad,
        heading_rad=ping.heading_rad,
        angles_rad=ping.angles_rad.astype(np.float32),
        ranges_m=ping.ranges_m.astype(np.float32),
        source=ping.source,
        position_sd_m=math.sqrt(swimmer.body.state.position_variance_m2),
    )
