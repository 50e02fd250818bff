"""Files of pings are whole or not there, found again, and removed with their mission only; here and behind a URL."""

import hashlib
import os
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from pyftpdlib.authorizers import DummyAuthorizer
from pyftpdlib.handlers import FTPHandler
from pyftpdlib.ioloop import IOLoop
from pyftpdlib.servers import FTPServer

from app.storage.ping_files import PingFileError, PingFiles, PingPlaceError, digest_in, file_name
from tests.support.ports import free_ports

CONTENT = b"pings"
DIGEST = hashlib.sha256(CONTENT).hexdigest()
NAME = file_name("m1", 7, DIGEST)


@pytest.fixture(params=["folder", "url"])
def files(request: pytest.FixtureRequest, tmp_path: Path) -> PingFiles:
    return PingFiles(str(tmp_path / "pings") if request.param == "folder" else f"memory://{tmp_path.name}/pings")


def test_a_file_is_read_as_it_was_written(files: PingFiles) -> None:
    assert files.names() == []
    files.write(NAME, CONTENT)
    files.write(NAME, CONTENT)
    assert files.read(NAME, DIGEST) == CONTENT
    assert files.names() == files.names("m1") == [NAME]
    assert files.names("m2") == []
    assert digest_in(NAME) == DIGEST


def test_a_missing_and_a_damaged_file_are_named(files: PingFiles) -> None:
    with pytest.raises(PingFileError, match=rf"{NAME} is missing"):
        files.read(NAME, DIGEST)
    files.write(NAME, CONTENT[:-1])
    with pytest.raises(PingFileError, match=rf"{NAME} is damaged: its SHA-256 is \w+, {DIGEST} was written"):
        files.read(NAME, DIGEST)


def test_no_password_is_told_of_where_files_are() -> None:
    with pytest.raises(PingFileError, match=rf"the file of pings memory://host/pings/{NAME} is missing"):
        PingFiles("memory://watch:hun@ter2@host/pings").read(NAME, DIGEST)


def test_halves_are_removed_and_whole_files_never(files: PingFiles) -> None:
    for name in (NAME, f"{NAME}.part", "m2/other.parquet.part"):
        files.write(name, CONTENT)
    assert files.unfinished("m1") == [f"{NAME}.part"]
    assert files.unfinished("m3") == []
    files.remove_unfinished([*files.unfinished("m1"), "m1/finished-meanwhile.part"])
    assert files.unfinished("m1") == []
    assert files.read(NAME, DIGEST) == CONTENT
    assert files.unfinished("m2") == ["m2/other.parquet.part"]


def test_a_mission_is_removed_with_its_files_and_no_others(files: PingFiles) -> None:
    assert files.condemned() == []
    others = ["m1/of-another-database.parquet", "m2/other.parquet"]
    for name in (NAME, f"{NAME}.part", *others):
        files.write(name, CONTENT)
    files.remove("m1", [NAME, "m1/lost.parquet", "m2/other.parquet"])
    files.remove("m3", [])
    assert (files.names(), files.condemned()) == (others, [])


def test_what_is_left_of_a_removal_is_removed_later(files: PingFiles, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (NAME, "m1/of-another-database.parquet"):
        files.write(name, CONTENT)
    files.write("m2.removed", b"")  # by an earlier version, which noted no names

    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as kill:
        kill.setattr(files, "_remove", killed)
        with pytest.raises(KeyboardInterrupt):
            files.remove("m1", [NAME])
    assert files.condemned() == ["m1", "m2"]
    for _ in range(2):  # twice: another process may do the same
        for mission_id in ("m1", "m2"):
            files.finish_removing(mission_id)
    assert (files.names(), files.condemned()) == (["m1/of-another-database.parquet"], [])


def test_a_full_disk_does_not_keep_files_from_being_removed(files: PingFiles, monkeypatch: pytest.MonkeyPatch) -> None:
    files.write(NAME, CONTENT)

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files, "write", full)
    files.remove("m1", [NAME])
    assert files.names() == []


def test_files_are_their_owners_only_and_no_half_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = PingFiles(str(tmp_path / "pings"))
    files.write(NAME, CONTENT)
    place = tmp_path / "pings" / NAME
    assert [path.stat().st_mode & 0o777 for path in (place, place.parent, tmp_path / "pings")] == [0o600, 0o700, 0o700]

    def full(_descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        files.write("m1/next.parquet", CONTENT)
    assert [path.name for path in place.parent.iterdir()] == [place.name]


def test_the_usual_place_is_beside_the_database(tmp_path: Path) -> None:
    beside = PingFiles.beside(f"sqlite+aiosqlite:///{tmp_path / 'fleet.db'}")
    assert beside.folder == tmp_path / "pings"
    assert PingFiles.beside("postgresql+asyncpg://fleet@db/fleet").folder == Path.cwd() / "pings"
    assert PingFiles.beside("sqlite+aiosqlite:///fleet.db", "memory://pings").folder is None


@pytest.fixture
def refusing() -> Iterator[int]:
    """The port of an FTP server that lets nobody in."""

    class Handler(FTPHandler):  # type: ignore[misc]
        authorizer = DummyAuthorizer()
        auth_failed_timeout = 0

    loop = IOLoop()
    server = FTPServer(("127.0.0.1", 0), Handler, ioloop=loop)
    ended = threading.Event()

    def serve() -> None:
        while not ended.is_set():
            loop.loop(timeout=0.05, blocking=False)

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield server.address[1]
    finally:
        ended.set()
        thread.join()
        server.close_all()
        loop.close()


@pytest.mark.filterwarnings("ignore:write permissions assigned to anonymous user")
def test_errors_of_the_library_that_reaches_files_are_told_as_such(refusing: int) -> None:
    """That of FTP is no OSError, nor are those of object stores."""
    files = PingFiles(f"ftp://watch:swordfish@127.0.0.1:{refusing}/pings")
    asked: list[Callable[[], object]] = [
        files.condemned,
        lambda: files.names("m1"),
        lambda: files.read(NAME, DIGEST),
        lambda: files.write(NAME, CONTENT),
        lambda: files.unfinished("m1"),
    ]
    for ask in asked:
        with pytest.raises(
            PingPlaceError, match=rf"at ftp://127.0.0.1:{refusing}/pings cannot be reached: 530"
        ) as told:
            ask()
        assert "swordfish" not in str(told.value)


def test_a_place_where_nobody_answers_is_told_as_such() -> None:
    with pytest.raises(PingPlaceError, match=r"cannot be reached: .*refused"):
        PingFiles(f"ftp://127.0.0.1:{free_ports(1)[0]}/pings").read(NAME, DIGEST)
