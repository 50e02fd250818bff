"""The watch that a process keeps beside the others: what nobody has is taken up, what is lost is let go in time."""

import asyncio
import random
import time
from collections.abc import Sequence

import structlog
from sqlalchemy.exc import SQLAlchemyError

from app.missions.alarm_kinds import AlarmKind
from app.missions.errors import ConflictError, MissionElsewhereError, NotAMemberError
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
from app.storage.queries import consoles as console_queries
from app.storage.queries import missions as mission_queries

AGAIN_S = 60.0
"""After this long a mission is tried again that could not be taken up, though the database answered."""

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
        self._taking: asyncio.Task[None] | None = None
        """Takes missions up, beside the watch: what it reads may be locked for longer than others wait."""
        self._failed_s: dict[str, float] = {}
        """When a mission could not be taken up, by the fault of none but itself."""
        self._telling: set[asyncio.Task[None]] = set()
        self._ended: list[asyncio.Task[None]] = []
        """What was cancelled when the watch ended, and may not have ended yet."""
        self._trouble = "did not begin yet"

    @property
    def state(self) -> str:
        """``ok``, or why nobody can rely on this process for its missions."""
        return self._trouble or "ok"

    async def begin(self) -> None:
        """Take up what nobody has, and keep watch from now on."""
        await self._ownership.enter()
        await self._note_consoles()
        await self._know_peers()
        taking = asyncio.create_task(self._take_up(await self._ownership.look()), name="taking up")
        self._taking = taking
        self._trouble = ""
        self._begin_watch()
        # The watch may cancel it, and take up by another one what is left over.
        await asyncio.wait([taking])
        if taking.cancelled():
            log.warning("not every mission was taken up at the start: the watch tries again")
        else:
            taking.result()

    def cancel(self) -> None:
        """Keep watch no longer and take nothing up; what is under way ends when it can."""
        watch, self._task = self._task, None
        self._ended = [task for task in (watch, self._taking, *self._telling, *self._ended) if task is not None]
        for task in self._ended:
            task.cancel()

    async def end(self) -> None:
        """Keep watch no longer, and wait for what is under way."""
        self.cancel()
        await asyncio.gather(*self._ended, return_exceptions=True)

    def _begin_watch(self) -> None:
        self._task = asyncio.create_task(self._keep(), name="watch")
        self._task.add_done_callback(self._watch_ended)

    def _watch_ended(self, task: asyncio.Task[None]) -> None:
        """Begin a watch again that ended though nobody ended it: without one missions stay that nobody flies."""
        if task is not self._task:
            return
        error = None if task.cancelled() else task.exception()
        self._trouble = f"ended by {type(error).__name__ if error else 'a cancellation'}, begun again"
        log.critical("the watch beside the other processes ended: it is begun again", exc_info=error)
        self._begin_watch()

    async def may_take_up(self, row: MissionRow) -> bool:
        """Tell whether this process may have a mission; else it is left to others.

        It is left to them where this process ends, or cannot reach the mission's vehicles.
        """
        if row.state not in AT_SEA:
            return True
        # Here, since nothing may be waited for between its being taken and its vehicles' flight.
        await self._know_peers()
        if not self._ownership.peers:
            return True
        if self._supervisor.begins_no_more:
            return False
        async with self._database.reading() as session:
            vehicles = await mission_queries.vehicles_of(session, row.id)
        return {str(vehicle.spec["kind"]) for vehicle in vehicles if vehicle.left_at is None} <= set(self._hub.kinds)

    async def resume(self, live: LiveMission) -> None:
        """Go on with a mission that was at sea when it was taken up, unless the service ends."""
        if live.header.state not in AT_SEA:
            return
        try:
            self._claims.claim_team(live)
        except ConflictError as error:
            if self._supervisor.begins_no_more:
                return  # it stays as it is stored
            # The settings changed while nobody had it: one mission's trouble is not the others'.
            await self._supervisor.set_state(live, MissionState.FAILED, str(error), "service", AlarmKind.MISSION_FAILED)
            return
        if live.header.state is MissionState.RUNNING and self._supervisor.run(live):
            # Vehicles wait for no line of the log.
            words = "the service was started anew: the mission goes on with what was committed"
            facts = {"failsafe": Failsafe.SERVICE_RESTARTED, "response": Response.WARN}
            await live.journal.log(Level.WARNING, "failsafe", words, **facts)

    async def _note_consoles(self) -> None:
        """Keep what our vehicles' plans are called by, for whoever takes our missions up."""
        async with self._database.writing() as session:
            for imc_id in self._hub.console_ids:
                await console_queries.note(session, imc_id)

    async def _know_peers(self) -> None:
        """Learn what plans are called by that vehicles may have from the process that had their mission before."""
        if self._hub.console_ids:
            async with self._database.reading() as session:
                self._hub.know_peers(await console_queries.ids(session))

    async def _keep(self) -> None:
        while True:
            try:
                async with asyncio.timeout(PERIOD_S):
                    await self._ownership.called.wait()
            except TimeoutError:
                pass
            self._ownership.called.clear()
            try:
                if self._ownership.aside:
                    await self._come_back()
                missions = self._left_over(await self._ownership.look())
                if missions and (self._taking is None or self._taking.done()):
                    self._taking = asyncio.create_task(self._try_to_take_up(missions), name="taking up")
            except MembershipLostError as error:
                self._trouble = f"others may take this process for dead: {error}"
                if self._ownership.aside:
                    log.error("not among the living yet", error=str(error))
                else:
                    log.error("others may take this process for dead: its vehicles are stopped", error=str(error))
                    await self._stand_aside()
            except (SQLAlchemyError, OSError) as error:
                self._trouble = f"cannot look after the other processes: {error}"
                log.error("cannot look after the other processes", error=str(error))
            except Exception as error:
                self._trouble = f"cannot look after the other processes: {error}"
                log.exception("cannot look after the other processes")
            else:
                self._trouble = ""

    def _left_over(self, missions: Sequence[str]) -> Sequence[str]:
        """Return which of the missions at sea that are open to this process it has to take up now."""
        missing = self._registry.missing(missions)
        latest_s = time.monotonic() - AGAIN_S
        self._failed_s = {one: at_s for one, at_s in self._failed_s.items() if one in missing and at_s > latest_s}
        return [one for one in missing if one not in self._failed_s]

    async def _try_to_take_up(self, missions: Sequence[str]) -> None:
        """Take missions up; what is left over is found again when the watch looks next."""
        try:
            await self._take_up(missions)
        except (NotAMemberError, SQLAlchemyError, OSError) as error:
            log.error("missions cannot be taken up", error=str(error))
        except Exception:
            log.exception("missions cannot be taken up")

    async def _take_up(self, missions: Sequence[str]) -> None:
        """Take up missions at sea that nobody has, or that this one took and did not load, as far as it may."""
        # Where several processes take up what one left behind, each comes by its share.
        for mission_id in random.sample(missions, len(missions)):
            try:
                await self._registry.get(mission_id)
            except MissionElsewhereError:
                continue
            except (NotAMemberError, SQLAlchemyError, OSError):
                raise  # that concerns all of them
            except Exception:
                # One that cannot be read, as when a newer version wrote it, is not the others' trouble.
                self._failed_s[mission_id] = time.monotonic()
                log.exception("a mission cannot be taken up", mission=mission_id)
                continue
            log.warning("mission taken up", mission=mission_id)

    async def _stand_aside(self) -> None:
        """Stop the vehicles before others take the missions up. Raises nothing: the watch goes on."""
        self._ownership.aside = True
        if self._taking is not None:
            self._taking.cancel()
        ours = [live for live in self._registry if live.id in self._supervisor.runs]
        halted = await asyncio.gather(*(self._supervisor.halt(live) for live in ours), return_exceptions=True)
        for live, error in zip(ours, halted, strict=True):
            if isinstance(error, BaseException):
                log.error("a mission's vehicles could not be stopped", mission=live.id, exc_info=error)
        self._ownership.called.set()  # what follows need not wait

    async def _come_back(self) -> None:
        """Go on as soon as that is allowed again. Raises MembershipLostError as long as it is not."""
        unchanged = await self._ownership.enter()
        self._ownership.aside = False
        if not unchanged:
            try:
                for live in self._registry:
                    self._claims.release_team(live)
            finally:
                self._registry.drop()
            return
        again = [
            live
            for live in self._registry
            if live.header.state is MissionState.RUNNING and live.id not in self._supervisor.runs
        ]
        # Vehicles wait for no line of the log.
        for live in again:
            self._supervisor.run(live)
        for live in again:
            words = "the database was out of reach; the vehicles were stopped meanwhile"
            telling = asyncio.create_task(live.journal.log(Level.WARNING, "resumed", words), name=f"tell {live.id}")
            self._telling.add(telling)
            telling.add_done_callback(self._told)

    def _told(self, done: asyncio.Task[None]) -> None:
        self._telling.discard(done)
        if not done.cancelled() and done.exception() is not None:
            log.error("a line of a mission's log could not be written", exc_info=done.exception())
