"""An ordinary user of the machine can neither read a file of the service nor command."""

import os
import shutil
import sqlite3
import stat
import subprocess
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.support.commands import COMMAND
from tests.support.faults.other_users import SERVICE, as_user, holding, modes, needs_root, open_folder, stranger
from tests.support.faults.service import Service, service_in
from tests.support.faults.stranger import NEW_MISSION
from tests.support.paths import PROJECT
from tests.support.ports import free_ports

pytestmark = [needs_root, pytest.mark.timeout(600)]

users = pytest.mark.parametrize("uid", [0, SERVICE], ids=["as-root", "as-ordinary-user"])


@pytest.fixture(autouse=True)
def generous_umask() -> Iterator[None]:
    """Nothing is private by the user's own doing."""
    before = os.umask(0)
    yield
    os.umask(before)


def settings_of(uid: int, folder: Path, **changes: str) -> dict[str, Any]:
    """A service's settings; one of an ordinary user has compiled functions of its own."""
    if uid:
        cache = folder / "compiled"
        shutil.copytree(os.environ["NUMBA_CACHE_DIR"], cache, dirs_exist_ok=True)
        for path in (cache, *cache.rglob("*")):
            os.chown(path, uid, uid)
            path.chmod(0o700 if path.is_dir() else 0o600)
        prefix = [*as_user(uid), "env", f"NUMBA_CACHE_DIR={cache}", f"HOME={folder}", f"MPLCONFIGDIR={folder}/mpl"]
    else:
        prefix = []
    return {"settings": changes, "prefix": prefix}


def operator(folder: Path) -> dict[str, str]:
    """What an operator sends along."""
    return {"Authorization": f"Bearer {(folder / 'operator.token').read_text().strip()}"}


def missions(service: Service) -> list[str]:
    return [name for (name,) in service.rows("select name from missions order by name")]


@pytest.mark.slow
@users
async def test_an_ordinary_user_does_not_command(uid: int) -> None:
    with open_folder(uid) as folder:
        ftp, files = free_ports(2)
        neptus = {
            "NEPTUS__ENABLED": "true",
            "NEPTUS__FTP_PORT": str(ftp),
            "NEPTUS__HTTP_PORT": str(files),
            "NEPTUS__CENTRE_LAT_DEG": "41.1855",
            "NEPTUS__CENTRE_LON_DEG": "-8.7045",
        }
        async with service_in(folder, **settings_of(uid, folder, **neptus)) as (service, api):
            own = await api.post("/missions", json=NEW_MISSION | {"name": "own"}, headers=operator(folder))
            assert own.status_code == httpx.codes.CREATED, own.text
            if uid == 0:
                assert (await api.get("/missions")).status_code == httpx.codes.OK, "the user who runs it"
            else:
                assert (await api.get("/missions")).status_code == httpx.codes.FORBIDDEN, "root is another user"

            assert await stranger("ask", service.port) == httpx.codes.FORBIDDEN
            for how in ("ask", "reset", "exit"):
                await stranger("many", how, service.port, 10)
            live = f"ws://127.0.0.1:{service.port}/api/v1/missions/{own.json()['id']}/live"
            assert await stranger("watch", live) == 4403
            assert (await stranger("panel", ftp)).startswith("530")
            # Asked to end it answers what has come, so nothing is under way any more.
            assert await service.end() == 0
        assert missions(service) == ["own"]


@pytest.mark.slow
@users
async def test_an_ordinary_user_reads_writes_and_locks_none_of_its_files(uid: int) -> None:
    with open_folder(uid) as folder:
        async with service_in(folder, **settings_of(uid, folder)) as (service, api):
            created = await api.post("/missions", json=NEW_MISSION, headers=operator(folder))
            assert created.status_code == httpx.codes.CREATED, created.text
            mission = created.json()["id"]
            run(uid, folder, "backup", "--database", service.database_url)
            run(uid, folder, "backup", "safe.db", "--database", service.database_url)
            run(uid, folder, "export", mission, "-f", "tracks.geojson", "--database", service.database_url)
            run(uid, folder, "export", mission, "-f", "tracks.kml", "-o", "k.kml", "--database", service.database_url)
            found = await stranger("files", folder)
            seen = set(modes(folder))
            assert {"fleet.db", "fleet.db-wal", "fleet.db-shm", "fleet.db-process-1", "operator.token"} <= seen
            assert {"backups", "output", "safe.db", "k.kml"} <= seen
        ours = {name for name in found["seen"] if name != "service.log"}  # the test's own
        for what in ("read", "written", "locked"):
            assert not ours & set(found[what]), what
        assert not any(name.startswith(("backups/", "output/")) for name in found["seen"]), "folders are closed"


def run(uid: int, folder: Path, *arguments: str) -> None:
    """Run a command as the service's user."""
    command = [*as_user(uid), "env", "-C", str(folder), *COMMAND]
    done = subprocess.run([*command, *arguments], capture_output=True, text=True, cwd=PROJECT, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
async def test_files_of_an_installation_made_before_are_closed_and_the_log_says_so() -> None:
    with open_folder() as folder:
        async with service_in(folder) as (service, _):
            secret = service.rows("select secret from processes")
            await service.kill()
        for path in folder.glob("fleet.db*"):
            path.chmod(0o644)
        (folder / "operator.token").chmod(0o640)
        before = folder.stat().st_mode
        async with service_in(folder, database=service.database) as (again, _):
            found = modes(folder)
            assert {mode for name, mode in found.items() if name.startswith("fleet.db")} == {"600"}, found
            assert found["operator.token"] == "600"
            lines = [line for line in again.said.splitlines() if "permissions" in line]
            assert any("fleet.db" in line and "644" in line for line in lines), again.said
            assert any("operator.token" in line for line in lines)
            assert not {*secret} & {*again.rows("select secret from processes")}, "secrets that were read are worthless"
        assert stat.S_IMODE(folder.stat().st_mode) == stat.S_IMODE(before), "the folder is the user's own"


@pytest.mark.slow
async def test_a_lock_that_a_stranger_holds_does_not_keep_a_dead_process_alive() -> None:
    with open_folder() as folder:
        async with service_in(folder) as (first, api):
            created = await api.post("/missions", json=NEW_MISSION)
            mission = f"/missions/{created.json()['id']}"
            assert (await api.post(f"{mission}/start")).status_code == httpx.codes.OK
            locks = list(folder.glob("fleet.db-process-*"))
            assert locks
            await first.kill()
            # As before the update: everyone could open it, and hold it for longer than its process lived.
            for path in locks:
                path.unlink(missing_ok=True)
                path.touch(0o644)
            blocking = await holding(*locks)
        try:
            # At the same address: what it sent to the dead process would come to itself.
            async with service_in(folder, database=first.database, port=first.port) as (again, api):
                answer = await api.get(mission, timeout=20)
                assert (answer.status_code, answer.json().get("state")) == (httpx.codes.OK, "running"), answer.text
                assert [number for (number,) in again.rows("select id from processes")] != [], again.said
        finally:
            assert blocking.stdin is not None
            blocking.stdin.close()
            await blocking.wait()


@pytest.mark.slow
async def test_backups_hold_no_secret_of_a_process() -> None:
    with open_folder() as folder:
        async with service_in(folder) as (service, _):
            ((secret,),) = service.rows("select secret from processes")
            run(0, folder, "backup", "copy.db", "--database", service.database_url)
        assert secret.encode() not in (folder / "copy.db").read_bytes()
        with closing(sqlite3.connect(folder / "copy.db")) as copy:
            assert copy.execute("select count(*) from processes").fetchone() == (1,)
