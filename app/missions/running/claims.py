"""Which mission has which vehicle: every vehicle belongs to one at most."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from sqlalchemy.ext.asyncio import AsyncSession

from app.missions.errors import ConflictError
from app.missions.fleet.hub import FleetHub, called
from app.missions.fleet.interface import Deployment, LinkState, VehicleRefusedError, VehicleReport
from app.missions.live.mission import LiveMission
from app.missions.search.site import simulated_world
from app.missions.spec.vehicle import VehicleSpec
from app.missions.states import AT_SEA
from app.storage.database import Guard
from app.storage.processes import processes
from simulator.obstacles.obstacles import ObstacleWorld


def free_elsewhere(live: LiveMission, vehicles: Sequence[VehicleSpec] | None = None) -> Guard:
    """Return what refuses a transaction by which a mission goes to sea with vehicles that another process leads.

    ``vehicles``: those that are asked about, else the mission's own.
    """
    wanted = [(str(v.kind), v.name) for v in (vehicles or [member.spec for member in live.team])]

    async def check(session: AsyncSession) -> None:
        await processes.stand_in_line(session)
        taken = await processes.missions_with_vehicles(session, AT_SEA, wanted, live.id)
        for (_, name), mission in taken.items():
            raise _taken(name, called(*mission))

    return check


def _taken(vehicle: str, mission: str) -> ConflictError:
    return ConflictError(
        f"vehicle {vehicle!r} takes part in mission {mission}",
        "finish or abort that mission, or take the vehicle out of one of them",
    )


def _refused(vehicle: VehicleSpec, error: VehicleRefusedError) -> ConflictError:
    return ConflictError(f"vehicle {vehicle.name!r} {error.reason}", error.remedy)


class Claims:
    """Takes vehicles for missions and gives them up."""

    def __init__(self, hub: FleetHub) -> None:
        self._hub = hub

    def check_team(self, live: LiveMission) -> None:
        """Refuse a mission without vehicles, or with one that another mission has. Raises ConflictError."""
        if not list(live.team):
            raise ConflictError("the mission has no vehicle", "add one: POST /api/v1/missions/{id}/vehicles")
        for member in live.team:
            owner = self._hub.claimed_by(member.key)
            if owner not in (None, live.id):
                raise _taken(member.name, self._hub.owner_of(member.key))

    def check_links(self, live: LiveMission) -> None:
        """Refuse to start while a vehicle that has to be ready before is not. Raises ConflictError."""
        infos = [self._hub.info(member.key) for member in live.team if member.capabilities.ready_before_start]
        missing = [info for info in infos if info.state not in (LinkState.READY, LinkState.ENGAGED)]
        if missing:
            reasons = "; ".join(f"{info.name} is {info.state}: {info.reason or 'no reason known'}" for info in missing)
            raise ConflictError(
                f"not every vehicle is ready: {reasons}",
                "wait for it, take it out of the mission, or see what 'bathyfleet doctor' finds",
            )

    async def prepare(self, live: LiveMission, vehicles: Sequence[VehicleSpec]) -> None:
        """Do beforehand what takes long when vehicles are claimed. Raises ConflictError."""
        for vehicle in vehicles:
            try:
                await self._hub.prepare(_deployment(live, vehicle))
            except VehicleRefusedError as error:
                raise _refused(vehicle, error) from error

    def claim_team(self, live: LiveMission) -> None:
        """Claim every vehicle, or none when one cannot be had. Raises ConflictError."""
        before = {member.key for member in live.team if self._hub.claimed_by(member.key) == live.id}
        try:
            for member in live.team:
                self.claim(live, member.spec)
        except ConflictError:
            for member in live.team:
                if member.key not in before and self._hub.claimed_by(member.key) == live.id:
                    self.release(live, member.spec)
            raise

    def claim(self, live: LiveMission, vehicle: VehicleSpec) -> None:
        """Take one vehicle, whose link prepares it. Raises ConflictError."""
        key = (vehicle.kind, vehicle.name)
        self._hub.claim(key, live.id, live.receive, name=live.spec.name)
        try:
            self._hub.deploy(_deployment(live, vehicle))
        except VehicleRefusedError as error:
            self._hub.release(key, live.id)
            raise _refused(vehicle, error) from error

    def release(self, live: LiveMission, vehicle: VehicleSpec) -> None:
        """Leave one vehicle of a mission that goes on to others; a simulated one is put away."""
        self._hub.release((vehicle.kind, vehicle.name), live.id)
        if self._hub.capabilities(vehicle.kind).simulated:
            self._hub.end_deployment(_deployment(live, vehicle))

    def release_team(self, live: LiveMission) -> None:
        """Give every vehicle of a mission up."""
        for member in [*live.team, *live.team.departed.values()]:
            self._hub.release(member.key, live.id)
            self._hub.end_deployment(_deployment(live, member.spec))


def _deployment(live: LiveMission, vehicle: VehicleSpec) -> Deployment:
    def berth() -> tuple[float, float] | None:
        """Return a place by a search's entry that is free for this vehicle."""
        truth = world()
        if live.search is None or truth is None:
            return None
        member = live.team.get(vehicle.name)
        slot = member.slot if member is not None else len(list(live.team))
        apart_m = max(live.spec.limits.min_separation_m, 1.0) * 1.1
        clear_m = live.search.spec.safety_m + live.search.spare_m
        east, north = live.search.site.berths(slot + 1, apart_m, clear_m, truth.solid)[slot]
        lat, lon = live.frame.to_geographic(np.array(east), np.array(north))
        return float(lat), float(lon)

    def world() -> ObstacleWorld | None:
        return None if live.spec.search is None else simulated_world(live.spec, live.spec.search)

    return Deployment(vehicle, live.id, live.spec, berth, world, _last_heard(live, vehicle.name))


def _last_heard(live: LiveMission, name: str) -> VehicleReport | None:
    """Return what was heard last of a vehicle of a mission at sea; another process may have heard it."""
    member = live.team.get(name) or live.team.departed.get(name)
    if live.header.state not in AT_SEA or member is None or member.report is None:
        return None
    battery_pct = member.report.battery_pct
    return replace(member.report, battery_pct=member.stored_battery_pct if battery_pct is None else battery_pct)
