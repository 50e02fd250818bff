"""Making sure that a database can be used before anything else is opened."""

import asyncio
import sqlite3
from collections.abc import Iterable
from contextlib import closing
from pathlib import Path

import structlog
from sqlalchemy import make_url
from sqlalchemy.exc import SQLAlchemyError

from app.storage import private
from app.storage.database import BUSY_TIMEOUT_MS
from app.storage.upkeep import migrate

FIRST_TOKEN_FILE = "operator.token"  # noqa: S105 - the file's name

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
        if present is None:
            await check_that_empty(url)
        elif not await asyncio.to_thread(migrate.is_known, present):
            raise of_another_version(url, present, newest)
        if not may_upgrade:
            found = f"is at revision {present}" if present else "is empty"
            raise DatabaseNotReadyError(f"the database {found}, this version needs {newest}: run 'bathyfleet migrate'")
        await migrate.upgrade(url)
    except (OSError, SQLAlchemyError, sqlite3.Error) as error:
        reason = str(getattr(error, "orig", None) or error).partition("\n")[0]
        raise DatabaseNotReadyError(f"the database cannot be used: {reason}; check database_url") from error
    log.info("database migrated", before=present, now=newest)


def of_another_version(url: str, present: str, newest: str) -> DatabaseNotReadyError:
    """Return the error that a database is at a revision that this version does not know."""
    return DatabaseNotReadyError(
        f"the database {name_of(url)} is at revision {present}, which this version does not know (its newest is "
        f"{newest}): a newer version wrote it, or another program. Install the version that wrote it, let it go back "
        f"by 'bathyfleet migrate --down-to {newest}' there, or name another database with database_url"
    )


async def is_up_to_date(url: str) -> bool:
    """Tell whether a database has the tables of this version."""
    return await migrate.current(url) == await asyncio.to_thread(migrate.head)


def _try_to_open(url: str) -> None:
    """Raise when an SQLite file cannot be opened; its asynchronous driver would report that twice."""
    file = file_of(url)
    if file is None:
        return
    if not file.parent.is_dir():
        reason = f"there is no folder {file.parent}"
        raise DatabaseNotReadyError(f"the database cannot be used: {reason}; check database_url")
    _look_for_restores(file)
    private.create(file)
    keep_for_owner([*private.family(file), file.parent / FIRST_TOKEN_FILE])
    with closing(sqlite3.connect(file, timeout=BUSY_TIMEOUT_MS / 1000)) as connection:
        # Not before something is read is it looked at whether it is a database.
        connection.execute("SELECT count(*) FROM sqlite_master").fetchone()


def _look_for_restores(file: Path) -> None:
    """Say that a restore was killed before its backup took the database's place.

    Raises DatabaseNotReadyError where there is no database, instead of an empty one that would take its place.
    """
    part = file.with_name(f"{file.name}.part")
    if not part.exists():
        return
    if not file.exists():
        raise DatabaseNotReadyError(
            f"there is no database {file}, and a restore of it did not end ({part} is left): run 'bathyfleet restore' "
            f"again, or remove {part.name} to begin with an empty one"
        )
    second = [path for path in private.family(file) if path.name.startswith(f"{file.name}.before-")]
    log.warning(
        "a restore did not end: the database is the one from before; restore again, or remove what is left",
        left=[str(path) for path in (part, *second) if path == part or path.samefile(file)],
    )


def folder_of(url: str) -> Path:
    """Return the folder of an SQLite database, where the first start leaves its token; the working one for others."""
    file = file_of(url)
    return Path() if file is None else file.parent


def file_of(url: str) -> Path | None:
    """Return the file of an SQLite database; None for other ones."""
    parsed = make_url(url)
    is_file = parsed.get_backend_name() == "sqlite" and parsed.database and parsed.database != ":memory:"
    return Path(parsed.database) if is_file and parsed.database else None


def keep_for_owner(files: Iterable[Path]) -> None:
    """Take other users' rights from files that were made by an earlier version, or by hand, and say so."""
    files = list(files)
    for file, mode in private.mend(files).items():
        log.warning(
            "file permissions mended: other users of this machine could have read or locked it",
            file=str(file),
            before=mode,
            now=f"{file.stat().st_mode & 0o777:o}",
        )
    for file in private.still_open(files):
        log.warning("file permissions are another user's to mend: others may read or lock it", file=str(file))
    for folder in {file.parent for file in files if private.is_public(file.parent)}:
        log.warning("every user of this machine may put files beside the database", folder=str(folder.resolve()))


async def check_that_empty(url: str) -> None:
    """Raise DatabaseNotReadyError when a database without a revision holds other tables: it is another program's."""
    tables = await migrate.tables(url)
    # Another process may have made them since the revision was read: whole, with it, or not at all.
    if tables and await migrate.current(url) is None:
        some = ", ".join(tables[:3]) + (", …" if len(tables) > 3 else "")
        raise DatabaseNotReadyError(
            f"the database {name_of(url)} is not one of bathyfleet: it holds other tables ({some}); "
            "nothing was changed. "
            "Name another file or database with database_url"
        )


def name_of(url: str) -> str:
    """Return what a person calls a database: its file, or its name on its server."""
    file = file_of(url)
    return str(file.resolve()) if file is not None else make_url(url).database or url
