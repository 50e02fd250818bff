"""Queries on the missions' logs."""

from collections.abc import Sequence

from sqlalchemy import func, select
from sqlalchemy.ext.asyncio import AsyncSession

from app.storage.models import EventRow


async def events_after(session: AsyncSession, mission_id: str, after: int, limit: int) -> Sequence[EventRow]:
    """Return up to ``limit`` events with an id above ``after``, oldest first."""
    query = (
        select(EventRow)
        .where(EventRow.mission_id == mission_id, EventRow.id > after)
        .order_by(EventRow.id)
        .limit(limit)
    )
    return (await session.scalars(query)).all()


async def last_event_id(session: AsyncSession, mission_id: str) -> int:
    """Return the id of the newest event, 0 when there is none."""
    return (await session.scalar(select(func.max(EventRow.id)).where(EventRow.mission_id == mission_id))) or 0
