"""Copies of a database that is in use, checked, damaged and put back; and room for new missions."""

import asyncio
import hashlib
import os
import re
import resource
import shutil
import signal
import sqlite3
import subprocess
import sys
from contextlib import closing
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from sqlalchemy import func, select
from sqlalchemy.exc import DBAPIError

from app.storage.database import Database
from app.storage.models import Base, MissionRow, SoundingRow
from app.storage.ping_files import REMOVED, PingFiles, digest_in, file_name
from app.storage.processes.membership import make_membership
from app.storage.upkeep import migrate
from app.storage.upkeep.backup import BackupError, back_up, contents_of, files_beside, restore_to
from app.storage.upkeep.prepare import DatabaseNotReadyError, prepare_database
from app.storage.upkeep.retention import ended_before, finish_removing, give_space_back, remove, unlisted_files
from tests.support.paths import PROJECT
from tests.support.storage.databases import Databases, query
from tests.support.storage.rows import PING_FILE, PING_FILE_NAME, mission, one_of_each, ping_chunk, sounding

WRITER = """
import sqlite3, sys
connection = sqlite3.connect(sys.argv[1], timeout=30, isolation_level=None)
print("writing", flush=True)
while True:
    connection.execute("BEGIN IMMEDIATE")
    for half in "ab":  # both or none
        connection.execute(
            "INSERT INTO events (mission_id, time, level, kind, message, data) VALUES (?, ?, 'info', ?, '', '{}')",
            ("m1", "2026-06-01", half),
        )
    connection.execute("COMMIT")
"""

NEEDS_PG_DUMP = pytest.mark.skipif(shutil.which("pg_dump") is None, reason="pg_dump is not installed")


def path_of(url: str) -> Path:
    return Path(url.removeprefix("sqlite+aiosqlite:///"))


async def fill(database: Database, files: PingFiles | None = None) -> None:
    (files or PingFiles.beside(database.url)).write(PING_FILE_NAME, PING_FILE)
    async with database.writing() as session:
        for rows in one_of_each():
            session.add_all(rows)
            await session.flush()


def beside(folder: Path, begin: str) -> list[Path]:
    return list(folder.glob(f"{begin}*"))


async def counts(url: str) -> dict[str, int]:
    database = Database(url)
    async with database.reading() as session:
        found = {
            table.name: int(await session.scalar(select(func.count()).select_from(table)) or 0)
            for table in Base.metadata.sorted_tables
        }
    await database.close()
    return found


def copies_beside_a_writer(url: str, folder: Path) -> list[Path]:
    """Copies that were made one after the other while another process wrote."""
    with subprocess.Popen([sys.executable, "-c", WRITER, str(path_of(url))], stdout=subprocess.PIPE) as writer:
        assert writer.stdout is not None
        writer.stdout.readline()
        try:
            return [back_up(url, folder / f"{number}.db")[0] for number in range(5)]
        finally:
            writer.kill()


async def test_copy_of_a_database_that_is_written_to_is_one_moment_of_it(sqlite: Database, tmp_path: Path) -> None:
    await fill(sqlite)
    sizes = []
    for copy in await asyncio.to_thread(copies_beside_a_writer, sqlite.url, tmp_path):
        assert copy.stat().st_mode & 0o777 == 0o600
        with closing(sqlite3.connect(copy)) as connection:
            halves = [
                connection.execute("SELECT count(*) FROM events WHERE kind = ?", half).fetchone()[0] for half in "ab"
            ]
            (journal,) = connection.execute("PRAGMA journal_mode").fetchone()
        assert halves[0] == halves[1]
        assert journal == "delete"
        sizes.append(halves[0])
    assert sizes == sorted(sizes)
    assert sizes[-1] > 0
    assert not any(f"{number}.db.part" in files for *_, files in os.walk(tmp_path) for number in range(5))


async def test_what_was_backed_up_is_there_again_after_the_disk_was_lost(sqlite: Database, tmp_path: Path) -> None:
    await fill(sqlite)
    await sqlite.close()
    before = await counts(sqlite.url)
    copy, contents = back_up(sqlite.url, tmp_path / "backups")
    assert {table: contents.rows[table] for table in before} == before
    os.unlink(path_of(sqlite.url))  # noqa: PTH108 - a moment's work
    assert restore_to(sqlite.url, copy, replace=False) == (contents, None)
    assert await counts(sqlite.url) == before


async def test_restoring_over_a_database_moves_it_aside_and_never_one_that_is_in_use(
    sqlite: Database, tmp_path: Path
) -> None:
    copy, _ = back_up(sqlite.url, tmp_path / "empty.db")
    await fill(sqlite)
    with pytest.raises(BackupError, match="exists"):
        restore_to(sqlite.url, copy, replace=False)
    async with sqlite.reading() as session:
        await session.scalars(select(MissionRow))
        with pytest.raises(BackupError, match="in use"):
            restore_to(sqlite.url, copy, replace=True)
    await sqlite.close()
    _, aside = restore_to(sqlite.url, copy, replace=True)
    assert (await counts(sqlite.url))["missions"] == 0
    assert aside is not None
    assert (await counts(f"sqlite+aiosqlite:///{aside}"))["missions"] == 1


async def test_a_full_disk_keeps_nothing_of_a_copy(sqlite: Database, tmp_path: Path) -> None:
    async with sqlite.writing() as session:
        session.add(mission("m1", reason="x" * 4_000_000))
    most = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1_000_000, most[1]))
    try:
        with pytest.raises(BackupError, match="cannot be written"):
            back_up(sqlite.url, tmp_path / "copies" / "x.db")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, most)
    assert list((tmp_path / "copies").iterdir()) == []


class InterruptedFiles(PingFiles):
    """The user presses Ctrl-C while files of pings are copied."""

    def write(self, name: str, content: bytes) -> None:
        raise KeyboardInterrupt


async def test_a_restore_that_is_broken_off_leaves_the_database_in_its_place(sqlite: Database, tmp_path: Path) -> None:
    await fill(sqlite)
    await sqlite.close()
    before = await counts(sqlite.url)
    copy, _ = back_up(sqlite.url, tmp_path / "copy.db")
    with pytest.raises(KeyboardInterrupt):
        restore_to(sqlite.url, copy, replace=True, pings=InterruptedFiles(str(tmp_path / "pings")))
    assert await counts(sqlite.url) == before
    assert not beside(tmp_path, f"{path_of(sqlite.url).name}.")


async def test_root_restores_nothing_that_its_owner_could_not_use(
    sqlite: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in the folder of a service that systemd runs: its user would be locked out of its own database."""
    await fill(sqlite)
    await sqlite.close()
    copy, _ = back_up(sqlite.url, tmp_path / "copy.db")
    path = path_of(sqlite.url)
    if os.geteuid() == 0:
        os.chown(path, 12345, -1)
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    with pytest.raises(BackupError, match=rf"{path.name} belongs to user {path.stat().st_uid}") as refused:
        restore_to(sqlite.url, copy, replace=True)
    assert "as that user" in refused.value.remedy
    assert not beside(tmp_path, f"{path.name}.")
    assert path.stat().st_uid != 0


KILLED_RESTORE = """
import os, shutil, signal, sys
from pathlib import Path
from app.storage.ping_files import PingFiles
from app.storage.upkeep.backup import restore_to

def killed(*_):
    os.kill(os.getpid(), signal.SIGKILL)

url, backup, moment = sys.argv[1:]
place, name = {
    "while a file of pings is written": (PingFiles, "write"),
    "while the database is copied": (shutil, "copyfileobj"),
    "before the new one takes its name": (Path, "replace"),
}[moment]
setattr(place, name, killed)
restore_to(url, Path(backup), replace=True)
"""


@pytest.mark.parametrize(
    ("moment", "left"),
    [
        ("while a file of pings is written", []),
        ("while the database is copied", [".part"]),
        ("before the new one takes its name", [".part", ".before-"]),
    ],
)
async def test_a_killed_restore_leaves_the_database_with_all_its_files_of_pings_and_is_named(
    databases: Databases,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
    moment: str,
    left: list[str],
) -> None:
    other = Database(databases.fresh("sqlite"))
    await fill(other, PingFiles(str(tmp_path / "elsewhere")))
    copy, _ = back_up(other.url, tmp_path / "copy.db", PingFiles(str(tmp_path / "elsewhere")))
    await other.close()
    url, content = f"sqlite+aiosqlite:///{tmp_path / 'fleet.db'}", b"pings of the database that is replaced"
    await migrate.upgrade(url)
    digest = hashlib.sha256(content).hexdigest()
    PingFiles.beside(url).write(file_name("m2", 1, digest), content)

    command = [sys.executable, "-c", KILLED_RESTORE, url, str(copy), moment]
    killed = await asyncio.to_thread(subprocess.run, command, cwd=PROJECT, check=False)
    assert killed.returncode == -signal.SIGKILL
    assert (await counts(url))["missions"] == 0
    assert PingFiles.beside(url).read(file_name("m2", 1, digest), digest) == content
    await prepare_database(url, may_upgrade=False)
    said = capsys.readouterr().out + caplog.text
    assert ("a restore did not end" in said) == bool(left)
    assert all(f"fleet.db{name}" in said for name in left)

    if left:
        path_of(url).rename(tmp_path / "lost.db")
        with pytest.raises(DatabaseNotReadyError, match=r"a restore of it did not end \(.*fleet\.db\.part is left\)"):
            await prepare_database(url, may_upgrade=True)
        (tmp_path / "lost.db").rename(path_of(url))
    for second_name in beside(tmp_path, "fleet.db.before-"):
        second_name.unlink()
    _, aside = await asyncio.to_thread(restore_to, url, copy, replace=True)
    assert aside is not None
    assert beside(tmp_path, "fleet.db.") == [aside]
    assert (await counts(url))["missions"] == 1
    assert (await counts(f"sqlite+aiosqlite:///{aside}"))["missions"] == 0


async def test_the_journal_of_a_lost_database_goes_aside_and_into_no_other(sqlite: Database, tmp_path: Path) -> None:
    await fill(sqlite)
    copy, _ = back_up(sqlite.url, tmp_path / "copy.db")
    before = await counts(sqlite.url)
    async with sqlite.writing() as session:
        session.add(mission("m2"))
    path = path_of(sqlite.url)
    journal = shutil.copy(f"{path}-wal", tmp_path / "wal").read_bytes()
    await sqlite.close()
    path.with_name(f"{path.name}-wal").write_bytes(journal)
    path.unlink()
    assert restore_to(sqlite.url, copy, replace=False)[1] is None
    assert await counts(sqlite.url) == before
    (aside,) = beside(path.parent, f"{path.name}.before-")
    assert (aside.name[-4:], aside.read_bytes()) == ("-wal", journal)


async def test_a_database_goes_aside_where_files_have_one_name_only(
    sqlite: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    copy, _ = back_up(sqlite.url, tmp_path / "empty.db")
    await fill(sqlite)
    await sqlite.close()

    def none(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")  # as on FAT

    monkeypatch.setattr(Path, "hardlink_to", none)
    _, aside = restore_to(sqlite.url, copy, replace=True)
    assert aside is not None
    assert aside.stat().st_mode & 0o777 == 0o600
    assert (await counts(f"sqlite+aiosqlite:///{aside}"))["missions"] == 1
    assert (await counts(sqlite.url))["missions"] == 0


@pytest.mark.parametrize("page", [0, 1, 2, 3])
async def test_damage_is_noticed_and_nothing_is_restored_from_it(sqlite: Database, tmp_path: Path, page: int) -> None:
    await fill(sqlite)
    copy, _ = back_up(sqlite.url, tmp_path / "copy.db")
    whole = copy.read_bytes()
    damaged = whole[: page * 4096] + b"\xff" * 1200 + whole[page * 4096 + 1200 :]
    for content in (damaged, whole[: len(whole) // 2]):
        copy.write_bytes(content)
        with pytest.raises(BackupError, match=re.escape(str(copy))):
            contents_of(copy)
        with pytest.raises(BackupError):
            restore_to(f"sqlite+aiosqlite:///{tmp_path / 'new.db'}", copy, replace=False)
        assert not (tmp_path / "new.db").exists()


async def test_files_of_pings_are_backed_up_and_put_back_with_the_database(sqlite: Database, tmp_path: Path) -> None:
    files = PingFiles(str(tmp_path / "pings"))
    await fill(sqlite, files)
    await sqlite.close()
    copy, made = back_up(sqlite.url, tmp_path / "copy.db", files)
    assert made.ping_files == contents_of(copy).ping_files == 1
    assert all(file.stat().st_mode & 0o077 == 0 for file in (tmp_path / "copy.db-pings").rglob("*"))
    file = tmp_path / "copy.db-pings" / PING_FILE_NAME
    file.write_bytes(PING_FILE + b"?")
    with pytest.raises(BackupError, match=f"{PING_FILE_NAME} is damaged"):
        contents_of(copy)
    file.unlink()
    with pytest.raises(BackupError, match=f"{PING_FILE_NAME} is missing"):
        contents_of(copy)
    assert contents_of(copy, files).ping_files_elsewhere == 1
    restore_to(sqlite.url, copy, replace=True, pings=files)
    assert files.names() == [PING_FILE_NAME]
    files.remove("m1", [PING_FILE_NAME])
    before = path_of(sqlite.url).read_bytes()
    with pytest.raises(BackupError, match=f"1 of 1 files .* not in .*copy.db-pings.*pings/{PING_FILE_NAME} is missing"):
        restore_to(sqlite.url, copy, replace=True, pings=files)
    assert path_of(sqlite.url).read_bytes() == before
    with pytest.raises(BackupError, match=f"{PING_FILE_NAME} is missing"):
        back_up(sqlite.url, tmp_path / "again.db", files)
    assert not beside(tmp_path, "again")


@NEEDS_PG_DUMP
async def test_an_archive_without_its_files_of_pings_is_refused(databases: Databases, tmp_path: Path) -> None:
    url, files = databases.fresh("postgresql"), PingFiles(str(tmp_path / "pings"))
    database = Database(url)
    await fill(database, files)
    await database.close()
    files.write("m1/left-by-a-kill.parquet", b"no archive refers to it")
    copy, made = await asyncio.to_thread(back_up, url, tmp_path / "fleet.dump", files)
    assert (made.ping_files, files_beside(copy).names()) == (1, [PING_FILE_NAME])

    shutil.rmtree(tmp_path / "fleet.dump-pings")  # as pg_dump leaves it
    missing = rf"1 of 1 files of pings are not in .*/fleet\.dump-pings, .*{PING_FILE_NAME} is missing"
    other, others = databases.fresh("postgresql"), PingFiles(str(tmp_path / "others"))
    for nowhere in (None, others):
        with pytest.raises(BackupError, match=missing) as refused:
            await asyncio.to_thread(contents_of, copy, nowhere)
        assert f"Copy the folder of pings_url to {tmp_path / 'fleet.dump-pings'}" in refused.value.remedy
    with pytest.raises(BackupError, match=missing):
        await asyncio.to_thread(restore_to, other, copy, replace=True, pings=others)
    assert (await counts(other))["missions"] == 0

    assert (await asyncio.to_thread(contents_of, copy, files)).ping_files_elsewhere == 1
    names = files.names()
    await asyncio.to_thread(restore_to, url, copy, replace=True, pings=files)
    assert files.names() == names, "where they are"
    assert not beside(tmp_path, "pings.")
    shutil.copytree(tmp_path / "pings", tmp_path / "fleet.dump-pings")  # by hand
    await asyncio.to_thread(restore_to, other, copy, replace=True, pings=others)
    assert others.names() == [PING_FILE_NAME]
    (tmp_path / "fleet.dump-pings" / PING_FILE_NAME).write_bytes(b"?")
    with pytest.raises(BackupError, match=f"{PING_FILE_NAME} is damaged"):
        await asyncio.to_thread(contents_of, copy, files)


async def test_a_backup_that_fails_leaves_what_belongs_to_another_one(sqlite: Database, tmp_path: Path) -> None:
    await fill(sqlite)
    copy, _ = back_up(sqlite.url, tmp_path / "harbour.db")
    kept, files = copy.rename(tmp_path / "kept.db"), files_beside(copy)
    for _ in range(2):
        with pytest.raises(BackupError, match=r"harbour\.db-pings exists"):
            back_up(sqlite.url, copy)
        assert files.read(PING_FILE_NAME, digest_in(PING_FILE_NAME)) == PING_FILE
    assert beside(tmp_path, "harbour.") == [tmp_path / "harbour.db-pings"]

    kept.rename(copy)
    PingFiles.beside(sqlite.url).remove("m1", [PING_FILE_NAME])
    with pytest.raises(BackupError, match="is missing"):
        back_up(sqlite.url, tmp_path / "next.db")
    assert contents_of(copy).ping_files == 1
    assert not beside(tmp_path, "next.")


@pytest.mark.parametrize("failing", [".db.part", "pings.part"])
async def test_a_backup_whose_last_steps_fail_leaves_nothing(
    sqlite: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failing: str
) -> None:
    await fill(sqlite)
    rename = Path.rename

    def full(path: Path, target: Path) -> Path:
        if path.name.endswith(failing):
            raise OSError(28, "No space left on device")
        return rename(path, target)

    (tmp_path / "copy.db-pings.part" / "m2").mkdir(parents=True)
    (tmp_path / "copy.db-pings.part" / "m2" / "left-by-a-kill.parquet").touch()
    with monkeypatch.context() as disk:
        disk.setattr(Path, "rename", full)
        with pytest.raises(BackupError, match="No space left"):
            back_up(sqlite.url, tmp_path / "copy.db")
    assert not beside(tmp_path, "copy.")
    copy, _ = back_up(sqlite.url, tmp_path / "copy.db")
    assert files_beside(copy).names() == [PING_FILE_NAME]
    assert sorted(beside(tmp_path, "copy.")) == [copy, tmp_path / "copy.db-pings"]


@pytest.mark.parametrize("place", ["folder", "url"])
async def test_what_is_replaced_keeps_its_files_of_pings(sqlite: Database, tmp_path: Path, place: str) -> None:
    files = PingFiles(str(tmp_path / "pings") if place == "folder" else f"memory://{tmp_path.name}/pings")
    await fill(sqlite, files)
    copy, _ = back_up(sqlite.url, tmp_path / "copy.db", files)
    content = b"pings that came after the backup"
    digest = hashlib.sha256(content).hexdigest()
    later, another_s = file_name("m1", 2, digest), file_name("another-database-s", 1, digest)
    for name in (later, another_s):
        files.write(name, content)
    async with sqlite.writing() as session:
        row = ping_chunk()
        row.name, row.digest, row.first_block, row.last_block = later, digest, 2, 2
        session.add(row)
    await sqlite.close()
    files.write(f"m1{REMOVED}", PING_FILE_NAME.encode())  # by a removal that was killed

    _, aside = restore_to(sqlite.url, copy, replace=True, pings=files)
    assert files.names() == sorted([another_s, later, PING_FILE_NAME])
    assert files.condemned() == [], "the mission is there again"
    assert not beside(tmp_path, "pings.")
    found = query(f"sqlite+aiosqlite:///{aside}", "select name, digest from ping_chunks order by id")
    assert [files.read(name, digest) for name, digest in found] == [PING_FILE, content]
    database = Database(sqlite.url)
    assert await unlisted_files(database, files) == [another_s, later]
    await database.close()


async def test_a_restore_without_room_for_files_of_pings_leaves_none_behind(sqlite: Database, tmp_path: Path) -> None:
    await fill(sqlite)
    content = bytes(100_000)
    digest = hashlib.sha256(content).hexdigest()
    large = file_name("m1", 2, digest)
    PingFiles.beside(sqlite.url).write(large, content)
    async with sqlite.writing() as session:
        row = ping_chunk()
        row.name, row.digest = large, digest
        session.add(row)
    await sqlite.close()
    before = await counts(sqlite.url)
    copy, _ = back_up(sqlite.url, tmp_path / "copy.db")
    most, room = resource.getrlimit(resource.RLIMIT_FSIZE), PingFiles(str(tmp_path / "room"))

    class SmallDisk(PingFiles):
        def write(self, name: str, content: bytes) -> None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, most[1]))
            try:
                super().write(name, content)
            finally:
                resource.setrlimit(resource.RLIMIT_FSIZE, most)

    with pytest.raises(BackupError, match="cannot be written: File too large"):
        restore_to(sqlite.url, copy, replace=True, pings=SmallDisk(room.url))
    assert room.names() == []
    assert await counts(sqlite.url) == before
    restore_to(sqlite.url, copy, replace=True, pings=room)
    assert room.names() == [PING_FILE_NAME, large]


async def test_a_mission_that_goes_takes_its_files_of_pings_along_whenever_the_process_is_killed(
    database: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files, long_ago = PingFiles(str(tmp_path / "pings")), datetime.now(UTC) - timedelta(days=100)
    async with database.writing() as session:
        session.add_all(mission(name, state="finished", updated_at=long_ago) for name in ("m1", "m2"))
        await session.flush()
        session.add(ping_chunk())
    for name in (PING_FILE_NAME, "m2/other.parquet"):
        files.write(name, PING_FILE)

    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as kill:
        kill.setattr(Database, "writing", killed)
        with pytest.raises(KeyboardInterrupt):
            await remove(database, "m1", 30, files)
    await finish_removing(database, files)
    assert (len(files.names()), files.condemned()) == (2, []), "the mission is still there"
    with monkeypatch.context() as kill:
        kill.setattr(files, "_remove", killed)
        with pytest.raises(KeyboardInterrupt):
            await remove(database, "m1", 30, files)
    await finish_removing(database, files)
    assert (files.names(), files.condemned()) == (["m2/other.parquet"], [])
    assert await unlisted_files(database, files) == ["m2/other.parquet"]


async def test_a_mission_that_goes_leaves_files_that_another_database_has_of_it(
    databases: Databases, tmp_path: Path
) -> None:
    """One that was moved aside, for example: it knows pings that came after the backup."""
    older, newer = Database(databases.fresh("sqlite")), Database(databases.fresh("sqlite"))
    files, long_ago = PingFiles(str(tmp_path / "pings")), datetime.now(UTC) - timedelta(days=100)
    content = b"came after the backup"
    digest = hashlib.sha256(content).hexdigest()
    later = file_name("m1", 2, digest)
    files.write(PING_FILE_NAME, PING_FILE)
    files.write(later, content)
    for database in (older, newer):
        async with database.writing() as session:
            session.add(mission("m1", state="finished", updated_at=long_ago))
            await session.flush()
            session.add(ping_chunk())
    assert await remove(older, "m1", 30, files)
    await finish_removing(newer, files)
    assert files.names() == [later]
    assert await unlisted_files(newer, files) == [later]

    # What another database condemned is not taken from one that has the mission.
    files.write(f"m1{REMOVED}", later.encode())
    await finish_removing(newer, files)
    assert (files.names(), files.condemned()) == ([later], [])
    await older.close()
    await newer.close()


async def test_what_is_no_backup_of_ours_is_named(sqlite: Database, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("nothing")
    with closing(sqlite3.connect(tmp_path / "other.db")) as connection:
        connection.execute("CREATE TABLE cats (name TEXT)")
    for name, said in (("notes.txt", "neither an SQLite"), ("other.db", "not one of bathyfleet")):
        with pytest.raises(BackupError, match=said):
            contents_of(tmp_path / name)
    with pytest.raises(BackupError, match="exists"):
        back_up(sqlite.url, tmp_path / "other.db")
    (tmp_path / "notes").touch()
    with pytest.raises(BackupError, match="cannot be written"):
        back_up(sqlite.url, tmp_path / "notes")
    with pytest.raises(BackupError, match="there is no database"):
        back_up(f"sqlite+aiosqlite:///{tmp_path / 'absent.db'}", tmp_path / "x.db")


@NEEDS_PG_DUMP
async def test_postgresql_is_copied_by_its_own_programs(
    databases: Databases,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    url = databases.fresh("postgresql")
    database = Database(url)
    files, others = PingFiles(str(tmp_path / "files")), PingFiles(str(tmp_path / "others"))
    await fill(database, files)
    await database.close()
    before = await counts(url)
    copy, made = await asyncio.to_thread(back_up, url, tmp_path / "fleet.dump", files)
    assert contents_of(copy) == made
    assert (made.size_bytes, made.ping_files) == (copy.stat().st_size, 1)
    other = databases.fresh("postgresql")
    await asyncio.to_thread(restore_to, other, copy, replace=True, pings=others)
    assert others.names() == [PING_FILE_NAME]
    assert before["processes"] > 0
    # Who lives now, and what he leads, is not copied.
    assert await counts(other) == before | {"mission_owners": 0, "processes": 0}
    query(url, "update alembic_version set version_num = '9999'")
    newer, _ = await asyncio.to_thread(back_up, url, tmp_path / "newer.dump", files)
    with pytest.raises(BackupError, match="is at revision 9999, which this version does not know"):
        await asyncio.to_thread(restore_to, other, newer, replace=True, pings=others)
    assert await counts(other) == before | {"mission_owners": 0, "processes": 0}
    half = tmp_path / "half.dump"
    half.write_bytes(copy.read_bytes()[:-2000])
    with pytest.raises(BackupError, match="pg_restore"):
        contents_of(half)

    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(BackupError, match="pg_dump is not installed") as refused:
        back_up(url, tmp_path / "again.dump")
    assert "docker compose exec database pg_dump" in refused.value.remedy


@NEEDS_PG_DUMP
async def test_a_database_of_postgresql_is_not_replaced_while_a_process_has_it(
    databases: Databases, tmp_path: Path
) -> None:
    url, files = databases.fresh("postgresql"), PingFiles(str(tmp_path / "files"))
    copy, _ = await asyncio.to_thread(back_up, url, tmp_path / "fleet.dump", files)
    member = make_membership(url, lambda: None)
    await member.enter(1)
    with pytest.raises(BackupError, match="is in use"):
        await asyncio.to_thread(restore_to, url, copy, replace=True, pings=files)
    await member.leave()
    await asyncio.to_thread(restore_to, url, copy, replace=True, pings=files)


@NEEDS_PG_DUMP
async def test_what_was_told_of_alarms_comes_back_though_who_told_it_does_not(
    databases: Databases, tmp_path: Path
) -> None:
    url = databases.fresh("postgresql")
    database, files = Database(url), PingFiles(str(tmp_path / "files"))
    await fill(database, files)
    await database.close()
    copy, _ = await asyncio.to_thread(back_up, url, tmp_path / "fleet.dump", files)
    statement = "select id, alarm_id, recipient, state, attempts, process_id from alarm_deliveries"
    assert query(url, statement) == [("d1", "a1", "bridge", "waiting", 0, 1)]
    waiting = [("d1", "a1", "bridge", "waiting", 0, None)]

    empty = databases.empty("postgresql")
    await asyncio.to_thread(restore_to, empty, copy, replace=False, pings=files)
    assert query(empty, statement) == waiting, "some other process delivers it now"
    with pytest.raises(DBAPIError, match="fk_alarm_deliveries_process_id_processes"):
        query(empty, "update alarm_deliveries set process_id = 7")

    await asyncio.to_thread(restore_to, url, copy, replace=True, pings=files)
    assert query(url, statement) == waiting, "over the row that named a process"


@NEEDS_PG_DUMP
@pytest.mark.parametrize("revision", ["0006", "0018"])  # before the audit log, and of a release
async def test_the_backup_of_an_older_version_replaces_a_newer_database(
    databases: Databases,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
    revision: str,
) -> None:
    """The way back after an upgrade; what others keep beside it stays."""
    older, newer, files = databases.empty("postgresql"), databases.fresh("postgresql"), PingFiles(str(tmp_path / "p"))
    await migrate.upgrade(older, revision)
    query(older, "insert into tokens (id, name, role, token_hash, created_at) values ('t', 'Ana', 'admin', 'd', now())")
    copy, _ = await asyncio.to_thread(back_up, older, tmp_path / "older.dump", files)
    database = Database(newer)
    await fill(database, files)
    await database.close()
    query(newer, "create table notes (mission varchar(36) references missions)")
    query(newer, "insert into notes values ('m1')")

    await asyncio.to_thread(restore_to, newer, copy, replace=True, pings=files)
    assert await migrate.current(newer) == revision
    assert await migrate.tables(newer) == sorted([*await migrate.tables(older), "notes"])
    assert query(newer, "select mission from notes") == [("m1",)]
    # Where logs go depends on whether a service ran in this process before.
    said = capsys.readouterr().out + caplog.text
    assert "tables stay that this version does not know" in said
    assert "notes" in said
    await migrate.upgrade(newer)
    assert query(newer, "select name from tokens") == [("Ana",)]
    assert (await counts(newer))["missions"] == 0


async def test_an_archive_goes_into_postgresql_as_a_whole_or_not_at_all(databases: Databases, tmp_path: Path) -> None:
    files = PingFiles(str(tmp_path / "files"))
    copy, _ = await asyncio.to_thread(back_up, databases.fresh("postgresql"), tmp_path / "fleet.dump", files)
    url = databases.empty("postgresql")
    query(url, "create table waypoints (depth_m real)")  # the last table of all is in the way
    with pytest.raises(BackupError, match=r"psql failed: .*relation \"waypoints\" already exists"):
        await asyncio.to_thread(restore_to, url, copy, replace=False, pings=files)
    assert query(url, "select tablename from pg_tables where schemaname = 'public'") == [("waypoints",)]


async def test_a_password_is_given_to_no_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fake = tmp_path / "pg_dump"
    fake.write_text(f'#!/bin/sh\necho "$@" > {tmp_path}/arguments\necho "$PGPASSWORD" > {tmp_path}/word\nexit 1\n')
    fake.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    with pytest.raises(BackupError, match="pg_dump failed"):
        back_up("postgresql+asyncpg://fleet:hunter2@db:5433/fleet", tmp_path / "x.dump")
    assert "hunter2" not in (tmp_path / "arguments").read_text()
    assert "--host db --port 5433 --username fleet --dbname fleet" in (tmp_path / "arguments").read_text()
    assert (tmp_path / "word").read_text() == "hunter2\n"


async def test_a_server_is_found_and_spoken_to_as_its_url_says(databases: Databases, tmp_path: Path) -> None:
    url, files = databases.fresh("postgresql"), PingFiles(str(tmp_path / "files"))
    by_socket = databases.server.socket_url.format(url.rpartition("/")[2])
    assert await migrate.current(by_socket) == migrate.head()
    copy, _ = await asyncio.to_thread(back_up, by_socket, tmp_path / "fleet.dump", files)
    await asyncio.to_thread(restore_to, by_socket, copy, replace=True, pings=files)
    # It has no certificate: what must be encrypted does not go there in the clear.
    for mode in ("require", "verify-full"):
        with pytest.raises(BackupError, match="SSL"):
            await asyncio.to_thread(back_up, f"{url}?ssl={mode}", tmp_path / "open.dump", files)
        with pytest.raises(BackupError, match="SSL"):
            await asyncio.to_thread(restore_to, f"{url}?ssl={mode}", copy, replace=True, pings=files)
    with pytest.raises(BackupError, match="has sslmode, which PostgreSQL's programs cannot be told"):
        back_up(f"{url}?sslmode=require", tmp_path / "x.dump", files)


async def test_missions_that_ended_long_ago_go_and_give_their_space_back(database: Database) -> None:
    now = datetime.now(UTC)
    ages = {"old": 100.0, "younger": 10.0, "running": 100.0, "paused": 100.0, "ready": 100.0}
    async with database.writing() as session:
        for name, days in ages.items():
            state = name if name in ("running", "paused", "ready") else "finished"
            session.add(mission(name, state=state, updated_at=now - timedelta(days=days)))
        await session.flush()
        for name in ages:
            many = 2000 if name == "old" else 3
            session.add_all(SoundingRow(**sounding(name, time_s=float(k))) for k in range(many))
    found = await ended_before(database, 30)
    assert [(ended.id, ended.soundings) for ended in found] == [("old", 2000)]
    assert not await remove(database, "running", 30)
    assert not await remove(database, "younger", 30)
    assert await remove(database, "old", 30)
    assert not await remove(database, "old", 30)
    after = await counts(database.url)
    assert (after["missions"], after["soundings"]) == (4, 12)
    note = await give_space_back(database.url)
    if database.url.startswith("sqlite"):
        assert int(note.split()[3]) > 100_000
