"""Running the migrations from code, on whatever database a URL names."""

from collections.abc import Callable
from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection, func, inspect, select
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from app.storage.database import Database, make_engine
from app.storage.models import AuditRow, ProcessRow
from app.storage.processes.membership import LOCKS, alive_beside
from app.storage.queries import audit

# The migrations lie beside the package in a checkout as in an installation.
MIGRATIONS = Path(__file__).resolve().parents[3] / "migrations"


_TURN = (LOCKS + 1, 0)
"""The advisory lock of who migrates a PostgreSQL database; no process has it."""


def _config(connection: Connection | None = None) -> Config:
    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS).replace("%", "%%"))
    config.attributes["connection"] = connection
    return config


def head() -> str:
    """Return the newest revision known to this version of the program."""
    revision = ScriptDirectory.from_config(_config()).get_current_head()
    if revision is None:
        raise RuntimeError(f"no migrations in {MIGRATIONS}: the installation is incomplete")
    return revision


def is_known(revision: str) -> bool:
    """Tell whether this version of the program knows a revision."""
    return revision in {script.revision for script in ScriptDirectory.from_config(_config()).walk_revisions()}


async def tables(url: str) -> list[str]:
    """Return the names of all tables in a database."""
    engine = make_engine(url)
    try:
        async with engine.connect() as connection:
            return await connection.run_sync(lambda sync: sorted(inspect(sync).get_table_names()))
    finally:
        await engine.dispose()


async def current(url: str) -> str | None:
    """Return the revision that a database is at; None when it is empty."""
    engine = make_engine(url)
    try:
        async with engine.connect() as connection:
            return await connection.run_sync(lambda sync: MigrationContext.configure(sync).get_current_revision())
    finally:
        await engine.dispose()


async def is_in_use(url: str) -> bool:
    """Tell whether a process of the service has a database."""
    if ProcessRow.__tablename__ not in await tables(url):
        return False  # of a version that kept no list of them
    database = Database(url)
    try:
        async with database.reading() as session:
            numbers = (await session.scalars(select(ProcessRow.id))).all()
            return bool(await alive_beside(session, url, numbers))
    finally:
        await database.close()


async def upgrade(url: str, revision: str = "head") -> None:
    """Bring a database up to ``revision``. Waits for another process that is doing the same."""
    await _run(url, lambda config: command.upgrade(config, revision))


async def downgrade(url: str, revision: str, noted: audit.Command | None = None) -> None:
    """Take a database back to ``revision`` (``base``: empty).

    ``noted`` is written into the audit log before, where there is one: together with the rest, or neither.
    """

    def down(config: Config) -> None:
        connection = config.attributes["connection"]
        if noted is not None and inspect(connection).has_table(AuditRow.__tablename__):
            with Session(connection) as session:
                audit.add(session, noted)
                session.flush()
        command.downgrade(config, revision)

    await _run(url, down)


async def _run(url: str, action: Callable[[Config], None]) -> None:
    engine = make_engine(url)
    try:
        async with engine.connect() as connection:
            await connection.execution_options(bathyfleet_writes=True)
            if engine.dialect.name == "sqlite":
                # Some changes of a table replace it: when the old one is dropped, what refers to it must not go along.
                raw = (await connection.get_raw_connection()).driver_connection
                assert raw is not None  # noqa: S101 - a connection that was opened has one
                await raw.execute("PRAGMA foreign_keys=OFF")
            async with connection.begin():
                if engine.dialect.name == "postgresql":
                    # Before the revision is read; SQLite's writers stand in line anyway.
                    await connection.execute(select(func.pg_advisory_xact_lock(*_TURN)))
                await connection.run_sync(lambda sync: action(_config(sync)))
                if engine.dialect.name == "sqlite":
                    await connection.run_sync(_check_references)
    finally:
        await engine.dispose()


def _check_references(connection: Connection) -> None:
    orphans = connection.exec_driver_sql("PRAGMA foreign_key_check").fetchmany(3)
    if orphans:
        raise IntegrityError("PRAGMA foreign_key_check", None, ValueError(f"rows that belong to nothing: {orphans}"))
