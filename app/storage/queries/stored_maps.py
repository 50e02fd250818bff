"""Queries on missions' stored maps."""

from typing import Any, NamedTuple

from sqlalchemy import delete, func, select
from sqlalchemy.ext.asyncio import AsyncSession

from app.storage.models import LogRow, SiteSurveyRow, SoundingRow, StoredMapRow


class Stored(NamedTuple):
    """A stored map, and the mission's soundings by verdict now."""

    row: StoredMapRow | None
    accepted: int
    rejected: int


async def newest_sounding(session: AsyncSession, mission_id: str) -> int:
    """Return the id of the sounding that was stored last; 0 without any."""
    query = select(func.max(SoundingRow.id)).where(SoundingRow.mission_id == mission_id)
    return (await session.scalar(query)) or 0


async def stored_map(session: AsyncSession, mission_id: str, last_import: int) -> Stored:
    """Return the stored map and how many soundings there are: only those that came since are counted.

    ``last_import`` is the newest log line of an import: logs are written by other processes, too, whose soundings may
    have earlier ids than others that were stored before. After one everything is counted, and where a log was taken
    back: what comes again has the id of what it takes the place of.
    """
    row = await session.get(StoredMapRow, mission_id)
    taken_back = select(LogRow.id).where(LogRow.mission_id == mission_id, LogRow.taken_back_at.is_not(None)).limit(1)
    query = select(SoundingRow.verdict, func.count().label("n")).where(SoundingRow.mission_id == mission_id)
    known = row is not None and row.last_import == last_import and await session.scalar(taken_back) is None
    if row is not None and known:
        query = query.where(SoundingRow.id > row.last_sounding)
    since = {found.verdict: found.n for found in await session.execute(query.group_by(SoundingRow.verdict))}
    accepted, rejected = (row.accepted, row.rejected) if row is not None and known else (0, 0)
    return Stored(row, accepted + since.get("accepted", 0), rejected + since.get("rejected", 0))


async def keep(session: AsyncSession, values: dict[str, Any]) -> None:
    """Store a map in place of the mission's older one."""
    await session.merge(StoredMapRow(**values))


async def forget(session: AsyncSession, mission_id: str) -> None:
    """Drop a mission's stored map, and what its site has of it: what they were made of changes in this transaction."""
    await session.execute(delete(StoredMapRow).where(StoredMapRow.mission_id == mission_id))
    await session.execute(delete(SiteSurveyRow).where(SiteSurveyRow.mission_id == mission_id))
