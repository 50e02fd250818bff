"""Missions as they run: their flights are begun, watched over and ended, their vehicles stopped."""

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from concurrent.futures import Executor
from functools import partial
from typing import Any

import structlog
from sqlalchemy.ext.asyncio import AsyncSession

from app.missions.alarm_kinds import OF_A_MISSION, AlarmKind
from app.missions.clock import now
from app.missions.compilation import Compilation
from app.missions.errors import ConflictError, MissionElsewhereError
from app.missions.fleet.hub import FleetHub
from app.missions.fleet.interface import LinkState, StopReceipt
from app.missions.flight.legs.other_vehicles import OtherVehicles
from app.missions.flight.runner import Runner
from app.missions.live.header import Ending
from app.missions.live.journals.journal import ENDS, add_lines
from app.missions.live.mission import LiveMission
from app.missions.running.claims import Claims
from app.missions.running.final_maps import FinalMaps
from app.missions.settings import ServiceSettings
from app.missions.states import ENDED, MissionState
from app.missions.team import Member
from app.missions.views.mission import Level
from app.storage.concurrency.uncancellable import to_the_end
from app.storage.database import Guard
from app.storage.queries import missions as mission_queries

COMPILED_SOON_S = 2.0
"""An operator who has waited so long for the first legs is told what is compiled."""
PATIENCE_S = 0.5
"""How long a stop waits for the database, so that a restart knows of it too; vehicles wait no longer for a disk."""
ANSWER_S = 0.5
"""How long whoever stops a mission waits for that to be written down, once its vehicles were stopped."""
NOT_WRITTEN = "not written down yet, a restart of the service would go on with the mission"

log = structlog.get_logger(__name__)


class MissionSupervisor:
    """Runs missions and ends them.

    Attributes
    ----------
    runs
        The flights that go on, by their missions' ids.
    """

    def __init__(
        self,
        hub: FleetHub,
        claims: Claims,
        executor: Executor,
        maps: FinalMaps,
        compilation: Compilation,
        settings: ServiceSettings,
    ) -> None:
        self._hub = hub
        self._claims = claims
        self._executor = executor
        self._maps = maps
        self._compilation = compilation
        self._settings = settings
        self._others = OtherVehicles(hub, settings.time_scale)
        self.runs: dict[str, asyncio.Task[None]] = {}
        self._acting: dict[str, asyncio.Lock] = {}
        self._ending: dict[str, asyncio.Task[list[StopReceipt]]] = {}
        """Step loops that were cancelled and have not ended yet."""
        self._unwritten: dict[str, asyncio.Task[None]] = {}
        """States that are in force and will be written down when that is possible again."""
        self._no_more = False
        self.ended: Callable[[LiveMission, str], None] = _nobody_follows
        """Called when a mission has ended: with it, and with the reason if it was flown to its end, else ''."""

    def acting(self, mission_id: str) -> asyncio.Lock:
        """Return the lock under which a mission's state changes.

        Whoever holds it keeps what an abort writes waiting, not its vehicles: see :meth:`held_up`.
        """
        return self._acting.setdefault(mission_id, asyncio.Lock())

    async def held_up(self, live: LiveMission) -> bool:
        """Whether a mission's lock is held for longer than vehicles wait to be stopped.

        Who joins a mission, or sends a vehicle on, writes that down under the lock: a database that hangs would keep
        vehicles at sea meanwhile.
        """
        try:
            async with asyncio.timeout(PATIENCE_S), self.acting(live.id):
                return False
        except TimeoutError:
            return True

    def begin_no_more(self) -> None:
        """Begin no flight from now on: the service ends."""
        self._no_more = True

    @property
    def begins_no_more(self) -> bool:
        """Whether the service ends, so that no flight begins any more."""
        return self._no_more

    def refuse_to_begin(self) -> None:
        """Raise ConflictError once no flight begins any more."""
        if self._no_more:
            raise ConflictError("the service ends: it begins no flight", "ask again when it runs")

    def run(self, live: LiveMission) -> bool:
        """Begin the flight; False where the service ends: whoever has the mission next begins it."""
        if self._no_more:
            log.warning("the service ends: a flight is left to the next start", mission=live.id)
            return False
        live.set_off()

        def fly() -> Awaitable[str]:
            # Made where its failure ends this mission alone: its planner may be gone since the mission was begun.
            scale, pause_s = self._settings.time_scale, self._settings.compute.map_pause_s
            shared = (self._hub, self._others, self._executor)
            return Runner(live, *shared, scale, pause_s, self._compilation.maps).run()

        self.runs[live.id] = asyncio.create_task(self._supervise(live, fly), name=f"mission {live.id}")
        return True

    async def _until_compiled(self, live: LiveMission) -> None:
        """Wait until what planning needs is compiled: on a new machine that takes a while."""
        name = live.spec.planner.name
        compiled = asyncio.create_task(self._compilation.planner(name, live.planning_sensor))
        try:
            if not (await asyncio.wait([compiled], timeout=COMPILED_SOON_S))[0]:
                await live.journal.log(
                    Level.INFO,
                    "mission",
                    f"planner {name!r} is being compiled, once on this machine: vehicles get their first legs when "
                    "that is done",
                )
            await compiled
        finally:
            compiled.cancel()

    async def _supervise(self, live: LiveMission, run: Callable[[], Awaitable[str]]) -> None:
        """Run a mission to its end; whatever happens, its vehicles are stopped."""
        try:
            if (ending := self._ending.get(live.id)) is not None:
                await asyncio.wait([ending])
            await self._until_compiled(live)
            reason = await run()
        except asyncio.CancelledError:
            raise
        except MissionElsewhereError as error:
            # What another process makes of the mission is not ours to write down.
            log.error("the mission was taken from this process", mission=live.id, error=str(error))
            live.halt()
            await self.stop_team(live)
            self.runs.pop(live.id, None)
            return
        except Exception as error:
            log.exception("the flight failed", mission=live.id)
            target, reason = MissionState.FAILED, f"the flight failed: {error}"
            alarm: AlarmKind | None = AlarmKind.MISSION_FAILED
        else:
            target, alarm = MissionState.FINISHED, None
            if live.ending is not None:
                target, reason = live.ending.state, live.ending.reason or "everybody is back"
        async with self.acting(live.id):
            try:
                await to_the_end(self._conclude(live, target, reason, alarm))
            finally:
                self.runs.pop(live.id, None)
        to_its_end = target is MissionState.FINISHED and live.ending is None
        self.ended(live, reason if to_its_end else "")

    async def _conclude(self, live: LiveMission, target: MissionState, reason: str, alarm: AlarmKind | None) -> None:
        """Bring a mission whose flight ended to its end."""
        live.halt()
        stops = await self.stop_team(live)
        await self._write_down(live)
        await self.log_stops(live, stops)
        # Who reads that the mission has ended finds its vehicles free.
        self._claims.release_team(live)
        await self._settle(live, self._begin_state(live, target, reason, "service", alarm), target, reason)
        self._maps.map_last(live)

    def _begin_state(
        self, live: LiveMission, state: MissionState, reason: str, actor: str, alarm: AlarmKind | None = None
    ) -> asyncio.Task[None]:
        """Begin to write a state down, if need be when the database can be used again."""
        work = live.journal.storage.done(partial(self._write_state, live, state, reason, actor, alarm))
        return asyncio.create_task(work, name=f"{state} of {live.id}")

    async def _settle(self, live: LiveMission, written: asyncio.Task[None], state: MissionState, reason: str) -> None:
        """Wait for a state to be written down; where that takes long it is in force before."""
        await asyncio.wait([written], timeout=ANSWER_S)
        if written.done():
            written.result()
            return
        self._unwritten[live.id] = written
        written.add_done_callback(partial(self._forget_unwritten, live.id))
        live.enter(state, f"{reason}: {NOT_WRITTEN}" if reason else NOT_WRITTEN)

    def _forget_unwritten(self, mission_id: str, done: asyncio.Task[None]) -> None:
        if self._unwritten.get(mission_id) is done:
            del self._unwritten[mission_id]
        if not done.cancelled() and done.exception() is not None:
            log.error("a mission's state could not be written", mission=mission_id, exc_info=done.exception())

    async def close(self) -> None:
        """Give up what could not be written down."""
        await asyncio.gather(*self._ending.values(), return_exceptions=True)
        unwritten = list(self._unwritten.values())
        for task in unwritten:
            task.cancel()
        await asyncio.gather(*unwritten, return_exceptions=True)

    async def stand_down(self, live: LiveMission, state: MissionState, reason: str, actor: str) -> list[StopReceipt]:
        """Commit a state in which vehicles do not follow, and stop them; returns what each answered.

        The state comes first: killed in between, a restart must not go on with an aborted mission. But a disk that
        hangs, or a long transaction, keeps no vehicle from being stopped.
        """
        live.halt()
        self._supersede(live)
        written = self._begin_state(live, state, reason, actor)
        await asyncio.wait([written], timeout=PATIENCE_S)
        stops = await self.halt(live)
        await asyncio.gather(self._settle(live, written, state, reason), self.log_stops(live, stops))
        return stops

    async def bring_home(self, live: LiveMission, ending: Ending) -> None:
        """Call all vehicles home; the mission ends when they are there. Those without a recovery point stop.

        Raises
        ------
        ConflictError
            When the service ends and the mission is paused: then it stays so.
        """

        async def keep(session: AsyncSession) -> None:
            # What a killed service forgets, nobody would bring home.
            await mission_queries.keep_ending(session, live.id, ending.remember())

        async def keep_if_it_flies(session: AsyncSession) -> None:
            self.refuse_to_begin()
            await keep(session)

        words = f"everybody returns; {ending.state} then"
        if live.header.state is MissionState.PAUSED:
            # Together: a mission whose vehicles do not set off stays as it was.
            await self.set_state(live, MissionState.RUNNING, "everybody returns", ending.actor, check=keep_if_it_flies)
            live.end_as(ending)
            self.run(live)
        else:
            async with live.database.writing() as session:
                await keep(session)
            live.end_as(ending)
        await live.journal.log(Level.INFO, "recovery", words, actor=ending.actor, state=ending.state)
        live.changed.set()
        live.publish_summary()

    def dismiss(self, live: LiveMission) -> None:
        """Give up the vehicles of a mission that was ended; its last map is made meanwhile."""
        self._claims.release_team(live)
        self._maps.map_last(live)
        self.ended(live, "")

    async def halt(self, live: LiveMission) -> list[StopReceipt]:
        """End the flight and stop the vehicles, at once and not only when the loop has ended."""
        live.halt()
        task = self.runs.pop(live.id, None)
        if task is not None:
            task.cancel()
        stops = await self.stop_team(live)
        if task is not None:
            # Where the machine is busy the loop takes its time to end: vehicles and operators do not wait for it.
            ended = asyncio.create_task(self._ended(live, task), name=f"end of {live.id}")
            self._ending[live.id] = ended
            ended.add_done_callback(partial(self._forget_ending, live.id))
            await asyncio.wait([ended], timeout=PATIENCE_S)
            if ended.done():
                again = {stop.vehicle: stop for stop in ended.result()}
                stops = [again.get(stop.vehicle, stop) for stop in stops]
        await self._write_down(live)
        return stops

    async def _ended(self, live: LiveMission, task: asyncio.Task[None]) -> list[StopReceipt]:
        """Wait for a cancelled flight to end; a vehicle that was just being engaged follows then, and is stopped."""
        await asyncio.gather(task, return_exceptions=True)
        return await self.stop_team(live, only_engaged=True)

    def _forget_ending(self, mission_id: str, done: asyncio.Task[list[StopReceipt]]) -> None:
        if self._ending.get(mission_id) is done:
            del self._ending[mission_id]
        if not done.cancelled() and done.exception() is not None:
            log.error("a mission's vehicles could not be stopped again", mission=mission_id, exc_info=done.exception())

    async def _write_down(self, live: LiveMission) -> None:
        """Write what vehicles measured until now, unless that takes long: then the journal goes on by itself."""
        flushing = asyncio.ensure_future(live.journal.flush())
        flushing.add_done_callback(partial(_log_failure, live.id))
        await asyncio.wait([flushing], timeout=PATIENCE_S)

    async def stop_vehicle(self, live: LiveMission, member: Member) -> StopReceipt:
        """Stop one vehicle and write down what it answered."""
        member.disengage()
        stop = await self._hub.stop(member.key)
        await self.log_stops(live, [stop])
        return stop

    async def stop_team(self, live: LiveMission, *, only_engaged: bool = False) -> list[StopReceipt]:
        """Stop the mission's vehicles, or those of them that follow; returns what each answered."""
        mine = [
            member
            for member in live.team
            if self._hub.claimed_by(member.key) == live.id
            and (not only_engaged or self._hub.info(member.key).state is LinkState.ENGAGED)
        ]
        for member in mine:
            member.disengage()
        live.changed.set()
        return list(await asyncio.gather(*(self._hub.stop(member.key) for member in mine)))

    async def log_stops(self, live: LiveMission, stops: Sequence[StopReceipt]) -> None:
        """Write down, together, what vehicles answered to a stop; a missing answer is an alarm.

        Nobody waits for that longer than for any other stop to be written; the vehicles have stopped.
        """
        lines = []
        for stop in stops:
            words = "acknowledged the stop" if stop.acknowledged else "has NOT acknowledged the stop"
            text = f"{stop.vehicle} {words}: {stop.detail}"
            answer: dict[str, Any] = {**receipt(stop)}
            if stop.acknowledged:
                lines.append(live.journal.line(Level.INFO, "stop", text, **answer))
            else:
                lines.append(live.journal.alarm_line(AlarmKind.STOP_NOT_ACKNOWLEDGED, text, **answer))
        if live.id in self._unwritten:
            for line in lines:
                live.journal.note_line(line)
            return
        writing = asyncio.ensure_future(live.journal.log_all(lines))
        writing.add_done_callback(partial(_log_failure, live.id))
        await asyncio.wait([writing], timeout=PATIENCE_S)

    async def set_state(
        self,
        live: LiveMission,
        state: MissionState,
        reason: str,
        actor: str,
        alarm: AlarmKind | None = None,
        *,
        check: Guard | None = None,
    ) -> None:
        """Commit a mission's new state together with its line in the log, then tell everyone.

        ``alarm`` is what that raises, if it does.

        ``check`` is called within the transaction before anything is changed, and raises what speaks against it.
        """
        self._supersede(live)
        await self._write_state(live, state, reason, actor, alarm, check)

    def _supersede(self, live: LiveMission) -> None:
        """Leave off writing an earlier state down: another one comes."""
        unwritten = self._unwritten.pop(live.id, None)
        if unwritten is not None:
            unwritten.cancel()

    async def _write_state(
        self,
        live: LiveMission,
        state: MissionState,
        reason: str,
        actor: str,
        alarm: AlarmKind | None,
        check: Guard | None = None,
    ) -> None:
        changed_at = now()
        words = f"{state} by {actor}" + (f": {reason}" if reason else "")
        facts: dict[str, Any] = {"state": state, "actor": actor}
        if state in ENDED:
            facts[ENDS] = [str(kind) for kind in (*OF_A_MISSION, AlarmKind.NOT_BEGUN)]
        elif state is MissionState.RUNNING:
            facts[ENDS] = [str(AlarmKind.NOT_BEGUN)]
        if alarm is None:
            line = live.journal.line(Level.INFO, "state", words, **facts)
        else:
            line = live.journal.alarm_line(alarm, words, **facts)
        async with live.database.writing() as session:
            if check is not None:
                await check(session)
            await mission_queries.set_state(session, live.id, state, reason, changed_at)
            await add_lines(session, [line])
        live.enter(state, reason, changed_at)
        live.journal.tell(line)


def _nobody_follows(_live: LiveMission, _reason: str) -> None:
    return None


def _log_failure(mission_id: str, done: asyncio.Task[None]) -> None:
    error = None if done.cancelled() else done.exception()
    if error is not None:
        # What could not be written stays noted and is tried again.
        log.error("the last soundings are not written yet", mission=mission_id, exc_info=error)


def receipt(stop: StopReceipt) -> dict[str, str | bool]:
    """Return a vehicle's answer to a stop as it is written down and shown."""
    return {"vehicle": stop.vehicle, "acknowledged": stop.acknowledged, "detail": stop.detail}
