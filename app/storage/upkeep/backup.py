"""Copies of a database while others write to it, checked, and put back in its place."""

import dataclasses
import os
import shutil
import sqlite3
from contextlib import closing
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from sqlalchemy import URL, make_url

from app.storage import private
from app.storage.ping_files import PingFileError, PingFiles, digest_in
from app.storage.upkeep import migrate, postgres_archive
from app.storage.upkeep.postgres_archive import BackupError as BackupError

SQLITE_MAGIC = b"SQLite format 3\0"
ARCHIVE_MAGIC = b"PGDMP"


@dataclass(frozen=True)
class Contents:
    """What a backup holds: its schema's revision and the rows of every table; both empty for pg_dump's archives.

    ``ping_files`` is how many files of pings belong to it, ``ping_files_elsewhere`` how many of these are not beside it
    but only where the database has its own.
    """

    size_bytes: int
    revision: str
    rows: dict[str, int]
    ping_files: int = 0
    ping_files_elsewhere: int = 0


def files_beside(backup: Path) -> PingFiles:
    """Return the files of pings that belong to a backup."""
    return PingFiles(str(backup.with_name(f"{backup.name}-pings").resolve()))


def back_up(url: str, target: Path, pings: PingFiles | None = None) -> tuple[Path, Contents]:
    """Copy the database to a file, or into a folder under a name with the time; returns the file and what it holds.

    SQLite's is one consistent state, however much is written meanwhile. The file appears under its name only when it
    was checked and is on the disk; only its owner may read it. Files of pings go into a folder beside it, which has its
    name before, when all of them are there. Nothing that was there is overwritten or removed.

    Parameters
    ----------
    pings
        Where files of pings are; None: in the usual place.

    Raises
    ------
    BackupError
    """
    parsed = make_url(url)
    suffix = "db" if parsed.get_backend_name() == "sqlite" else "dump"
    if target.is_dir() or not target.suffix:
        target /= f"bathyfleet-{datetime.now(UTC):%Y%m%dT%H%M%SZ}.{suffix}"
    copies = Path(files_beside(target).url)
    for place in (target, copies):
        if place.exists():
            raise BackupError(f"{place} exists", "Name another file: backups are not overwritten")
    part, parts = target.with_name(f"{target.name}.part"), copies.with_name(f"{copies.name}.part")
    made = parts
    try:
        private.make_folder(target.parent)
        shutil.rmtree(parts, ignore_errors=True)  # of a backup to this file that was killed
        os.close(os.open(part, os.O_CREAT | os.O_TRUNC | os.O_WRONLY, 0o600))
        if suffix == "db":
            expected = _copy_sqlite(parsed, part)
            contents = _database_of(part)
            if contents.rows != expected:
                raise BackupError(f"the copy has other rows than the database: {contents.rows}, not {expected}")
        else:
            postgres_archive.dump(parsed, part)
            contents = _database_of(part)
        # Whatever is in the copy has had its file before.
        copied = (pings or PingFiles.beside(url)).copy_to(PingFiles(str(parts)), _ping_files(part))
        contents = dataclasses.replace(contents, ping_files=copied)
        _to_disk(part)
        if copied:
            made = parts.rename(copies)
        part.rename(target)
        _to_disk(target)
    except PingFileError as error:
        raise BackupError(str(error), "Bring it back from an older backup, or set pings_url to where it is") from None
    except (OSError, sqlite3.Error) as error:
        raise BackupError(f"{target} cannot be written: {error}", "Is there room on that disk?") from None
    finally:
        if not target.exists():
            shutil.rmtree(made, ignore_errors=True)
        for left in (part.with_name(part.name + suffix) for suffix in ("", "-journal", "-wal", "-shm")):
            if left.exists():
                left.unlink()
    return target, contents


def contents_of(file: Path, pings: PingFiles | None = None) -> Contents:
    """Check a backup from end to end, with each file of pings that it refers to; returns what it holds.

    Those that are not beside it are looked for among ``pings``, where the database has its own.

    Raises
    ------
    BackupError
        When it or a file is damaged, or a file is in neither place.
    """
    contents, beside, names = _database_of(file), files_beside(file), _ping_files(file)
    there = set(beside.names())
    elsewhere = [name for name in names if name not in there]
    try:
        for name in there.intersection(names):
            beside.read(name, digest_in(name))
    except PingFileError as error:
        raise BackupError(str(error), "Use an older backup") from None
    for name in elsewhere:
        try:
            (pings or beside).read(name, digest_in(name))
        except PingFileError as error:
            raise BackupError(
                f"{len(elsewhere)} of {len(names)} files of pings are not in {beside.folder}, where they belong: "
                f"{error}",
                f"Copy the folder of pings_url to {beside.folder} from where the database was, or use an older backup",
            ) from None
    return dataclasses.replace(contents, ping_files=len(names), ping_files_elsewhere=len(elsewhere))


def _database_of(file: Path) -> Contents:
    """Check a backup without the files beside it. Raises BackupError."""
    with file.open("rb") as opened:
        begin = opened.read(len(SQLITE_MAGIC))
    if begin.startswith(ARCHIVE_MAGIC):
        postgres_archive.check(file)
        return Contents(file.stat().st_size, "", {})
    if begin != SQLITE_MAGIC:
        raise BackupError(f"{file} is neither an SQLite database nor an archive of pg_dump")
    try:
        # Opened as something that does not change, so that nothing is left beside it.
        with closing(sqlite3.connect(f"{file.resolve().as_uri()}?mode=ro&immutable=1", uri=True)) as connection:
            faults = [row[0] for row in connection.execute("PRAGMA integrity_check(5)") if row[0] != "ok"]
            orphans = connection.execute("PRAGMA foreign_key_check").fetchmany(5)
            faults += [f"{table} row {row} belongs to no {parent}" for table, row, parent, _ in orphans]
            if faults:
                raise BackupError(f"{file} is damaged: {'; '.join(faults)}", "Use an older backup")
            rows = _count(connection)
            if "alembic_version" not in rows:
                raise BackupError(f"{file} is an SQLite database, but not one of bathyfleet")
            (revision,) = connection.execute("SELECT version_num FROM alembic_version").fetchone() or ("",)
    except sqlite3.Error as error:
        raise BackupError(f"{file} is damaged: {error}", "Use an older backup") from None
    return Contents(file.stat().st_size, revision, rows)


def _ping_files(file: Path) -> list[str]:
    """Return the names of the files of pings that a backup refers to, one that nobody has open. Raises BackupError."""
    with file.open("rb") as opened:
        if opened.read(len(ARCHIVE_MAGIC)) == ARCHIVE_MAGIC:
            return postgres_archive.ping_files(file)
    with closing(sqlite3.connect(f"{file.resolve().as_uri()}?mode=ro&immutable=1", uri=True)) as connection:
        if not connection.execute("SELECT 1 FROM sqlite_master WHERE name = 'ping_chunks'").fetchone():
            return []  # of a version that had none
        return [name for (name,) in connection.execute("SELECT name FROM ping_chunks ORDER BY id")]


def restore_to(url: str, file: Path, *, replace: bool, pings: PingFiles | None = None) -> tuple[Contents, Path | None]:
    """Put a checked backup in the database's place; returns what it holds, and where what was there before is now.

    ``pings`` are the files of pings, those of the backup are added there; None: in the usual place. What is there
    stays: the database that goes aside refers to it, and so may others.

    Raises
    ------
    BackupError
        When the backup is damaged, of another kind or of a newer version, lacks files of pings that are not there
        either, or there is a database already and ``replace`` is False, or somebody has it open.
    """
    parsed = make_url(url)
    files = pings or PingFiles.beside(url)
    contents = contents_of(file, files)
    revision = contents.revision if contents.rows else postgres_archive.revision(file)
    if not revision:
        raise BackupError(f"{file} holds no database of bathyfleet")
    if not migrate.is_known(revision):
        raise BackupError(
            f"{file} is at revision {revision}, which this version does not know (its newest is {migrate.head()})",
            "Restore it with the version that wrote it; nothing was changed",
        )
    if parsed.get_backend_name() != "sqlite":
        if contents.revision:
            raise BackupError(f"{file} is an SQLite database and cannot be restored to PostgreSQL")
        if postgres_archive.is_in_use(parsed):
            raise BackupError(f"the database {parsed.database} is in use", "Stop the service first")
        _add_ping_files(files, file)
        postgres_archive.put_back(parsed, file, replace=replace)
        return contents, None
    if not contents.revision:
        raise BackupError(f"{file} is an archive of pg_dump: name a PostgreSQL database with --database")
    return contents, _put_file_back(_path(parsed), file, files, replace=replace)


def _put_file_back(path: Path, file: Path, files: PingFiles, *, replace: bool) -> Path | None:
    """Put SQLite's file in its place; returns where what was there is now.

    The old one keeps its name until the new one takes it, whole and with all its files of pings: whatever ends this,
    there is a database and nothing of it is missing.
    """
    if path.exists() and not replace:
        raise BackupError(f"{path} exists", "--replace moves it aside")
    _check_owner(path)
    private.make_folder(path.parent)
    part = path.with_name(f"{path.name}.part")
    aside = path.with_name(f"{path.name}.before-{datetime.now(UTC):%Y%m%dT%H%M%S.%fZ}")
    there = path.exists()
    if aside.exists():
        raise BackupError(f"{aside} exists", "Try again: that name has the time in it")
    try:
        if there:
            _close_for_good(path)
        _add_ping_files(files, file)
        with file.open("rb") as source, private.open_new(part, "wb") as copy:
            shutil.copyfileobj(source, copy)
        _to_disk(part)
        if there:
            _close_for_good(path)  # once more: copying may have taken long
            _keep(path, aside)
        _move_journals(path, aside)
        part.replace(path)
        _to_disk(path)
    except OSError as error:
        raise BackupError(f"{path} cannot be written: {error.strerror}", "Is there room on that disk?") from None
    finally:
        if part.exists():  # it did not take its place
            part.unlink()
            _move_journals(aside, path)
            if there:
                aside.unlink(missing_ok=True)
    private.mend(private.family(aside))
    return aside if there else None


def _check_owner(path: Path) -> None:
    """Raise BackupError where root would leave a database that the user whose place it is may not open."""
    there = next(one for one in (path, *path.absolute().parents) if one.exists())
    owner = there.stat().st_uid
    if os.geteuid() == 0 and owner != 0:
        raise BackupError(
            f"{there} belongs to user {owner}, who could not use what root puts there", "Restore it as that user"
        )


def _keep(path: Path, aside: Path) -> None:
    """Give a file a second name; a copy has it where the file system knows one name for a file only."""
    try:
        aside.hardlink_to(path)
    except OSError:
        with path.open("rb") as source:
            private.write(aside, iter(lambda: source.read(1 << 20), b""))
        _to_disk(aside)


def _move_journals(path: Path, new: Path) -> None:
    """Let the journals of a damaged or lost database go with it: SQLite would write them into another one."""
    for suffix in ("-wal", "-shm", "-journal"):
        journal = path.with_name(path.name + suffix)
        if journal.exists():
            journal.rename(new.with_name(new.name + suffix))


def _add_ping_files(files: PingFiles, backup: Path) -> None:
    """Put a backup's files of pings in their place, before the database that refers to them is put in its own."""
    names, beside = _ping_files(backup), files_beside(backup)
    beside.copy_to(files, set(beside.names()).intersection(names))
    for mission_id in {name.partition("/")[0] for name in names}:
        files.spare(mission_id)  # its removal had not come to an end


def _copy_sqlite(url: URL, target: Path) -> dict[str, int]:
    """Copy what one reading transaction sees; returns the rows of every table in it."""
    path = _path(url)
    if not path.is_file():
        raise BackupError(f"there is no database {path}", "Name it with --database")
    with closing(sqlite3.connect(path, timeout=30)) as source, closing(sqlite3.connect(target)) as copy:
        source.isolation_level = None
        source.execute("BEGIN")
        rows = _count(source)
        source.backup(copy)
        source.execute("ROLLBACK")
        if "processes" in rows:
            # By the secret of a process that lives its holder could speak in anybody's name.
            copy.execute("PRAGMA secure_delete=ON")
            copy.execute("UPDATE processes SET secret = '', certificate = NULL")
            copy.commit()
        # One file, whole in itself: no journal has to go with it.
        copy.execute("PRAGMA journal_mode=DELETE")
    return rows


def _count(connection: sqlite3.Connection) -> dict[str, int]:
    names = "SELECT name FROM sqlite_master WHERE type = 'table' AND name NOT LIKE 'sqlite_%' ORDER BY name"
    tables = [name for (name,) in connection.execute(names)]
    counted = {}
    for table in tables:
        quoted = table.replace('"', '""')
        ((counted[table],),) = connection.execute(f'SELECT count(*) FROM "{quoted}"')  # noqa: S608 - the names are its own
    return counted


def _close_for_good(path: Path) -> None:
    """Bring what stands in the journals into the file and remove them. Raises BackupError when somebody has it open."""
    try:
        with closing(sqlite3.connect(path, timeout=1)) as connection:
            connection.execute("PRAGMA locking_mode=EXCLUSIVE")
            mode = connection.execute("PRAGMA journal_mode=DELETE").fetchone()[0]
            connection.execute("BEGIN EXCLUSIVE")
            connection.execute("COMMIT")
        if mode != "delete":
            raise BackupError(f"{path} is in use", "Stop the service first")
    except sqlite3.OperationalError:
        raise BackupError(f"{path} is in use", "Stop the service first") from None
    except sqlite3.DatabaseError:
        pass  # damaged, which is why it is replaced; its journals go aside with it


def _path(url: URL) -> Path:
    if not url.database or url.database == ":memory:":
        raise BackupError("a database in memory cannot be copied to a file")
    return Path(url.database)


def _to_disk(path: Path) -> None:
    for place in (path, path.parent):
        descriptor = os.open(place, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
