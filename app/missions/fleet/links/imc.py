"""Vehicles on the IMC network (DUNE on board), through :class:`imc_bridge.Bridge`."""

import math
from collections.abc import Sequence
from dataclasses import replace

from app.missions import metrics
from app.missions.errors import InvalidRequestError
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
    RestartReport,
    SoundingReport,
    SoundSpeedReport,
    StopReceipt,
    VehicleInfo,
    VehicleRefusedError,
    VehicleReport,
    WaypointOrder,
    WaypointReport,
    WaypointStatus,
)
from app.missions.settings import ImcSettings
from imc_bridge import (
    BottomPoint,
    Bridge,
    BridgeEvent,
    BridgeSettings,
    Fault,
    Guidance,
    LinkChange,
    NodeState,
    NodeView,
    PacketsDropped,
    RefusedError,
    Restarted,
    Sounding,
    SoundSpeedSample,
    StateReport,
    SwathPing,
    TargetRange,
    Waypoint,
    WaypointChange,
)
from imc_bridge.control.depth_layers import ALONE, DepthLayer
from imc_bridge.doctor.diagnosis import drop_words, radio_gap_words
from imc_bridge.doctor.doctor import Diagnosis, judge
from imc_bridge.network.consoles import Mark

_UNENGAGED = {
    NodeState.HEARD: LinkState.HEARD,
    NodeState.ANNOUNCED: LinkState.HEARD,
    NodeState.ACTIVE: LinkState.HEARD,
    NodeState.IN_PLAN: LinkState.HEARD,
    NodeState.READY: LinkState.READY,
    NodeState.LOST: LinkState.LOST,
    NodeState.EXPECTED_OFFLINE: LinkState.EXPECTED_OFFLINE,
}
DUNE_CIRCLES_M = 15.0
"""From this distance on DUNE circles about a reference in place of going straight to it."""
MAX_CORNERS = 24
"""Of an area that are shown to other consoles."""
_SILENT = frozenset({NodeState.LOST, NodeState.EXPECTED_OFFLINE})


def make_imc_link(settings: ImcSettings, time_scale: float) -> "ImcFleetLink":
    """The link as the service's settings describe it."""
    return ImcFleetLink(bridge_settings(settings, time_scale))


def bridge_settings(settings: ImcSettings, time_scale: float) -> BridgeSettings:
    """The bridge's settings as the service's describe them."""
    return BridgeSettings(**settings.model_dump(exclude={"enabled"}), time_scale=time_scale)


class ImcFleetLink(FleetLink):
    """The fleet interface over IMC/UDP; see :class:`app.missions.fleet.interface.FleetLink` for its contract."""

    kind = "imc"
    capabilities = LinkCapabilities(ready_before_start=True, keeps_way_home=True, circles_m=DUNE_CIRCLES_M)

    def __init__(self, settings: BridgeSettings) -> None:
        self._bridge = Bridge(settings)
        self._sink: EventSink = lambda _event: None
        self._led: dict[str, tuple[Guidance, str]] = {}

    @property
    def console_id(self) -> int:
        """Our IMC id."""
        return self._bridge.settings.id

    def know_peers(self, console_ids: frozenset[int]) -> None:
        """See :meth:`app.missions.fleet.interface.FleetLink.know_peers`."""
        self._bridge.know_peers(console_ids)

    async def start(self, sink: EventSink) -> None:
        """Bind the ports and listen.

        Raises ``imc_bridge.PortInUseError`` when a port is taken, InvalidRequestError when an interface is not there.
        """
        self._sink = sink
        try:
            await self._bridge.start(self._forward)
        except ValueError as error:
            raise InvalidRequestError("imc", str(error), "See docs/settings.md") from None

    async def close(self) -> None:
        """Stop every engaged vehicle, then release sockets and tasks."""
        await self._bridge.close()

    def vehicles(self) -> Sequence[VehicleInfo]:
        """Every vehicle heard of, by IMC id."""
        return self._infos(self._bridge.nodes())

    def vehicle(self, name: str) -> VehicleInfo | None:
        """Return the first of this name, without a look at all the others; None where there is none."""
        return next(iter(self._infos(self._bridge.nodes(name))), None)

    def _infos(self, nodes: Sequence[NodeView]) -> list[VehicleInfo]:
        """Return those that are vehicles, and wanted."""
        wanted = self._bridge.settings.vehicles
        lost = self._bridge.drops.recent
        trouble = ". ".join(drop_words(lost, self._bridge.transport.receive_buffer_bytes)) if lost else ""
        return [
            replace(_info(node), machine_advice=trouble)
            for node in nodes
            if node.is_vehicle and (not wanted or node.name in wanted)
        ]

    def deploy(self, deployment: Deployment) -> None:
        """Lead a vehicle from its next engagement on as its mission describes it, whose area other consoles show."""
        vehicle = deployment.vehicle
        self._led[vehicle.name] = Guidance(vehicle.guidance), vehicle.gateway or ""
        self._bridge.want(vehicle.name)
        if vehicle.gateway:
            self._bridge.want(vehicle.gateway)
        self._show_area(deployment.mission.name, deployment.mission.area.ring)

    def end_deployment(self, deployment: Deployment) -> None:
        """Take the mission's area off other consoles."""
        self._show_area(deployment.mission.name, ())

    def _show_area(self, mission: str, ring: Sequence[tuple[float, float]]) -> None:
        """Show a mission's area on other consoles' maps, corner by corner: (longitude, latitude); empty: no longer."""
        board = self._bridge.board
        for name in [name for name in board.marks if name.startswith(f"{mission} corner ")]:
            board.show(name, None)
        for index, (lon, lat) in enumerate(ring[:MAX_CORNERS]):
            board.show(f"{mission} corner {index + 1}", Mark("Area", lat, lon))

    async def engage(self, vehicle: str) -> None:
        """Make the vehicle ours; raises VehicleRefusedError.

        A vehicle that someone else aborted or took over is left alone until it was stopped from here, which pausing a
        mission does: only an operator may decide that it goes on.
        """
        intervention = self._bridge.intervention(vehicle)
        if intervention:
            remedy = "It is left alone; when it may go on, pause and resume the mission"
            raise VehicleRefusedError(vehicle, intervention, remedy)
        try:
            await self._bridge.engage(vehicle, *self._led.get(vehicle, (Guidance.FOLLOW, "")))
        except RefusedError as error:
            raise VehicleRefusedError(vehicle, error.reason, error.remedy) from error

    async def order(self, order: WaypointOrder) -> None:
        """Send a waypoint; raises VehicleRefusedError when the vehicle is not engaged."""
        waypoint = Waypoint(
            mission_id=order.mission_id,
            step=order.step,
            lat_deg=order.position.lat_deg,
            lon_deg=order.position.lon_deg,
            depth_m=order.position.depth_m,
            speed_mps=order.speed_mps,
            arrival_radius_m=order.arrival_radius_m,
            min_altitude_m=order.min_altitude_m,
            lead_lat_deg=order.lead.lat_deg if order.lead else None,
            lead_lon_deg=order.lead.lon_deg if order.lead else None,
            circle_lat_deg=order.circle.lat_deg if order.circle else None,
            circle_lon_deg=order.circle.lon_deg if order.circle else None,
            bottom=tuple(BottomPoint(place.lat_deg, place.lon_deg, place.depth_m) for place in order.bottom),
        )
        try:
            self._bridge.goto(order.vehicle, waypoint)
        except RefusedError as error:
            raise VehicleRefusedError(order.vehicle, error.reason, error.remedy) from error
        place = order.position
        self._bridge.board.show(
            f"waypoint of {order.vehicle}", Mark("Waypoint", place.lat_deg, place.lon_deg, place.depth_m)
        )

    async def stop(self, vehicle: str, *, timeout_s: float = 3.0) -> StopReceipt:
        """Stop the vehicle; a plan of another console is left alone."""
        self._bridge.board.show(f"waypoint of {vehicle}", None)
        result = await self._bridge.stop(vehicle, timeout_s=timeout_s)
        return StopReceipt(result.vehicle, result.acknowledged, result.detail)

    async def keep_way_home(
        self, vehicle: str, way: Sequence[Position], speed_mps: float, layer: DepthLayer = ALONE
    ) -> None:
        """Store a way home in DUNE's plan database, for its LostComms supervisor; raises VehicleRefusedError."""
        places = [
            Waypoint("home", k, place.lat_deg, place.lon_deg, place.depth_m, speed_mps) for k, place in enumerate(way)
        ]
        try:
            await self._bridge.keep_way_home(vehicle, places, layer)
        except RefusedError as error:
            raise VehicleRefusedError(vehicle, error.reason, error.remedy) from error

    async def drop_way_home(self, vehicle: str) -> None:
        """Disarm the supervisor and delete the way home; raises VehicleRefusedError when that is not confirmed."""
        try:
            await self._bridge.drop_way_home(vehicle)
        except RefusedError as error:
            raise VehicleRefusedError(vehicle, error.reason, error.remedy) from error

    def diagnosis(self) -> Diagnosis:
        """What keeps vehicles from working with us, as heard so far."""
        return judge(self._bridge, self._bridge.listening_s)

    def _forward(self, event: BridgeEvent) -> None:
        if isinstance(event, PacketsDropped):
            metrics.PACKETS_DROPPED.inc(event.count)
        translated = _translate(event)
        if translated is not None:
            self._sink(translated)


def _translate(event: BridgeEvent) -> FleetEvent | None:
    match event:
        case StateReport():
            return vehicle_report(event)
        case Sounding():
            return sounding_report(event)
        case SwathPing():
            return ping_report(event)
        case TargetRange():
            return range_report(event)
        case SoundSpeedSample():
            return sound_speed_report(event)
        case WaypointChange():
            return WaypointReport(
                vehicle=event.vehicle,
                mission_id=event.waypoint.mission_id,
                step=event.waypoint.step,
                status=WaypointStatus(event.status.value),
                reason=event.reason,
            )
        case Restarted():
            where = ", under water when it was last heard before" if event.submerged else ""
            words = (
                f"DUNE on board has restarted{where}: what it was doing is forgotten, and it is asked to follow again"
            )
            return RestartReport(event.vehicle, words)
        case LinkChange():
            state = _link_state(event.state, event.engaged, event.ours)
            return LinkReport(event.vehicle, state, event.reason, event.goes_home)
        case Fault():
            return fault_report(event)
        case _:
            # A refused Distance or ping is counted in the vehicle's details.
            return None


def _beam_geometry(sounding: Sounding) -> BeamGeometry | None:
    angles = (
        sounding.roll_rad,
        sounding.pitch_rad,
        sounding.yaw_rad,
        sounding.beam_azimuth_rad,
        sounding.beam_off_nadir_rad,
    )
    degrees = (None if angle is None else math.degrees(angle) for angle in angles)
    return BeamGeometry.where_known(sounding.vehicle_lat_deg, sounding.vehicle_lon_deg, *degrees)


def _link_state(state: NodeState, engaged: bool, ours: bool) -> LinkState:
    """``ours``: it executes our plan. One of an earlier run is replaced when the vehicle is engaged."""
    if engaged and state not in _SILENT:
        return LinkState.ENGAGED
    if state is NodeState.IN_PLAN and ours:
        return LinkState.READY
    return _UNENGAGED[state]


def sounding_report(event: Sounding) -> SoundingReport:
    """What the bridge measured, as missions know it."""
    return SoundingReport(
        vehicle=event.vehicle,
        time_s=event.time_s,
        footprint=Position(event.lat_deg, event.lon_deg, event.bottom_depth_m),
        vehicle_depth_m=event.vehicle_depth_m,
        range_m=event.range_m,
        source=event.source,
        beam=event.beam,
        position_sd_m=event.position_sd_m,
        beam_geometry=_beam_geometry(event),
    )


def ping_report(event: SwathPing) -> PingReport:
    """What a multibeam measured, as missions know it."""
    return PingReport(
        vehicle=event.vehicle,
        time_s=event.time_s,
        position=Position(event.lat_deg, event.lon_deg, event.depth_m),
        roll_rad=event.roll_rad,
        pitch_rad=event.pitch_rad,
        heading_rad=event.yaw_rad,
        angles_rad=event.angles_rad,
        ranges_m=event.ranges_m,
        source=event.source,
        position_sd_m=event.position_sd_m,
    )


def range_report(event: TargetRange) -> RangeReport:
    """A range that the bridge heard of, as missions know it."""
    return RangeReport(
        vehicle=event.vehicle,
        time_s=event.time_s,
        target=event.target,
        range_m=event.range_m,
        position=Position(event.vehicle_lat_deg, event.vehicle_lon_deg, event.vehicle_depth_m),
        source=event.source,
        position_sd_m=event.position_sd_m,
    )


def sound_speed_report(event: SoundSpeedSample) -> SoundSpeedReport:
    """A sound speed that the bridge heard of, as missions know it."""
    return SoundSpeedReport(
        vehicle=event.vehicle,
        time_s=event.time_s,
        position=Position(event.lat_deg, event.lon_deg, event.depth_m),
        speed_mps=event.speed_mps,
        source=event.source,
    )


def fault_report(event: Fault) -> FaultReport:
    """A fault that the bridge heard of, as missions know it."""
    return FaultReport(event.vehicle, event.time_s, FaultKind(event.kind.value), event.reason, event.over)


def vehicle_report(state: StateReport) -> VehicleReport:
    """What the bridge heard of a vehicle, as missions know it."""
    return VehicleReport(
        vehicle=state.vehicle,
        time_s=state.time_s,
        position=Position(state.lat_deg, state.lon_deg, state.depth_m),
        heading_rad=state.heading_rad,
        speed_mps=state.speed_mps,
        altitude_m=state.altitude_m,
        battery_pct=state.battery_pct,
        battery_confidence_pct=state.battery_confidence_pct,
        energy_left_s=state.energy_left_s,
        position_sd_m=state.position_sd_m,
        current_mps=state.current_mps,
    )


def _info(node: NodeView) -> VehicleInfo:
    details = {
        "operation mode": node.operation_mode,
        "plan": node.plan_id,
        "plan control": node.plan_state,
        "IMC version": node.imc_version,
        "clock ahead of ours": None if node.clock_offset_s is None else f"{node.clock_offset_s:.1f} s",
        "bottom sensors": ", ".join(node.bottom_sensors) or None,
        "soundings": str(node.soundings),
        "soundings refused": "; ".join(f"{reason}: {count}" for reason, count in node.refused.items()) or None,
        "pings": str(node.pings) if node.pings else None,
        "pings refused": "; ".join(f"{reason}: {count}" for reason, count in node.pings_refused.items()) or None,
        "rate limiters": node.rate_limiters,
        "way home": node.way_home or None,
        "conflict": node.conflict,
    }
    return VehicleInfo(
        name=node.name,
        kind="imc",
        state=_link_state(node.state, node.engaged, node.ours),
        reason=node.reason,
        age_s=node.age_s,
        position_age_s=node.position_age_s,
        without_position=node.without_position,
        address=node.address,
        imc_id=node.imc_id,
        report=None if node.report is None else vehicle_report(node.report),
        goes_home=node.goes_home,
        faults=tuple(fault_report(fault) for fault in node.faults),
        details={key: value for key, value in details.items() if value is not None},
        # Only a vehicle that came back shows that it was radio that ended.
        advice=". ".join(radio_gap_words(node.radio_gaps)) if node.radio_gaps and node.state not in _SILENT else "",
    )
