"""Room in the database: missions that ended long ago go, and the disk gets its space back."""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from sqlalchemy import delete, func, select, text
from sqlalchemy.exc import OperationalError

from app.storage.concurrency.own_thread import on_own_thread
from app.storage.database import Database, make_engine
from app.storage.models import MissionRow, SoundingRow
from app.storage.ping_files import PingFiles
from app.storage.queries.pings import file_names

ENDED = ("finished", "aborted", "failed")


@dataclass(frozen=True)
class Ended:
    """A mission that is over."""

    id: str
    name: str
    ended: datetime
    soundings: int


async def ended_before(database: Database, days: float) -> list[Ended]:
    """Return the missions that ended more than ``days`` ago, oldest first. Never one that can go on."""
    soundings = (
        select(func.count()).select_from(SoundingRow).where(SoundingRow.mission_id == MissionRow.id).scalar_subquery()
    )
    query = (
        select(MissionRow.id, MissionRow.name, MissionRow.updated_at, soundings)
        .where(MissionRow.state.in_(ENDED), MissionRow.updated_at < _moment(days))
        .order_by(MissionRow.updated_at, MissionRow.id)
    )
    async with database.reading() as session:
        return [Ended(*row) for row in await session.execute(query)]


async def remove(database: Database, mission_id: str, days: float, files: PingFiles | None = None) -> bool:
    """Remove a mission with all that belongs to it; False when it did not end long enough ago, after all.

    ``files`` are where its pings are; None: in the usual place.
    """
    files = files or PingFiles.beside(database.url)
    condition = (MissionRow.id == mission_id, MissionRow.state.in_(ENDED), MissionRow.updated_at < _moment(days))
    async with database.writing() as session:
        names = await file_names(session, mission_id)
        removed = (await session.scalars(delete(MissionRow).where(*condition).returning(MissionRow.id))).first()
    if removed is not None and names:
        await on_own_thread(files.remove, mission_id, names)
    return removed is not None


async def finish_removing(database: Database, files: PingFiles) -> None:
    """Remove the files of missions that were removed when a process was killed; never those of one that is there."""
    for mission_id in await on_own_thread(files.condemned):
        async with database.reading() as session:
            there = await session.scalar(select(MissionRow.id).where(MissionRow.id == mission_id))
        await on_own_thread(files.finish_removing if there is None else files.spare, mission_id)


async def unlisted_files(database: Database, files: PingFiles) -> list[str]:
    """Return the files of pings that no mission of this database has: another database's, or left by a kill."""
    found = await on_own_thread(files.names)
    async with database.reading() as session:
        listed = set(await file_names(session))
    return [name for name in found if name not in listed]


async def give_space_back(url: str) -> str:
    """Let the file shrink; returns what the user should know about it."""
    engine = make_engine(url)
    try:
        sqlite = engine.dialect.name == "sqlite"
        # VACUUM cannot stand in a transaction, not even in the one that begins by itself.
        async with engine.connect() as connection:
            if not sqlite:
                await connection.execution_options(isolation_level="AUTOCOMMIT")
                await connection.execute(text("VACUUM"))
                return "PostgreSQL uses their space again; VACUUM FULL would give it back to the disk"
            raw = (await connection.get_raw_connection()).driver_connection
            assert raw is not None  # noqa: S101 - a connection that was opened has one
            before = await _bytes(raw)
            await raw.execute("VACUUM")
            await raw.execute("PRAGMA wal_checkpoint(TRUNCATE)")
            return f"the file has {before - await _bytes(raw)} bytes less"
    except OperationalError as error:
        return f"their space is used again but not given back to the disk: {error.orig}"
    finally:
        await engine.dispose()


async def _bytes(raw: object) -> int:
    execute = raw.execute  # type: ignore[attr-defined]
    pages = await (await execute("PRAGMA page_count")).fetchone()
    size = await (await execute("PRAGMA page_size")).fetchone()
    return int(pages[0]) * int(size[0])


def _moment(days: float) -> datetime:
    return datetime.now(UTC) - timedelta(days=days)
