"""Making sure that a database can be used before anything else is opened."""

import asyncio
import sqlite3

import structlog
from sqlalchemy import make_url
from sqlalchemy.exc import SQLAlchemyError

from app.storage import migrate

log = structlog.get_logger(__name__)


class DatabaseNotReadyError(Exception):
    """The database cannot be used as it is; ``str()`` says why and what to do."""


async def prepare_database(url: str, *, may_upgrade: bool) -> None:
    """Bring a database's tables up to date.

    Raises
    ------
    DatabaseNotReadyError
        When it cannot be reached, or is not up to date and ``may_upgrade`` is False.
    """
    try:
        await asyncio.to_thread(_try_to_open, url)
        present = await migrate.current(url)
        newest = await asyncio.to_thread(migrate.head)
        if present == newest:
            return
        if not may_upgrade:
            found = f"is at revision {present}" if present else "is empty"
            raise DatabaseNotReadyError(f"the database {found}, this version needs {newest}: run 'bathyfleet migrate'")
        await migrate.upgrade(url)
    except (OSError, SQLAlchemyError, sqlite3.Error) as error:
        reason = str(getattr(error, "orig", None) or error).partition("\n")[0]
        raise DatabaseNotReadyError(f"the database cannot be used: {reason}; check database_url") from error
    log.info("database migrated", before=present, now=newest)


def _try_to_open(url: str) -> None:
    """Raise when an SQLite file cannot be opened; its asynchronous driver would report that twice."""
    parsed = make_url(url)
    if parsed.get_backend_name() == "sqlite" and parsed.database:
        sqlite3.connect(parsed.database).close()
