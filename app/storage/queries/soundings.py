"""Queries on soundings and on the answers given to batches of them."""

import zlib
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import Select, and_, delete, func, or_, select, tuple_
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.ext.asyncio import AsyncSession

from app.storage.models import BatchRow, ImportRow, MissionRow, ReferenceRow, SoundingRow

LOG_KEY = "log-1"
"""What the keys of batches of vehicles' logs begin with."""

TAKEN_BACK = "taken-back"
"""The verdict on soundings whose log was taken back: their values stay, and whatever comes again takes their place."""

ROWS_AT_ONCE = 200

Identity = tuple[str, float, int]
"""What makes a sounding the same sounding within a mission: vehicle, vehicle's time, beam."""


IDENTITY = ("mission_id", "vehicle", "time_s", "beam")


async def insert_new(
    session: AsyncSession, rows: Sequence[dict[str, Any]], *, any_taken_back: bool = False
) -> set[Identity]:
    """Store soundings; those already there are left alone. Returns the identities that were new.

    ``any_taken_back``: the mission has soundings whose log was taken back; those that come again take their place.
    """
    if not rows:
        return set()
    insert = sqlite.insert if session.get_bind().dialect.name == "sqlite" else postgresql.insert
    row = insert(SoundingRow)
    if any_taken_back:
        # Of two with one identity in a statement PostgreSQL would refuse the second.
        rows = list({tuple(one[name] for name in IDENTITY): one for one in reversed(rows)}.values())[::-1]
        values: dict[str, Any] = {name: row.excluded[name] for name in rows[0] if name not in IDENTITY}
        taken_back = SoundingRow.verdict == TAKEN_BACK
        values = {"ruling": None, "log": None} | values
        settled = row.on_conflict_do_update(index_elements=IDENTITY, set_=values, where=taken_back)
    else:
        settled = row.on_conflict_do_nothing(index_elements=IDENTITY)
    statement = settled.returning(SoundingRow.vehicle, SoundingRow.time_s, SoundingRow.beam)
    new: set[Identity] = set()
    # Some at a time: a statement is prepared by the event loop's thread.
    for first in range(0, len(rows), ROWS_AT_ONCE):
        result = await session.execute(statement, list(rows[first : first + ROWS_AT_ONCE]))
        new.update((vehicle, time_s, beam) for vehicle, time_s, beam in result)
    return new


def accepted_query(
    mission_id: str, *, until_id: int | None = None, until_step: int | None = None
) -> Select[*tuple[Any, ...]]:
    """Return the query of accepted soundings in the order they came, up to an id or to the end of a step.

    Columns are east, north, depth, deviation (metres) and whether an operator restored the sounding.
    """
    query = (
        select(
            SoundingRow.east_m,
            SoundingRow.north_m,
            SoundingRow.depth_m,
            SoundingRow.sd_m,
            SoundingRow.ruling.is_not(None),
        )
        .where(SoundingRow.mission_id == mission_id, SoundingRow.verdict == "accepted")
        .order_by(SoundingRow.id)
    )
    if until_id is not None:
        query = query.where(SoundingRow.id <= until_id)
    return query if until_step is None else query.where(SoundingRow.step <= until_step)


def accepted_in(mission_id: str, box_m: tuple[float, float, float, float]) -> Select[*tuple[Any, ...]]:
    """Return the query of accepted soundings in a box: west, south, east and north, local metres.

    Columns are those of :func:`accepted_query`.
    """
    west, south, east, north = box_m
    return accepted_query(mission_id).where(
        SoundingRow.east_m.between(west, east), SoundingRow.north_m.between(south, north)
    )


async def vehicles_of(session: AsyncSession, mission_id: str, verdict: str | None = None) -> set[str]:
    """Return the names of those who sounded something; ``verdict``: of which that is said."""
    query = select(SoundingRow.vehicle).where(SoundingRow.mission_id == mission_id).distinct()
    return set(await session.scalars(query if verdict is None else query.where(SoundingRow.verdict == verdict)))


def track_query(mission_id: str) -> Select[*tuple[Any, ...]]:
    """Return the query of accepted soundings along the vehicles' ways.

    Columns are vehicle, the vehicle's time (s), east, north, depth and deviation (metres).
    """
    row = SoundingRow
    columns = (row.vehicle, row.time_s, row.east_m, row.north_m, row.depth_m, row.sd_m)
    return select(*columns).where(row.mission_id == mission_id, row.verdict == "accepted").order_by(row.id)


def cast_query(mission_id: str) -> Select[*tuple[Any, ...]]:
    """Return the query of what accepted soundings find their sound speed cast by.

    Columns are the vehicle's time (s), latitude and longitude of the raw footprint (degrees).
    """
    row = SoundingRow
    columns = (row.time_s, row.lat_deg, row.lon_deg)
    return select(*columns).where(row.mission_id == mission_id, row.verdict == "accepted").order_by(row.id)


async def ids_at(session: AsyncSession, mission_id: str, table: Sequence[NDArray[np.float64]]) -> list[list[int]]:
    """Return for every row (east, north, depth, ...) of a table the accepted soundings with these very values."""
    found: dict[tuple[float, float, float], list[int]] = {}
    columns = (SoundingRow.east_m, SoundingRow.north_m, SoundingRow.depth_m)
    keys = [(float(row[0]), float(row[1]), float(row[2])) for row in table]
    for first in range(0, len(keys), 500):
        query = select(SoundingRow.id, *columns).where(
            SoundingRow.mission_id == mission_id,
            SoundingRow.verdict == "accepted",
            tuple_(*columns).in_(keys[first : first + 500]),
        )
        for row in await session.execute(query):
            found.setdefault((row.east_m, row.north_m, row.depth_m), []).append(row.id)
    return [found.get(key, []) for key in keys]


async def counts(session: AsyncSession, mission_id: str) -> dict[str, int]:
    """Return the number of soundings by verdict."""
    query = (
        select(SoundingRow.verdict, func.count().label("n"))
        .where(SoundingRow.mission_id == mission_id)
        .group_by(SoundingRow.verdict)
    )
    return {row.verdict: row.n for row in await session.execute(query)}


async def refusals(session: AsyncSession, mission_id: str) -> dict[str, int]:
    """Return why soundings were rejected, and how many each."""
    query = (
        select(SoundingRow.reason, func.count().label("n"))
        .where(SoundingRow.mission_id == mission_id, SoundingRow.verdict == "rejected")
        .group_by(SoundingRow.reason)
    )
    return {row.reason: row.n for row in await session.execute(query)}


@dataclass(frozen=True)
class Extent:
    """When the soundings of one verdict were made, and the largest deviation that their positions state.

    ``position_sd_m`` is None where one of them states none.
    """

    first_time_s: float
    last_time_s: float
    position_sd_m: float | None


async def extent(session: AsyncSession, mission_id: str, verdict: str) -> Extent | None:
    """Return what soundings of a verdict span; None without any."""
    position = SoundingRow.position_sd_m
    query = select(
        func.min(SoundingRow.time_s),
        func.max(SoundingRow.time_s),
        func.max(position),
        func.count(position),
        func.count(),
    ).where(SoundingRow.mission_id == mission_id, SoundingRow.verdict == verdict)
    first_s, last_s, worst_m, stated, number = (await session.execute(query)).one()
    return Extent(first_s, last_s, worst_m if stated == number else None) if number else None


def columns_query(mission_id: str, names: Sequence[str]) -> Select[*tuple[Any, ...]]:
    """Return the query of some columns, numbers and texts, of every sounding, in the order they came."""
    columns = [getattr(SoundingRow, name) for name in names]
    return select(*columns).where(SoundingRow.mission_id == mission_id).order_by(SoundingRow.id)


def accepted_columns_query(mission_id: str, vehicle: str, names: Sequence[str]) -> Select[*tuple[Any, ...]]:
    """Return the query of some columns, numbers and texts, of a vehicle's accepted soundings, as they came."""
    row = SoundingRow
    return columns_query(mission_id, names).where(row.vehicle == vehicle, row.verdict == "accepted")


async def any_position_sd(session: AsyncSession, mission_id: str, vehicle: str) -> bool:
    """Whether any accepted sounding of a vehicle states how uncertain its position is."""
    query = accepted_columns_query(mission_id, vehicle, ["id"]).where(SoundingRow.position_sd_m.is_not(None))
    return (await session.execute(query.limit(1))).first() is not None


async def soundings_after(session: AsyncSession, mission_id: str, after: int, most: int) -> Sequence[SoundingRow]:
    """Return the next ``most`` soundings with an id above ``after``, rejected ones included, in the order they came."""
    query = select(SoundingRow).where(SoundingRow.mission_id == mission_id, SoundingRow.id > after)
    return (await session.scalars(query.order_by(SoundingRow.id).limit(most))).all()


def accepted_after(
    mission_ids: Sequence[str] | None,
    after: int,
    most: int,
    *,
    boxes: Sequence[tuple[float, float, float, float]] | None = None,
    from_s: float | None = None,
    until_s: float | None = None,
    vehicle: str | None = None,
) -> tuple[Select[*tuple[Any, ...]], Select[*tuple[Any, ...]]]:
    """Return two queries of soundings with an id above ``after``, of all missions where ``mission_ids`` is None.

    The first tells the largest id among the next ``most`` of them and how many these are, the second has those among
    them that are accepted, lie in one of the ``boxes`` (west, south, east and north, degrees) and were made between the
    two times, in their order. So what one query costs has a bound, however few of them are asked for.
    """
    row = SoundingRow
    of_missions = () if mission_ids is None else (row.mission_id.in_(mission_ids),)
    ids = select(row.id).where(row.id > after, *of_missions).order_by(row.id).limit(most).subquery()
    last = select(func.max(ids.c.id), func.count())
    conditions = [row.id > after, *of_missions, row.verdict == "accepted"]
    if boxes is not None:
        conditions.append(
            or_(
                *(
                    and_(row.lon_deg.between(west, east), row.lat_deg.between(south, north))
                    for west, south, east, north in boxes
                )
            )
        )
    conditions += [] if from_s is None else [row.time_s >= from_s]
    conditions += [] if until_s is None else [row.time_s <= until_s]
    conditions += [] if vehicle is None else [row.vehicle == vehicle]
    columns = (row.mission_id, row.vehicle, row.time_s, row.depth_m, row.sd_m, row.position_sd_m, row.beam, row.step)
    return last.select_from(ids), select(row.id, row.lon_deg, row.lat_deg, *columns).where(*conditions)


async def window(
    session: AsyncSession, queries: tuple[Select[*tuple[Any, ...]], Select[*tuple[Any, ...]]], most: int, limit: int
) -> tuple[int | None, Sequence[Any]]:
    """Return what the queries of :func:`accepted_after` find: up to ``limit`` rows, and the id that was looked up to.

    That id is None where there is nothing beyond.
    """
    last_id, number = (await session.execute(queries[0])).one()
    if not number:
        return None, ()
    query = queries[1].where(SoundingRow.id <= last_id).order_by(SoundingRow.id).limit(limit)
    return last_id if number >= most else None, (await session.execute(query)).all()


async def answer_to(session: AsyncSession, mission_id: str, key: str) -> BatchRow | None:
    """Return the answer once given to an idempotency key; waits for a transaction that is about to answer."""
    return next(iter(await answers_to(session, mission_id, {key})), None)


async def answers_to(session: AsyncSession, mission_id: str, keys: Collection[str]) -> Sequence[BatchRow]:
    """Return the answers once given to idempotency keys; waits for a transaction that is about to answer."""
    if session.get_bind().dialect.name != "sqlite":  # it has one writer at a time
        await session.execute(select(MissionRow.id).where(MissionRow.id == mission_id).with_for_update(key_share=True))
    if not keys:
        return []
    query = select(BatchRow).where(BatchRow.mission_id == mission_id, BatchRow.key.in_(keys))
    return (await session.scalars(query)).all()


async def forget_answers(session: AsyncSession, mission_id: str, before: datetime, spare: str) -> None:
    """Drop the answers to keys that came before a moment, but for keys that begin with ``spare``."""
    old = (BatchRow.mission_id == mission_id, BatchRow.created_at < before)
    await session.execute(delete(BatchRow).where(*old, BatchRow.key.not_like(f"{spare}%")))


def pack(values: NDArray[np.float64]) -> bytes:
    """Return an array's values as they are stored."""
    return zlib.compress(np.ascontiguousarray(values, dtype="<f8").tobytes(), level=1)


def unpack(stored: bytes, *shape: int) -> NDArray[np.float64]:
    """Return stored values in the given shape; -1 for one length that follows from the others."""
    return np.frombuffer(zlib.decompress(stored), dtype="<f8").astype(np.float64).reshape(shape)


async def imported_arrays(session: AsyncSession, mission_id: str) -> NDArray[np.float64]:
    """Return what was imported, in that order, shape (n, 4): east, north, depth, deviation (metres)."""
    return unpack_imported(await imported(session, mission_id))


async def imported(session: AsyncSession, mission_id: str, *, without: str = "") -> Sequence[bytes]:
    """Return the soundings of every import as they are stored, in that order; ``without`` one of them."""
    query = select(ImportRow.soundings).where(ImportRow.mission_id == mission_id, ImportRow.id != without)
    return (await session.scalars(query.order_by(ImportRow.created_at, ImportRow.id))).all()


def unpack_imported(stored: Sequence[bytes]) -> NDArray[np.float64]:
    """Return stored soundings of imports one after another, shape (n, 4)."""
    return np.concatenate([np.zeros((0, 4)), *(unpack(soundings, -1, 4) for soundings in stored)])


async def any_imported(session: AsyncSession, mission_id: str) -> bool:
    """Tell whether anything was imported."""
    return await session.scalar(select(ImportRow.id).where(ImportRow.mission_id == mission_id).limit(1)) is not None


async def reference_grid(session: AsyncSession, mission_id: str) -> NDArray[np.float64] | None:
    """Return the depths of a mission's reference grid at the map's cells, (rows, cols); None without one."""
    row = await session.get(ReferenceRow, mission_id)
    return None if row is None else unpack(row.depths, row.rows, row.cols)
