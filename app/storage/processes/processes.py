"""Queries on the processes that share a database, and on which of them has which mission."""

from collections.abc import Iterable, Sequence
from datetime import datetime

from sqlalchemy import delete, exists, func, select
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.ext.asyncio import AsyncSession

from app.storage.models import MissionOwnerRow, MissionRow, MissionVehicleRow, ProcessRow
from app.storage.processes.membership import LOCKS


async def all_processes(session: AsyncSession) -> Sequence[ProcessRow]:
    """Return every process that entered and was not found dead yet, oldest first."""
    return (await session.scalars(select(ProcessRow).order_by(ProcessRow.id))).all()


async def bury(session: AsyncSession, numbers: Iterable[int]) -> None:
    """Forget processes; their missions have no owner now."""
    await session.execute(delete(ProcessRow).where(ProcessRow.id.in_(list(numbers))))


async def is_known(session: AsyncSession, process: int) -> bool:
    """Tell whether a process entered and was not found dead; it is not buried before the transaction ends."""
    query = select(ProcessRow.id).where(ProcessRow.id == process).with_for_update(read=True, key_share=True)
    return await session.scalar(query) is not None


async def owner(session: AsyncSession, mission_id: str, *, hold: bool = False) -> int | None:
    """Return the number of the process that has a mission; ``hold``: it keeps it until the transaction ends."""
    query = select(MissionOwnerRow.process_id).where(MissionOwnerRow.mission_id == mission_id)
    # Many transactions of the owner may hold it at the same time. SQLite's writers exclude each other anyway.
    return await session.scalar(query.with_for_update(read=True) if hold else query)


async def take(session: AsyncSession, mission_id: str, process: int, at: datetime) -> None:
    """Give a mission without owner to a process; nothing happens when it has one."""
    insert = sqlite.insert if session.get_bind().dialect.name == "sqlite" else postgresql.insert
    values = {"mission_id": mission_id, "process_id": process, "since": at}
    await session.execute(insert(MissionOwnerRow).values(values).on_conflict_do_nothing())


async def release(session: AsyncSession, mission_ids: Iterable[str], process: int) -> None:
    """Give missions up; those of other processes stay theirs."""
    await session.execute(
        delete(MissionOwnerRow).where(
            MissionOwnerRow.mission_id.in_(list(mission_ids)), MissionOwnerRow.process_id == process
        )
    )


async def open_to(session: AsyncSession, states: Sequence[str], process: int) -> Sequence[str]:
    """Return the missions in any of ``states`` that no process has but perhaps this one, oldest first."""
    others = exists().where(MissionOwnerRow.mission_id == MissionRow.id, MissionOwnerRow.process_id != process)
    query = select(MissionRow.id).where(MissionRow.state.in_(states), ~others).order_by(MissionRow.created_at)
    return (await session.scalars(query)).all()


async def stand_in_line(session: AsyncSession) -> None:
    """Let one transaction after the other pass here, whichever process it is of; SQLite's writers do so anyway."""
    if session.get_bind().dialect.name == "postgresql":
        await session.execute(select(func.pg_advisory_xact_lock(LOCKS, 0)))


async def missions_with_vehicles(
    session: AsyncSession, states: Sequence[str], vehicles: Iterable[tuple[str, str]], other_than: str
) -> dict[tuple[str, str], tuple[str, str]]:
    """Return which of the vehicles (kind, name) take part in another mission in any of ``states``: its name and id."""
    wanted = set(vehicles)
    query = (
        select(MissionVehicleRow.spec, MissionVehicleRow.name, MissionRow.name, MissionRow.id)
        .join(MissionRow, MissionRow.id == MissionVehicleRow.mission_id)
        .where(
            MissionRow.state.in_(states),
            MissionRow.id != other_than,
            MissionVehicleRow.left_at.is_(None),
            MissionVehicleRow.name.in_({name for _, name in wanted}),
        )
    )
    rows = await session.execute(query)
    found = {(str(spec["kind"]), vehicle): (name, mission_id) for spec, vehicle, name, mission_id in rows}
    return {key: mission for key, mission in found.items() if key in wanted}
