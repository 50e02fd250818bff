"""Which mission has which vehicle: every vehicle belongs to one at most."""

import math
from collections.abc import Callable, Sequence

import numpy as np
from sqlalchemy.ext.asyncio import AsyncSession

from app.missions.errors import ConflictError
from app.missions.fleet.hub import FleetHub
from app.missions.fleet.interface import LinkState
from app.missions.fleet.links.sim import Launch, Lookout, SimFleetLink
from app.missions.live.mission import LiveMission
from app.missions.running.ownership import AT_SEA
from app.missions.search.site import simulated_world
from app.missions.spec.mission import VehicleKind, VehicleSpec
from app.storage import processes
from app.storage.database import Guard
from simulator.targets import RangingNoise

Lead = Callable[[str, str, str | None], None]
"""How a vehicle is led from now on: its name, the guidance, the gateway."""

ShowArea = Callable[[str, Sequence[tuple[float, float]]], None]
"""What other consoles are shown of a mission: its name and its area's ring; an empty ring takes it away."""


def free_elsewhere(live: LiveMission, vehicles: Sequence[VehicleSpec] | None = None) -> Guard:
    """Return what refuses a transaction by which a mission goes to sea with vehicles that another process leads.

    ``vehicles``: those that are asked about, else the mission's own.
    """
    wanted = [(str(v.kind), v.name) for v in (vehicles or [member.spec for member in live.team])]

    async def check(session: AsyncSession) -> None:
        await processes.stand_in_line(session)
        taken = await processes.missions_with_vehicles(session, AT_SEA, wanted, live.id)
        for (_, name), mission_id in taken.items():
            raise _taken(name, mission_id)

    return check


def _taken(vehicle: str, mission_id: str) -> ConflictError:
    return ConflictError(
        f"vehicle {vehicle!r} takes part in mission {mission_id}",
        "finish or abort that mission, or take the vehicle out of one of them",
    )


class Claims:
    """Takes vehicles for missions and gives them up."""

    def __init__(self, hub: FleetHub, sim: SimFleetLink, lead: Lead, show_area: ShowArea) -> None:
        self._hub = hub
        self._sim = sim
        self._lead = lead
        self._show_area = show_area

    def check_team(self, live: LiveMission) -> None:
        """Refuse a mission without vehicles, or with one that another mission has. Raises ConflictError."""
        if not list(live.team):
            raise ConflictError("the mission has no vehicle", "add one: POST /api/v1/missions/{id}/vehicles")
        for member in live.team:
            owner = self._hub.claimed_by(member.key)
            if owner not in (None, live.id):
                raise _taken(member.name, owner)

    def check_links(self, live: LiveMission) -> None:
        """Refuse to start while a vehicle that is commanded over IMC is not ready. Raises ConflictError."""
        infos = [self._hub.info(member.key) for member in live.team if member.spec.kind is VehicleKind.IMC]
        missing = [info for info in infos if info.state not in (LinkState.READY, LinkState.ENGAGED)]
        if missing:
            reasons = "; ".join(f"{info.name} is {info.state}: {info.reason or 'no reason known'}" for info in missing)
            raise ConflictError(
                f"not every vehicle is ready: {reasons}",
                "wait for it, take it out of the mission, or see what 'bathyfleet doctor' finds",
            )

    def claim_team(self, live: LiveMission) -> None:
        """Claim every vehicle, or none when one cannot be had. Raises ConflictError."""
        before = {member.key for member in live.team if self._hub.claimed_by(member.key) == live.id}
        try:
            for member in live.team:
                self.claim(live, member.spec)
        except ConflictError:
            for member in live.team:
                if member.key not in before:
                    self._hub.release(member.key, live.id)
            raise

    def claim(self, live: LiveMission, vehicle: VehicleSpec) -> None:
        """Take one vehicle; a simulated one is launched. Raises ConflictError."""
        key = (vehicle.kind, vehicle.name)
        self._hub.claim(key, live.id, live.receive)
        if vehicle.kind is VehicleKind.IMC:
            self._lead(vehicle.name, vehicle.guidance, vehicle.gateway)
            self._show_area(live.spec.name, live.spec.area.ring)
        if vehicle.kind is VehicleKind.SIM:
            try:
                self._launch(live, vehicle)
            except ConflictError:
                self._hub.release(key, live.id)
                raise

    def _launch(self, live: LiveMission, vehicle: VehicleSpec) -> None:
        size = live.area.max(axis=0)
        start = (vehicle.start[1], vehicle.start[0]) if vehicle.start is not None else self._berth(live, vehicle)
        search = live.spec.search
        launch = Launch(
            vehicle=vehicle.name,
            mission_id=live.id,
            sensor=vehicle.sensor,
            south_west=(live.frame.origin_lat_deg, live.frame.origin_lon_deg),
            width_m=float(size[0]),
            height_m=float(size[1]),
            start=start,
            noise=live.spec.sounding_noise,
            targets=tuple(live.spec.targets),
            ranging=RangingNoise(
                relative_sd=live.spec.tracking.range_noise,
                sd_m=live.spec.tracking.range_sd_m,
                hearing_m=live.spec.tracking.hearing_m or math.inf,
            ),
            lookout=None
            if search is None
            else Lookout(simulated_world(live.spec, search), search.scanner.reach_m, search.scanner.resolution_deg),
        )
        try:
            self._sim.launch(launch)
        except ValueError as error:
            raise ConflictError(f"vehicle {vehicle.name!r} cannot be launched: {error}", "change its start") from error

    def _berth(self, live: LiveMission, vehicle: VehicleSpec) -> tuple[float, float] | None:
        """Return latitude and longitude of a free place by a search's entry for each vehicle; None: anywhere."""
        member = live.team.get(vehicle.name)
        if live.search is None:
            return None
        slot = member.slot if member is not None else len(list(live.team))
        limits = live.spec.limits
        apart_m = max(limits.min_separation_m, 1.0) * 1.1
        east, north = live.search.site.berths(slot + 1, apart_m, live.search.spec.safety_m)[slot]
        lat, lon = live.frame.to_geographic(np.array(east), np.array(north))
        return float(lat), float(lon)

    def release_team(self, live: LiveMission) -> None:
        """Give every vehicle of a mission up; its simulated ones are put away."""
        self._show_area(live.spec.name, ())
        for member in [*live.team, *live.team.left.values()]:
            self._hub.release(member.key, live.id)
            if member.spec.kind is VehicleKind.SIM and self._hub.claimed_by(member.key) is None:
                self._sim.put_away(member.name)
