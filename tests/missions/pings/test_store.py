"""Pings are stored once and read back in their order, wherever the process was killed."""

import asyncio
import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from app.missions.errors import PingsUnreadableError
from app.missions.fleet.interface import Position
from app.missions.pings import store as module
from app.missions.pings.codec import columns_of
from app.missions.pings.store import PingStore
from app.missions.views.measurements.soundings import Verdict
from app.storage.database import Database
from app.storage.ping_files import PingFiles
from app.storage.queries import pings as ping_queries
from tests.support.missions.pings import CLOCK_S, open_store, ping, same, take, times_of
from tests.support.missions.specs import LAT, LON
from tests.support.storage.databases import Databases
from tests.support.storage.rows import mission
from tests.support.waiting import until

CHUNK = 12


@pytest.fixture(autouse=True)
def small_files(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "CHUNK_PINGS", CHUNK)


@pytest.fixture
async def database(either_url: str) -> Any:
    database = Database(either_url)
    async with database.writing() as session:
        session.add(mission())
    yield database
    await database.close()


@pytest.fixture
def files(tmp_path: Path) -> PingFiles:
    return PingFiles(str(tmp_path / "pings"))


@pytest.fixture
async def store(database: Database, files: PingFiles) -> PingStore:
    return (await open_store(database, files))[0]


def times(*numbers: int) -> list[float]:
    return [ping(number).time_s for number in numbers]


async def test_every_ping_has_its_verdict_and_is_stored_once(store: PingStore, database: Database) -> None:
    far = ping(2, position=Position(LAT + 0.01, LON, 2.0))
    taken = await take(store, database, [ping(0), ping(1), ping(0), far, ping(3, time_s=float("nan"))])
    assert [v.verdict for v in taken.verdicts] == [
        Verdict.ACCEPTED,
        Verdict.ACCEPTED,
        Verdict.DUPLICATE,
        Verdict.REJECTED,
        Verdict.REJECTED,
    ]
    assert taken.verdicts[3].reason == "position: too far"
    assert (taken.totals.pings, taken.totals.beams, taken.totals.rejected) == (2, 16, 1)
    assert taken.accepted["a"].time_s.tolist() == times(0, 1)
    again = await take(store, database, [ping(0), ping(1), far, ping(4), ping(0, vehicle="b")])
    assert [v.verdict for v in again.verdicts] == [*[Verdict.DUPLICATE] * 3, *[Verdict.ACCEPTED] * 2]
    assert await times_of(store) == {"a": times(0, 1, 4), "b": times(0)}


async def test_duplicates_are_known_in_files_and_after_a_restart(
    store: PingStore, database: Database, files: PingFiles
) -> None:
    reports = [ping(number) for number in range(30)]
    for first in range(0, 30, 3):
        await take(store, database, reports[first : first + 3])
    await store.close()
    assert len(files.names("m1")) == 3
    opened, counts = await open_store(database, files)
    assert (counts.pings, counts.beams) == (30, 240)
    taken = await take(opened, database, [*reports[::-1], ping(7, time_s=CLOCK_S + 0.01)])
    assert [v.verdict for v in taken.verdicts] == [*[Verdict.DUPLICATE] * 30, Verdict.ACCEPTED]
    await opened.close()
    assert (await times_of(opened))["a"] == [*times(*range(30)), CLOCK_S + 0.01]


async def test_enough_pings_become_a_file_by_themselves(store: PingStore, database: Database, files: PingFiles) -> None:
    for number in range(CHUNK):
        await take(store, database, [ping(number), ping(number, vehicle="b", time_s=5.0 + number)])
    await until(lambda: len(files.names("m1")) == 2, "both vehicles have a file")
    await until(lambda: store._mover is None or store._mover.done(), "they are in the database")
    chunks, waiting = await store.contents()
    assert sorted((row.vehicle, row.pings, row.beams) for row in chunks) == [("a", 12, 96), ("b", 12, 96)]
    assert waiting == {}
    read = {vehicle: pings async for vehicle, pings in store.all_accepted()}
    assert same(read["a"], columns_of([ping(number) for number in range(CHUNK)]))
    assert len(read["b"]) == CHUNK


async def test_pings_of_all_parts_are_read_in_their_order_while_they_move(
    store: PingStore, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "BLOCKS_AT_ONCE", 5)
    monkeypatch.setattr(store, "committed", lambda taken: store._waiting.update({"a": 1}))
    order = [3, 1, 2, *range(4, 40)]
    for number in order:
        await take(store, database, [ping(number)])
    newest = await store.newest_block()
    await take(store, database, [ping(50)])
    found: list[float] = []
    async for _, pings in store.all_accepted(newest):
        found += pings.time_s.tolist()
        await store.move()
    assert found == times(*order)
    assert (await times_of(store))["a"] == times(*order, 50)


async def test_a_missing_or_damaged_file_is_named(store: PingStore, database: Database, files: PingFiles) -> None:
    await take(store, database, [ping(number) for number in range(CHUNK)])
    await store.close()
    (name,) = files.names("m1")
    file = files.where(name)
    os.truncate(file, 100)
    with pytest.raises(PingsUnreadableError, match=f"{name} is damaged"):
        await times_of(store)
    os.unlink(file)  # noqa: PTH108 - a moment's work
    with pytest.raises(PingsUnreadableError, match=f"{name} is missing") as said:
        await times_of(store)
    assert "pings_url" in said.value.remedy
    _, counts = await open_store(database, files)
    assert counts.pings == CHUNK, "the mission is opened all the same"


class Killed(BaseException):
    """Ends a process in the middle of something."""


def _die(*_: Any, **__: Any) -> Any:
    raise Killed


async def _die_later(*_: Any, **__: Any) -> Any:
    raise Killed


def _half(files: PingFiles) -> Callable[[str, bytes], None]:
    def write(name: str, content: bytes) -> None:
        PingFiles.write(files, f"{name}.part", content[: len(content) // 2])
        raise Killed

    return write


def _written(files: PingFiles) -> Callable[[str, bytes], None]:
    def write(name: str, content: bytes) -> None:
        PingFiles.write(files, name, content)
        raise Killed

    return write


POINTS = ("before the file", "in the file", "after the file", "in the transaction", "after the transaction")


@pytest.mark.parametrize("point", POINTS)
async def test_a_kill_while_pings_are_moved_loses_and_doubles_nothing(
    store: PingStore, database: Database, files: PingFiles, monkeypatch: pytest.MonkeyPatch, point: str
) -> None:
    monkeypatch.setattr(module, "CLOSE_S", 60.0)  # however busy the disk is
    monkeypatch.setattr(store, "committed", lambda taken: store._waiting.update({"a": 1}))
    for number in range(20):
        await take(store, database, [ping(number)])
    with monkeypatch.context() as kill:
        if point == "before the file":
            kill.setattr(module, "_chunk_of", _die)
        elif point == "in the file":
            kill.setattr(files, "write", _half(files))
        elif point == "after the file":
            kill.setattr(files, "write", _written(files))
        elif point == "in the transaction":
            move = ping_queries.move_to_chunk

            async def moved(*arguments: Any) -> bool:
                await move(*arguments)
                raise Killed

            kill.setattr(ping_queries, "move_to_chunk", moved)
        else:
            replace = store._replace

            async def replaced(*arguments: Any) -> None:
                await replace(*arguments)
                raise Killed

            kill.setattr(store, "_replace", replaced)
        with pytest.raises(Killed):
            await store.move()
    opened, counts = await open_store(database, files)
    assert (counts.pings, counts.rejected_pings) == (20, 0)
    assert await times_of(opened) == {"a": times(*range(20))}
    assert files.unfinished("m1") == [], "no half is left"
    taken = await take(opened, database, [ping(number) for number in range(25)])
    assert taken.totals.pings == 5
    await opened.close()
    assert await times_of(opened) == {"a": times(*range(25))}
    chunks, waiting = await opened.contents()
    assert waiting == {}
    assert files.names("m1") == [row.name for row in chunks], "a file that was left is written again"


async def test_another_database_in_the_same_place_keeps_its_files(
    store: PingStore, database: Database, files: PingFiles, databases: Databases
) -> None:
    """An older copy of a database, opened by a second service or moved aside, has no whole file removed."""
    async with (copy := Database(databases.fresh("sqlite"))).writing() as session:
        session.add(mission())
    older, _ = await open_store(copy, files)
    await take(older, copy, [ping(0)])
    await take(store, database, [ping(number) for number in range(30)])
    await store.close()
    written = files.names("m1")
    assert written
    opened, _ = await open_store(copy, files)
    assert files.names("m1") == written
    await opened.close()
    await copy.close()
    assert await times_of(store) == {"a": times(*range(30))}


async def test_two_processes_that_move_the_same_pings_keep_them_once(
    store: PingStore, database: Database, files: PingFiles
) -> None:
    for number in range(6):
        await take(store, database, [ping(number)])
    other, _ = await open_store(database, files)
    write = files.write

    def both(name: str, content: bytes) -> None:
        write(name, content)
        if not chunks:
            chunks.append(name)
            asyncio.run_coroutine_threadsafe(other.move(), loop).result(20)

    chunks: list[str] = []
    loop = asyncio.get_running_loop()
    files.write = both
    await store.move()
    assert await times_of(store) == {"a": times(*range(6))}
    assert len((await store.contents())[0]) == 1


async def test_a_full_disk_leaves_pings_in_the_database_until_there_is_room(
    store: PingStore, database: Database, files: PingFiles, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as disk:
        disk.setattr(files, "write", full)
        await take(store, database, [ping(number) for number in range(CHUNK)])
        assert store._mover is not None
        await store._mover
        mover = store._mover
        await take(store, database, [ping(CHUNK)])
        assert store._mover is mover, "not tried again at once"
    assert await times_of(store) == {"a": times(*range(CHUNK + 1))}
    await store.close()
    assert len(files.names("m1")) == 2
    assert await times_of(store) == {"a": times(*range(CHUNK + 1))}


async def test_a_place_that_hangs_is_not_waited_for_at_the_end_and_later_gets_what_is_left(
    store: PingStore, database: Database, files: PingFiles, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers, asked = threading.Event(), threading.Event()

    def hang(_name: str, _content: bytes) -> None:
        asked.set()
        answers.wait()
        raise OSError("it never answered")

    with monkeypatch.context() as silent:
        silent.setattr(files, "write", hang)
        await take(store, database, [ping(number) for number in range(CHUNK)])
        await until(asked.is_set, "the file is being written")
        try:
            await store.close(asyncio.get_running_loop().time())
            assert [thread for thread in threading.enumerate() if thread.name == "own hang" and thread.daemon]
        finally:
            answers.set()
    assert (await store.contents())[1]["a"].pings == CHUNK, "they stay in the database"
    opened, _ = await open_store(database, files)
    opened.begin_to_tidy()
    await until(lambda: opened._tidying is not None and opened._tidying.done(), "it was looked for halves")
    await opened.close()
    assert len(files.names("m1")) == 1
    assert await times_of(opened) == {"a": times(*range(CHUNK))}
