"""One simulated vehicle in the water: what it follows, and what it reports and measures as time passes."""

import math

import numpy as np

from app.missions.fleet.interface import (
    BeamGeometry,
    FaultKind,
    FaultReport,
    FleetEvent,
    LinkState,
    PingReport,
    Position,
    RangeReport,
    ScanReport,
    SoundingReport,
    SoundSpeedReport,
    VehicleReport,
    WaypointOrder,
)
from imc_bridge.control.orders import PASSED_WITHIN_M
from simulator.floors.terrain import Terrain
from simulator.obstacles.scanning import Scan, Scanning
from simulator.sonars.swath import SwathSounder
from simulator.targets import Ranging
from simulator.vehicles.battery import Battery
from simulator.vehicles.vehicle import STEP_S
from simulator.world import PROBE_PERIOD_S, BeamReturn, LocalPosition, SimulatedVehicle, SwathPing


class DeployedVehicle:
    """A simulated vehicle in the water."""

    def __init__(
        self,
        mission_id: str,
        body: SimulatedVehicle,
        terrain: Terrain,
        ranging: Ranging,
        targets_since_s: float,
        scanning: Scanning | None = None,
    ) -> None:
        self.mission_id = mission_id
        self.body = body
        self.ranging = ranging
        self.targets_since_s = targets_since_s
        """When the targets that it ranges to began to move, by its clock."""
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
        self.raised_to_m = math.inf
        """The least depth that it was raised to on its way, to keep clear of the bottom."""
        self.reported_s = -math.inf
        self.report: VehicleReport | None = None
        self.faults: dict[FaultKind, FaultReport] = {}

    @property
    def battery(self) -> Battery:
        """Its battery. Raises ValueError where it has none."""
        if self.body.battery is None:
            raise ValueError(f"{self.body.name} has no battery")
        return self.body.battery

    def position(self, place: LocalPosition) -> Position:
        """Return where a place over its sea floor lies on the Earth."""
        lat, lon = self.terrain.frame.to_geodetic(place.east_m, place.north_m)
        return Position(lat, lon, place.depth_m)

    def make_report(self) -> VehicleReport:
        """Return what it reports now, and remember that it did."""
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
        """Set out for a waypoint."""
        self.order, self.reached, self.adrift, self.raised_to_m = order, False, False, math.inf
        self.head_for(order, order.position, order.position.depth_m)

    def head_for(self, order: WaypointOrder, place: Position, depth_m: float) -> None:
        """Head for a place, ``depth_m`` below the surface, as fast as the order says."""
        east, north = self.terrain.frame.to_local(place.lat_deg, place.lon_deg)
        self.body.go_to(
            east,
            north,
            depth_m,
            order.speed_mps,
            arrival_radius_m=order.arrival_radius_m,
            pass_within_m=None if order.lead is None else PASSED_WITHIN_M,
            stops=order.last and not self.body.vehicle.limits.hovers,
        )


def lived(deployed: DeployedVehicle, passed_s: float) -> tuple[list[FleetEvent], list[FleetEvent]]:
    """Let time pass, and return what was sounded, of the water too, and what was scanned.

    One that looks round does so on its way, and not only where it is in the end; so does a probe.
    """
    scanning, body = deployed.scanning, deployed.body
    if scanning is None:
        return (_sounded if body.water is None else _probed)(deployed, passed_s), []
    soundings: list[FleetEvent] = []
    scans: list[FleetEvent] = []
    while passed_s > 0.0 and not scanning.collided:
        soundings += _sounded(deployed, min(passed_s, STEP_S))
        passed_s -= STEP_S
        scan = scanning.step(body.time_s, body.true_position)
        if scan is not None:
            scans.append(_scan(deployed, scan, scanning))
    return soundings, scans


def _sounded(deployed: DeployedVehicle, passed_s: float) -> list[FleetEvent]:
    body = deployed.body
    if isinstance(body.sonar, SwathSounder):
        return [_ping(deployed, ping) for ping in body.advance_swath(passed_s)]
    return [_sounding(deployed, m) for m in body.advance(passed_s) if m.valid]


def _probed(deployed: DeployedVehicle, passed_s: float) -> list[FleetEvent]:
    """Let time pass, and return what was sounded and what a sound velocity probe measured meanwhile."""
    events: list[FleetEvent] = []
    while passed_s > 0.0:
        events += _sounded(deployed, min(passed_s, PROBE_PERIOD_S))
        passed_s -= PROBE_PERIOD_S
        speed_mps, body = deployed.body.measure_sound_speed(), deployed.body
        if speed_mps is not None:
            events.append(SoundSpeedReport(body.name, body.time_s, deployed.position(body.position), speed_mps, "CTD"))
    return events


def _scan(deployed: DeployedVehicle, scan: Scan, scanning: Scanning) -> ScanReport:
    return ScanReport(
        vehicle=deployed.body.name,
        time_s=scan.time_s,
        position=deployed.position(deployed.body.position),
        first_bearing_deg=0.0,
        bearing_step_deg=scanning.resolution_deg,
        reach_m=scanning.reach_m,
        ranges_m=tuple(scan.ranges_m.tolist()),
        source="sim",
    )


def ranges(deployed: DeployedVehicle) -> list[FleetEvent]:
    """Return the ranges to moving targets that are due."""
    body = deployed.body
    return [
        RangeReport(
            vehicle=body.name,
            time_s=body.time_s,
            target=target,
            range_m=range_m,
            position=deployed.position(body.position),
            source="sim",
            position_sd_m=math.sqrt(body.state.position_variance_m2),
        )
        for target, range_m in deployed.ranging.step(body.time_s, body.true_position)
    ]


def _sounding(deployed: DeployedVehicle, measurement: BeamReturn) -> SoundingReport:
    if measurement.footprint is None:
        raise ValueError("a measurement without a return has no footprint")
    sonar = deployed.position(measurement.position)
    return SoundingReport(
        vehicle=measurement.vehicle,
        time_s=measurement.time_s,
        footprint=deployed.position(measurement.footprint),
        vehicle_depth_m=measurement.position.depth_m,
        range_m=measurement.range_m,
        source=measurement.source,
        beam=measurement.beam,
        position_sd_m=math.sqrt(deployed.body.state.position_variance_m2),
        beam_geometry=BeamGeometry(sonar.lat_deg, sonar.lon_deg, *_angles_deg(measurement)),
    )


def _angles_deg(measurement: BeamReturn) -> tuple[float | None, ...]:
    """Return roll, pitch and heading, and the beam's azimuth and angle from straight down where its range is slant."""
    attitude = (measurement.roll_rad, measurement.pitch_rad, measurement.heading_rad)
    beam = () if measurement.beam_rad is None else measurement.beam_rad
    return tuple(math.degrees(angle) for angle in (*attitude, *beam))


def _ping(deployed: DeployedVehicle, ping: SwathPing) -> PingReport:
    return PingReport(
        vehicle=ping.vehicle,
        time_s=ping.time_s,
        position=deployed.position(ping.position),
        roll_rad=ping.roll_rad,
        pitch_rad=ping.pitch_rad,
        heading_rad=ping.heading_rad,
        angles_rad=ping.angles_rad.astype(np.float32),
        ranges_m=ping.ranges_m.astype(np.float32),
        source=ping.source,
        position_sd_m=math.sqrt(deployed.body.state.position_variance_m2),
    )
