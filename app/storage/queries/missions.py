"""Queries on missions, their vehicles, steps and waypoints."""

import math
from collections import Counter
from collections.abc import Collection, Sequence
from datetime import datetime
from typing import Any

from sqlalchemy import ColumnElement, Select, Subquery, func, or_, select, update
from sqlalchemy.ext.asyncio import AsyncSession
from sqlalchemy.orm import aliased, defer

from app.storage.models import EventRow, LogRow, MissionRow, MissionVehicleRow, PositionRow, StepRow, WaypointRow

ALL = select(MissionRow.id).order_by(MissionRow.created_at.desc(), MissionRow.id)
"""The ids of all missions, newest first."""


CHUNK = 500
"""At most so many ids are asked for in one query."""


async def summaries(session: AsyncSession, mission_ids: Sequence[str]) -> Sequence[tuple[str, dict[str, Any]]]:
    """Return how lists tell of those of some missions that ended and are in no memory, by id."""
    found: list[tuple[str, dict[str, Any]]] = []
    for first in range(0, len(mission_ids), CHUNK):
        among = MissionRow.id.in_(mission_ids[first : first + CHUNK])
        query = select(MissionRow.id, MissionRow.summary).where(among, MissionRow.summary.is_not(None))
        found += [(mission_id, summary) for mission_id, summary in await session.execute(query) if summary]
    return found


async def keep_summary(session: AsyncSession, mission_id: str, summary: dict[str, Any] | None) -> None:
    """Keep how lists tell of a mission that ended; None: it may change, as a process has it in memory."""
    await session.execute(update(MissionRow).where(MissionRow.id == mission_id).values(summary=summary))


async def oldest_first(session: AsyncSession, mission_id: str | None = None) -> Sequence[MissionRow]:
    """Return all missions in the order in which they were created, or only the one of an id."""
    query = select(MissionRow).order_by(MissionRow.created_at, MissionRow.id)
    return (await session.scalars(query if mission_id is None else query.where(MissionRow.id == mission_id))).all()


async def in_states(session: AsyncSession, states: Collection[str]) -> Sequence[MissionRow]:
    """Return the missions that are in one of some states, in the order in which they were created."""
    query = select(MissionRow).where(MissionRow.state.in_(states)).order_by(MissionRow.created_at, MissionRow.id)
    return (await session.scalars(query)).all()


async def followers(session: AsyncSession, mission_id: str) -> Sequence[str]:
    """Return the ids of the missions that are to begin after one, and have not, oldest first."""
    follows = MissionRow.spec["after"].as_string() == mission_id
    query = select(MissionRow.id).where(follows, MissionRow.state == "ready").order_by(MissionRow.created_at)
    return (await session.scalars(query)).all()


async def forgotten_followers(session: AsyncSession) -> Sequence[tuple[str, str]]:
    """Return missions that are to begin after one that finished, and nobody has been told why they did not.

    With the name of the one before.
    """
    before = aliased(MissionRow)
    told = select(EventRow.id).where(EventRow.mission_id == MissionRow.id, EventRow.kind == "waiting").exists()
    query = (
        select(MissionRow.id, before.name)
        .join(before, before.id == MissionRow.spec["after"].as_string())
        .where(MissionRow.state == "ready", before.state == "finished", ~told)
    )
    return [(mission_id, name) for mission_id, name in await session.execute(query)]


async def newest_named(session: AsyncSession, name: str) -> MissionRow | None:
    """Return the newest mission of this name."""
    query = select(MissionRow).where(MissionRow.name == name).order_by(MissionRow.created_at.desc()).limit(1)
    return (await session.scalars(query)).first()


async def set_state(session: AsyncSession, mission_id: str, state: str, reason: str, now: datetime) -> None:
    """Record a mission's new state."""
    await session.execute(
        update(MissionRow).where(MissionRow.id == mission_id).values(state=state, reason=reason, updated_at=now)
    )


async def add_elapsed(session: AsyncSession, mission_id: str, seconds: float, now: datetime) -> None:
    """Add running time to a mission."""
    await session.execute(
        update(MissionRow)
        .where(MissionRow.id == mission_id)
        .values(elapsed_s=MissionRow.elapsed_s + seconds, updated_at=now)
    )


async def keep_flown(session: AsyncSession, mission_id: str, flown: dict[str, dict[str, float]]) -> None:
    """Record what vehicles have flown, by name."""
    for name, figures in flown.items():
        of_it = (MissionVehicleRow.mission_id == mission_id, MissionVehicleRow.name == name)
        await session.execute(update(MissionVehicleRow).where(*of_it).values(flown=figures))


async def keep_withdrawal(session: AsyncSession, mission_id: str, name: str, withdrawal: dict[str, Any] | None) -> None:
    """Record why a vehicle does not survey any more; None: it does."""
    of_it = (MissionVehicleRow.mission_id == mission_id, MissionVehicleRow.name == name)
    await session.execute(update(MissionVehicleRow).where(*of_it).values(withdrawal=withdrawal))


async def keep_ending(session: AsyncSession, mission_id: str, ending: dict[str, Any] | None) -> None:
    """Record what a mission becomes once all its vehicles are home; None: it goes on."""
    await session.execute(update(MissionRow).where(MissionRow.id == mission_id).values(ending=ending))


async def committed_way(session: AsyncSession, mission_id: str) -> tuple[dict[str, float], Counter[str]]:
    """Return how long all legs of each vehicle are together, metres, but for the way to the end of its first one.

    Legs that were not begun do not count, and how many there are comes second.
    """
    query = (
        select(WaypointRow.vehicle, WaypointRow.east_m, WaypointRow.north_m, WaypointRow.begun)
        .where(WaypointRow.mission_id == mission_id)
        .order_by(WaypointRow.vehicle, WaypointRow.step)
    )
    way_m: dict[str, float] = {}
    before: tuple[str, float, float] | None = None
    spared: Counter[str] = Counter()
    for vehicle, east, north, begun in await session.execute(query):
        if not begun:
            spared[vehicle] += 1
            continue
        if before is not None and before[0] == vehicle:
            way_m[vehicle] = way_m.get(vehicle, 0.0) + math.hypot(east - before[1], north - before[2])
        before = (vehicle, east, north)
    return way_m, spared


async def vehicles_of(session: AsyncSession, mission_id: str) -> Sequence[MissionVehicleRow]:
    """Return every vehicle that ever took part, by slot."""
    query = select(MissionVehicleRow).where(MissionVehicleRow.mission_id == mission_id).order_by(MissionVehicleRow.slot)
    return (await session.scalars(query)).all()


async def last_step(session: AsyncSession, mission_id: str) -> StepRow | None:
    """Return the newest committed step."""
    query = select(StepRow).where(StepRow.mission_id == mission_id).order_by(StepRow.number.desc()).limit(1)
    return (await session.scalars(query)).first()


async def forget_memory(session: AsyncSession, mission_id: str, step: int) -> None:
    """Drop what planner and targets' filters remembered after a step."""
    of_step = (StepRow.mission_id == mission_id, StepRow.number == step)
    await session.execute(update(StepRow).where(*of_step).values(memory=b"", targets=None))


async def remember(session: AsyncSession, mission_id: str, step: int, memory: bytes, targets: bytes | None) -> None:
    """Replace what planner and targets' filters remember after a step."""
    of_step = (StepRow.mission_id == mission_id, StepRow.number == step)
    await session.execute(update(StepRow).where(*of_step).values(memory=memory, targets=targets))


async def unsettled_waypoints(
    session: AsyncSession, mission_id: str, settled: Collection[str]
) -> Sequence[WaypointRow]:
    """Return every vehicle's waypoints after the last one whose status is among ``settled``, first to last."""
    last = _last_settled(mission_id, settled)
    query = (
        select(WaypointRow)
        .outerjoin(last, WaypointRow.vehicle == last.c.vehicle)
        .where(WaypointRow.mission_id == mission_id, WaypointRow.step > func.coalesce(last.c.step, 0))
        .order_by(WaypointRow.step, WaypointRow.vehicle)
    )
    return (await session.scalars(query)).all()


async def settled_waypoints(session: AsyncSession, mission_id: str, settled: Collection[str]) -> Sequence[WaypointRow]:
    """Return each vehicle's last waypoint whose status is among ``settled``."""
    last = _last_settled(mission_id, settled)
    query = (
        select(WaypointRow)
        .join(last, (WaypointRow.vehicle == last.c.vehicle) & (WaypointRow.step == last.c.step))
        .where(WaypointRow.mission_id == mission_id)
    )
    return (await session.scalars(query)).all()


def _last_settled(mission_id: str, settled: Collection[str]) -> Subquery:
    return (
        select(WaypointRow.vehicle, func.max(WaypointRow.step).label("step"))
        .where(WaypointRow.mission_id == mission_id, WaypointRow.status.in_(settled))
        .group_by(WaypointRow.vehicle)
        .subquery()
    )


async def first_step_at(session: AsyncSession, mission_id: str) -> datetime | None:
    """Return when the first step was committed."""
    query = select(StepRow.committed_at).where(StepRow.mission_id == mission_id).order_by(StepRow.number).limit(1)
    return (await session.scalars(query)).first()


async def steps_after(session: AsyncSession, mission_id: str, after: int, limit: int) -> Sequence[StepRow]:
    """Return up to ``limit`` steps with a number above ``after``, without the planner's memory, first to last."""
    query = select(StepRow).where(StepRow.mission_id == mission_id, StepRow.number > after).order_by(StepRow.number)
    return (await session.scalars(query.limit(limit).options(defer(StepRow.memory)))).all()


async def waypoints_between(session: AsyncSession, mission_id: str, first: int, last: int) -> Sequence[WaypointRow]:
    """Return the waypoints of steps ``first`` to ``last``."""
    query = select(WaypointRow).where(WaypointRow.mission_id == mission_id, WaypointRow.step.between(first, last))
    return (await session.scalars(query.order_by(WaypointRow.step, WaypointRow.vehicle))).all()


async def newest_waypoints(session: AsyncSession, mission_id: str) -> Sequence[WaypointRow]:
    """Return the newest waypoint of each vehicle."""
    newest = (
        select(WaypointRow.vehicle, func.max(WaypointRow.step).label("step"))
        .where(WaypointRow.mission_id == mission_id)
        .group_by(WaypointRow.vehicle)
        .subquery()
    )
    query = (
        select(WaypointRow)
        .join(newest, (WaypointRow.vehicle == newest.c.vehicle) & (WaypointRow.step == newest.c.step))
        .where(WaypointRow.mission_id == mission_id)
        .order_by(WaypointRow.vehicle)
    )
    return (await session.scalars(query)).all()


async def set_waypoint_status(
    session: AsyncSession,
    mission_id: str,
    step: int,
    vehicle: str,
    status: str,
    reason: str,
    now: datetime,
    *,
    begun: bool = True,
) -> None:
    """Record what became of a waypoint."""
    await session.execute(
        update(WaypointRow)
        .where(WaypointRow.mission_id == mission_id, WaypointRow.step == step, WaypointRow.vehicle == vehicle)
        .values(status=status, reason=reason, begun=begun, changed_at=now)
    )


async def add_positions(session: AsyncSession, rows: Sequence[dict[str, Any]]) -> None:
    """Append points to the tracks."""
    if rows:
        await session.execute(PositionRow.__table__.insert(), list(rows))  # type: ignore[attr-defined]


def _counts(mission_id: str) -> ColumnElement[bool]:
    """Return the condition that a position is of no log that was taken back."""
    taken_back = select(LogRow.id).where(LogRow.mission_id == mission_id, LogRow.taken_back_at.is_not(None))
    return or_(PositionRow.log.is_(None), PositionRow.log.not_in(taken_back))


def positions_after(mission_id: str, after_id: int) -> Select[*tuple[Any, ...]]:
    """Return the query of places that were written after the one of this id: id, vehicle, origin, time and place."""
    return (
        select(
            PositionRow.id,
            PositionRow.vehicle,
            PositionRow.imported,
            PositionRow.time_s,
            PositionRow.lon_deg,
            PositionRow.lat_deg,
            PositionRow.depth_m,
        )
        .where(PositionRow.mission_id == mission_id, PositionRow.id > after_id, _counts(mission_id))
        .order_by(PositionRow.id)
    )


async def last_positions(session: AsyncSession, mission_id: str) -> dict[str, PositionRow]:
    """Return each vehicle's last received position; its own clock may have been reset, and logs come later."""
    newest = (
        select(func.max(PositionRow.id))
        .where(PositionRow.mission_id == mission_id, PositionRow.imported.is_(False))
        .group_by(PositionRow.vehicle)
    )
    query = select(PositionRow).where(PositionRow.id.in_(newest))
    return {row.vehicle: row for row in await session.scalars(query)}


async def track_points(session: AsyncSession, mission_id: str) -> dict[str, list[tuple[float, float, float, float]]]:
    """Return each vehicle's places as (longitude, latitude, depth, time), in the order of arrival."""
    query = (
        select(PositionRow.vehicle, PositionRow.lon_deg, PositionRow.lat_deg, PositionRow.depth_m, PositionRow.time_s)
        .where(PositionRow.mission_id == mission_id, _counts(mission_id))
        .order_by(PositionRow.vehicle, PositionRow.id)
    )
    result: dict[str, list[tuple[float, float, float, float]]] = {}
    for vehicle, lon, lat, depth, time in await session.execute(query):
        result.setdefault(vehicle, []).append((lon, lat, depth, time))
    return result
