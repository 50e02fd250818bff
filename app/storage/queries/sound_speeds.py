"""Queries on sound speeds that vehicles measured."""

from collections.abc import Sequence
from typing import Any

from sqlalchemy import delete, func, insert, select
from sqlalchemy.ext.asyncio import AsyncSession

from app.storage.models import SoundSpeedRow


async def add(session: AsyncSession, rows: Sequence[dict[str, Any]]) -> None:
    """Append samples."""
    if rows:
        await session.execute(insert(SoundSpeedRow), list(rows))


async def counts(session: AsyncSession, mission_id: str) -> dict[str, int]:
    """Return how many samples of each vehicle are stored."""
    query = select(SoundSpeedRow.vehicle, func.count()).where(SoundSpeedRow.mission_id == mission_id)
    found = await session.execute(query.group_by(SoundSpeedRow.vehicle))
    return {vehicle: int(count) for vehicle, count in found}


async def halve(session: AsyncSession, mission_id: str, vehicle: str) -> None:
    """Remove every second sample of a vehicle, in the order in which they came."""
    order = func.row_number().over(order_by=SoundSpeedRow.id).label("number")
    own = (SoundSpeedRow.mission_id == mission_id) & (SoundSpeedRow.vehicle == vehicle)
    numbered = select(SoundSpeedRow.id, order).where(own).subquery()
    second = select(numbered.c.id).where(numbered.c.number % 2 == 0)
    await session.execute(delete(SoundSpeedRow).where(SoundSpeedRow.id.in_(second)))


async def samples(
    session: AsyncSession,
    mission_id: str,
    *,
    vehicle: str | None = None,
    first_s: float | None = None,
    last_s: float | None = None,
) -> Sequence[Any]:
    """Return samples in the order in which they came: vehicle, source, time, depth, speed, latitude, longitude.

    Parameters
    ----------
    vehicle
        Of which one; None: of all.
    first_s, last_s
        By the vehicle's clock, both included; None: no bound.
    """
    query = select(
        SoundSpeedRow.vehicle,
        SoundSpeedRow.source,
        SoundSpeedRow.time_s,
        SoundSpeedRow.depth_m,
        SoundSpeedRow.speed_mps,
        SoundSpeedRow.lat_deg,
        SoundSpeedRow.lon_deg,
    ).where(SoundSpeedRow.mission_id == mission_id)
    if vehicle is not None:
        query = query.where(SoundSpeedRow.vehicle == vehicle)
    if first_s is not None:
        query = query.where(SoundSpeedRow.time_s >= first_s)
    if last_s is not None:
        query = query.where(SoundSpeedRow.time_s <= last_s)
    return (await session.execute(query.order_by(SoundSpeedRow.id))).all()
