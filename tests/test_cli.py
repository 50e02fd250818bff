"""The command line: what a user sees and which code a script gets."""

import asyncio
import json
import os
import re
import signal
import socket
import sqlite3
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pytest
import rasterio
import typer.main

from app.cli import app as command_line
from app.cli import evaluations, main
from app.mapping.coordinates.georeference import LocalFrame
from app.storage.database import Database
from app.storage.ping_files import PingFiles
from tests.support import commands
from tests.support.api.rest import mission_spec, soundings
from tests.support.commands import serving
from tests.support.imc import log_writer as writer
from tests.support.mapping.multibeam import line, write_gsf, write_kmall
from tests.support.paths import PROJECT
from tests.support.ports import free_ports
from tests.support.storage.rows import PING_FILE, PING_FILE_NAME, mission, ping_chunk

COMMANDS = (
    "serve",
    "demo",
    "evaluate",
    "export",
    "report",
    "import",
    "import-log",
    "tide",
    "doctor",
    "migrate",
    "token",
    "audit",
    "backup",
    "restore",
    "prune",
    "missions",
)


@dataclass
class Ended:
    """How a command ended."""

    code: int
    stdout: str
    stderr: str


Run = Callable[..., Ended]


@pytest.fixture
def environment() -> dict[str, str]:
    return commands.environment(COLUMNS="200", NO_COLOR="1")


@pytest.fixture
def bathyfleet(
    tmp_path: Path,
    environment: dict[str, str],
    monkeypatch: pytest.MonkeyPatch,
    capsysbinary: pytest.CaptureFixture[bytes],
) -> Run:
    """Run the console script's function with these arguments in an empty folder."""

    def run(*arguments: str, **variables: str) -> Ended:
        with monkeypatch.context() as patch:
            patch.chdir(tmp_path)
            patch.setattr(os, "environ", environment | variables)
            patch.setattr(sys, "argv", ["bathyfleet", *arguments])
            with pytest.raises(SystemExit) as ended:
                main()
        out, err = capsysbinary.readouterr()
        return Ended(int(ended.value.code or 0), out.decode(), err.decode())

    return run


def test_help_lists_every_command_without_loading_the_service(bathyfleet: Run) -> None:
    shown = bathyfleet("--help")
    assert shown.code == 0
    for command in COMMANDS:
        assert command in shown.stdout
    imported = subprocess.run(
        [sys.executable, "-X", "importtime", "-c", "import app.cli"],
        cwd=PROJECT,
        capture_output=True,
        text=True,
        check=True,
    )
    for heavy in ("numpy", "fastapi", "sqlalchemy", "pydantic", "matplotlib"):
        assert f" {heavy}\n" not in imported.stderr


@pytest.mark.parametrize("command", [*COMMANDS, "evaluate explore", "token create"])
def test_every_command_explains_its_options(bathyfleet: Run, command: str) -> None:
    shown = bathyfleet(*command.split(), "--help")
    assert shown.code == 0
    assert "Options" in shown.stdout


def every_command(command: Any, words: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Every command and group of commands, with the words that it is called by."""
    if words == ("evaluate",):
        command = typer.main.get_command(evaluations())
    yield words, command
    for name, inner in getattr(command, "commands", {}).items():
        yield from every_command(inner, (*words, name))


def test_the_help_shows_all_that_is_said_of_an_option_and_its_default(
    bathyfleet: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("typer.rich_utils.MAX_WIDTH", 300)
    for words, command in every_command(typer.main.get_command(command_line)):
        shown = bathyfleet(*words, "-h")
        assert (shown.code, shown.stderr) == (0, ""), words
        for option in command.params:
            assert (option.help or "") in shown.stdout, (words, option.name)
            if isinstance(option.show_default, str):
                assert f"[default: ({option.show_default})]" in shown.stdout, (words, option.name)


@pytest.mark.parametrize(
    ("arguments", "variables", "code", "message"),
    [
        (["serve", "--host", "0.0.0.0"], {}, 1, "there is no access token: make one with 'bathyfleet token create"),
        (["serve", "--database", "mysql://h"], {}, 2, "database_url (from the command line): use sqlite"),
        (
            ["serve", "--database", "sqlite:////no/folder/x.db"],
            {},
            1,
            "the database cannot be used: there is no folder",
        ),
        (["serve"], {"BATHYFLEET_PROT": "1"}, 2, "did you mean BATHYFLEET_PORT?"),
        (["serve"], {"BATHYFLEET_AUTO_MIGRATE": "false"}, 1, "the database is empty"),
        (["serve", "--time-scale", "0"], {}, 2, "greater than 0"),
        (["serve", "--host", "192.0.2.77", "--insecure"], {}, 1, "cannot listen on 192.0.2.77:8080"),
        (["export", "nowhere"], {}, 1, "there is no database /"),
        (["export", "nowhere", "--format", "doc"], {}, 2, "'doc' is not one of tif, nc, bag"),
        (
            ["export", "nowhere", "--out", "map.xyz"],
            {},
            2,
            "map.xyz would be a GeoTIFF: say the kind of",
        ),
        (["export", "nowhere", "--interval", "1"], {}, 2, "tif does not depend on it, geojson, kml"),
        (["export", "nowhere", "--format", "csv", "--vehicle", "a"], {}, 2, "does not depend on it, soundings.geojson"),
        (["export", "nowhere", "--format", "xyz", "--order", "special"], {}, 2, "does not depend on it, tif, nc,"),
        (
            ["export", "nowhere", "--format", "vr.bag", "--crs", "utm"],
            {},
            2,
            "vr.bag does not depend on it, tif, nc",
        ),
        (["report", "nowhere", "--out", "x.doc"], {}, 2, "x.doc ends in none of .pdf, .html"),
        (["report", "nowhere", "--lang", "xx"], {}, 2, "'xx' is not one of en, pt"),
        (["import-log", "nowhere", "Data.lsf"], {}, 1, "there is no database /"),
        (["sites", "list"], {}, 1, "there is no database /"),
        (["audit"], {}, 1, "there is no database /"),
        (["prune", "--days", "3"], {}, 1, "there is no database /"),
        (["token", "create", "x", "--role", "king"], {}, 2, "king"),
        (["token", "create", "x", "--role", "viewer", "--vehicle", "a"], {}, 2, "only a token of role vehicle"),
        (["token", "create", "x", "--role", "vehicle", "--vehicle", "a b"], {}, 2, "is no name of a vehicle"),
        (["token", "create", "x", "--days", "1e9"], {}, 2, "--days"),
        (["token", "revoke", "zzz"], {}, 2, "no valid token has an id that begins with 'zzz'"),
        (["migrate", "--down-to", "nonsense"], {}, 1, "Can't locate revision"),
        (["demo", "--terrain", "nowhere.npz"], {}, 2, "does not exist"),
        (["demo", "--vehicles", "0"], {}, 2, "--vehicles"),
        (["demo", "--search", "quarry"], {}, 1, "quarry"),
        (["demo", "--minutes", "5", "--km", "1"], {}, 1, "--minutes and --km are given"),
        (["demo", "--minutes", "0"], {}, 2, "--minutes"),
        (["demo", "--search", "harbour", "--km", "1"], {}, 1, "a search is as long as its time window"),
        (["evaluate", "explore"], {}, 2, "--terrain"),
        (["import", "nowhere", "absent.xyz"], {}, 2, "does not exist"),
        (["tide", "nowhere", "--datum", "4326"], {}, 1, "datum_epsg is 4326"),
        (["tide", "nowhere", "--url", "http://127.0.0.1:9"], {}, 1, "does not answer"),
        (["tide", "nowhere", __file__, "--level", "1"], {}, 2, "the table's levels would count: give one of them"),
        (["adjust", "nowhere", "--undo", "--fixes", __file__], {}, 2, "positions as they came have no fixes"),
        (["patch-test", "nowhere", "rover", "--position-sd", "0"], {}, 1, "position_sd_m is 0.0"),
        (["patch-test", "nowhere", "rover"], {}, 1, "there is no database /"),
        (["missions", "list", "--state", "runing"], {}, 2, "'runing' is not one of draft, ready, running"),
        (["fly"], {}, 2, "No such command 'fly'"),
    ],
)
def test_expected_errors_are_said_without_a_traceback(
    bathyfleet: Run, arguments: list[str], variables: dict[str, str], code: int, message: str
) -> None:
    ended = bathyfleet(*arguments, **variables)
    assert ended.code == code, ended.stderr
    assert message in ended.stderr
    assert "Traceback" not in ended.stderr
    assert ended.stdout == ""


def test_an_interrupt_that_compiled_code_turned_into_an_error_ends_as_any_other(
    bathyfleet: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unpickle() -> None:
        raise SystemError("_numba_unpickle returned a result with an exception set") from KeyboardInterrupt()

    monkeypatch.setattr("app.cli.evaluations", unpickle)
    ended = bathyfleet("evaluate", "survey")
    assert (ended.code, ended.stdout, ended.stderr) == (130, "", "")


@pytest.mark.slow
def test_whatever_is_listed_ends_alike_when_nobody_reads_it(
    bathyfleet: Run, tmp_path: Path, environment: dict[str, str]
) -> None:
    with serving(tmp_path, environment) as (_, url), httpx.Client(base_url=f"{url}/api/v1") as client:
        mission = client.post("/missions", json=mission_spec()).json()["id"]
        client.post(f"/missions/{mission}/measurements", json={"items": soundings(12)})
        reader, writer = os.pipe()
        os.close(reader)
        begun = {
            words: subprocess.Popen(
                [*commands.COMMAND, *words.split()],
                cwd=tmp_path,
                env=environment,
                stdout=writer,
                stderr=subprocess.PIPE,
                text=True,
            )
            for words in (
                f"missions list --url {url}",
                f"export {mission} --format csv --out -",
                "export --formats",
                "audit",
                "audit --format csv",
                "audit --format json",
                "token list --json",
                "--help",
            )
        }
        os.close(writer)
        ended = {words: (process.communicate()[1], process.returncode) for words, process in begun.items()}
    assert ended == dict.fromkeys(begun, ("", 1))


def test_a_port_that_is_taken_is_said(bathyfleet: Run) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        ended = bathyfleet("serve", "--port", str(taken.getsockname()[1]))
    assert ended.code == 1
    assert "Address already in use; choose another with --port or --host" in ended.stderr
    assert "Traceback" not in ended.stderr


def test_migrate_goes_up_and_down(bathyfleet: Run) -> None:
    assert "from revision empty to" in bathyfleet("migrate").stdout
    assert "already" in bathyfleet("migrate").stdout
    assert "to empty" in bathyfleet("migrate", "--down-to", "base").stdout


def test_tokens_are_made_listed_and_revoked(bathyfleet: Run) -> None:
    made = bathyfleet("token", "create", "Maria", "--role", "viewer", "--days", "30")
    assert re.fullmatch(r"bf_[\w-]{43}\n", made.stdout)
    assert "bathyfleet.db, so a new one was made" in made.stderr
    assert "was made" not in bathyfleet("token", "create", "Rui").stderr
    _, listed = json.loads(bathyfleet("token", "list", "--json").stdout)
    assert (listed["name"], listed["role"], listed["revoked_at"]) == ("Maria", "viewer", None)
    assert listed["expires_at"] > listed["created_at"]
    assert listed["id"] in bathyfleet("token", "list").stdout
    assert bathyfleet("token", "revoke", listed["id"][:8]).code == 0
    _, revoked = json.loads(bathyfleet("token", "list", "--json").stdout)
    assert revoked["revoked_at"]


def test_what_cannot_be_written_into_the_audit_log_is_done_and_said_to_be_in_none(
    bathyfleet: Run, tmp_path: Path
) -> None:
    bathyfleet("migrate")
    bathyfleet("migrate", "--down-to", "0018")
    with closing(sqlite3.connect(tmp_path / "bathyfleet.db")) as connection:
        connection.execute("create trigger full before insert on audit begin select raise(abort, 'no room'); end")
    for command, told in (
        (["migrate"], "from revision 0018 to"),
        (["token", "create", "Maria"], "bf_"),
        (["backup", "copy.db"], "copy.db is written and checked"),
        (["restore", "copy.db", "--replace"], "copy.db is restored"),
    ):
        ended = bathyfleet(*command)
        assert (ended.code, told in ended.stdout) == (0, True), (command, ended)
        assert "it is done, but not in the audit log: no room\n" in ended.stderr


def test_lists_are_whole_in_a_narrow_terminal(bathyfleet: Run) -> None:
    bathyfleet("token", "create", "Maria", "--role", "operator", "--days", "30")
    (listed,) = json.loads(bathyfleet("token", "list", "--json").stdout)
    (noted,) = [json.loads(line) for line in bathyfleet("audit", "--format", "json").stdout.splitlines()]
    tokens, audit = (bathyfleet(*words, COLUMNS="80").stdout for words in (["token", "list"], ["audit"]))
    assert "…" not in tokens + audit
    assert noted["time"][:19] + "Z" in audit
    columns = zip(*(line.split("│")[1:-1] for line in tokens.splitlines() if line.startswith("│")), strict=True)
    assert listed["expires_at"] in ["".join(part.strip() for part in column) for column in columns]


def test_commands_are_written_down_and_the_whole_is_backed_up_and_restored(bathyfleet: Run, tmp_path: Path) -> None:
    bathyfleet("token", "create", "Maria", "--role", "viewer")
    assert bathyfleet("token", "revoke", "none").code == 2
    made = bathyfleet("backup", "copies")
    assert (made.code, "1 tokens" in made.stdout) == (0, True)
    (copy,) = tmp_path.rglob("copies/bathyfleet-*.db")
    assert bathyfleet("backup", "--verify", str(copy)).code == 0
    assert bathyfleet("restore", str(copy)).code == 1
    assert bathyfleet("restore", str(copy), "--replace").code == 0
    (tmp_path / "pings" / "m1").mkdir(parents=True)
    (tmp_path / "pings" / "m1" / "another's.parquet").touch()
    pruned = bathyfleet("prune", "--days", "30", "--apply").stdout
    assert pruned.startswith("0 missions removed")
    assert f"1 files of pings in {tmp_path / 'pings'} are of no mission of this database and stay" in pruned
    lines = [json.loads(line) for line in bathyfleet("audit", "--format", "json").stdout.splitlines()]
    assert [(line["action"], line["result"]) for line in lines] == [
        ("restore", "done"),
        ("token revoke", "refused"),
        ("token create", "done"),
    ]
    assert {line["origin"] for line in lines} == {"command line"}
    assert "Maria" in bathyfleet("audit").stdout
    assert bathyfleet("audit", "--format", "csv").stdout.startswith("id,time,actor,role,origin,action")


async def store_pings(file: Path) -> None:
    """Put a mission with a file of pings into a database."""
    database = Database(f"sqlite+aiosqlite:///{file}")
    async with database.writing() as session:
        session.add(mission("m1"))
        await session.flush()
        session.add(ping_chunk())
    await database.close()
    PingFiles.beside(database.url).write(PING_FILE_NAME, PING_FILE)


def test_files_of_pings_that_are_not_beside_a_backup_are_said_to_be_missing(bathyfleet: Run, tmp_path: Path) -> None:
    bathyfleet("migrate")
    asyncio.run(store_pings(tmp_path / "bathyfleet.db"))
    assert "and 1 files of pings" in bathyfleet("backup", "copy.db").stdout
    (tmp_path / "copy.db-pings").rename(tmp_path / "away")
    sound = bathyfleet("backup", "--verify", "copy.db")
    assert (sound.code, "copy.db is sound" in sound.stdout) == (0, True)
    assert f"1 of its files of pings are in {tmp_path / 'pings'} only: copy them to " in sound.stderr
    (tmp_path / "pings").rename(tmp_path / "lost")
    for words in (["backup", "--verify", "copy.db"], ["restore", "copy.db", "--replace"]):
        refused = bathyfleet(*words)
        assert (refused.code, refused.stdout) == (1, "")
        assert f"1 of 1 files of pings are not in {tmp_path / 'copy.db-pings'}, where they belong" in refused.stderr
        assert f"Copy the folder of pings_url to {tmp_path / 'copy.db-pings'}" in refused.stderr


def at_revision(file: Path, revision: str) -> None:
    with closing(sqlite3.connect(file)) as connection:
        connection.execute("update alembic_version set version_num = ?", (revision,))
        connection.commit()


@pytest.mark.parametrize("words", [["migrate"], ["migrate", "--down-to", "base"]])
def test_another_program_s_database_is_not_migrated(bathyfleet: Run, tmp_path: Path, words: list[str]) -> None:
    with closing(sqlite3.connect(tmp_path / "bathyfleet.db")) as connection:
        connection.execute("create table cats (name text)")
    refused = bathyfleet(*words)
    assert refused.code == 1, refused.stdout
    assert "bathyfleet.db is not one of bathyfleet: it holds other tables (cats); nothing was changed" in refused.stderr
    with closing(sqlite3.connect(tmp_path / "bathyfleet.db")) as connection:
        assert connection.execute("select name from sqlite_master").fetchall() == [("cats",)]


def test_a_newer_version_s_database_is_neither_changed_nor_put_in_place(bathyfleet: Run, tmp_path: Path) -> None:
    bathyfleet("token", "create", "Maria")
    assert bathyfleet("backup", "copy.db").code == 0
    file, copy = tmp_path / "bathyfleet.db", tmp_path / "copy.db"
    at_revision(copy, "9999")
    before = file.read_bytes()
    refused = bathyfleet("restore", str(copy), "--replace")
    assert (refused.code, refused.stdout) == (1, "")
    assert "copy.db is at revision 9999, which this version does not know" in refused.stderr
    assert "Restore it with the version that wrote it; nothing was changed" in refused.stderr
    assert file.read_bytes() == before
    assert list(tmp_path.glob("*.before*")) == []

    at_revision(file, "9999")
    for words in (["migrate"], ["migrate", "--down-to", "0001"], ["token", "list"]):
        refused = bathyfleet(*words)
        assert refused.code == 1
        assert "bathyfleet.db is at revision 9999, which this version does not know" in refused.stderr
        assert re.search(r"let it go back by 'bathyfleet migrate --down-to \d{4}' there", refused.stderr)
    made = bathyfleet("backup", "newer.db")
    assert (made.code, "revision 9999" in made.stdout) == (0, True)
    assert "the database is another version's" in made.stderr


def test_a_backup_that_the_start_would_not_bring_up_to_date_is_restored_and_said_to_be(
    bathyfleet: Run, tmp_path: Path
) -> None:
    bathyfleet("token", "create", "Maria")
    assert bathyfleet("backup", "copy.db").code == 0
    at_revision(tmp_path / "copy.db", "0018")
    restored = bathyfleet("restore", "copy.db", "--replace", BATHYFLEET_AUTO_MIGRATE="false")  # as with PostgreSQL
    assert restored.code == 0
    assert "what was there before is now" in restored.stdout
    assert "copy.db is restored" in restored.stdout
    assert "run 'bathyfleet migrate'" in restored.stderr


def test_a_way_down_is_written_down_before_and_only_where_it_is_gone(bathyfleet: Run) -> None:
    newest = re.search(r"to (\d{4})", bathyfleet("migrate").stdout)
    assert newest is not None
    assert bathyfleet("migrate", "--down-to", "nonsense").code == 1
    assert bathyfleet("migrate", "--down-to", newest[1]).code == 0
    assert "to 0018" in bathyfleet("migrate", "--down-to", "0018").stdout
    bathyfleet("migrate")
    lines = [json.loads(line) for line in bathyfleet("audit", "--format", "json").stdout.splitlines()]
    assert [line["target"] for line in lines] == [
        f"0018 to {newest[1]}",
        f"{newest[1]} down to 0018",
        f"empty to {newest[1]}",
    ]


@pytest.mark.parametrize(
    "words", [["token", "list"], ["audit"], ["sites", "list"], ["export", "x"], ["prune", "--days", "30"]]
)
def test_what_only_reads_leaves_an_older_database_as_it_is(bathyfleet: Run, words: list[str]) -> None:
    bathyfleet("migrate")
    bathyfleet("migrate", "--down-to", "0018")
    refused = bathyfleet(*words)
    assert refused.code == 1, refused
    assert re.search(r"is at revision 0018, this version needs \d{4}: run 'bathyfleet migrate'", refused.stderr)
    assert "from revision 0018 to" in bathyfleet("migrate").stdout


def test_a_backup_brings_an_older_database_up_to_nothing(bathyfleet: Run, tmp_path: Path) -> None:
    """A service of the older version may still be running on it."""
    bathyfleet("migrate")
    bathyfleet("migrate", "--down-to", "0018")
    made = bathyfleet("backup", "older.db")
    assert (made.code, "revision 0018" in made.stdout) == (0, True)
    assert "it stays as it is" in made.stderr
    assert "from revision 0018 to" in bathyfleet("migrate").stdout


@pytest.mark.slow
def test_a_mission_is_served_exported_and_found_again(
    bathyfleet: Run, tmp_path: Path, environment: dict[str, str]
) -> None:
    with serving(tmp_path, environment) as (process, url), httpx.Client(base_url=f"{url}/api/v1") as client:
        mission: dict[str, Any] = client.post("/missions", json=mission_spec()).json()
        client.post(f"/missions/{mission['id']}/measurements", json={"items": soundings(12)})
        exported_beside = bathyfleet("export", mission["id"], "--format", "csv", "--out", "-")
        assert exported_beside.stdout.count("rover") == 12
        back = bathyfleet("migrate", "--down-to", "0001")
        assert (back.code, "Stop the service first" in back.stderr) == (1, True)
        tide = ("tide", mission["id"], "--level", "1")
        refused = bathyfleet(*tide)
        assert refused.code == 1
        assert "in a service that would not notice. Name that service with --url" in refused.stderr
        assert bathyfleet(*tide, "--url", url).code == 0
        assert bathyfleet("tide", mission["id"], "--level", "0", "--url", url).code == 0
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 0  # a first start may still be compiling
    written = bathyfleet("export", mission["id"][:8], "--format", "tif", "--out", "maps/basin.tif")
    assert written.code == 0, written.stderr
    with rasterio.open(tmp_path / "maps" / "basin.tif") as raster:
        assert raster.count >= 2
    log = writer.write(tmp_path / "Data.lsf", writer.survey(20))
    imported = bathyfleet("import-log", mission["id"][:8], str(log), "nowhere.lsf")
    assert imported.code == 1
    assert imported.stdout == "Data.lsf: lauv-log-1, 20 soundings accepted, 0 rejected, 0 there before\n"
    assert "nowhere.lsf cannot be read: No such file" in imported.stderr
    pings = line(LocalFrame(41.18525, -8.7047))
    write_kmall(tmp_path / "line.kmall", pings)
    write_gsf(tmp_path / "line.gsf", pings)
    imported = bathyfleet("import-log", mission["id"][:8], "line.kmall", "--vehicle", "wam-v")
    first, *notes = imported.stdout.splitlines()
    assert first.endswith(
        "wam-v, 0 soundings accepted, 0 rejected, 0 there before, 12 pings accepted, 0 rejected, 0 there before"
    )
    assert "  depths are below the water surface of their time, not reduced for the tide" in notes
    prior = bathyfleet("import", mission["id"][:8], "line.gsf", "--sd", "0.3")
    assert prior.stdout.startswith("252 of 252 depths imported: "), prior.stderr
    bathyfleet("export", mission["id"], "--format", "png")
    assert (tmp_path / "output" / "harbour-basin.png").stat().st_size > 1000
    bathyfleet("export", mission["id"], "--crs", "utm")
    assert (tmp_path / "output" / "harbour-basin-epsg32629.tif").is_file()
    refused = bathyfleet("export", mission["id"], "--crs", "EPSG:4326")
    assert (refused.code, "no projected system in metres" in refused.stderr) == (1, True)
    bathyfleet("report", mission["id"][:8])
    assert (tmp_path / "output" / "harbour-basin-report.pdf").read_bytes().startswith(b"%PDF-")
    bathyfleet("report", mission["id"], "--out", "basin.html", "--lang", "pt")
    assert "Relatório do levantamento: Harbour basin" in (tmp_path / "basin.html").read_text()

    (tmp_path / "old.csv").write_text("lon,lat,depth\n-8.7048,41.1852,9.5\n")
    refused = bathyfleet("import", mission["id"], "old.csv")
    assert (refused.code, "sd_m: 1 of its depths state no uncertainty" in refused.stderr) == (1, True)
    (tmp_path / "harbour.tid").write_text("2026/11/20 20:00 1.0\n2026/11/21 02:00 3.0\n2026/11/21 08:00 1.0\n")
    corrected = bathyfleet("tide", mission["id"], "harbour.tid", "--source", "gauge")
    assert "depths are below EPSG:5861 LAT depth, by tide table unnamed" in corrected.stdout
    assert "32 soundings accepted, 0 rejected" in corrected.stdout

    with serving(tmp_path, environment) as (process, url), httpx.Client(base_url=f"{url}/api/v1") as client:
        assert client.get(f"/missions/{mission['id']}").json()["progress"]["soundings"] == 32
        for said in ("1 of 1 depths imported: 9.50", "1 of 1 depths imported, as before: 9.50"):
            imported = bathyfleet("import", mission["id"][:8], "old.csv", "--order", "1a", "--url", url)
            assert said in imported.stdout, imported.stderr
        more = writer.write(tmp_path / "More.lsf.gz", writer.survey(30))
        sent = bathyfleet("import-log", mission["id"][:8], str(more), "line.gsf", "--url", url)
        assert sent.code == 1
        assert sent.stdout == "More.lsf.gz: lauv-log-1, 10 soundings accepted, 0 rejected, 20 there before\n"
        assert "line.gsf does not tell its vehicle's name" in sent.stderr
        again = bathyfleet("import-log", mission["id"][:8], str(more), "--json", "--url", url)
        assert [(view["soundings"], view["known"]) for view in json.loads(again.stdout)] == [(10, True)], again.stderr
        lost = bathyfleet("import-log", mission["id"], "nowhere.lsf", "--url", url)
        assert (lost.code, "nowhere.lsf cannot be read: No such file" in lost.stderr) == (1, True)
        wrong = bathyfleet("import", mission["id"], "old.csv", "--order", "9", "--url", url)
        assert (wrong.code, "order is '9'" in wrong.stderr) == (1, True)
        process.terminate()
        assert process.wait(60) == 0  # a first start may still be compiling


@pytest.mark.slow
def test_logs_are_json_lines_with_the_requests_id(tmp_path: Path, environment: dict[str, str]) -> None:
    with serving(tmp_path, environment, "--log-format", "json") as (process, url):
        httpx.get(f"{url}/api/v1/missions")  # nothing to tell of
        httpx.get(f"{url}/api/v1/mission", headers={"X-Request-Id": "abc-1"})
        process.send_signal(signal.SIGINT)
        assert process.stderr is not None
        lines = [json.loads(line) for line in process.stderr.read().splitlines()]
    (request,) = [line for line in lines if line["event"] == "request"]
    assert (request["request_id"], request["path"], request["status"]) == ("abc-1", "/api/v1/mission", 404)


def test_the_doctor_says_what_is_missing(bathyfleet: Run) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    variables = {"BATHYFLEET_IMC__PORT": str(port), "BATHYFLEET_IMC__LOOPBACK_ONLY": "true"}
    ended = bathyfleet("doctor", "--seconds", "0.2", "--json", **variables)
    assert ended.code == 1
    diagnosis = json.loads(ended.stdout)
    assert diagnosis["healthy"] is False
    assert any("no vehicle" in finding["text"] and finding["remedy"] for finding in diagnosis["own"])
    shown = bathyfleet("doctor", "--seconds", "0.2", **variables)
    assert (shown.code, "no vehicle" in shown.stdout) == (1, True)


def test_the_doctor_judges_a_recording(bathyfleet: Run, tmp_path: Path) -> None:
    path = tmp_path / "session.jsonl"
    path.write_text('{"t": 1.0, "src": "127.0.0.1:6002", "dst": "127.0.0.1:6101", "hex": "00"}\n')
    ended = bathyfleet("doctor", "--replay", str(path), "--json")
    assert ended.code == 1
    assert "no_vehicle" in json.loads(ended.stdout)["causes"]
    path.write_text("rubbish")
    assert "line 1" in bathyfleet("doctor", "--replay", str(path)).stderr


def test_the_doctor_says_when_the_service_holds_the_port(bathyfleet: Run) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as holder:
        holder.bind(("0.0.0.0", 0))
        ended = bathyfleet(
            "doctor",
            "--seconds",
            "0.2",
            BATHYFLEET_IMC__PORT=str(holder.getsockname()[1]),
            BATHYFLEET_IMC__LOOPBACK_ONLY="true",
        )
    assert ended.code == 1
    assert "is held by" in " ".join(ended.stdout.split())
    assert "/api/v1/doctor" in " ".join(ended.stdout.split())
    assert "Traceback" not in ended.stderr


@pytest.mark.slow
def test_missions_are_listed_paused_and_aborted_where_there_is_no_browser(
    bathyfleet: Run, tmp_path: Path, environment: dict[str, str]
) -> None:
    with serving(tmp_path, environment) as (_, url), httpx.Client(base_url=f"{url}/api/v1") as client:
        here = {"BATHYFLEET_PORT": str(httpx.URL(url).port)}
        assert "there are no missions" in bathyfleet("missions", "list", **here).stdout
        simulated = {"vehicles": [{"name": "auv-1", "kind": "sim"}, {"name": "auv-2", "kind": "sim"}], "steps": 50}
        one, two = (
            client.post("/missions", json=mission_spec(name=name, **simulated)).json()["id"] for name in ("A", "B")
        )
        none = bathyfleet("missions", "abort", **here)
        assert (none.code, "0 missions can be meant by abort" in none.stderr) == (1, True)
        client.post(f"/missions/{one}/start").raise_for_status()
        listed = bathyfleet("missions", "list", **here).stdout.splitlines()
        assert listed[0] == f"{two}  B: ready"
        assert listed[1].startswith(f"{one}  A: running")
        asked = ("missions", "list", "--json", "--state", "running", "--state", "paused")
        (running,) = json.loads(bathyfleet(*asked, "--url", f"{url}/api/v1/").stdout)
        assert (running["id"], running["state"], "step" in running["progress"]) == (one, "running", True)
        assert bathyfleet("missions", "list", "--limit", "1", **here).stdout.splitlines() == listed[:1]
        assert bathyfleet("missions", "list", "--before", two[:8], **here).stdout.startswith(f"{one}  A: running")
        unknown = bathyfleet("missions", "pause", "none-such", **here)
        assert (unknown.code, f"There are: {two} B; {one} A, at {url}" in unknown.stderr) == (1, True), unknown.stderr
        assert "no missions that are failed" in bathyfleet("missions", "list", "--state", "failed", **here).stdout
        longer = bathyfleet("missions", "budget", "--steps", "60", **here)
        assert (longer.code, longer.stdout.startswith(f"{one}  A: 60 steps")) == (0, True), longer.stderr
        assert client.get(f"/missions/{one}").json()["progress"]["budget"] == {"steps": 60}
        both = bathyfleet("missions", "budget", "--steps", "60", "--minutes", "3", **here)
        assert (both.code, "2 lengths are given" in both.stderr) == (1, True)
        none = bathyfleet("missions", "budget", one, "--steps", "0", "--url", url)
        assert (none.code, "steps: " in none.stderr) == (1, True)
        for action, state in (("pause", "paused"), ("resume", "running"), ("abort", "aborted")):
            done = bathyfleet("missions", action, "--note", "a ferry", **here)
            assert (done.code, done.stdout.splitlines()[0]) == (0, f"{one}  A: {state}")
            if action != "resume":
                assert done.stdout.count("acknowledged the stop") == 2
            assert client.get(f"/missions/{one}").json()["state"] == state
        late = bathyfleet("missions", "resume", one, "--url", url)
        assert (late.code, "aborted" in late.stderr) == (1, True)
    gone = bathyfleet("missions", "list", "--url", url)
    assert (gone.code, "does not answer" in gone.stderr) == (1, True)


@pytest.mark.slow
def test_missions_of_a_service_that_asks_for_a_token_are_reached_by_that_of_its_first_start(
    bathyfleet: Run, tmp_path: Path, environment: dict[str, str]
) -> None:
    with serving(tmp_path, environment) as (_, url):
        here = {"BATHYFLEET_PORT": str(httpx.URL(url).port)}
        token = (tmp_path / "operator.token").read_text().strip()
        assert bathyfleet("missions", "list", **here).code == 0
        assert bathyfleet("missions", "list", "--url", url, "--token", token).code == 0
        (tmp_path / "operator.token").unlink()
        assert bathyfleet("missions", "list", **here, BATHYFLEET_TOKEN=token).code == 0
        assert bathyfleet("missions", "list", "--url", url, "--token", "wrong").code == 1


@pytest.mark.slow
def test_missions_of_this_machine_are_reached_whatever_name_the_certificate_has_and_by_no_proxy(
    bathyfleet: Run,
    tmp_path: Path,
    environment: dict[str, str],
    certificate: tuple[Path, Path],
    other_certificate: Path,
) -> None:
    cert, key = certificate  # for localhost
    proxy = f"http://127.0.0.1:{free_ports(1)[0]}"
    here = {
        "BATHYFLEET_HOST": "::1",
        "BATHYFLEET_TLS_CERTIFICATE": str(cert),
        "BATHYFLEET_TLS_KEY": str(key),
        "http_proxy": proxy,
        "https_proxy": proxy,
    }
    with serving(tmp_path, environment | here) as (_, url):
        port = str(httpx.URL(url).port)
        listed = bathyfleet("missions", "list", **here, BATHYFLEET_PORT=port)
        assert (listed.code, "there are no missions" in listed.stdout) == (0, True), listed.stderr
        stranger = here | {"BATHYFLEET_TLS_CERTIFICATE": str(other_certificate)}
        refused = bathyfleet("missions", "list", **stranger, BATHYFLEET_PORT=port)
        assert (refused.code, "its certificate is not trusted" in refused.stderr) == (1, True), refused.stderr
