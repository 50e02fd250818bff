"""Queries on the missions' logs."""

from collections import Counter
from collections.abc import Collection, Sequence

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


async def events_of_levels(session: AsyncSession, mission_id: str, levels: Collection[str]) -> Sequence[EventRow]:
    """Return the events of some levels, oldest first."""
    query = select(EventRow).where(EventRow.mission_id == mission_id, EventRow.level.in_(levels)).order_by(EventRow.id)
    return (await session.scalars(query)).all()


async def events_of_kind(session: AsyncSession, mission_id: str, kind: str) -> Sequence[EventRow]:
    """Return the events of a kind, oldest first."""
    query = select(EventRow).where(EventRow.mission_id == mission_id, EventRow.kind == kind).order_by(EventRow.id)
    return (await session.scalars(query)).all()


async def last_event_id(session: AsyncSession, mission_id: str, *, kind: str | None = None) -> int:
    """Return the id of the newest event, of this kind where one is given; 0 when there is none."""
    query = select(func.max(EventRow.id)).where(EventRow.mission_id == mission_id)
    return (await session.scalar(query if kind is None else query.where(EventRow.kind == kind))) or 0


async def newest_of_kind(session: AsyncSession, mission_id: str, kind: str) -> EventRow | None:
    """Return the newest event of a kind."""
    query = select(EventRow).where(EventRow.mission_id == mission_id, EventRow.kind == kind)
    return (await session.scalars(query.order_by(EventRow.id.desc()).limit(1))).first()


async def count_by_vehicle(session: AsyncSession, mission_id: str, kind: str, mark: str) -> dict[str, int]:
    """Return how many events of a kind each vehicle has whose data are marked so."""
    query = select(EventRow.data).where(EventRow.mission_id == mission_id, EventRow.kind == kind)
    return dict(Counter(str(data.get("vehicle")) for data in await session.scalars(query) if data.get(mark)))
