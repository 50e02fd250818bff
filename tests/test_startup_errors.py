"""What keeps the service from starting is said in one line, with what to do about it."""

import re
import socket
import sqlite3
import subprocess
from contextlib import closing
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.support.commands import COMMAND, environment
from tests.support.faults.other_users import SERVICE, as_user, needs_root, open_folder
from tests.support.ports import free_ports


def start(folder: Path, *words: str, **variables: str) -> tuple[int, str]:
    """How ``bathyfleet serve`` ends in a folder, and all that it says; log lines that are no errors left out."""
    serve = [*words, *COMMAND, "serve", "--port", "0", "--log-level", "error"]
    own = environment(NO_COLOR="1", **variables)
    done = subprocess.run(serve, cwd=folder, env=own, capture_output=True, text=True, check=False, timeout=200)
    return done.returncode, done.stdout + done.stderr


def check_one_line(said: str, *parts: str) -> None:
    assert said.count("\n") == 1, said
    assert said.startswith("error: ")
    for part in parts:
        assert part in said


def foreign(path: Path, *statements: str) -> None:
    with closing(sqlite3.connect(path)) as connection:
        for statement in statements:
            connection.execute(statement)
        connection.commit()


def test_settings_that_are_not_utf8(tmp_path: Path) -> None:
    (tmp_path / "bathyfleet.toml").write_bytes("# Leixões\nport = 1\n".encode("latin-1"))
    code, said = start(tmp_path)
    assert code == 2
    check_one_line(said, "bathyfleet.toml is not UTF-8", "byte 6 is 0xf5")


@pytest.mark.parametrize(
    ("url", "parts"),
    [
        ("nosuch://me:swordfish@x/y", ["nosuch:// is not known", "use a folder, or a URL such as s3://bucket/pings"]),
        ("s3://me:swordfish@b/p", ["s3:// needs a package that is not installed (Install s3fs", "or name a folder"]),
    ],
)
def test_a_place_for_pings_that_nothing_here_reaches(tmp_path: Path, url: str, parts: list[str]) -> None:
    if url.startswith("s3:") and find_spec("s3fs") is not None:
        pytest.skip("s3fs is installed")
    code, said = start(tmp_path, BATHYFLEET_PINGS_URL=url)
    assert code == 2
    check_one_line(said, "pings_url (from BATHYFLEET_PINGS_URL): ", *parts)
    assert "swordfish" not in said
    assert not list(tmp_path.iterdir())


def test_a_database_of_a_newer_version(tmp_path: Path) -> None:
    foreign(
        tmp_path / "bathyfleet.db",
        "create table alembic_version (version_num varchar(32) primary key)",
        "insert into alembic_version values ('9999')",
    )
    code, said = start(tmp_path)
    assert code == 1
    check_one_line(said, "bathyfleet.db is at revision 9999", "newer version", "database_url")


def test_a_database_of_another_program_is_left_alone(tmp_path: Path) -> None:
    file = tmp_path / "bathyfleet.db"
    foreign(file, "create table bookmarks (url text)", "insert into bookmarks values ('kept')")
    before = file.read_bytes()
    code, said = start(tmp_path)
    assert code == 1
    check_one_line(said, "not one of bathyfleet", "bookmarks")
    with closing(sqlite3.connect(file)) as connection:
        assert [name for (name,) in connection.execute("select name from sqlite_master")] == ["bookmarks"]
    assert file.read_bytes()[100:] == before[100:], "but for the head, which counts openings"


def test_a_file_that_is_no_database(tmp_path: Path) -> None:
    (tmp_path / "bathyfleet.db").write_text("a list of things\n" * 100)
    code, said = start(tmp_path)
    assert code == 1
    check_one_line(said, "file is not a database", "database_url")
    assert (tmp_path / "bathyfleet.db").read_text() == "a list of things\n" * 100


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    code, said = start(tmp_path, BATHYFLEET_DATABASE_URL="sqlite+aiosqlite:///absent/fleet.db")
    assert code == 1
    check_one_line(said, "there is no folder absent", "database_url")


@needs_root
@pytest.mark.parametrize("mode", [0o555, 0o000], ids=["unwritable", "unreadable"])
def test_a_folder_of_somebody_else(mode: int) -> None:
    with open_folder() as folder:
        (folder / "closed").mkdir()
        (folder / "closed").chmod(mode)
        prefix = [*as_user(SERVICE), "env", f"HOME={folder}"]
        code, said = start(folder, *prefix, BATHYFLEET_DATABASE_URL="sqlite+aiosqlite:///closed/fleet.db")
    assert code == 1
    check_one_line(said, "the database cannot be used", "ermission denied", "database_url")


@needs_root
def test_a_database_that_may_only_be_read() -> None:
    with open_folder(SERVICE) as folder:
        foreign(folder / "bathyfleet.db", "pragma user_version = 1")
        (folder / "bathyfleet.db").chmod(0o444)
        code, said = start(folder, *as_user(SERVICE), "env", f"HOME={folder}")
    assert code == 1
    check_one_line(said, "the database cannot be used", "readonly", "database_url")


@pytest.fixture(scope="module")
def beside_another(tmp_path_factory: pytest.TempPathFactory) -> tuple[int, Path, int, str]:
    """A UDP port that somebody has, the folder of a start that wants it, and how that ended."""
    folder = tmp_path_factory.mktemp("beside")
    (port,) = free_ports(1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", port))
        own = {"BATHYFLEET_IMC__ENABLED": "true", "BATHYFLEET_IMC__LOOPBACK_ONLY": "true"}
        return port, folder, *start(folder, BATHYFLEET_IMC__PORT=str(port), **own)


@pytest.mark.slow
def test_a_udp_port_that_is_taken(beside_another: tuple[int, Path, int, str]) -> None:
    port, _, code, said = beside_another
    assert code == 1
    check_one_line(said, f"UDP port {port} cannot be bound", "stop it or set another port")


@pytest.mark.slow
def test_an_interface_that_this_machine_has_not(tmp_path: Path) -> None:
    own = {"BATHYFLEET_IMC__ENABLED": "true", "BATHYFLEET_IMC__INTERFACES": '["192.0.2.7"]'}
    code, said = start(tmp_path, BATHYFLEET_IMC__PORT=str(free_ports(1)[0]), **own)
    assert code == 1
    check_one_line(said, "192.0.2.7")


def test_nothing_remains_of_a_start_that_failed(beside_another: tuple[int, Path, int, str]) -> None:
    _, folder, _, _ = beside_another
    assert (folder / "bathyfleet.db").exists(), "it came so far"
    assert not [path.name for path in folder.iterdir() if re.search(r"-process-", path.name)]


def test_a_variable_that_overrules_the_settings_file_is_told(tmp_path: Path) -> None:
    (tmp_path / "bathyfleet.toml").write_text('database_url = "sqlite+aiosqlite:///other/fleet.db"\n')
    variables = {"BATHYFLEET_DATABASE_URL": "sqlite+aiosqlite:///absent/fleet.db", "BATHYFLEET_LOG_FORMAT": "json"}
    serve = [*COMMAND, "serve", "--port", "0"]
    done = subprocess.run(
        serve, cwd=tmp_path, env=environment(**variables), capture_output=True, text=True, check=False
    )
    assert '"setting": "database_url", "variable": "BATHYFLEET_DATABASE_URL"' in done.stdout + done.stderr
