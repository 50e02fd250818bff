"""The missions that this process has in memory."""

import asyncio
import time
from collections import Counter
from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial

import structlog
from pydantic import ValidationError
from sqlalchemy import delete, select
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.ext.asyncio import AsyncSession

from app.compute.compute import Compute
from app.missions.errors import (
    ConflictError,
    InvalidRequestError,
    MissionElsewhereError,
    MissionNotFoundError,
    MissionUnreadableError,
)
from app.missions.fleet.hub import FleetHub
from app.missions.live.load import stored_spec, take_up
from app.missions.live.mission import LiveMission
from app.missions.live.threads import Threads
from app.missions.pings.store import CLOSE_S
from app.missions.running.ended_missions import EndedMissions, store_summary
from app.missions.running.final_maps import FinalMaps
from app.missions.running.ownership import Ownership
from app.missions.spec.mission import MissionSpec
from app.missions.states import AT_SEA, ENDED
from app.missions.traffic.watch import Traffic
from app.missions.views.mission import MissionSummary
from app.storage.database import Database
from app.storage.models import MissionRow
from app.storage.ping_files import PingFiles
from app.storage.queries import missions as mission_queries
from app.storage.queries import pings as ping_queries
from app.storage.queries import sites as site_queries
from app.storage.queries import soundings as sounding_queries

ENDED_MISSIONS_IN_MEMORY = 8
LOOKED_AT_EVERY_S = 5.0
"""How often it is looked whether an ended mission in memory is still stored: it may be pruned meanwhile."""

log = structlog.get_logger(__name__)


class MissionRegistry:
    """Takes missions up from the database when they are asked for, and lets those go that ended.

    Until ``share`` is called it belongs to a process that only looks something up beside the others.
    """

    def __init__(
        self,
        database: Database,
        hub: FleetHub,
        threads: Threads,
        maps: FinalMaps,
        ping_files: PingFiles,
        time_scale: float,
        traffic: Traffic | None = None,
        compute: Compute | None = None,
    ) -> None:
        self._database = database
        self._hub = hub
        self._threads = threads
        self._maps = maps
        self._ping_files = ping_files
        self._time_scale = time_scale
        self._traffic = traffic
        self._compute = compute
        self._ownership: Ownership | None = None
        self._may_take_up: Callable[[MissionRow], Awaitable[bool]] = _always
        self._taken_up: Callable[[LiveMission], Awaitable[None]] = _nothing
        self._live: dict[str, LiveMission] = {}
        self._ended = EndedMissions(database)
        # Known to exist, whoever has them; another process may have deleted one meanwhile.
        self._seen: set[str] = set()
        self._looked_s: dict[str, float] = {}
        self._held: Counter[str] = Counter()
        self._loading = asyncio.Lock()

    def share(
        self,
        ownership: Ownership,
        may_take_up: Callable[[MissionRow], Awaitable[bool]],
        taken_up: Callable[[LiveMission], Awaitable[None]],
    ) -> None:
        """Take up only what ``ownership`` and ``may_take_up`` allow.

        ``taken_up`` is called with what was taken up, before anybody else gets it.
        """
        self._ownership = ownership
        self._may_take_up = may_take_up
        self._taken_up = taken_up

    def __iter__(self) -> Iterator[LiveMission]:
        return iter(list(self._live.values()))

    @contextmanager
    def hold(self, mission_id: str) -> Iterator[None]:
        """Keep a mission in memory, from when it is taken up, though it has ended and nobody watches it."""
        self._held[mission_id] += 1
        try:
            yield
        finally:
            self._held[mission_id] -= 1

    def left(self, mission_id: str) -> MissionSummary | None:
        """Return a mission as it was when it ended and left memory; None where it is in memory or never was."""
        return None if mission_id in self._live else self._ended.get(mission_id)

    def missing(self, mission_ids: Sequence[str]) -> list[str]:
        """Return those of some missions that are not in memory, in the same order."""
        return [one for one in mission_ids if one not in self._live]

    async def recall(self, mission_ids: Sequence[str]) -> None:
        """Learn how missions stood that left memory in an earlier run, or in another process."""
        await self._ended.recall(self.missing(mission_ids))

    async def check_exists(self, mission_id: str) -> None:
        """Raise MissionNotFoundError where there is no such mission; it is not taken up."""
        if mission_id in self._live or mission_id in self._ended or mission_id in self._seen:
            return
        async with self._database.reading() as session:
            if await session.scalar(select(MissionRow.id).where(MissionRow.id == mission_id)) is None:
                raise _not_found(mission_id)
        self._seen.add(mission_id)

    async def spec(self, mission_id: str) -> MissionSpec:
        """Return what a mission is to do; it is not taken up. Raises MissionNotFoundError, MissionUnreadableError."""
        if mission_id in self._live:
            return self._live[mission_id].spec
        async with self._database.reading() as session:
            row = await session.get(MissionRow, mission_id)
        if row is None:
            raise _not_found(mission_id)
        with _opening(mission_id):
            return await asyncio.to_thread(stored_spec, row)

    async def get(self, mission_id: str) -> LiveMission:
        """Return a mission, taken up if need be.

        One that was taken and could not be loaded stays this process's: at sea, its watch takes it up again.

        Raises
        ------
        MissionNotFoundError, MissionElsewhereError, MissionUnreadableError, NotAMemberError
        """
        live = self._live.get(mission_id)
        if live is not None and not await self._was_removed(live):
            return live
        async with self._loading:
            if mission_id in self._live:
                return self._live[mission_id]
            async with self._database.reading() as session:
                row = await session.get(MissionRow, mission_id)
            if row is None:
                raise _not_found(mission_id)
            database = self._database
            entries = 0
            if self._ownership is not None:
                entries = self._ownership.entries
                self._ownership.check_member(entries)
                if not (await self._may_take_up(row) and await self._ownership.take(mission_id)):
                    raise MissionElsewhereError(f"another process has mission {mission_id}", "ask again in a moment")
                database = database.guarded(self._ownership.guard(mission_id))
                # Its last owner may have written until the moment it was taken.
                async with database.reading() as session:
                    row = await session.get_one(MissionRow, mission_id)
            with _opening(mission_id):
                live = await take_up(database, self._hub, self._threads, row, self._ping_files, self._time_scale)
            try:
                await self._complete(live, row)
                if self._ownership is not None:
                    # Others may have it meanwhile. From here until its vehicles fly nothing is waited for.
                    self._ownership.check_member(entries)
            except BaseException:
                live.abandon("it could not be taken up")
                raise
            self._live[mission_id] = live
            self._ended.forget(mission_id)
            self._maps.take_up(live)
            if self._ownership is not None:
                live.survey_late_changes(partial(self._maps.survey, live))
                self._maps.survey(live)
            await self._taken_up(live)
            if self._ownership is not None:
                live.pings.begin_to_tidy()
            return live

    async def _complete(self, live: LiveMission, row: MissionRow) -> None:
        """Do what is left before a mission that was opened may be in memory."""
        if row.summary is not None:
            await store_summary(live, None)
        live.ships.traffic = self._traffic
        if self._compute is not None:
            live.compute_by(self._compute)
        await self._make_room()

    async def _was_removed(self, live: LiveMission) -> bool:
        """Tell whether a mission that ended is stored no more, and put it away then."""
        if live.header.state not in ENDED or time.monotonic() < self._looked_s.get(live.id, 0.0) + LOOKED_AT_EVERY_S:
            return False
        self._looked_s[live.id] = time.monotonic()
        try:
            async with self._database.reading() as session:
                there = await session.scalar(select(MissionRow.id).where(MissionRow.id == live.id))
        except SQLAlchemyError:
            return False  # what is in memory can be shown meanwhile
        if there is not None or self._live.get(live.id) is not live:
            return False
        self._maps.forget(live.id)
        await self._put_away(live, "the mission was removed")
        return True

    async def _put_away(self, live: LiveMission, why: str) -> None:
        """Forget a mission that is stored no more."""
        self._ended.forget(live.id)
        self._seen.discard(live.id)
        self._looked_s.pop(live.id, None)
        if self._live.pop(live.id, None) is not None:
            live.abandon(why)
        if self._ownership is not None:
            await self._ownership.release([live.id])

    async def own(self, session: AsyncSession, mission_id: str) -> None:
        """Have a new mission together with its rows, or none of both. Raises NotAMemberError."""
        if self._ownership is not None:
            await self._ownership.take_within(session, mission_id)

    async def try_out(self, row: MissionRow) -> None:
        """Open a mission as it is to be stored, and put it away. Raises InvalidRequestError where it cannot be opened.

        ``row`` is not stored, and no other mission has its id.
        """
        try:
            with _opening(row.id):
                live = await take_up(self._database, self._hub, self._threads, row, self._ping_files, self._time_scale)
        except MissionUnreadableError as error:
            log.exception("a mission is refused that could not be opened", name=row.name)
            words = f"no mission can be made of it: {_reason(error.__cause__)}"
            raise InvalidRequestError("body", words, "correct what it says") from error
        live.abandon("it is not stored")

    async def _make_room(self) -> None:
        idle = [
            m
            for m in self._live.values()
            if m.header.state in ENDED
            and not m.broadcaster.watched
            and not self._maps.holds(m.id)
            and not self._held[m.id]
        ]
        for live in idle[: max(0, len(idle) - ENDED_MISSIONS_IN_MEMORY + 1)]:
            summary = live.summary()
            self._ended.note(summary)
            del self._live[live.id]
            await live.close()
            if self._ownership is not None:
                await store_summary(live, summary)
                await self._ownership.release([live.id])

    async def delete(self, live: LiveMission) -> None:
        """Remove a mission with everything that belongs to it. What was measured is kept: then ConflictError."""
        if live.header.state in AT_SEA:
            raise ConflictError(f"the mission is {live.header.state}", "finish or abort it first")
        counts = live.counts
        _refuse_measured(live.header.step, counts.accepted + counts.rejected, counts.pings + counts.rejected_pings)
        async with live.database.reading() as session:
            # What was taken back is kept as well.
            measured = sum((await sounding_queries.counts(session, live.id)).values())
            pinged = await ping_queries.totals(session, live.id)
        _refuse_measured(0, measured, pinged.pings + pinged.rejected)
        self._maps.forget(live.id)
        async with live.database.writing() as session:
            await _delete(session, live.id)
        await self._put_away(live, "the mission was deleted")

    async def delete_unreadable(self, mission_id: str) -> None:
        """Remove a mission that cannot be opened, whatever its state: nobody could end it. Raises ConflictError.

        As with any other, what was measured is kept. The caller has tried to get it: then it is this process's.
        """
        database = self._database
        if self._ownership is not None:
            database = database.guarded(self._ownership.guard(mission_id))
        async with database.writing() as session:
            step = await mission_queries.last_step(session, mission_id)
            counts = await sounding_queries.counts(session, mission_id)
            pinged = await ping_queries.totals(session, mission_id)
            _refuse_measured(0 if step is None else step.number, sum(counts.values()), pinged.pings + pinged.rejected)
            await _delete(session, mission_id)
        self._seen.discard(mission_id)
        if self._ownership is not None:
            await self._ownership.release([mission_id])

    async def forget(self, live: LiveMission, why: str) -> None:
        """Put a mission away that is stored otherwise now; who watches it is told to ask again."""
        self._maps.forget(live.id)
        if self._live.pop(live.id, None) is not None:
            live.broadcaster.end(why)
            await live.close()

    async def close(self) -> None:
        """Write down what is left."""
        until_s = asyncio.get_running_loop().time() + CLOSE_S
        for live in self:
            try:
                await live.close(until_s)
                if self._ownership is not None and live.header.state in ENDED:
                    await store_summary(live, live.summary())
            except MissionElsewhereError as error:
                log.warning("the last words of a mission are not written", mission=live.id, error=str(error))

    def drop(self) -> None:
        """Forget everything unwritten: other processes have it now."""
        for live in self:
            live.abandon()
        self._live.clear()
        self._ended.clear()


@contextmanager
def _opening(mission_id: str) -> Iterator[None]:
    """Raise MissionUnreadableError for what is stored of a mission and makes no sense."""
    try:
        yield
    except (ValueError, LookupError, TypeError) as error:
        raise MissionUnreadableError(
            f"mission {mission_id} cannot be opened as it is stored: {_reason(error)}",
            "run the version that wrote it, or delete it: DELETE /api/v1/missions/{id}",
        ) from error


def _reason(error: BaseException | None) -> str:
    """Return in one line why something makes no sense: of several faults the first."""
    if not isinstance(error, ValidationError):
        return str(error)
    first = error.errors(include_url=False, include_input=False)[0]
    field = ".".join(str(part) for part in first["loc"])
    return f"{field}: {first['msg']}" if field else str(first["msg"])


def _refuse_measured(steps: int, soundings: int, pings: int) -> None:
    """Keep a mission in which something was done. Raises ConflictError."""
    if steps or soundings or pings:
        and_pings = f" and {pings} pings" if pings else ""
        raise ConflictError(
            f"the mission took {steps} steps and has {soundings} soundings{and_pings}: what was measured is kept",
            "leave it in the list; only missions in which nothing was measured can be deleted",
        )


async def _delete(session: AsyncSession, mission_id: str) -> None:
    """Delete a mission's row with all that belongs to it. Raises ConflictError where another one is to follow it."""
    followers = await mission_queries.followers(session, mission_id)
    if followers:
        first = await session.get_one(MissionRow, followers[0])
        raise ConflictError(f"{first.name!r} is to begin after it", "change or delete that one first")
    await session.execute(delete(MissionRow).where(MissionRow.id == mission_id))
    await site_queries.forget_survey(session, mission_id)


def _not_found(mission_id: str) -> MissionNotFoundError:
    return MissionNotFoundError(f"there is no mission {mission_id!r}", "GET /api/v1/missions lists all")


async def _always(_row: MissionRow) -> bool:
    return True


async def _nothing(_live: LiveMission) -> None:
    return None
