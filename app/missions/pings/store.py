"""Keeps the pings of a mission: first as blocks in the database, some thousand of a vehicle then in a file."""

import asyncio
import hashlib
import math
from collections import Counter
from collections.abc import AsyncIterator, Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np
import structlog
from sqlalchemy.ext.asyncio import AsyncSession

from app.arrays import FloatArray
from app.mapping.swath.pings import Pings
from app.missions.clock import now
from app.missions.errors import MissionElsewhereError, PingsUnreadableError
from app.missions.fleet.interface import PingReport
from app.missions.large_batches import made_of
from app.missions.pings.chunk_file import PingBlock, read_chunk, write_chunk
from app.missions.pings.codec import JudgedPings, columns_of, joined, pack, unpack
from app.missions.pings.gate import PingGate, storable
from app.missions.views.measurements.soundings import ItemVerdict, Verdict
from app.storage.concurrency.own_thread import on_own_thread
from app.storage.concurrency.uncancellable import to_the_end
from app.storage.database import Database
from app.storage.models import PingBlockRow, PingChunkRow
from app.storage.ping_files import PingFileError, PingFiles, PingPlaceError, file_name
from app.storage.queries import logs as log_queries
from app.storage.queries import pings as ping_queries
from app.storage.queries.pings import Totals

BEAMS_PER_ITEM = 20
"""So many beams are as much work as an item without."""
BLOCK_PINGS = 1000
"""Most pings of a block."""
CHUNK_PINGS = 4096
"""So many pings of a vehicle are moved to a file."""
BLOCKS_AT_ONCE = 256
"""Blocks that are read together."""
CLOSE_S = 5.0
"""How long a mission, or all of them when the service ends, may take to move their last pings."""
WAIT_S = 60.0
"""How long a file that could not be written is left alone."""

log = structlog.get_logger(__name__)


@dataclass(frozen=True)
class JudgedBlock:
    """Pings of a vehicle that are stored together; ``indices`` are theirs among all that were judged with them."""

    vehicle: str
    source: str
    indices: tuple[int, ...]
    judged: JudgedPings
    content: bytes

    def without(self, known: Collection[float]) -> "JudgedBlock":
        """Return the same without the pings of some times."""
        rows = [row for row, time_s in enumerate(self.judged.pings.time_s.tolist()) if time_s not in known]
        judged = JudgedPings(self.judged.pings.take(np.array(rows, int)), tuple(self.judged.reasons[r] for r in rows))
        return JudgedBlock(
            self.vehicle, self.source, tuple(self.indices[row] for row in rows), judged, pack(judged) if rows else b""
        )


@dataclass(frozen=True)
class JudgedBatch:
    """Pings as the gate judges them, ready to be stored: a verdict on each, and those that can be in blocks."""

    verdicts: Sequence[ItemVerdict]
    blocks: Sequence[JudgedBlock]


@dataclass(frozen=True)
class TakenPings:
    """Pings that were stored in a transaction: the verdicts in their order, and what was new."""

    verdicts: Sequence[ItemVerdict]
    stored: Mapping[str, Totals]
    accepted: Mapping[str, Pings]
    """By vehicle."""

    @property
    def totals(self) -> Totals:
        """What was new of all vehicles."""
        return sum(self.stored.values(), Totals())


class PingStore:
    """The pings of one mission."""

    def __init__(self, database: Database, mission_id: str, gate: PingGate, files: PingFiles) -> None:
        self._database = database
        self._mission_id = mission_id
        self._gate = gate
        self._files = files
        self._waiting: Counter[str] = Counter()
        """Pings of each vehicle that are in no file yet."""
        self._newest_s: dict[str, float] = {}
        """By vehicle the latest time of a ping that may be stored."""
        self._any = False
        """Whether there were pings when the mission was opened."""
        self._took = False
        self.taken_back: frozenset[int] = frozenset()
        """Numbers of the logs that were taken back: what they brought does not count."""
        self._moving = asyncio.Lock()
        self._mover: asyncio.Task[None] | None = None
        self._tidying: asyncio.Task[None] | None = None
        self._not_before_s = -math.inf

    async def open(self, session: AsyncSession) -> Totals:
        """Look what there is; returns how many pings are stored and count."""
        self.taken_back = await log_queries.taken_back(session, self._mission_id)
        stored = await ping_queries.totals(session, self._mission_id, without=self.taken_back)
        self._any = stored != Totals() or bool(self.taken_back)
        self._newest_s = await ping_queries.newest_times(session, self._mission_id)
        waiting = await ping_queries.waiting(session, self._mission_id)
        self._waiting = Counter({vehicle: found.pings + found.rejected for vehicle, found in waiting.items()})
        return stored

    async def tidy(self) -> None:
        """Remove halves of files that a killed process left behind; only for the process that has the mission.

        Raises
        ------
        MissionElsewhereError
            When another process has it now: then nothing is removed.
        """
        if not self._any:
            return  # a file is made of what is stored
        async with self._moving:
            # In this order: what another process writes once it has the mission was not found before.
            left = await on_own_thread(self._files.unfinished, self._mission_id)
            if left:
                async with self._database.writing():
                    pass  # it is refused where the mission is another process's
                await on_own_thread(self._files.remove_unfinished, left)
        if left:
            log.warning("files of pings that were not written to the end are removed", files=left)

    def begin_to_tidy(self) -> None:
        """Do so beside everything else: files may be on a machine that does not answer, and vehicles do not wait."""
        self._tidying = asyncio.create_task(self._try_to_tidy(), name=f"tidy pings of {self._mission_id}")

    async def _try_to_tidy(self) -> None:
        try:
            await self.tidy()
            # What an earlier process could not move any more is moved when this one closes, if not before.
            self._took = self._took or any(self._waiting.values())
        except MissionElsewhereError:
            pass  # nothing of it is ours to remove
        except Exception as error:
            log.warning(
                "files of pings that were not written to the end stay: they could not be looked for",
                mission=self._mission_id,
                error=str(error),
            )

    async def judge(self, reports: Sequence[PingReport]) -> JudgedBatch:
        """Return what the gate says of pings, and how they are stored; changes nothing."""
        beams = sum(len(report.angles_rad) for report in reports)
        return await made_of(range(beams // BEAMS_PER_ITEM), self.judge_here, reports)

    def judge_here(self, reports: Sequence[PingReport]) -> JudgedBatch:
        """Return in the caller's thread what :meth:`judge` returns."""
        verdicts: list[ItemVerdict] = []
        fresh: dict[tuple[str, str], list[tuple[int, PingReport, str]]] = {}
        seen: set[tuple[str, float]] = set()
        for index, report in enumerate(reports):
            identity = report.vehicle, report.time_s
            if identity in seen:
                verdicts.append(_duplicate(index))
                continue
            checked, reason = self._gate.check(report)
            verdict = Verdict.REJECTED if reason else Verdict.ACCEPTED
            verdicts.append(ItemVerdict(index=index, verdict=verdict, reason=reason))
            if storable(report):
                seen.add(identity)
                fresh.setdefault((report.vehicle, report.source), []).append((index, checked, reason))
        blocks = []
        for (vehicle, source), found in fresh.items():
            for first in range(0, len(found), BLOCK_PINGS):
                indices, checks, reasons = zip(*found[first : first + BLOCK_PINGS], strict=True)
                judged = JudgedPings(columns_of(checks), reasons)
                blocks.append(JudgedBlock(vehicle, source, indices, judged, pack(judged)))
        return JudgedBatch(verdicts, blocks)

    async def take(
        self, batches: Sequence[JudgedBatch], step: int, session: AsyncSession, *, log: int | None = None
    ) -> TakenPings:
        """Store pings in the caller's transaction, which nobody else does meanwhile; those that are known are not.

        ``log``: the number of the log that brings them.
        Call :meth:`committed` with the result once the transaction has committed.
        """
        verdicts: list[ItemVerdict] = []
        rows: list[dict[str, Any]] = []
        stored: dict[str, Totals] = {}
        accepted: dict[str, list[Pings]] = {}
        taken: dict[str, set[float]] = {}
        received = now()
        for batch in batches:
            own = list(batch.verdicts)
            for judged in batch.blocks:
                block, times_s = judged, judged.judged.pings.time_s
                before = taken.setdefault(block.vehicle, set())
                known = await self._known(session, block.vehicle, times_s)
                known |= before.intersection(times_s.tolist())
                if known:
                    block = await made_of(range(times_s.size * BEAMS_PER_ITEM), judged.without, known)
                    for index in set(judged.indices) - set(block.indices):
                        own[index] = _duplicate(index)
                    if not block.indices:
                        continue
                before.update(block.judged.pings.time_s.tolist())
                good = block.judged.accepted
                sizes = Totals(len(good), good.beams, len(block.judged) - len(good))
                stored[block.vehicle] = stored.get(block.vehicle, Totals()) + sizes
                if len(good):
                    accepted.setdefault(block.vehicle, []).append(good)
                rows.append(self._row(block, sizes, step, received) | {"log": log})
            verdicts += own
        await ping_queries.add_blocks(session, rows)
        return TakenPings(verdicts, stored, {vehicle: joined(parts) for vehicle, parts in accepted.items()})

    def _row(self, block: JudgedBlock, sizes: Totals, step: int, received: datetime) -> dict[str, Any]:
        times_s = block.judged.pings.time_s
        return {
            "mission_id": self._mission_id,
            "vehicle": block.vehicle,
            "step": step,
            "received_at": received,
            "source": block.source,
            "first_time_s": float(times_s.min()),
            "last_time_s": float(times_s.max()),
            "pings": sizes.pings,
            "beams": sizes.beams,
            "rejected": sizes.rejected,
            "times": times_s.astype("<f8").tobytes(),
            "content": block.content,
        }

    async def _known(self, session: AsyncSession, vehicle: str, times_s: FloatArray) -> set[float]:
        """Return those of the times at which a ping of the vehicle is stored already."""
        newest_s = self._newest_s.get(vehicle, -math.inf)
        # Noted before the commit: pings that come again because that failed are looked for.
        self._newest_s[vehicle] = max(newest_s, float(times_s.max()))
        if times_s.min() > newest_s:
            return set()
        return await ping_queries.known_times(session, self._mission_id, vehicle, times_s, without=self.taken_back)

    def committed(self, taken: TakenPings) -> None:
        """Note that what was taken is stored; what there is enough of is moved to a file beside everything else."""
        for vehicle, sizes in taken.stored.items():
            self._took = True
            self._waiting[vehicle] += sizes.pings + sizes.rejected
        full = any(pings >= CHUNK_PINGS for pings in self._waiting.values())
        idle = self._mover is None or self._mover.done()
        if full and idle and asyncio.get_running_loop().time() >= self._not_before_s:
            self._mover = asyncio.create_task(self.move(CHUNK_PINGS), name=f"pings of {self._mission_id}")

    async def move(self, at_least: int = 1) -> None:
        """Move pings to files, of every vehicle that has so many; what cannot be moved stays in the database."""
        async with self._moving:
            try:
                for vehicle in [name for name, pings in self._waiting.items() if pings >= at_least]:
                    while self._waiting[vehicle] >= at_least:
                        await self._move(vehicle)
            except MissionElsewhereError:
                pass  # nothing more is ours to move
            except Exception:
                self._not_before_s = asyncio.get_running_loop().time() + WAIT_S
                log.exception("pings stay in the database, their file could not be written", mission=self._mission_id)

    async def _move(self, vehicle: str) -> None:
        async with self._database.reading() as session:
            rows = await ping_queries.oldest_blocks(session, self._mission_id, vehicle, CHUNK_PINGS)
        if not rows:
            self._waiting[vehicle] = 0
            return
        chunk, content = await asyncio.to_thread(_chunk_of, rows)
        await on_own_thread(self._files.write, chunk.name, content)
        # The file stays whatever becomes of the transaction: that a commit failed cannot always be told for sure.
        await to_the_end(self._replace(len(rows), chunk))
        self._waiting[vehicle] -= chunk.pings + chunk.rejected

    async def _replace(self, blocks: int, chunk: PingChunkRow) -> None:
        async with self._database.writing() as session:
            if not await ping_queries.move_to_chunk(session, blocks, chunk):
                raise MissionElsewhereError("another process moves these pings", "ask again in a moment")

    async def newest_block(self) -> int:
        """Return the number of the newest block: what is stored later comes after it."""
        async with self._database.reading() as session:
            return await ping_queries.newest_block(session, self._mission_id)

    async def all_accepted(
        self, until_block: int | None = None, until_step: int | None = None
    ) -> AsyncIterator[tuple[str, Pings]]:
        """Yield vehicles with their accepted pings, each vehicle's in the order they came, some thousand at a time.

        ``until_block``, ``until_step``: no later ones. Pings may be moved to files meanwhile.

        Raises
        ------
        PingsUnreadableError
            When a file is missing or damaged, with its name.
        """
        until = await self.newest_block() if until_block is None else until_block
        done: dict[str, int] = {}
        after = 0
        while True:
            async with self._database.reading() as session:
                rows = await ping_queries.blocks_after(session, self._mission_id, after, until, BLOCKS_AT_ONCE)
                chunks = await ping_queries.chunks(session, self._mission_id)
            missing = [one for one in chunks if one.last_block > done.get(one.vehicle, 0) and one.first_block <= until]
            for chunk in missing:
                before, done[chunk.vehicle] = done.get(chunk.vehicle, 0), chunk.last_block
                if chunk.log in self.taken_back:
                    continue
                pings = await self._accepted_of(chunk, before, until, until_step)
                if len(pings):
                    yield chunk.vehicle, pings
            if missing:
                continue  # some of the blocks may be in them
            if not rows:
                return
            after = rows[-1].id
            for row in rows:
                done[row.vehicle] = row.id
            rows = [row for row in rows if row.log not in self.taken_back]
            wanted = [row for row in rows if until_step is None or row.step <= until_step]
            for vehicle, pings in await asyncio.to_thread(_accepted_by_vehicle, wanted):
                yield vehicle, pings

    async def _accepted_of(self, row: PingChunkRow, after: int, until: int, until_step: int | None) -> Pings:
        def read() -> Pings:
            chunk = read_chunk(self._files.read(row.name, row.digest))
            wanted = chunk.judged.is_accepted & (chunk.block > after) & (chunk.block <= until)
            if until_step is not None:
                wanted &= chunk.step <= until_step
            return chunk.judged.pings if wanted.all() else chunk.judged.pings.take(wanted)

        try:
            return await on_own_thread(read)
        except PingFileError as error:
            raise _unreadable(error) from None

    async def contents(self) -> tuple[Sequence[PingChunkRow], Mapping[str, ping_queries.WaitingPings]]:
        """Return the files, and by vehicle what is in none yet, without what was taken back."""
        async with self._database.reading() as session:
            return (
                await ping_queries.chunks(session, self._mission_id),
                await ping_queries.waiting(session, self._mission_id, without=self.taken_back),
            )

    async def file(self, number: int) -> tuple[PingChunkRow, bytes] | None:
        """Return one of the files with its content. Raises PingsUnreadableError."""
        async with self._database.reading() as session:
            row = await ping_queries.chunk(session, self._mission_id, number)
        if row is None:
            return None
        try:
            return row, await on_own_thread(self._files.read, row.name, row.digest)
        except PingFileError as error:
            raise _unreadable(error) from None

    def abandon(self) -> None:
        """Move nothing any more: the mission is another process's."""
        for task in (self._mover, self._tidying):
            if task is not None:
                task.cancel()
        self._took = False

    async def close(self, until_s: float | None = None) -> None:
        """Move what is left to files, if anything came; not while those there are being looked through.

        What is not moved until then, by the loop's time, stays in the database: where the files are may not answer.
        None: for some seconds.
        """
        now_s = asyncio.get_running_loop().time()
        closing = asyncio.create_task(self._finish(), name=f"last pings of {self._mission_id}")
        try:
            await asyncio.wait([closing], timeout=CLOSE_S if until_s is None else max(0.0, until_s - now_s))
        finally:
            given_up = [task for task in (closing, self._mover, self._tidying) if task is not None and not task.done()]
            for task in given_up:
                task.cancel()
            # A transaction is still brought to its end; nothing else is waited for.
            await asyncio.gather(*given_up, return_exceptions=True)
        if closing in given_up:
            log.warning("pings stay in the database: moving them to files took too long", mission=self._mission_id)
        else:
            closing.result()

    async def _finish(self) -> None:
        if self._tidying is not None and not self._tidying.done():
            return  # it stays in the database, and nobody waits for a machine that does not answer
        if self._mover is not None:
            await asyncio.wait([self._mover])
        if self._took:
            await self.move()


def _duplicate(index: int) -> ItemVerdict:
    return ItemVerdict(index=index, verdict=Verdict.DUPLICATE, reason="already stored")


def _unreadable(error: PingFileError) -> PingsUnreadableError:
    if isinstance(error, PingPlaceError):
        return PingsUnreadableError(str(error), "ask again when it answers; see that pings_url names it")
    return PingsUnreadableError(str(error), "bring the file back from a backup, or set pings_url to where it is")


def _chunk_of(rows: Sequence[PingBlockRow]) -> tuple[PingChunkRow, bytes]:
    """Return the file that takes the place of blocks, and what is to be known of it."""
    first = rows[0]
    blocks = [PingBlock(row.id, row.step, row.received_at, row.source, unpack(row.content)) for row in rows]
    content = write_chunk(blocks, first.mission_id, first.vehicle)
    digest = hashlib.sha256(content).hexdigest()
    chunk = PingChunkRow(
        mission_id=first.mission_id,
        vehicle=first.vehicle,
        name=file_name(first.mission_id, first.id, digest),
        first_block=first.id,
        last_block=rows[-1].id,
        first_time_s=min(row.first_time_s for row in rows),
        last_time_s=max(row.last_time_s for row in rows),
        pings=sum(row.pings for row in rows),
        beams=sum(row.beams for row in rows),
        rejected=sum(row.rejected for row in rows),
        times=b"".join(row.times for row in rows),
        digest=digest,
        size=len(content),
        log=first.log,
    )
    return chunk, content


def _accepted_by_vehicle(rows: Sequence[PingBlockRow]) -> list[tuple[str, Pings]]:
    """Return vehicles with the accepted pings of blocks; no piece has more than some thousand."""
    pieces: list[tuple[str, Pings]] = []
    gathered: dict[str, list[Pings]] = {}
    for row in rows:
        parts = gathered.setdefault(row.vehicle, [])
        parts.append(unpack(row.content).accepted)
        if sum(len(part) for part in parts) >= CHUNK_PINGS:
            pieces.append((row.vehicle, joined(gathered.pop(row.vehicle))))
    pieces += [(vehicle, joined(parts)) for vehicle, parts in gathered.items()]
    return [(vehicle, pings) for vehicle, pings in pieces if len(pings)]
