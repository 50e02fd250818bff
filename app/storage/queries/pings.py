"""Queries on the pings of swath sonars: blocks in the database, and the files that blocks were moved to."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import ColumnElement, delete, func, insert, or_, select, true
from sqlalchemy.ext.asyncio import AsyncSession
from sqlalchemy.orm import defer

from app.storage.models import BeamEditRow, PingBlockRow, PingChunkRow


@dataclass(frozen=True)
class Totals:
    """Pings of a vehicle: accepted ones with their beams, and refused ones."""

    pings: int = 0
    beams: int = 0
    rejected: int = 0

    def __add__(self, more: "Totals") -> "Totals":
        return Totals(self.pings + more.pings, self.beams + more.beams, self.rejected + more.rejected)


@dataclass(frozen=True)
class WaitingPings(Totals):
    """Pings of a vehicle that are in no file yet."""

    blocks: int = 0
    first_time_s: float = 0.0
    last_time_s: float = 0.0


async def add_blocks(session: AsyncSession, rows: Sequence[dict[str, Any]]) -> None:
    """Store blocks in their order."""
    if rows:
        await session.execute(insert(PingBlockRow), list(rows))


async def beam_edits(session: AsyncSession, mission_id: str) -> Sequence[BeamEditRow]:
    """Return what operators said of beams, in the order in which they said it."""
    query = select(BeamEditRow).where(BeamEditRow.mission_id == mission_id).order_by(BeamEditRow.id)
    return (await session.scalars(query)).all()


def _not_of(table: type[PingBlockRow] | type[PingChunkRow], without: Collection[int]) -> ColumnElement[bool]:
    """Return the condition that no log of these numbers brought the pings."""
    return or_(table.log.is_(None), table.log.not_in(without)) if without else true()


async def known_times(
    session: AsyncSession,
    mission_id: str,
    vehicle: str,
    times_s: NDArray[np.float64],
    *,
    without: Collection[int] = (),
) -> set[float]:
    """Return those of the times at which a ping of the vehicle is stored already, by no log ``without`` which it is.

    Only blocks and files that may have one are looked at: of pings in the order they were made none, or the last.
    """
    found: set[float] = set()
    for table in (PingBlockRow, PingChunkRow):
        query = select(table.times).where(
            table.mission_id == mission_id,
            table.vehicle == vehicle,
            table.last_time_s >= float(times_s.min()),
            table.first_time_s <= float(times_s.max()),
            _not_of(table, without),
        )
        for stored in await session.scalars(query):
            found.update(np.intersect1d(np.frombuffer(stored, "<f8"), times_s).tolist())
    return found


async def newest_times(session: AsyncSession, mission_id: str) -> dict[str, float]:
    """Return by vehicle the latest time of a ping that is stored."""
    newest: dict[str, float] = {}
    for table in (PingBlockRow, PingChunkRow):
        query = select(table.vehicle, func.max(table.last_time_s)).where(table.mission_id == mission_id)
        for vehicle, time_s in await session.execute(query.group_by(table.vehicle)):
            newest[vehicle] = max(time_s, newest.get(vehicle, time_s))
    return newest


async def period(
    session: AsyncSession, mission_id: str, *, without: Collection[int] = ()
) -> tuple[float, float] | None:
    """Return the times of a mission's first and last ping, ``without`` those of some logs; None without any."""
    ends: list[float] = []
    for table in (PingBlockRow, PingChunkRow):
        query = select(func.min(table.first_time_s), func.max(table.last_time_s))
        of_mission = (table.mission_id == mission_id, _not_of(table, without))
        first_s, last_s = (await session.execute(query.where(*of_mission))).one()
        ends += [] if first_s is None else [first_s, last_s]
    return (min(ends), max(ends)) if ends else None


async def waiting(session: AsyncSession, mission_id: str, *, without: Collection[int] = ()) -> dict[str, WaitingPings]:
    """Return by vehicle what is in no file yet, ``without`` what some logs brought."""
    table = PingBlockRow
    query = select(
        table.vehicle,
        func.sum(table.pings),
        func.sum(table.beams),
        func.sum(table.rejected),
        func.count(),
        func.min(table.first_time_s),
        func.max(table.last_time_s),
    )
    of_mission = (table.mission_id == mission_id, _not_of(table, without))
    found = await session.execute(query.where(*of_mission).group_by(table.vehicle))
    return {
        vehicle: WaitingPings(int(pings), int(beams), int(rejected), blocks, first_s, last_s)
        for vehicle, pings, beams, rejected, blocks, first_s, last_s in found
    }


async def totals(session: AsyncSession, mission_id: str, *, without: Collection[int] = ()) -> Totals:
    """Return how many pings of a mission are stored, ``without`` what some logs brought."""
    found = Totals()
    for table in (PingBlockRow, PingChunkRow):
        sums = select(func.sum(table.pings), func.sum(table.beams), func.sum(table.rejected))
        row = (await session.execute(sums.where(table.mission_id == mission_id, _not_of(table, without)))).one()
        found += Totals(*(int(number or 0) for number in row))
    return found


async def newest_block(session: AsyncSession, mission_id: str) -> int:
    """Return the id of the block that was stored last; 0 without any."""
    newest = select(func.max(PingBlockRow.id)).where(PingBlockRow.mission_id == mission_id)
    moved = select(func.max(PingChunkRow.last_block)).where(PingChunkRow.mission_id == mission_id)
    return max((await session.scalar(newest)) or 0, (await session.scalar(moved)) or 0)


async def oldest_blocks(session: AsyncSession, mission_id: str, vehicle: str, pings: int) -> Sequence[PingBlockRow]:
    """Return a vehicle's oldest blocks, with so many pings together if there are so many; of one log, or of none."""
    table = PingBlockRow
    of_vehicle = (table.mission_id == mission_id, table.vehicle == vehicle)
    sizes = select(table.id, table.pings + table.rejected, table.log).where(*of_vehicle).order_by(table.id)
    last, gathered, of_log = 0, 0, None
    for block, size, log in await session.execute(sizes.limit(pings)):
        if gathered and log != of_log:
            break
        last, gathered, of_log = block, gathered + size, log
        if gathered >= pings:
            break
    return (await session.scalars(select(table).where(*of_vehicle, table.id <= last).order_by(table.id))).all()


async def blocks_after(
    session: AsyncSession, mission_id: str, after: int, until: int, limit: int
) -> Sequence[PingBlockRow]:
    """Return blocks with ids above ``after``, up to ``until``, in their order."""
    table = PingBlockRow
    query = select(table).where(table.mission_id == mission_id, table.id > after, table.id <= until)
    return (await session.scalars(query.order_by(table.id).limit(limit))).all()


async def chunks(session: AsyncSession, mission_id: str) -> Sequence[PingChunkRow]:
    """Return what is known of a mission's files, by their first blocks."""
    query = select(PingChunkRow).where(PingChunkRow.mission_id == mission_id).order_by(PingChunkRow.first_block)
    return (await session.scalars(query.options(defer(PingChunkRow.times, raiseload=True)))).all()


async def file_names(session: AsyncSession, mission_id: str | None = None) -> Sequence[str]:
    """Return the names of a mission's files, or of all."""
    query = select(PingChunkRow.name).order_by(PingChunkRow.id)
    return (
        await session.scalars(query if mission_id is None else query.where(PingChunkRow.mission_id == mission_id))
    ).all()


async def chunk(session: AsyncSession, mission_id: str, number: int) -> PingChunkRow | None:
    """Return what is known of one of a mission's files."""
    found = await session.get(PingChunkRow, number, options=[defer(PingChunkRow.times, raiseload=True)])
    return found if found is not None and found.mission_id == mission_id else None


async def move_to_chunk(session: AsyncSession, blocks: int, row: PingChunkRow) -> bool:
    """Put a file in the place of blocks. False when they are not as many any more: then nothing must be committed."""
    table = PingBlockRow
    gone = delete(table).where(
        table.mission_id == row.mission_id,
        table.vehicle == row.vehicle,
        table.id >= row.first_block,
        table.id <= row.last_block,
    )
    found = await session.execute(gone.returning(table.id))
    session.add(row)
    return len(found.all()) == blocks
