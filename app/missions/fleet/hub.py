"""All links together: which vehicles exist, how they are, and which mission hears of which vehicle."""

from collections.abc import Sequence
from typing import NamedTuple

import structlog

from app.missions.errors import ConflictError
from app.missions.fleet.interface import (
    Deployment,
    EventSink,
    FleetEvent,
    FleetLink,
    LinkCapabilities,
    LinkState,
    Position,
    StopReceipt,
    VehicleInfo,
    VehicleRefusedError,
    WaypointOrder,
)
from app.missions.spec.vehicle import VehicleKind
from imc_bridge.control.depth_layers import ALONE, DepthLayer

VehicleKey = tuple[VehicleKind, str]

SWITCHED_OFF = LinkCapabilities(ready_before_start=True)
"""Of a kind without a link: nobody comes from there, so no mission may wait for that."""

log = structlog.get_logger(__name__)


class _Claim(NamedTuple):
    mission_id: str
    called: str
    sink: EventSink


class FleetHub:
    """Routes commands to the link that reaches a vehicle, and its events to the mission that claimed it."""

    def __init__(self, links: Sequence[FleetLink]) -> None:
        self._links = {VehicleKind(link.kind): link for link in links}
        polled = {kind: link.polled_vehicles for kind, link in self._links.items()}
        self.polled = {kind: vehicles for kind, vehicles in polled.items() if vehicles is not None}
        """By kind: who is told of the requests of vehicles that poll."""
        self._claims: dict[VehicleKey, _Claim] = {}

    async def start(self) -> None:
        """Open every link."""
        for kind, link in self._links.items():
            await link.start(self._sink(kind))

    async def close(self) -> None:
        """Close every link, which stops every engaged vehicle; one link's trouble does not keep the others from it."""
        for kind, link in self._links.items():
            try:
                await link.close()
            except Exception:
                log.exception("link did not close", link=kind)

    @property
    def console_ids(self) -> frozenset[int]:
        """What plans of our vehicles are called by."""
        return frozenset(link.console_id for link in self._links.values() if link.console_id is not None)

    def know_peers(self, console_ids: frozenset[int]) -> None:
        """Learn by which ids processes on our database have led vehicles: what those were given is ours to end."""
        for link in self._links.values():
            link.know_peers(console_ids)

    @property
    def kinds(self) -> tuple[VehicleKind, ...]:
        """The kinds of vehicles that can be reached."""
        return tuple(self._links)

    def link(self, kind: VehicleKind) -> FleetLink | None:
        """Return the link that reaches vehicles of a kind; None where there is none."""
        return self._links.get(kind)

    def capabilities(self, kind: VehicleKind) -> LinkCapabilities:
        """Return what vehicles of a kind can do."""
        link = self._links.get(kind)
        return SWITCHED_OFF if link is None else link.capabilities

    def vehicles(self) -> list[tuple[VehicleInfo, str | None]]:
        """Return every known vehicle, each with the id of the mission it takes part in."""
        return [
            (info, self.claimed_by((VehicleKind(info.kind), info.name)))
            for link in self._links.values()
            for info in link.vehicles()
        ]

    def infos(self) -> dict[VehicleKey, VehicleInfo]:
        """Return what is known of every vehicle that was heard."""
        return {(kind, info.name): info for kind, link in self._links.items() for info in link.vehicles()}

    def info(self, key: VehicleKey) -> VehicleInfo:
        """Return what is known of a vehicle; state ``unknown`` when it was never heard."""
        kind, name = key
        link = self._links.get(kind)
        if link is None:
            return VehicleInfo(name, kind, LinkState.UNKNOWN, f"links of kind {kind} are switched off in the settings")
        info = link.vehicle(name)
        if info is not None:
            return info
        reason = "not heard since the service was started: is it switched on, and does it reach this service?"
        if link.capabilities.simulated:
            reason = "simulated: it is launched when its mission starts"
        return VehicleInfo(name, kind, LinkState.UNKNOWN, reason)

    def claimed_by(self, key: VehicleKey) -> str | None:
        """Return the id of the mission a vehicle takes part in."""
        claim = self._claims.get(key)
        return claim.mission_id if claim else None

    def owner_of(self, key: VehicleKey) -> str:
        """Return what the mission that a vehicle takes part in is called; '' without one."""
        claim = self._claims.get(key)
        return claim.called if claim else ""

    def claim(self, key: VehicleKey, mission_id: str, sink: EventSink, *, name: str) -> None:
        """Give a vehicle's events to a mission. Raises ConflictError when another one has it."""
        owner = self.claimed_by(key)
        if owner not in (None, mission_id):
            raise ConflictError(
                f"vehicle {key[1]!r} takes part in mission {self.owner_of(key)}",
                f"finish or abort that mission, or take the vehicle out of it: "
                f"DELETE /api/v1/missions/{owner}/vehicles/{key[1]}",
            )
        self._claims[key] = _Claim(mission_id, called(name, mission_id), sink)

    def release(self, key: VehicleKey, mission_id: str) -> None:
        """Give up a vehicle; nothing happens when the mission does not have it."""
        if self.claimed_by(key) == mission_id:
            del self._claims[key]

    def check_deployment(self, key: VehicleKey) -> None:
        """Raise VehicleRefusedError where a vehicle could be deployed now for no mission."""
        kind, name = key
        link = self._links.get(kind)
        if link is not None:
            link.check_deployment(name)

    async def prepare(self, deployment: Deployment) -> None:
        """Do beforehand what of :meth:`deploy` takes long. Raises VehicleRefusedError."""
        link = self._links.get(deployment.vehicle.kind)
        if link is not None:
            await link.prepare(deployment)

    def deploy(self, deployment: Deployment) -> None:
        """Prepare a vehicle for its mission, where there is a link to it. Raises VehicleRefusedError."""
        link = self._links.get(deployment.vehicle.kind)
        if link is not None:
            link.deploy(deployment)

    def end_deployment(self, deployment: Deployment) -> None:
        """Undo ``deploy`` at the mission's end."""
        link = self._links.get(deployment.vehicle.kind)
        if link is not None:
            link.end_deployment(deployment)

    async def engage(self, key: VehicleKey) -> None:
        """Make a vehicle ready to follow. Raises VehicleRefusedError."""
        await self._link(key).engage(key[1])

    async def order(self, key: VehicleKey, order: WaypointOrder) -> None:
        """Send a waypoint. Raises VehicleRefusedError."""
        await self._link(key).order(order)

    async def keep_way_home(
        self, key: VehicleKey, way: Sequence[Position], speed_mps: float, layer: DepthLayer = ALONE
    ) -> None:
        """Store a way home on board a vehicle. Raises VehicleRefusedError."""
        await self._link(key).keep_way_home(key[1], way, speed_mps, layer)

    async def drop_way_home(self, key: VehicleKey) -> None:
        """Leave no way home on board a vehicle. Raises VehicleRefusedError."""
        await self._link(key).drop_way_home(key[1])

    async def stop(self, key: VehicleKey) -> StopReceipt:
        """Stop a vehicle; whatever goes wrong is told in the receipt."""
        try:
            return await self._link(key).stop(key[1])
        except VehicleRefusedError as error:
            return StopReceipt(key[1], acknowledged=False, detail=error.reason)
        except Exception as error:
            log.exception("stop failed", vehicle=key[1])
            return StopReceipt(key[1], acknowledged=False, detail=f"stop failed: {error}")

    def _link(self, key: VehicleKey) -> FleetLink:
        kind, name = key
        try:
            return self._links[kind]
        except KeyError:
            reason = f"links of kind {kind} are switched off"
            raise VehicleRefusedError(name, reason, "switch them on in the settings") from None

    def _sink(self, kind: VehicleKind) -> EventSink:
        def receive(event: FleetEvent) -> None:
            claim = self._claims.get((kind, event.vehicle))
            if claim is not None:
                claim.sink(event)

        return receive


def called(name: str, mission_id: str) -> str:
    """Return how people are told of a mission: its name need not be unique."""
    return f"{name!r} ({mission_id})"
