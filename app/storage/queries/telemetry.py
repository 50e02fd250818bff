"""Queries on vehicles' telemetry."""

from collections.abc import Sequence
from typing import Any

from sqlalchemy import func, select
from sqlalchemy.ext.asyncio import AsyncSession

from app.storage.models import TelemetryRow


async def add(session: AsyncSession, rows: Sequence[dict[str, Any]]) -> None:
    """Append samples."""
    if rows:
        await session.execute(TelemetryRow.__table__.insert(), list(rows))  # type: ignore[attr-defined]


async def samples(session: AsyncSession, mission_id: str, most: int) -> Sequence[Any]:
    """Return the samples of at most about ``most`` moments, evenly spread and the newest among them, oldest first."""
    mine = TelemetryRow.mission_id == mission_id
    moments = await session.scalar(select(func.count(TelemetryRow.at_s.distinct())).where(mine)) or 0
    stride = -(-moments // most)
    numbered = select(
        TelemetryRow.vehicle,
        TelemetryRow.at_s,
        TelemetryRow.depth_m,
        TelemetryRow.altitude_m,
        TelemetryRow.battery_pct,
        TelemetryRow.age_s,
        # All vehicles of a moment have its number.
        func.dense_rank().over(order_by=TelemetryRow.at_s.desc()).label("number"),
    ).where(mine)
    every = numbered.subquery()
    query = select(*(column for column in every.c if column.name != "number")).order_by(every.c.at_s, every.c.vehicle)
    if stride > 1:
        query = query.where(every.c.number % stride == 1)
    return (await session.execute(query)).all()


async def last_heard(session: AsyncSession, mission_id: str) -> dict[str, float]:
    """Return the time of each vehicle's last report, Unix seconds by the service's clock."""
    heard = func.max(TelemetryRow.at_s - TelemetryRow.age_s)
    query = select(TelemetryRow.vehicle, heard).where(TelemetryRow.mission_id == mission_id)
    found = await session.execute(query.group_by(TelemetryRow.vehicle))
    return {vehicle: at_s for vehicle, at_s in found if at_s is not None}


async def last_batteries(session: AsyncSession, mission_id: str) -> dict[str, float]:
    """Return what each vehicle told last of its battery's level, percent."""
    told = (TelemetryRow.mission_id == mission_id) & TelemetryRow.battery_pct.is_not(None)
    newest = select(func.max(TelemetryRow.id)).where(told).group_by(TelemetryRow.vehicle)
    query = select(TelemetryRow.vehicle, TelemetryRow.battery_pct).where(TelemetryRow.id.in_(newest))
    found = await session.execute(query)
    return {vehicle: level_pct for vehicle, level_pct in found if level_pct is not None}
