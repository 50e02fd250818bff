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
from app.missions.operations.imports.multibeam_log import is_multibeam
from app.missions.operations.imports.uploads import Upload
from app.missions.running.final_maps import FinalMaps
from app.missions.settings import ServiceSettings
from app.missions.views.measurements.imports import LogOptions, LogState, LogView
from app.missions.views.measurements.soundings import LogImportView
from app.missions.views.mission import Level
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

    @property
    def ended(self) -> bool:
        return self.state in (LogState.DONE, LogState.FAILED)

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
        self._tasks: set[asyncio.Task[None]] = set()
        self._closing = False

    def check(self, live: LiveMission, options: LogOptions) -> None:
        """Refuse what need not be sent. Raises InvalidRequestError, ImportUnavailableError."""
        if is_multibeam(options.filename) and options.vehicle is None:
            raise InvalidRequestError(
                "vehicle", f"{options.filename} does not tell its vehicle's name", "say whose it is: vehicle=NAME"
            )
        check_log(live, options.filename, options.vehicle)
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
        self.check(live, options)
        if not upload.size_bytes:
            raise InvalidRequestError("file", "it is empty", "send the file's content as the body")
        for job in self._jobs.values():
            same = (job.mission_id, job.digest, job.asked_vehicle) == (live.id, upload.sha256, options.vehicle)
            if same and not job.ended:
                return job.view()
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
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return job.view()

    async def all(self, live: LiveMission) -> list[LogView]:
        """Return what was imported and what is under way, oldest first.

        Those that stored nothing new are known until the service ends.
        """
        async with live.database.reading() as session:
            rows = await event_queries.events_of_kind(session, live.id, "import")
        stored = {view.id: view for row in rows if (view := _stored_view(row)) is not None}
        here = {job.id: job.view() for job in self._jobs.values() if job.mission_id == live.id}
        return sorted((stored | here).values(), key=lambda view: view.created_at)

    async def one(self, live: LiveMission, import_id: str) -> LogView:
        """Return the import of a log. Raises ImportNotFoundError."""
        for view in await self.all(live):
            if view.id == import_id:
                return view
        raise ImportNotFoundError(
            f"there is no import of a log {import_id!r}", "GET /api/v1/missions/{id}/logs lists them"
        )

    async def close(self) -> None:
        """Begin nothing more, and end what is under way between two batches."""
        self._closing = True
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def _remember(self, job: _Job) -> None:
        ended = [one.id for one in self._jobs.values() if one.ended]
        for known in ended[: max(0, len(self._jobs) - MAX_REMEMBERED)]:
            del self._jobs[known]
        self._jobs[job.id] = job

    async def _import(self, job: _Job, upload: Upload, keeping: AsyncExitStack) -> None:
        async with keeping, self._turn:
            job.state = LogState.READING
            with self._hold(job.mission_id):
                try:
                    job.result = await self._read(job, upload)
                    job.state = LogState.DONE
                except asyncio.CancelledError:
                    job.fail("the service ended", "send it again: what was stored of it is not stored twice")
                    raise
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
        check_log(live, job.file, job.vehicle)
        bridge = bridge_settings(self._settings.imc, self._settings.time_scale)

        def show(done: int, _total: int) -> None:
            job.read_bytes = done

        wanted = WantedLog(job.file, job.vehicle, bridge, near(live), self._settings.unconfined_imports)
        async with reading(upload.file, wanted) as process:
            job.vehicle = process.opened.vehicle
            head = LogHead(job.file, job.digest, job.vehicle, process.opened.size_bytes)
            work = LogImport(live, self._settings, head, _WhileOpen(process, live, self._get))
            try:
                return await work.run(actor=job.actor, progress=show, import_id=job.id)
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
            live = await self._get(job.mission_id)
            await live.journal.log(
                Level.WARNING,
                "import",
                f"the log {job.file} could not be imported: {problem}",
                actor=job.actor,
                sha256=job.digest,
                import_id=job.id,
                file=job.file,
                vehicle=job.vehicle,
                problem=problem,
                remedy=remedy,
            )
        except (MissionError, SQLAlchemyError, sqlite3.Error) as error:
            log.warning("a log that failed is in no mission's log", mission=job.mission_id, error=str(error))
        finally:
            job.fail(problem, remedy)


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
    failed = "problem" in data
    if "sha256" not in data or not (failed or "packets" in data):
        return None
    result = (
        None if failed else LogImportView(**{name: data[name] for name in LogImportView.model_fields if name in data})
    )
    return LogView(
        id=data.get("import_id") or f"line-{row.id}",
        file=data["file"],
        vehicle=data["vehicle"],
        sha256=data["sha256"],
        state=LogState.FAILED if failed else LogState.DONE,
        created_at=row.time,
        actor=data.get("actor", ""),
        result=result,
        problem=data.get("problem", ""),
        remedy=data.get("remedy", ""),
    )
