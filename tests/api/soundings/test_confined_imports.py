"""Files that are sent: streamed to disk, read locked in, and nothing of the machine comes back with them."""

import asyncio
import gzip
import hashlib
import os
import platform
import socket
import sys
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.missions.errors import FileTooLargeError, ImportUnavailableError, InvalidRequestError
from app.missions.operations.imports import reader_process, uploads
from tests.support.api.rest import make_client, mission_spec, prior_text, running
from tests.support.faults.leading_out import grids, told
from tests.support.faults.service import service_in
from tests.support.paths import PROJECT

GRID: dict[str, Any] = {"crs": "EPSG:4326", "sd_m": 0.3, "positive": "down"}


@pytest.mark.slow
async def test_no_file_brings_another_one_back(
    make_settings: Any, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    files = grids(tmp_path)
    async with running(make_settings()) as server, make_client(server) as client:
        path = f"/missions/{(await client.post('/missions', json=mission_spec())).json()['id']}"
        for name, content in files.items():
            answer = await client.post(f"{path}/imports", content=content, params=GRID | {"filename": name})
            assert answer.status_code == 422, (name, answer.text)
            assert not told(answer.text), name
            assert answer.json()["errors"][0]["expected"], name
        answer = await client.put(
            f"{path}/reference", content=files["external.nc"], params=GRID | {"filename": "external.nc"}
        )
        assert answer.status_code == 422
        crs = f"+proj=longlat +ellps=bessel +nadgrids={tmp_path / 'private.key'} +type=crs"
        answer = await client.post(
            f"{path}/imports", content=b"-8.7049 41.1851 5\n", params=GRID | {"filename": "a.xyz", "crs": crs}
        )
        assert answer.status_code == 422
        (problem,) = answer.json()["errors"]
        assert problem.pop("value") == crs, "that is what was sent"
        assert not told(str(problem))
        assert (await client.get(f"{path}/imports")).json() == []
        assert (await client.get(f"{path}/reference")).status_code == 404
        events = await client.get(f"{path}/events", headers={"Accept": "application/json"})
        assert not told(events.text)
    assert not told("".join(capfd.readouterr()))


@pytest.mark.slow
@pytest.mark.skipif(platform.machine() not in ("x86_64", "aarch64"), reason="no list of system calls for it")
async def test_a_filter_that_forbids_to_lock_the_reader_in_is_told_from_a_kernel_that_cannot(tmp_path: Path) -> None:
    filtered = [sys.executable, str(PROJECT / "tests" / "support" / "faults" / "forbidding.py")]
    async with service_in(tmp_path, prefix=filtered) as (_, api):
        path = f"/missions/{(await api.post('/missions', json=mission_spec())).json()['id']}"
        answer = await api.post(f"{path}/imports", content=b"-8.7049 41.1851 5\n", params=GRID | {"filename": "a.xyz"})
        assert answer.status_code == 503, answer.text
        assert "the service is forbidden to use Landlock and seccomp" in answer.json()["detail"]
        assert "SystemCallFilter=" in answer.json()["remedy"]


@pytest.mark.slow
async def test_what_a_file_says_is_not_quoted(client: httpx.AsyncClient, mission: dict[str, Any]) -> None:
    path = f"/missions/{mission['id']}/imports"
    for name, content in {
        "a.csv": b"lon,lat,depth\n-8.7049,41.1851,hunter2",
        "b.xyz": b"hunter2 1 2\n",
        "c.csv": b"lon,lat,depth\n-8.7049,41.1851,31337.5",
        "d.csv": b"lon,lat,depth\n31337.5,41.1851,5",
        "e.asc": b"ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\nhunter2 1\n2 31337.5\n",
        "f.tif": b"hunter2",
        "g.nc": b"CDF\x01hunter2",
        "h.csv.gz": gzip.compress(b"lon,lat,depth,sd\n-8.7049,41.1851,5,31337.5"),
    }.items():
        answer = await client.post(path, content=content, params={"crs": "EPSG:4326", "sd_m": 0.3, "filename": name})
        assert answer.status_code == 422, (name, answer.text)
        assert "hunter2" not in answer.text, name
        assert "31337" not in answer.text, name


def names_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def lies_in(descriptor: int, folder: Path) -> bool:
    return Path(f"/proc/self/fd/{descriptor}").readlink().is_relative_to(folder)


async def pieces(content: bytes, size: int) -> AsyncIterator[bytes]:
    for begin in range(0, len(content), size):
        yield content[begin : begin + size]


async def test_an_upload_lies_on_disk_without_a_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    content = os.urandom(3 * 2**20 + 5)
    async with uploads.Uploads().receive(pieces(content, 70_001), len(content)) as upload:
        assert names_in(tmp_path) == []
        assert lies_in(upload.file.fileno(), tmp_path)
        status = os.fstat(upload.file.fileno())
        assert status.st_mode & 0o077 == 0
        assert (upload.size_bytes, status.st_size) == (len(content), len(content))
        assert upload.sha256 == hashlib.sha256(content).hexdigest()
        assert upload.file.read() == content
        with pytest.raises(OSError, match="write"):
            upload.file.write(b"x")
    assert upload.file.closed


async def test_an_upload_ends_at_the_limit_and_gives_its_place_back() -> None:
    taken = uploads.Uploads()
    before = names_in(Path("/proc/self/fd"))
    for _ in range(2 * uploads.MAX_AT_ONCE):
        came = 0

        async def endless() -> AsyncIterator[bytes]:
            nonlocal came
            while True:
                came += 1000
                yield bytes(1000)

        with pytest.raises(FileTooLargeError):
            async with taken.receive(endless(), 10_000):
                raise AssertionError("never there")
        assert came == 11_000
    assert names_in(Path("/proc/self/fd")) == before


async def test_more_uploads_than_the_disk_is_meant_for_are_put_off() -> None:
    taken = uploads.Uploads()
    held = [taken.receive(pieces(b"1 2 3", 5), 100) for _ in range(uploads.MAX_AT_ONCE)]
    for one in held:
        await one.__aenter__()
    with pytest.raises(ImportUnavailableError, match="as many as can be"):
        await taken.receive(pieces(b"1 2 3", 5), 100).__aenter__()
    await held.pop().__aexit__(None, None, None)
    async with taken.receive(pieces(b"1 2 3", 5), 100) as upload:
        assert upload.size_bytes == 5
    for one in held:
        await one.__aexit__(None, None, None)


async def test_who_waits_too_long_for_others_files_is_told_to_come_back(
    client: httpx.AsyncClient, mission: dict[str, Any], server: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    reader = server.config.app.state.edge.service.imports._reader
    path = f"/missions/{mission['id']}/imports"
    monkeypatch.setattr(reader_process, "WAITING_TIMEOUT_S", 0.01)
    async with reader.turn():
        answer = await client.post(path, content=prior_text(), params={"filename": "a.csv"})
        assert (answer.status_code, answer.json()["type"]) == (503, "urn:bathyfleet:problem:import-unavailable")
        assert int(answer.headers["Retry-After"]) > 0
        # Nobody else waits for it.
        assert (await client.get(path)).json() == []
    assert (await client.post(path, content=prior_text(), params={"filename": "a.csv"})).status_code == 201


async def test_an_upload_that_breaks_off_leaves_nothing(
    client: httpx.AsyncClient, mission: dict[str, Any], server: Any
) -> None:
    path = f"/api/v1/missions/{mission['id']}/imports?filename=a.csv"
    edge = server.config.app.state.edge
    host, port = client.base_url.host, client.base_url.port
    reader, writer = await asyncio.open_connection(host, port)
    writer.write(f"POST {path} HTTP/1.1\r\nHost: {host}\r\nContent-Length: 1000000\r\n\r\n1,2,3\n".encode())
    await writer.drain()
    writer.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
    writer.close()
    await asyncio.wait_for(reader.read(), 10)
    # Every place is free again once the others have been taken in.
    answers = [client.post(path.removeprefix("/api/v1"), content=b"") for _ in range(uploads.MAX_AT_ONCE)]
    assert {answer.status_code for answer in await asyncio.gather(*answers)} == {422}
    assert not edge.service.uploads._open
    assert (await client.post(path.removeprefix("/api/v1"), content=prior_text())).status_code == 201


def test_the_reading_process_learns_nothing_of_the_service(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BATHYFLEET_DATABASE_URL", "postgresql://a:secret@b/c")
    monkeypatch.setenv("PGPASSWORD", "secret")
    given = reader_process.reader_environment()
    assert "secret" not in " ".join(given.values())
    assert not [name for name in given if name.startswith(("BATHYFLEET", "PG", "HOME", "SSH"))]


@pytest.mark.parametrize("break_", ["short", "long", "shape", "huge", "depth", "nan", "sd"])
def test_what_the_reading_process_hands_back_is_checked(break_: str, tmp_path: Path) -> None:
    import numpy as np

    table, shape = np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0], [0.1, 0.2]]), (4, 2)
    with (tmp_path / "result").open("w+b") as file:
        file.write(table.tobytes())
        file.flush()
        np.testing.assert_array_equal(reader_process._values(file, shape, None), table.T)
        if break_ == "short":
            file.truncate(63)
        elif break_ == "long":
            file.truncate(65)
        elif break_ == "shape":
            shape = (2, 4)
        elif break_ == "huge":
            shape = (4, 2**61)
        else:
            row = {"depth": 2, "nan": 0, "sd": 3}[break_]
            table[row, 1] = {"depth": 1e9, "nan": np.nan, "sd": -1.0}[break_]
            file.seek(0)
            file.write(table.tobytes())
        with pytest.raises(InvalidRequestError, match="broke off"):
            reader_process._values(file, shape, None)


@pytest.mark.parametrize(
    "said",
    [b"", b"{}", b"[]", b'{"confined": {}, "shape": ["4"]}', b'{"confined": {}, "notes": ["' + b"x" * 501 + b'"]}'],
)
def test_an_answer_of_another_form_is_none(said: bytes) -> None:
    assert reader_process._answer(said) is None
