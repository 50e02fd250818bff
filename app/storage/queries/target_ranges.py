"""Queries on ranges to moving targets."""

from collections.abc import Sequence
from typing import Any

from sqlalchemy import insert, select, tuple_
from sqlalchemy.ext.asyncio import AsyncSession

from app.storage.models import TargetRangeRow

Identity = tuple[str, str, float]
"""What makes a range the same range within a mission: target, vehicle, vehicle's time."""

CHUNK = 300


async def known_ranges(session: AsyncSession, mission_id: str, wanted: Sequence[Identity]) -> set[Identity]:
    """Return those of the ranges that are stored already."""
    columns = (TargetRangeRow.target, TargetRangeRow.vehicle, TargetRangeRow.time_s)
    found: set[Identity] = set()
    for first in range(0, len(wanted), CHUNK):
        query = select(*columns).where(
            TargetRangeRow.mission_id == mission_id, tuple_(*columns).in_(wanted[first : first + CHUNK])
        )
        found |= {(target, vehicle, time_s) for target, vehicle, time_s in await session.execute(query)}
    return found


async def add_ranges(session: AsyncSession, rows: Sequence[dict[str, Any]]) -> int:
    """Store ranges in their order; returns the id of the last one, 0 without any."""
    if not rows:
        return 0
    ids = await session.scalars(insert(TargetRangeRow).returning(TargetRangeRow.id, sort_by_parameter_order=True), rows)
    return max(ids)


async def ranges_after(
    session: AsyncSession, mission_id: str, after: int, limit: int | None = None, target: str | None = None
) -> Sequence[TargetRangeRow]:
    """Return the ranges with an id above ``after``, in the order they were judged."""
    query = select(TargetRangeRow).where(TargetRangeRow.mission_id == mission_id, TargetRangeRow.id > after)
    if target is not None:
        query = query.where(TargetRangeRow.target == target)
    return (await session.scalars(query.order_by(TargetRangeRow.id).limit(limit))).all()
