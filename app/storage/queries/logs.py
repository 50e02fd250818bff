"""Queries on vehicles' own logs, and on what they brought."""

from collections.abc import Sequence
from datetime import datetime
from typing import NamedTuple

from sqlalchemy import and_, case, delete, func, select, update
from sqlalchemy.ext.asyncio import AsyncSession

from app.storage.models import BatchRow, LogRow, PingBlockRow, PingChunkRow, SoundingRow
from app.storage.queries.soundings import LOG_KEY, TAKEN_BACK

NO_LEVEL = "tide: "
"""How the reason of a sounding begins of whose time no water level is known."""


class Brought(NamedTuple):
    """What of a log counted until it was taken back."""

    soundings: int
    pings: int


def number_key(number: int) -> str:
    """Return what the keys of the batches of a numbered log begin with."""
    return f"{LOG_KEY}:{number}:"


async def of_content(session: AsyncSession, mission_id: str, digest: str) -> Sequence[LogRow]:
    """Return the logs with this content (SHA-256), oldest first, those that were taken back among them."""
    query = select(LogRow).where(LogRow.mission_id == mission_id, LogRow.digest == digest)
    return (await session.scalars(query.order_by(LogRow.id))).all()


async def earlier_batches(session: AsyncSession, mission_id: str, digest: str) -> Sequence[BatchRow]:
    """Return the first batches of a file that was taken in before logs were numbered; ``digest``: its SHA-256."""
    query = select(BatchRow).where(
        BatchRow.mission_id == mission_id, BatchRow.digest == digest, BatchRow.key.like(f"{LOG_KEY}-%-0")
    )
    return (await session.scalars(query)).all()


async def numbered(session: AsyncSession, mission_id: str, number: int) -> LogRow | None:
    """Return one of a mission's logs."""
    row = await session.get(LogRow, number)
    return row if row is not None and row.mission_id == mission_id else None


async def taken_back(session: AsyncSession, mission_id: str) -> frozenset[int]:
    """Return the numbers of the logs that were taken back."""
    query = select(LogRow.id).where(LogRow.mission_id == mission_id, LogRow.taken_back_at.is_not(None))
    return frozenset(await session.scalars(query))


async def take_back(session: AsyncSession, row: LogRow, at: datetime, actor: str) -> Brought:
    """Mark a log and its soundings as taken back; its pings and its track are told by its number."""
    row.taken_back_at, row.taken_back_by = at, actor
    sounding = SoundingRow
    of_log = (sounding.mission_id == row.mission_id, sounding.log == row.id, sounding.verdict != TAKEN_BACK)
    counted = select(func.count()).where(*of_log, sounding.verdict == "accepted")
    soundings = await session.scalar(counted) or 0
    await session.execute(
        update(sounding).where(*of_log).values(verdict=TAKEN_BACK), execution_options={"synchronize_session": False}
    )
    pings = 0
    for table in (PingBlockRow, PingChunkRow):
        summed = select(func.sum(table.pings)).where(table.mission_id == row.mission_id, table.log == row.id)
        pings += int(await session.scalar(summed) or 0)
    # Sent again, its batches are written again: what came from elsewhere meanwhile stays as it is.
    of_batches = (BatchRow.mission_id == row.mission_id, BatchRow.key.like(f"{number_key(row.id)}%"))
    await session.execute(delete(BatchRow).where(*of_batches))
    return Brought(soundings, pings)


async def with_doubles(session: AsyncSession, row: LogRow) -> list[str]:
    """Return the names of the vehicle's other logs of which some was known already, and not stored, as in ``row``."""
    others = select(LogRow).where(
        LogRow.mission_id == row.mission_id,
        LogRow.vehicle == row.vehicle,
        LogRow.id != row.id,
        LogRow.taken_back_at.is_(None),
    )
    found = []
    for other in (await session.scalars(others.order_by(LogRow.id))).all():
        answers = select(BatchRow.answer).where(
            BatchRow.mission_id == row.mission_id, BatchRow.key.like(f"{number_key(other.id)}%")
        )
        counted = [answer.get("verdicts", answer.get("pings", {})) for answer in await session.scalars(answers)]
        if any(verdicts.get("duplicate") for verdicts in counted):
            found.append(other.file)
    return found


async def bring_back_rulings(session: AsyncSession, row: LogRow) -> None:
    """Let the soundings that operators had decided about count as decided, when their log was sent again.

    ``row``: the log as it is taken in now.
    """
    sounding = SoundingRow
    before = select(LogRow.id).where(
        LogRow.mission_id == row.mission_id,
        LogRow.digest == row.digest,
        LogRow.vehicle == row.vehicle,
        LogRow.altimeter == row.altimeter,
        LogRow.taken_back_at.is_not(None),
    )
    counts = and_(sounding.ruling == "restored", sounding.reason.not_like(f"{NO_LEVEL}%"))
    await session.execute(
        update(sounding)
        .where(
            sounding.mission_id == row.mission_id,
            sounding.verdict == TAKEN_BACK,
            sounding.ruling.is_not(None),
            sounding.log.in_(before),
        )
        .values(verdict=case((counts, "accepted"), else_="rejected"), log=row.id),
        execution_options={"synchronize_session": False},
    )
