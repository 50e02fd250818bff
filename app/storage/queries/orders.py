"""Queries on what operators order vehicles to do."""

from collections.abc import Collection, Sequence
from datetime import datetime

from sqlalchemy import select, update
from sqlalchemy.ext.asyncio import AsyncSession

from app.storage.models import VehicleOrderRow, WaypointRow


async def newest(session: AsyncSession, mission_id: str, limit: int = 200) -> Sequence[VehicleOrderRow]:
    """Return a mission's orders, newest first."""
    query = select(VehicleOrderRow).where(VehicleOrderRow.mission_id == mission_id)
    return (await session.scalars(query.order_by(VehicleOrderRow.id.desc()).limit(limit))).all()


async def in_states(session: AsyncSession, mission_id: str, states: Collection[str]) -> Sequence[VehicleOrderRow]:
    """Return a mission's orders that are in one of some states, first to last."""
    query = select(VehicleOrderRow).where(VehicleOrderRow.mission_id == mission_id, VehicleOrderRow.state.in_(states))
    return (await session.scalars(query.order_by(VehicleOrderRow.id))).all()


async def end_all(
    session: AsyncSession,
    mission_id: str,
    vehicle: str,
    open_states: Collection[str],
    state: str,
    reason: str,
    at: datetime,
) -> None:
    """Record that a vehicle's orders that are in one of some states are over."""
    of_it = (VehicleOrderRow.mission_id == mission_id, VehicleOrderRow.vehicle == vehicle)
    await session.execute(
        update(VehicleOrderRow)
        .where(*of_it, VehicleOrderRow.state.in_(open_states))
        .values(state=state, reason=reason, changed_at=at)
    )


async def change(session: AsyncSession, order_id: int, state: str, reason: str, at: datetime) -> None:
    """Record what an order has come to."""
    values = {"state": state, "reason": reason, "changed_at": at}
    await session.execute(update(VehicleOrderRow).where(VehicleOrderRow.id == order_id).values(**values))


async def last_legs(
    session: AsyncSession, mission_id: str, vehicle: str, upto: int, limit: int
) -> list[tuple[int, float, float]]:
    """Return (number, east, north) of where a vehicle's last legs up to one ended, first to last."""
    query = (
        select(WaypointRow.step, WaypointRow.east_m, WaypointRow.north_m)
        .where(WaypointRow.mission_id == mission_id, WaypointRow.vehicle == vehicle, WaypointRow.step <= upto)
        .where(WaypointRow.status.not_in(("missed", "refused")) | (WaypointRow.step == upto))
        .order_by(WaypointRow.step.desc())
        .limit(limit)
    )
    rows = (await session.execute(query)).all()
    return [(int(number), float(east), float(north)) for number, east, north in rows[::-1]]
