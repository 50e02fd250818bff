"""Vehicles simulated inside the service, over a sea floor laid under each mission's area."""

import asyncio
import contextlib
import math
import threading
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import structlog

from app.compiled.cache import RAYS, wait_for_compiling
from app.missions.clock import now
from app.missions.fleet.interface import (
    Deployment,
    EventSink,
    FaultKind,
    FaultReport,
    FleetEvent,
    FleetLink,
    LinkCapabilities,
    LinkReport,
    LinkState,
    Position,
    StopReceipt,
    VehicleInfo,
    VehicleRefusedError,
    WaypointOrder,
    WaypointReport,
    WaypointStatus,
)
from app.missions.fleet.links.simulated.launch import (
    FinalState,
    FloorPatch,
    Launch,
    Lookout,
    lay,
    target_in,
    terrain_of,
)
from app.missions.fleet.links.simulated.vehicle import DeployedVehicle, lived, ranges
from app.missions.settings import SimulationSettings
from app.missions.spec.swath import SwathSonarSpec
from app.missions.spec.vehicle import Sensor
from simulator.equipment import Equipment
from simulator.floors.terrain import Terrain, TerrainError
from simulator.obstacles.scanning import Scanning
from simulator.sonars.mounting import SonarMounting
from simulator.sonars.raycasting import warm_up
from simulator.sonars.sensors import SensorKind, SonarNoise
from simulator.sonars.swath import SwathSonar
from simulator.targets import Ranging, RangingNoise, Target
from simulator.vehicles.battery import BatterySpec
from simulator.vehicles.vehicle import BOAT, VehicleLimits
from simulator.water_column import WaterColumn
from simulator.world import SimulatedVehicle

TICK_S = 0.05
PIECE_S = 2.0
"""Vehicles live so many of their seconds one after the other."""
PAUSE_S = 0.01
"""For so long at most others wait for that."""
MOST_AT_ONCE_S = 0.5
"""Seconds of the wall clock that are made up for."""
log = structlog.get_logger(__name__)
REPORT_PERIOD_S = 0.5
"""Time between position reports on the vehicle's clock, as often as DUNE sends EstimatedState."""
LAUNCH_MARGIN_M = 2.0
LAUNCH_SPACING_M = 15.0
"""Beside each other there is room for the circles of two vehicles, of 5 m each, and for the usual separation."""
KEPT_TERRAINS = 32
RAISED_BY_M, CLIMB = 0.05, 4.0
"""A vehicle over a rising bottom is raised by at least so much each time, and by so many times what it is too low more
than to its least altitude: over a steep bottom it would never come up to it."""
ROOM_M = 0.5
"""It goes down to its depth again where that is so much higher above the bottom than it has to be."""

FORSAKEN_S = 60.0
"""A vehicle that is out of reach for so long gives its waypoint up, as DUNE does: its motor is off and it comes up."""
SILENT = "out of reach"
AGROUND = "ran into an obstacle and lies there"
SENSORS = {
    Sensor.SINGLE_BEAM: SensorKind.SINGLE,
    Sensor.DVL: SensorKind.DVL,
    Sensor.MULTIBEAM: SensorKind.MULTIBEAM,
}
SCAN_NOISE_M = 0.02


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
        self._terrains: dict[FloorPatch, Terrain] = {}
        self._deployed: dict[str, DeployedVehicle] = {}
        self._final_states: dict[str, FinalState] = {}
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
        for name in self._deployed:
            await self.stop(name)
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)

    def check_deployment(self, vehicle: str) -> None:
        """See whether there is a sea floor that it can be launched over. Raises VehicleRefusedError."""
        if self._settings.terrain is None:
            return
        try:
            terrain_of(self._settings.terrain)
        except TerrainError as error:
            raise _no_floor(vehicle, error) from error

    async def prepare(self, deployment: Deployment) -> None:
        """Lay the sea floor of a mission, which for a large area takes seconds. Raises VehicleRefusedError."""
        patch = FloorPatch.under(deployment.mission)
        if patch not in self._terrains:
            try:
                self._keep_terrain(patch, await asyncio.to_thread(lay, self._settings, patch))
            except TerrainError as error:
                raise _no_floor(deployment.vehicle.name, error) from error

    def deploy(self, deployment: Deployment) -> None:
        """Launch a vehicle where its mission has it begin, or where the mission that this one follows left it.

        One that was at sea for its mission in another process goes on from where it was heard last.
        """
        self.check_deployment(deployment.vehicle.name)
        vehicle, mission, world = deployment.vehicle, deployment.mission, deployment.world()
        final = self._final_states.get(vehicle.name)
        if final is not None and (final.mission_id != mission.after or vehicle.start is not None):
            final = None
        heard = deployment.last_heard
        if heard is not None:
            place = heard.position.lat_deg, heard.position.lon_deg
            final = FinalState(deployment.mission_id, place, 100.0 if heard.battery_pct is None else heard.battery_pct)
        launch = Launch(
            vehicle=vehicle.name,
            mission_id=deployment.mission_id,
            sensor=vehicle.sensor,
            floor=FloorPatch.under(mission),
            start=(vehicle.start[1], vehicle.start[0]) if vehicle.start is not None else deployment.berth(),
            noise=mission.sounding_noise,
            swath=SwathSonar(**(vehicle.sonar or SwathSonarSpec()).model_dump()),
            mounting=SonarMounting(**vehicle.real_mounting.model_dump(exclude={"source"})),
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
            goes_on_from=final,
        )
        try:
            self.launch(launch)
        except ValueError as error:
            raise VehicleRefusedError(vehicle.name, f"cannot be launched: {error}", "change its start") from error

    def end_deployment(self, deployment: Deployment) -> None:
        """Put a vehicle away, unless another mission has it."""
        there = self._deployed.get(deployment.vehicle.name)
        if there is not None and there.mission_id == deployment.mission_id:
            at = there.position(there.body.true_position)
            final = FinalState(there.mission_id, (at.lat_deg, at.lon_deg), there.battery.level_pct)
            self._final_states[deployment.vehicle.name] = final
            self.put_away(deployment.vehicle.name)

    def launch(self, launch: Launch) -> None:
        """Bring a vehicle into the world; nothing happens when it is there already for the same mission.

        One that another mission left there is put away: it is over that one's sea floor, with that one's sonar.
        Raises ValueError when the start lies outside of the sea floor.
        """
        there = self._deployed.get(launch.vehicle)
        if there is not None and there.mission_id == launch.mission_id:
            return
        self.put_away(launch.vehicle)
        terrain = self._terrain(launch.floor)
        seed = [self._settings.seed, *launch.vehicle.encode()]
        started_s = now().timestamp()
        moving = [target for target in launch.targets if target.simulated is not None]
        # Who joins later finds them where they have gone meanwhile.
        since_s = started_s - self._under_way_s(launch.mission_id)
        targets = [Target(target_in(target, terrain), terrain, since_s) for target in moving]
        body = SimulatedVehicle(
            launch.vehicle,
            terrain,
            (*self._start(launch, terrain), 0.0),
            np.random.default_rng(seed),
            Equipment(
                sensor=SENSORS[launch.sensor],
                noise=SonarNoise(relative_sd=launch.noise),
                swath=launch.swath or SwathSonar(),
                mounting=launch.mounting,
                drift_m2ps=self._settings.drift_m2ps,
                limits=_limits_of(launch),
                battery=launch.battery,
            ),
            current=self._settings.current_mps,
            water=WaterColumn.of(self._settings.sound_speed),
            start_time_s=started_s,
        )
        ranging = Ranging(targets, launch.ranging, np.random.default_rng([*seed, 1]), started_s)
        scanning = None
        if launch.lookout is not None:
            out = launch.lookout
            noise = np.random.default_rng([*seed, 2])
            scanning = Scanning(out.world, out.reach_m, out.resolution_deg, SCAN_NOISE_M, noise, started_s)
        deployed = DeployedVehicle(launch.mission_id, body, terrain, ranging, since_s, scanning)
        if launch.goes_on_from is not None:
            body.float_at(*terrain.frame.to_local(*launch.goes_on_from.place))
            deployed.battery.recharge(launch.goes_on_from.battery_pct)
        deployed.make_report()
        self._deployed[launch.vehicle] = deployed

    def _under_way_s(self, mission_id: str) -> float:
        """Return for how long a mission's targets have been under way, by its vehicles' clocks."""
        there = [one for one in self._deployed.values() if one.mission_id == mission_id]
        return max((one.body.time_s - one.targets_since_s for one in there), default=0.0)

    def recharge(self, vehicle: str, level_pct: float = 100.0) -> None:
        """Fill a vehicle's battery up to a level."""
        self._deployed[vehicle].battery.recharge(level_pct)

    def fail(self, vehicle: str, kind: FaultKind, reason: str) -> None:
        """Let something break on board."""
        deployed = self._deployed[vehicle]
        fault = deployed.faults[kind] = FaultReport(vehicle, deployed.body.time_s, kind, reason)
        self._sink(fault)

    def mend(self, vehicle: str, kind: FaultKind) -> None:
        """Repair what is broken on board; nothing happens when that is not."""
        deployed = self._deployed[vehicle]
        fault = deployed.faults.pop(kind, None)
        if fault is not None:
            self._sink(replace(fault, time_s=deployed.body.time_s, over=True))

    def silence(self, vehicle: str) -> None:
        """Take a vehicle out of reach: what it tells meanwhile is lost, and it takes no orders."""
        deployed = self._deployed[vehicle]
        if deployed.silent_since_s is None and not deployed.aground:
            deployed.silent_since_s = deployed.body.time_s
            deployed.state = LinkState.LOST
            self._sink(LinkReport(vehicle, LinkState.LOST, SILENT))

    def reach(self, vehicle: str) -> None:
        """Bring a vehicle back within reach; nothing happens when it is."""
        deployed = self._deployed[vehicle]
        if deployed.silent_since_s is not None and not deployed.aground:
            deployed.silent_since_s = None
            deployed.state = LinkState.READY
            self._sink(deployed.make_report())
            self._sink(LinkReport(vehicle, LinkState.READY))

    def swims(self, vehicle: str) -> bool:
        """Whether a vehicle is in the world."""
        return vehicle in self._deployed

    def is_silent(self, vehicle: str) -> bool:
        """Whether a vehicle is out of reach."""
        return self._deployed[vehicle].silent_since_s is not None

    def is_adrift(self, vehicle: str) -> bool:
        """Whether a vehicle gave its waypoint up as nobody heard it, and has none yet: the current takes it along."""
        return self._deployed[vehicle].adrift

    def true_position(self, vehicle: str) -> Position:
        """Return where a vehicle is, whatever it takes itself to be."""
        deployed = self._deployed[vehicle]
        return deployed.position(deployed.body.true_position)

    def battery_pct(self, vehicle: str) -> float:
        """Return what a vehicle's battery really holds."""
        return self._deployed[vehicle].battery.level_pct

    def put_away(self, vehicle: str) -> None:
        """Take a vehicle out of the world; nothing happens when it is not there."""
        self._deployed.pop(vehicle, None)

    def _terrain(self, patch: FloorPatch) -> Terrain:
        """Return the sea floor of a mission's area; its vehicles share one, which takes a while to lay."""
        if patch not in self._terrains:
            self._keep_terrain(patch, lay(self._settings, patch))
        return self._terrains[patch]

    def _keep_terrain(self, patch: FloorPatch, terrain: Terrain) -> None:
        while len(self._terrains) >= KEPT_TERRAINS:
            del self._terrains[next(iter(self._terrains))]
        self._terrains[patch] = terrain

    def _start(self, launch: Launch, terrain: Terrain) -> tuple[float, float]:
        if launch.start is not None:
            return terrain.frame.to_local(*launch.start)
        # The first place along the southern border that nobody is near. Who joins others under way, who may come along
        # there, or finds none gets the one that is farthest from all.
        spacing = min(LAUNCH_SPACING_M, terrain.width_m / 4)
        places = np.arange(LAUNCH_MARGIN_M, terrain.width_m, spacing)
        there = [
            terrain.frame.to_local(at.lat_deg, at.lon_deg)
            for at in (s.position(s.body.true_position) for s in self._deployed.values())
        ]
        away = [min((math.hypot(x - e, LAUNCH_MARGIN_M - n) for e, n in there), default=math.inf) for x in places]
        joins = any(s.order is not None for s in self._deployed.values() if s.mission_id == launch.mission_id)
        free = np.flatnonzero(np.array(away) >= (math.inf if joins else 0.99 * spacing))
        return float(places[free[0] if len(free) else int(np.argmax(away))]), LAUNCH_MARGIN_M

    def vehicles(self) -> Sequence[VehicleInfo]:
        """Every vehicle that was launched."""
        return [self._info(name, simulated) for name, simulated in self._deployed.items()]

    def vehicle(self, name: str) -> VehicleInfo | None:
        """Return one of them; None for one that was not launched."""
        simulated = self._deployed.get(name)
        return None if simulated is None else self._info(name, simulated)

    def _info(self, name: str, simulated: DeployedVehicle) -> VehicleInfo:
        return VehicleInfo(
            name,
            self.kind,
            simulated.state,
            AGROUND if simulated.aground else "" if simulated.silent_since_s is None else SILENT,
            age_s=0.0
            if simulated.silent_since_s is None
            else (simulated.body.time_s - simulated.silent_since_s) / self._time_scale,
            report=simulated.report,
            faults=tuple(simulated.faults.values()),
        )

    async def engage(self, vehicle: str) -> None:
        """Let a vehicle follow. Raises VehicleRefusedError when it was not launched."""
        deployed = self._deployed.get(vehicle)
        if deployed is None:
            raise VehicleRefusedError(vehicle, "is not in the water", "add it to a mission as a vehicle of kind sim")
        if deployed.aground:
            raise VehicleRefusedError(vehicle, AGROUND, "take it out of the mission")
        if deployed.silent_since_s is not None:
            raise VehicleRefusedError(vehicle, f"is {SILENT}", "wait until it is heard again")
        if deployed.state is not LinkState.ENGAGED:
            deployed.state = LinkState.ENGAGED
            self._sink(LinkReport(vehicle, LinkState.ENGAGED))

    async def order(self, order: WaypointOrder) -> None:
        """Send a vehicle to a waypoint."""
        deployed = self._deployed.get(order.vehicle)
        if deployed is None or deployed.state is not LinkState.ENGAGED:
            raise VehicleRefusedError(order.vehicle, "does not follow this service", "engage it first")
        deployed.begin(order)
        for status in (WaypointStatus.SENT, WaypointStatus.ACKNOWLEDGED):
            self._sink(WaypointReport(order.vehicle, order.mission_id, order.step, status))

    async def stop(self, vehicle: str, *, timeout_s: float = 3.0) -> StopReceipt:
        """Switch a vehicle's motor off."""
        deployed = self._deployed.get(vehicle)
        if deployed is not None and deployed.silent_since_s is not None:
            return StopReceipt(vehicle, acknowledged=False, detail=f"it is {SILENT}")
        if deployed is None or deployed.state is not LinkState.ENGAGED:
            return StopReceipt(vehicle, acknowledged=True, detail="was not following")
        deployed.body.stop()
        deployed.order = None
        deployed.state = LinkState.READY
        self._sink(LinkReport(vehicle, LinkState.READY))
        return StopReceipt(vehicle, acknowledged=True, detail="motor off")

    def _warm_up(self) -> None:
        if self._settings.terrain is not None:
            # Of a file that cannot be read the checklist tells.
            with contextlib.suppress(TerrainError):
                terrain_of(self._settings.terrain)
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
            if late_s > 0 and self._deployed and not self._told_of_pace:
                self._told_of_pace = True
                log.warning("simulated vehicles live slower than asked for", late_s=round(late_s, 2))
            left_s = min(now_s - then_s, MOST_AT_ONCE_S) * self._time_scale
            then_s = now_s
            while left_s > 0.0:
                for deployed in list(self._deployed.values()):
                    self._live_through(deployed, min(left_s, PIECE_S))
                    if loop.time() - now_s > PAUSE_S:
                        await asyncio.sleep(0)
                        now_s = loop.time()
                left_s -= PIECE_S

    def _live_through(self, deployed: DeployedVehicle, passed_s: float) -> None:
        """Let time pass for one vehicle, and tell what came of it; what goes wrong with it holds no other up."""
        try:
            for event in self._advance(deployed, passed_s):
                self._sink(event)
        except Exception:
            log.exception("a simulated vehicle could not live on for a moment", vehicle=deployed.body.name)

    def _advance(self, deployed: DeployedVehicle, passed_s: float) -> list[FleetEvent]:
        events: list[FleetEvent] = []
        soundings, scans = lived(deployed, passed_s)
        events += scans
        if deployed.scanning is not None and deployed.scanning.collided and not deployed.aground:
            deployed.aground = True
            deployed.body.stop()
            deployed.order = None
            deployed.state = LinkState.HEARD
            events.append(LinkReport(deployed.body.name, LinkState.HEARD, AGROUND))
        if deployed.silent_since_s is not None:
            self._live_unheard(deployed, deployed.silent_since_s)
            return []
        order = deployed.order
        if order is not None:
            events += soundings
            self._keep_clear_of_bottom(deployed, order)
        events += ranges(deployed)
        if deployed.body.time_s - deployed.reported_s >= REPORT_PERIOD_S:
            events.append(deployed.make_report())
        if order is not None and not deployed.reached and deployed.body.arrived:
            deployed.reached = True
            if order.lead is not None:
                # Until it is sent on it flies straight ahead, as far as there is room.
                deployed.head_for(order, order.lead, order.lead.depth_m)
            # The loop plans from the last report: it must be the place of arrival.
            events.append(deployed.make_report())
            events.append(WaypointReport(order.vehicle, order.mission_id, order.step, WaypointStatus.REACHED))
        return events

    def _live_unheard(self, deployed: DeployedVehicle, since_s: float) -> None:
        """Let a vehicle that is out of reach go on with its waypoint for a while."""
        ranges(deployed)
        if deployed.order is not None:
            self._keep_clear_of_bottom(deployed, deployed.order)
            if deployed.body.time_s - since_s >= FORSAKEN_S:
                deployed.body.stop()
                deployed.order = None
                deployed.adrift = True

    def _keep_clear_of_bottom(self, deployed: DeployedVehicle, order: WaypointOrder) -> None:
        """Raise a vehicle over a rising bottom, again and again, and let it go down where that has fallen."""
        bottom_m, least_m = deployed.body.bottom_m, order.min_altitude_m
        too_low_m = least_m - deployed.body.state.altitude_m
        ahead = order.lead if deployed.reached and order.lead is not None else order.position
        depth_m = max(0.0, bottom_m - least_m - CLIMB * too_low_m)
        if too_low_m > 0.0 and depth_m < deployed.raised_to_m - RAISED_BY_M:
            deployed.raised_to_m = depth_m
            deployed.head_for(order, ahead, depth_m)
        elif deployed.raised_to_m < ahead.depth_m and bottom_m - ahead.depth_m > least_m + ROOM_M:
            deployed.raised_to_m = math.inf
            deployed.head_for(order, ahead, ahead.depth_m)


def _no_floor(vehicle: str, error: TerrainError) -> VehicleRefusedError:
    remedy = "Name a terrain file in simulation.terrain that can be read, or none"
    return VehicleRefusedError(vehicle, f"cannot be launched: {error}", remedy)


def _limits_of(launch: Launch) -> VehicleLimits:
    """Return what a vehicle can do: one that is asked to be faster than an AUV plays a faster vehicle."""
    if launch.lookout is not None:
        return BOAT
    auv = VehicleLimits()
    return replace(auv, max_speed_mps=max(auv.max_speed_mps, launch.battery.nominal_mps))
