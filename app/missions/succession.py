"""Missions that follow others: each begins by itself when the one before it was flown to its end.

So several areas are surveyed one after the other by the same team. A mission that a person ended, that was aborted or
failed is followed by nothing until a person starts it, and so is one whose vehicles are not all fit to go on. How
they come into the next area is checked as for any mission: they are sent to its border, at the surface, straight and
clear of keep-out zones.
"""

import asyncio
from collections.abc import Awaitable, Callable

import structlog

from app.missions.alarm_kinds import AlarmKind, AlarmSeverity
from app.missions.errors import ConflictError, InvalidRequestError, MissionError, MissionNotFoundError
from app.missions.flight.survey_end import NOT_WAITED_FOR
from app.missions.live.mission import LiveMission
from app.missions.preflight.survey import preflight
from app.missions.spec.mission import MissionSpec
from app.missions.states import ENDED, MissionState, MoveRefusedError
from app.missions.views.mission import CheckStatus, Level
from app.storage.database import Database
from app.storage.models import MissionRow
from app.storage.queries import missions as mission_queries

PATIENCE_S = 120.0
"""Vehicles that were just stopped come up and answer again within this time."""
AGAIN_S = 1.0

log = structlog.get_logger(__name__)


class Succession:
    """Lets missions begin when those before them end.

    Parameters
    ----------
    get
        Returns a mission that this process may have. Raises MissionElsewhereError.
    start
        Starts one, in the service's name. Raises ConflictError, MoveRefusedError.
    """

    def __init__(
        self,
        database: Database,
        get: Callable[[str], Awaitable[LiveMission]],
        start: Callable[[LiveMission, str], Awaitable[object]],
    ) -> None:
        self._database = database
        self._get = get
        self._start = start
        self._under_way: set[asyncio.Task[None]] = set()

    async def check(self, spec: MissionSpec, own_id: str | None = None, before: str | None = None) -> None:
        """Refuse a mission that could never follow the one that it names. Raises InvalidRequestError.

        ``own_id`` and ``before`` are its id and what it followed, of one that is described anew.
        """
        if spec.after is None or spec.after == before:
            return
        async with self._database.reading() as session:
            row = await session.get(MissionRow, spec.after)
            if row is None:
                raise InvalidRequestError("after", f"there is no mission {spec.after!r}", "leave it out, or name one")
            if row.state in ENDED:
                raise InvalidRequestError("after", f"{row.name!r} is {row.state} already", "leave it out, and start it")
            while row is not None and row.id != own_id:
                earlier = row.spec.get("after")
                row = None if earlier is None else await session.get(MissionRow, earlier)
        if row is not None:
            raise InvalidRequestError("after", "that mission follows this one", "name one that does not")

    def ended(self, live: LiveMission, reason: str) -> None:
        """Let those that follow a mission begin, or say why they do not. ``reason``: as for ``Supervisor.ended``."""
        task = asyncio.create_task(self._followed(live, reason), name=f"after {live.id}")
        self._under_way.add(task)
        task.add_done_callback(self._over)

    def _over(self, task: asyncio.Task[None]) -> None:
        self._under_way.discard(task)
        if not task.cancelled() and task.exception() is not None:
            log.error("what follows a mission could not begin", task=task.get_name(), exc_info=task.exception())

    async def close(self) -> None:
        """Begin nothing any more."""
        for task in self._under_way:
            task.cancel()
        await asyncio.gather(*self._under_way, return_exceptions=True)

    async def begin(self) -> None:
        """Tell of missions that were to begin while no service ran: a person has to look at their vehicles first."""
        async with self._database.reading() as session:
            found = await mission_queries.forgotten_followers(session)
        for mission_id, before in found:
            try:
                live = await self._get(mission_id)
            except MissionError:
                continue  # another process has it
            words = f"{before!r} was flown to its end while the service restarted: start it when its vehicles are fit"
            await _raise(live, words)

    async def _followed(self, before: LiveMission, reason: str) -> None:
        async with self._database.reading() as session:
            ids = await mission_queries.followers(session, before.id)
        for mission_id in ids:
            try:
                await self._follow(mission_id, before, reason)
            except MissionNotFoundError:
                continue
            except MissionError as error:
                words = f"the mission that follows does not begin by itself: {error}"
                await before.journal.alarm(AlarmKind.NOT_BEGUN, words)

    async def _follow(self, mission_id: str, before: LiveMission, reason: str) -> None:
        """Start a mission after the one before it, as soon as its vehicles answer; else raise an alarm."""
        live, ended = await self._get(mission_id), f"{before.spec.name!r} was flown to its end"
        if not reason:
            words = f"does not begin by itself: {before.spec.name!r} was not flown to its end"
            await live.journal.log(Level.WARNING, "waiting", words)
            return
        why_not, told = _unfit(live, before), False
        until_s = asyncio.get_running_loop().time() + PATIENCE_S
        while not why_not:
            # Meanwhile a person may have started it, given it up, or described it anew.
            live = await self._get(mission_id)
            if live.header.state is not MissionState.READY or live.spec.after != before.id:
                return
            trouble = await self._tried(live, ended)
            if not trouble:
                return
            if not told:
                told = True
                await live.journal.log(Level.INFO, "state", f"{ended}: begins as soon as it can: {trouble}")
            if asyncio.get_running_loop().time() > until_s:
                why_not = trouble
            else:
                await asyncio.sleep(AGAIN_S)
        await _raise(live, why_not)

    async def _tried(self, live: LiveMission, why: str) -> str:
        """Start a mission that is ready; returns what keeps it from that, '' once it is started."""
        problems = [check for check in preflight(live).checks if check.status is CheckStatus.PROBLEM]
        if problems:
            return "; ".join(f"{check.title}: {check.message}" for check in problems)
        try:
            await self._start(live, why)
        except (ConflictError, MoveRefusedError) as error:
            return str(error)
        return ""


async def _raise(live: LiveMission, why: str) -> None:
    await live.journal.alarm(AlarmKind.NOT_BEGUN, f"does not begin by itself: {why}")


def _unfit(live: LiveMission, before: LiveMission) -> str:
    """Return why nobody but a person may let a mission begin after the one before it; '' if it may begin by itself."""
    grave = [alarm for alarm in before.journal.alarms.open if alarm.severity is AlarmSeverity.CRITICAL]
    if grave:
        return f"nobody has acknowledged: {grave[0].message}"
    for member in live.team:
        earlier = before.team.get(member.name) or before.team.departed.get(member.name)
        if earlier is None:
            continue
        if earlier.left_at is not None:
            return f"{member.name} left {before.spec.name!r}"
        # At the end everybody is called home, with its part done; who has done it goes before.
        if earlier.withdrawal is not None and not earlier.withdrawal.done:
            return f"{member.name} did not fly {before.spec.name!r} to its end: {earlier.withdrawal.why}"
        flown = earlier.flown
        if earlier.legs and not flown.legs_reached:
            return f"{member.name} flew no leg of {before.spec.name!r}"
        # The first leg may have led to where it was. Who was given none had nothing to fly.
        if flown.missed_last and flown.missed_last >= min(NOT_WAITED_FOR, flown.legs_reached):
            words = f"it missed its last {flown.missed_last} of {flown.legs_missed + flown.legs_reached} legs"
            return f"{member.name} did not fly {before.spec.name!r} to its end: {words}"
    return ""
