"""The watch that a process keeps beside the others: what nobody has is taken up, what is lost is let go in time."""

import asyncio
import random
from collections.abc import Sequence

import structlog
from sqlalchemy.exc import SQLAlchemyError

from app.missions.alarm_kinds import AlarmKind
from app.missions.errors import ConflictError, MissionElsewhereError
from app.missions.fleet.hub import FleetHub
from app.missions.live.mission import LiveMission
from app.missions.running.claims import Claims
from app.missions.running.ownership import PERIOD_S, Ownership
from app.missions.running.registry import MissionRegistry
from app.missions.running.supervisor import MissionSupervisor
from app.missions.spec.failsafes import Failsafe, Response
from app.missions.states import AT_SEA, MissionState
from app.missions.views.mission import Level
from app.storage.database import Database
from app.storage.models import MissionRow
from app.storage.processes.membership import MembershipLostError
from app.storage.queries import missions as mission_queries

log = structlog.get_logger(__name__)


class Failover:
    """Keeps this process' part of the missions going.

    Parameters
    ----------
    ownership, registry
        What this process may have, and what it has.
    """

    def __init__(
        self,
        database: Database,
        hub: FleetHub,
        ownership: Ownership,
        registry: MissionRegistry,
        supervisor: MissionSupervisor,
        claims: Claims,
    ) -> None:
        self._database = database
        self._hub = hub
        self._ownership = ownership
        self._registry = registry
        self._supervisor = supervisor
        self._claims = claims
        self._task: asyncio.Task[None] | None = None

    async def begin(self) -> None:
        """Take up what nobody has, and keep watch from now on."""
        await self._ownership.enter()
        await self._take_up(await self._ownership.look())
        self._task = asyncio.create_task(self._keep(), name="watch")

    async def end(self) -> None:
        """Keep watch no longer."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)

    async def may_take_up(self, row: MissionRow) -> bool:
        """Tell whether a mission is left to others, because this process cannot reach its vehicles."""
        if row.state not in AT_SEA or not self._ownership.peers:
            return True
        async with self._database.reading() as session:
            vehicles = await mission_queries.vehicles_of(session, row.id)
        return {str(vehicle.spec["kind"]) for vehicle in vehicles if vehicle.left_at is None} <= set(self._hub.kinds)

    async def resume(self, live: LiveMission) -> None:
        """Go on with a mission that was at sea when it was taken up."""
        if live.header.state not in AT_SEA:
            return
        try:
            self._claims.claim_team(live)
        except ConflictError as error:
            # The settings changed while nobody had it: one mission's trouble is not the others'.
            await self._supervisor.set_state(live, MissionState.FAILED, str(error), "service", AlarmKind.MISSION_FAILED)
            return
        if live.header.state is MissionState.RUNNING:
            self._supervisor.run(live)
            # Vehicles wait for no line of the log.
            words = "the service was started anew: the mission goes on with what was committed"
            facts = {"failsafe": Failsafe.SERVICE_RESTARTED, "response": Response.WARN}
            await live.journal.log(Level.WARNING, "failsafe", words, **facts)

    async def _keep(self) -> None:
        while True:
            try:
                async with asyncio.timeout(PERIOD_S):
                    await self._ownership.called.wait()
            except TimeoutError:
                pass
            self._ownership.called.clear()
            try:
                await self._take_up(await self._ownership.look())
            except MembershipLostError as error:
                log.error("others may take this process for dead: its vehicles are stopped", error=str(error))
                await self._stand_aside()
            except (SQLAlchemyError, OSError) as error:
                log.error("cannot look after the other processes", error=str(error))
            except Exception:
                log.exception("cannot look after the other processes")

    async def _take_up(self, missions: Sequence[str]) -> None:
        """Take up missions at sea that nobody has, as far as this process may."""
        # Where several processes take up what one left behind, each comes by its share.
        for mission_id in random.sample(missions, len(missions)):
            try:
                await self._registry.get(mission_id)
            except MissionElsewhereError:
                continue
            except (MembershipLostError, SQLAlchemyError, OSError):
                raise  # that concerns all of them
            except Exception:
                # One that cannot be read, as when a newer version wrote it, is not the others' trouble.
                log.exception("a mission cannot be taken up", mission=mission_id)
                continue
            log.warning("mission taken up", mission=mission_id)

    async def _stand_aside(self) -> None:
        """Stop the vehicles before others take the missions up; go on as soon as that is allowed again."""
        ours = [live for live in self._registry if live.id in self._supervisor.runs]
        await asyncio.gather(*(self._supervisor.halt(live) for live in ours))
        while True:
            try:
                unchanged = await self._ownership.enter()
                break
            except (MembershipLostError, SQLAlchemyError, OSError) as error:
                log.error("not among the living yet", error=str(error))
                await asyncio.sleep(PERIOD_S)
        if not unchanged:
            for live in self._registry:
                self._claims.release_team(live)
            self._registry.drop()
            return
        for live in self._registry:
            if live.header.state is MissionState.RUNNING and live.id not in self._supervisor.runs:
                await live.journal.log(
                    Level.WARNING, "resumed", "the database was out of reach; the vehicles were stopped meanwhile"
                )
                self._supervisor.run(live)
