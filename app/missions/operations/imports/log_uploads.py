"""Vehicles' own logs that are sent to the service: one is read at a time, beside everything else."""

import asyncio
import sqlite3
import uuid
from collections.abc import Awaitable, Callable
from contextlib import AbstractContextManager, AsyncExitStack
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import structlog
from sqlalchemy.exc import SQLAlchemyError

from app.missions.clock import now
from app.missions.errors import (
    ConflictError,
    ImportNotFoundError,
    ImportUnavailableError,
    InvalidRequestError,
    MissionError,
)
from app.missions.fleet.links.imc import bridge_settings
from app.missions.live.mission import LiveMission
from app.missions.operations.imports.log_batches import LogBatch, LogFacts, WantedLog
from app.missions.operations.imports.log_import import LogHead, LogImport, check_log, near
from app.missions.operations.imports.log_process import ReadingProcess, reading
from app.missions.operations.imports.log_withdrawal import TAKEN_BACK, take_back_log
from app.missions.operations.imports.multibeam_log import is_multibeam
from app.missions.operations.imports.uploads import Upload
from app.missions.running.final_maps import FinalMaps
from app.missions.settings import ServiceSettings
from app.missions.views.measurements.imports import LogOptions, LogState, LogView
from app.missions.views.measurements.soundings import LogImportView
from app.missions.views.mission import Level
from app.storage.concurrency.uncancellable import to_the_end
from app.storage.db_errors import trouble_of
from app.storage.models import EventRow
from app.storage.queries import events as event_queries

MAX_UNDER_WAY = 4
"""Of each the disk holds the file until it is read; other uploads need room as well."""
MAX_REMEMBERED = 100
"""Imports that have ended and whose results are told without the mission's log."""

log = structlog.get_logger(__name__)


@dataclass
class _Job:
    """A log that was sent, and how far it is."""

    id: str
    mission_id: str
    file: str
    vehicle: str | None
    asked_vehicle: str | None
    digest: str
    actor: str
    created_at: datetime
    size_bytes: int
    state: LogState = LogState.WAITING
    read_bytes: int = 0
    result: LogImportView | None = None
    problem: str = ""
    remedy: str = ""
    work: LogImport | None = None
    taken_back_at: datetime | None = None
    stopped_by: str = ""
    """Who does not want it to be read on."""

    @property
    def ended(self) -> bool:
        return self.state not in (LogState.WAITING, LogState.READING)

    @property
    def number(self) -> int | None:
        """Of the log, once something of it is stored."""
        return None if self.work is None else self.work.number

    def view(self) -> LogView:
        return LogView(
            id=self.id,
            file=self.file,
            vehicle=self.vehicle,
            sha256=self.digest,
            state=self.state,
            created_at=self.created_at,
            actor=self.actor,
            read_bytes=self.read_bytes,
            size_bytes=self.size_bytes,
            result=self.result,
            problem=self.problem,
            remedy=self.remedy,
            taken_back_at=self.taken_back_at,
            taken_back_by=self.stopped_by,
            can_be_taken_back=_can_be_taken_back(self.state, self.number),
        )

    def fail(self, problem: str, remedy: str) -> None:
        self.state, self.problem, self.remedy = LogState.FAILED, problem, remedy


class LogUploads:
    """Imports logs into the missions of this process.

    Parameters
    ----------
    get
        Returns a mission, taken up if need be.
    hold
        Keeps a mission in memory meanwhile.
    maps
        Shows what was imported; while a mission runs its next decision's map does.
    """

    def __init__(
        self,
        settings: ServiceSettings,
        get: Callable[[str], Awaitable[LiveMission]],
        hold: Callable[[str], AbstractContextManager[None]],
        maps: FinalMaps,
    ) -> None:
        self._settings = settings
        self._get = get
        self._hold = hold
        self._maps = maps
        self._turn = asyncio.Semaphore(1)
        self._jobs: dict[str, _Job] = {}
        self._tasks: dict[str, asyncio.Task[None]] = {}
        """Of the logs that wait or are read, by their ids."""
        self._closing = False

    def check(self, live: LiveMission, options: LogOptions, size_bytes: int | None = None) -> None:
        """Refuse what need not be sent. Raises InvalidRequestError, ImportUnavailableError.

        ``size_bytes``: of the file, where that is known. Where as many logs are under way as can be, one that may be
        among them is taken in to see whether it is.
        """
        if is_multibeam(options.filename) and options.vehicle is None:
            raise InvalidRequestError(
                "vehicle", f"{options.filename} does not tell its vehicle's name", "say whose it is: vehicle=NAME"
            )
        check_log(live, options.filename, options.vehicle)
        under_way = [job for job in self._jobs.values() if job.mission_id == live.id and not job.ended]
        if not any(size_bytes in (None, job.size_bytes) for job in under_way):
            self._refuse_more()

    def _refuse_more(self) -> None:
        if self._closing or len(self._tasks) >= MAX_UNDER_WAY:
            raise ImportUnavailableError(
                "the service is ending"
                if self._closing
                else f"{len(self._tasks)} logs wait or are being read, as many as can",
                "send it again in a while",
            )

    def begin(
        self, live: LiveMission, upload: Upload, options: LogOptions, actor: str, keeping: AsyncExitStack
    ) -> LogView:
        """Import a log from now on; ``keeping`` holds its file, and is taken over.

        A log that is under way in the same mission, as the same vehicle's, is not begun again.

        Raises
        ------
        InvalidRequestError, ImportUnavailableError
        """
        self.check(live, options, upload.size_bytes)
        if not upload.size_bytes:
            raise InvalidRequestError("file", "it is empty", "send the file's content as the body")
        for job in self._jobs.values():
            same = (job.mission_id, job.digest, job.asked_vehicle) == (live.id, upload.sha256, options.vehicle)
            if same and not job.ended:
                return job.view()
        self._refuse_more()
        job = _Job(
            id=str(uuid.uuid4()),
            mission_id=live.id,
            file=options.filename,
            vehicle=options.vehicle,
            asked_vehicle=options.vehicle,
            digest=upload.sha256,
            actor=actor,
            created_at=now(),
            size_bytes=upload.size_bytes,
        )
        self._remember(job)
        task = asyncio.create_task(self._import(job, upload, keeping.pop_all()), name=f"log into {live.id}")
        self._tasks[job.id] = task
        task.add_done_callback(lambda _: self._tasks.pop(job.id, None))
        return job.view()

    async def all(self, live: LiveMission) -> list[LogView]:
        """Return what was imported and what is under way, oldest first.

        Those that stored nothing new are known until the service ends.
        """
        return [view for view, _ in await self._listed(live)]

    async def _listed(self, live: LiveMission) -> list[tuple[LogView, int | None]]:
        """Return what was imported and what is under way, oldest first, with the number of each log that has one."""
        async with live.database.reading() as session:
            rows = await event_queries.events_of_kind(session, live.id, "import")
        found = {view.id: (view, row.data.get("log")) for row in rows if (view := _stored_view(row)) is not None}
        found |= {job.id: (job.view(), job.number) for job in self._jobs.values() if job.mission_id == live.id}
        over = {row.data[TAKEN_BACK]: row for row in rows if TAKEN_BACK in row.data}
        listed = [(_as_taken_back(view, over.get(number)), number) for view, number in found.values()]
        return sorted(listed, key=lambda one: one[0].created_at)

    async def one(self, live: LiveMission, import_id: str) -> LogView:
        """Return the import of a log. Raises ImportNotFoundError."""
        return (await self._one(live, import_id))[0]

    async def _one(self, live: LiveMission, import_id: str) -> tuple[LogView, int | None]:
        for view, number in await self._listed(live):
            if view.id == import_id:
                return view, number
        raise ImportNotFoundError(
            f"there is no import of a log {import_id!r}", "GET /api/v1/missions/{id}/logs lists them"
        )

    async def take_back(self, live: LiveMission, import_id: str, actor: str) -> LogView:
        """Stop reading a log, and let nothing count of what it brought, whichever of its sendings did.

        What it brought stays stored, marked; the same file sent again counts again.

        Raises
        ------
        ImportNotFoundError, ConflictError
            When there is no such import; when what the log brought cannot be told from other soundings.
        """
        return await to_the_end(self._take_back(live, import_id, actor))

    async def _take_back(self, live: LiveMission, import_id: str, actor: str) -> LogView:
        await self._one(live, import_id)
        await self._stop(lambda job: job.id == import_id, actor)
        live = await self._get(live.id)
        view, number = await self._one(live, import_id)
        if number is None:
            if view.state is LogState.TAKEN_BACK:
                return view
            one = view.result
            brought = one is not None and bool(one.soundings + one.rejected + one.pings + one.pings_rejected)
            raise ConflictError(
                "this log was imported by an earlier version, which did not note what it brought"
                if brought
                else "nothing is stored of this log",
                f"reject soundings one by one or many at once: POST /api/v1/missions/{live.id}/soundings/reject",
            )
        await self._stop(lambda job: job.mission_id == live.id and job.number == number, actor)
        with self._hold(live.id):
            await take_back_log(live, number, actor)
            if not live.running:
                self._maps.take_up(live)
        return await self.one(live, import_id)

    async def _stop(self, chosen: Callable[[_Job], bool], actor: str) -> None:
        """End the reading of some logs, between two batches."""
        for job in [one for one in self._jobs.values() if chosen(one) and not one.ended]:
            task = self._tasks.get(job.id)
            if task is not None and not task.done():
                job.stopped_by = actor
                task.cancel()
                await asyncio.wait([task])

    async def close(self) -> None:
        """Begin nothing more, and end what is under way between two batches."""
        self._closing = True
        tasks = list(self._tasks.values())
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def _remember(self, job: _Job) -> None:
        ended = [one.id for one in self._jobs.values() if one.ended]
        for known in ended[: max(0, len(self._jobs) - MAX_REMEMBERED)]:
            del self._jobs[known]
        self._jobs[job.id] = job

    async def _import(self, job: _Job, upload: Upload, keeping: AsyncExitStack) -> None:
        try:
            async with keeping, self._turn:
                await self._import_now(job, upload)
        except asyncio.CancelledError:
            if not job.stopped_by:
                job.fail("the service ended", "send it again: what was stored of it is not stored twice")
                raise
            await to_the_end(self._note_stop(job))

    async def _import_now(self, job: _Job, upload: Upload) -> None:
        job.state = LogState.READING
        with self._hold(job.mission_id):
            try:
                job.result = await self._read(job, upload)
                job.state, job.stopped_by = LogState.DONE, ""
            except MissionError as error:
                await self._fail(job, str(error), error.remedy)
            except Exception as error:
                words = trouble_of(error) if isinstance(error, SQLAlchemyError | sqlite3.Error) else ""
                if not words:
                    log.exception("a log could not be imported", mission=job.mission_id, file=job.file)
                problem, _, remedy = (words or "something went wrong inside the service").partition(": ")
                await self._fail(job, problem, remedy or "the service's own log says what; send it again")

    async def _read(self, job: _Job, upload: Upload) -> LogImportView:
        live = await self._get(job.mission_id)
        if job.vehicle is None or not is_multibeam(job.file):
            return await self._read_into(live, job, upload)
        with live.placed_files.reading(job.file, job.vehicle):
            return await self._read_into(live, job, upload)

    async def _read_into(self, live: LiveMission, job: _Job, upload: Upload) -> LogImportView:
        check_log(live, job.file, job.vehicle)
        bridge = bridge_settings(self._settings.imc, self._settings.time_scale)

        def show(done: int, _total: int) -> None:
            job.read_bytes = done

        wanted = WantedLog(job.file, job.vehicle, bridge, near(live), self._settings.unconfined_imports)
        async with reading(upload.file, wanted) as process:
            job.vehicle = process.opened.vehicle
            content = process.opened.unpacked_sha256 or job.digest
            head = LogHead(job.file, job.digest, job.vehicle, process.opened.size_bytes, content)
            job.work = LogImport(live, self._settings, head, _WhileOpen(process, live, self._get))
            try:
                return await job.work.run(actor=job.actor, progress=show, import_id=job.id)
            finally:
                # What was stored before reading broke off counts as well.
                if await self._is_open(live):
                    if not live.running:
                        self._maps.take_up(live)
                    live.publish_summary()

    async def _is_open(self, live: LiveMission) -> bool:
        """Tell whether a mission in memory is still the one that is stored, and the service goes on."""
        try:
            return not self._closing and await self._get(live.id) is live
        except (MissionError, SQLAlchemyError, sqlite3.Error):
            return False

    async def _fail(self, job: _Job, problem: str, remedy: str) -> None:
        """Note why a log was not imported, or not to its end, also in the mission's log."""
        try:
            words = f"the log {job.file} could not be imported: {problem}"
            await self._note(job, Level.WARNING, words, problem=problem, remedy=remedy)
        finally:
            job.fail(problem, remedy)

    async def _note_stop(self, job: _Job) -> None:
        """Note who stopped a log, also in the mission's log."""
        try:
            words = f"reading the log {job.file} was stopped by {job.stopped_by}"
            await self._note(job, Level.INFO, words, stopped_by=job.stopped_by)
        finally:
            job.state, job.taken_back_at = LogState.TAKEN_BACK, now()

    async def _note(self, job: _Job, level: Level, words: str, **data: str) -> None:
        """Write a line of the mission's log, if that can be."""
        about = {"sha256": job.digest, "import_id": job.id, "file": job.file, "vehicle": job.vehicle, **data}
        number = {} if job.number is None else {"log": job.number}
        try:
            live = await self._get(job.mission_id)
            await live.journal.log(level, "import", words, actor=job.actor, **about, **number)
        except (MissionError, SQLAlchemyError, sqlite3.Error) as error:
            log.warning("what became of a log is in no mission's log", mission=job.mission_id, error=str(error))


class _WhileOpen:
    """What a process reads, while the mission in memory is the one that the import began with."""

    def __init__(
        self, process: ReadingProcess, live: LiveMission, get: Callable[[str], Awaitable[LiveMission]]
    ) -> None:
        self._process = process
        self._live = live
        self._get = get

    async def next(self) -> LogBatch | None:
        batch = await self._process.next()
        if await self._get(self._live.id) is not self._live:
            raise ConflictError(
                "the mission was described anew meanwhile", "send it again: what was stored of it is not stored twice"
            )
        return batch

    def facts(self) -> LogFacts:
        return self._process.facts()


def _stored_view(row: EventRow) -> LogView | None:
    """Return what a line of the mission's log tells of a log; None where it is about something else."""
    data: dict[str, Any] = row.data
    failed, stopped = "problem" in data, "stopped_by" in data
    state = LogState.FAILED if failed else LogState.TAKEN_BACK if stopped else LogState.DONE
    if "sha256" not in data or not (failed or stopped or "packets" in data):
        return None
    told = {name: data[name] for name in LogImportView.model_fields if name in data}
    result = None if failed or stopped else LogImportView(**told)
    return LogView(
        id=data.get("import_id") or f"line-{row.id}",
        file=data["file"],
        vehicle=data["vehicle"],
        sha256=data["sha256"],
        state=state,
        created_at=row.time,
        actor=data.get("actor", ""),
        result=result,
        problem=data.get("problem", ""),
        remedy=data.get("remedy", ""),
        taken_back_at=row.time if stopped else None,
        taken_back_by=data.get("stopped_by", ""),
        can_be_taken_back=_can_be_taken_back(state, data.get("log")),
    )


def _can_be_taken_back(state: LogState, number: int | None) -> bool:
    """Tell whether a log can be stopped or taken back; ``number``: under which what it brought is stored, if it is."""
    return state in (LogState.WAITING, LogState.READING) or (state is not LogState.TAKEN_BACK and number is not None)


def _as_taken_back(view: LogView, row: EventRow | None) -> LogView:
    """Return what is told of a log; ``row``: the line of the mission's log that it is taken back, if it is."""
    if row is None:
        return view
    over = {"state": LogState.TAKEN_BACK, "taken_back_at": row.time, "taken_back_by": row.data.get("actor", "")}
    return view.model_copy(update={**over, "can_be_taken_back": False})
