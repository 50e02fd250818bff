"""kill -9 while pings are stored and moved to files: what was accepted is there once, in its order."""

import asyncio
import random
import subprocess
import sys
from pathlib import Path

import pytest

from app.storage.database import Database
from app.storage.ping_files import PingFiles
from tests.support.missions.pings import open_store, times_of
from tests.support.paths import PROJECT
from tests.support.storage.databases import Databases
from tests.support.storage.rows import mission

KILLS = 6

WRITER = """
import asyncio, sys
from app.missions.pings import store as module
from app.storage.database import Database
from app.storage.ping_files import PingFiles
from tests.support.missions.pings import open_store, ping, take

async def main(url, files, first):
    module.CHUNK_PINGS = 20
    database = Database(url)
    store, _ = await open_store(database, PingFiles(files))
    number = first
    while True:
        taken = await take(store, database, [ping(number + i, vehicle=v) for i in range(3) for v in "ab"])
        number += 3
        print(number, flush=True)

asyncio.run(main(sys.argv[1], sys.argv[2], int(sys.argv[3])))
"""


def written_until_killed(url: str, folder: Path, first: int, lines: int) -> int:
    """Let a process store pings, kill it, and return the number of pings that it said are stored."""
    command = [sys.executable, "-c", WRITER, url, str(folder), str(first)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, cwd=PROJECT, text=True) as writer:
        assert writer.stdout is not None
        said = [int(writer.stdout.readline()) for _ in range(lines)]
        writer.kill()
        said += [int(line) for line in writer.stdout if line.endswith("\n")]
    return said[-1]


@pytest.mark.slow
@pytest.mark.timeout(300)
async def test_pings_survive_being_killed_at_random_moments(databases: Databases, tmp_path: Path) -> None:
    database = Database(databases.fresh("sqlite"))
    async with database.writing() as session:
        session.add(mission())
    moments, files, number = random.Random(2026), PingFiles(str(tmp_path / "pings")), 0  # noqa: S311 - no secret
    kills = 0
    while kills < KILLS or len(files.names("m1")) < 2:
        # Later ones live longer: some pings have to be moved into files meanwhile, however busy the machine is.
        lines = moments.randint(8, 60) * (1 if kills < KILLS else 10)
        said = await asyncio.to_thread(written_until_killed, database.url, tmp_path / "pings", number, lines)
        kills += 1
        store, counts = await open_store(database, files)
        chunks, _ = await store.contents()
        assert {row.name for row in chunks} <= set(files.names("m1"))
        found = await times_of(store)
        assert found["a"] == sorted(set(found["a"]))
        assert found["a"] == found["b"]
        assert counts.pings == 2 * len(found["a"])
        # What was said to be stored is; of what was not said yet at most one transaction more.
        assert said <= len(found["a"]) <= said + 3
        number = len(found["a"])
    await database.close()
