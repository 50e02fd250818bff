"""Vehicles that join a mission and leave it, while it runs too."""

import asyncio
from datetime import datetime

from app.missions import states
from app.missions.clock import now
from app.missions.errors import ConflictError, VehicleNotFoundError
from app.missions.fleet.hub import FleetHub
from app.missions.fleet.interface import StopReceipt
from app.missions.flight.orders import OrderBook
from app.missions.live.mission import LiveMission
from app.missions.running.admission import check_vehicle
from app.missions.running.claims import Claims, free_elsewhere
from app.missions.running.supervisor import PATIENCE_S, MissionSupervisor
from app.missions.spec.mounting import MountingSpec
from app.missions.spec.vehicle import VehicleSpec
from app.missions.states import AT_SEA, ENDED, MissionState
from app.missions.team import Member
from app.missions.views.mission import Level
from app.storage.models import MissionVehicleRow
from app.storage.queries import missions as mission_queries
from app.storage.queries import pings as ping_queries
from app.storage.queries import soundings as sounding_queries


class TeamChanges:
    """Changes which vehicles take part in missions."""

    def __init__(self, hub: FleetHub, claims: Claims, supervisor: MissionSupervisor) -> None:
        self._hub = hub
        self._claims = claims
        self._supervisor = supervisor

    async def join(self, live: LiveMission, vehicle: VehicleSpec, actor: str) -> None:
        """Let a vehicle join. Raises ConflictError, InvalidRequestError."""
        async with self._supervisor.acting(live.id):
            refuse_ended(live, "takes no more vehicles")
            live.refuse_ending()
            check_vehicle(vehicle, live.spec, self._hub.kinds)
            await _refuse_another_mounting(live, vehicle)
            if live.team.get(vehicle.name) is not None:
                raise ConflictError(
                    f"vehicle {vehicle.name!r} takes part already", "choose another name, or remove the vehicle first"
                )
            if live.header.state in AT_SEA:
                await self._claims.prepare(live, [vehicle])
                self._claims.claim(live, vehicle)
            try:
                slot = await _store_joining(live, vehicle)
            except BaseException:
                self._claims.release(live, vehicle)
                raise
            live.team.join(vehicle, slot)
            live.state_mounting(vehicle.name, vehicle.mounting)
            if live.header.state is MissionState.DRAFT:
                await self._supervisor.set_state(live, states.move(MissionState.DRAFT, "complete_draft"), "", actor)
            await live.journal.log(Level.INFO, "vehicle", f"{vehicle.name} joined", vehicle=vehicle.name, actor=actor)
            live.changed.set()

    async def rejoin(self, live: LiveMission, name: str, actor: str) -> None:
        """Let a vehicle that left take part again, described as it was. Raises VehicleNotFoundError, ConflictError."""
        member = live.team.departed.get(name)
        if member is None:
            gone = ", ".join(live.team.departed) or "none"
            raise VehicleNotFoundError(f"vehicle {name!r} has not left this mission", f"those that have: {gone}")
        await self.join(live, member.spec, actor)

    async def take_out(self, live: LiveMission, name: str, actor: str) -> None:
        """Stop a vehicle and take it out of the mission. Raises VehicleNotFoundError, ConflictError."""
        refuse_ended(live, "keeps its vehicles")
        await self.stop_one(live, name, actor)

    async def stop_one(self, live: LiveMission, name: str, actor: str) -> list[StopReceipt]:
        """Stop a vehicle and take it out of the mission; once that has ended it stays in it and is told once more.

        Raises
        ------
        VehicleNotFoundError, ConflictError
            The latter when it takes part in another mission meanwhile.
        """
        if live.header.state is MissionState.RUNNING and await self._supervisor.held_up(live):
            return await self._leave(live, live.team.named(name), actor)
        async with self._supervisor.acting(live.id):
            member = live.team.named(name)
            if live.header.state in ENDED:
                return [await self._stop_again(live, member)]
            return await self._leave(live, member, actor)

    async def _stop_again(self, live: LiveMission, member: Member) -> StopReceipt:
        owner = self._hub.claimed_by(member.key)
        if owner is not None:
            raise ConflictError(
                f"the mission is {live.header.state}, and vehicle {member.name!r} takes part in mission "
                f"{self._hub.owner_of(member.key)} now",
                f"stop it there: POST /api/v1/missions/{owner}/vehicles/{member.name}/abort",
            )
        return await self._supervisor.stop_vehicle(live, member)

    async def _leave(self, live: LiveMission, member: Member, actor: str) -> list[StopReceipt]:
        stops: list[StopReceipt] = []
        at = now()
        # As with a mission: a vehicle does not wait for a slow disk.
        written = asyncio.ensure_future(_store_leaving(live, member.name, at))
        await asyncio.wait([written], timeout=PATIENCE_S)
        claimed = self._hub.claimed_by(member.key) == live.id
        live.part(OrderBook).leave(member)
        live.team.leave(member.name, at)
        live.boundaries.forget(member.name)
        live.changed.set()
        live.publish_summary()
        if claimed:
            stops = [await self._supervisor.stop_vehicle(live, member)]
            self._hub.release(member.key, live.id)
        await written
        if live.header.state is MissionState.READY and not list(live.team):
            move = states.move(MissionState.READY, "reopen_draft")
            await self._supervisor.set_state(live, move, "no vehicle left", actor)
        await live.journal.log(Level.INFO, "vehicle", f"{member.name} left", vehicle=member.name, actor=actor)
        return stops


async def _refuse_another_mounting(live: LiveMission, vehicle: VehicleSpec) -> None:
    """Refuse a vehicle whose sonar is stated to be mounted otherwise than where it sounded before."""
    if vehicle.mounting == live.corrections.stated_mountings.get(vehicle.name, MountingSpec()):
        return
    async with live.database.reading() as session:
        sounded = await sounding_queries.vehicles_of(session, live.id)
        pinged = await ping_queries.waiting(session, live.id)
        chunks = await ping_queries.chunks(session, live.id)
    if vehicle.name in sounded | set(pinged) | {chunk.vehicle for chunk in chunks}:
        raise ConflictError(
            f"vehicle {vehicle.name!r} sounded in this mission before, with another mounting stated",
            f"let it join as it was, and correct that: PUT /api/v1/missions/{live.id}/mountings/{vehicle.name}",
        )


async def _store_joining(live: LiveMission, vehicle: VehicleSpec) -> int:
    """Write a vehicle's part in a mission down; returns its place in the depth stack."""
    async with live.database.writing() as session:
        if live.header.state in AT_SEA:
            await free_elsewhere(live, [vehicle])(session)
        rows = await mission_queries.vehicles_of(session, live.id)
        known = next((row for row in rows if row.name == vehicle.name), None)
        if known is not None:
            # It comes back: it keeps its place, and surveys whatever it did when it left.
            known.spec, known.left_at, known.withdrawal = vehicle.model_dump(mode="json"), None, None
            return known.slot
        session.add(vehicle_row(live.id, vehicle, len(rows)))
        return len(rows)


async def _store_leaving(live: LiveMission, name: str, at: datetime) -> None:
    async with live.database.writing() as session:
        for row in await mission_queries.vehicles_of(session, live.id):
            if row.name == name:
                row.left_at = at


def vehicle_row(mission_id: str, vehicle: VehicleSpec, slot: int) -> MissionVehicleRow:
    """Return a vehicle's part in a mission as it is stored."""
    return MissionVehicleRow(
        mission_id=mission_id,
        name=vehicle.name,
        slot=slot,
        spec=vehicle.model_dump(mode="json"),
        joined_at=now(),
        left_at=None,
    )


def refuse_ended(live: LiveMission, words: str) -> None:
    """Refuse what cannot be done to a mission any more. Raises ConflictError."""
    if live.header.state in ENDED:
        raise ConflictError(f"the mission is {live.header.state} and {words}", "create a new mission")
