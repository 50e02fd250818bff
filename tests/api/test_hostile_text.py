"""Texts of strangers in terminals, logs, tables and files: seen as they are, obeyed by nothing."""

import csv
import io
import logging
import re
import unicodedata
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from urllib.parse import quote

import httpx
import pytest
import structlog
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner
from websockets import ConnectionClosed
from websockets.asyncio.client import connect

from app.api import logs
from app.api.accounts.roles import Role
from app.api.accounts.tokens import TokenStore
from app.cli import app
from app.commands.service.doctor import show_diagnosis
from app.csv_cells import text_cell
from app.mapping.products.kml import tracks_kml
from app.mapping.products.tracks import Track, TrackPoint, tracks_gpx
from app.settings import Settings
from app.storage.database import Database
from app.storage.upkeep.prepare import prepare_database
from imc_bridge.doctor.diagnosis import Cause, Diagnosis, NodeDiagnosis, problem
from imc_bridge.events import NodeState
from imc_bridge.printable import printable
from tests.support.api.rest import make_client, mission_spec, running, soundings
from tests.support.storage.databases import Databases

HOSTILE = "a\x1b[2J\x07\x9b31m\x7f\u202eb\u2028c\u2066[red]d[/red]"
SHOWN = r"a\x1b[2J\x07\x9b31m\x7f\u202eb\u2028c\u2066[red]d[/red]"
OBEYED = re.compile("[\x00-\x09\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2028\u2029\u2066-\u2069\ud800-\udfff]")


@given(st.text(st.characters(blacklist_categories=()), max_size=50))
def test_what_is_printable_controls_nothing_and_stays_what_it_is(text: str) -> None:
    shown = printable(text)
    assert not OBEYED.search(shown)
    assert "\n" not in shown
    shown.encode()
    ET.fromstring("<a>" + shown.replace("&", "&amp;").replace("<", "&lt;") + "</a>")  # noqa: S314 - our own
    assert printable(shown) == shown
    if all(unicodedata.category(letter)[0] in "LMNPSZ" and letter not in "\u2028\u2029" for letter in text):
        assert shown == text


def test_lines_and_length_are_kept_where_that_is_asked() -> None:
    assert printable("a\n\tb\r\x1b", keep="\n\t") == "a\n\tb\\r\\x1b"
    assert printable("\x1b" * 10, most=5) == r"\x1b" + "\\"


@pytest.mark.parametrize("beginning", ["=", "+", "-", "@", "\t=", "\r="])
def test_a_text_is_no_formula_and_a_number_is_a_number(beginning: str) -> None:
    assert str(text_cell(f"{beginning}cmd|' /C calc'!A0")).startswith("'")
    assert text_cell(-1.5) == -1.5
    assert text_cell("lauv-1") == "lauv-1"
    assert text_cell(HOSTILE) == SHOWN
    assert text_cell(None) is None


async def test_paths_in_the_audit_log_do_nothing_to_the_terminal(make_settings: Callable[..., Settings]) -> None:
    settings = make_settings()
    async with running(settings) as server, make_client(server) as client:
        await client.post("/missions/" + quote(HOSTILE) + "/abort")
        await client.post("/" + quote("=HYPERLINK(1)"))
    runner = CliRunner()
    table = await _run(runner, "audit", "--database", settings.database_url)
    assert not OBEYED.search(table)
    assert r"\x1b[2J" in re.sub(r"[│\s]", "", table)
    sheet = await _run(runner, "audit", "--database", settings.database_url, "--format", "csv")
    assert not OBEYED.search(sheet.replace("\r\n", "\n"))
    rows = list(csv.DictReader(io.StringIO(sheet)))
    assert any(SHOWN in row["target"] for row in rows)


async def _run(runner: CliRunner, *arguments: str) -> str:
    import asyncio

    result = await asyncio.to_thread(runner.invoke, app, list(arguments), env={"COLUMNS": "300"})
    assert result.exit_code == 0, result.output
    return str(result.stdout)


async def test_names_of_tokens_are_no_markup(make_settings: Callable[..., Settings]) -> None:
    settings = make_settings()
    await prepare_database(settings.database_url, may_upgrade=True)
    database = Database(settings.database_url)
    await TokenStore(database).create("[red]x[/red] [/nothing]\x1b[2J", Role.VIEWER)
    await database.close()
    listed = await _run(CliRunner(), "token", "list", "--database", settings.database_url)
    assert r"[red]x[/red] [/nothing]\x1b[2J" in listed


@pytest.fixture
def console() -> Iterator[io.StringIO]:
    stream = io.StringIO()
    logs.configure("info", "console", stream)
    yield stream
    logs.configure()


def test_the_services_log_obeys_nobody(console: io.StringIO) -> None:
    log = structlog.get_logger("hostile")
    log.info("request " + HOSTILE, path=HOSTILE, items=[HOSTILE])
    logging.getLogger("uvicorn.error").warning("from %s", HOSTILE)
    try:
        raise ValueError(HOSTILE)
    except ValueError:
        log.exception("failed", name=HOSTILE)
    said = console.getvalue()
    assert not OBEYED.search(said)
    assert said.count(r"\x1b[2J") == 6
    assert "Traceback (most recent call last):\n" in said
    assert [line for line in said.splitlines() if line.startswith("c")] == []


def test_the_doctor_shows_names_of_strangers(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "300")
    finding = problem(Cause.NO_TRAFFIC, f"nothing comes from {HOSTILE}", f"see {HOSTILE}")
    diagnosis = Diagnosis(1.0, (), (NodeDiagnosis(HOSTILE, 0x1E, NodeState.HEARD, (finding,)),))
    show_diagnosis(diagnosis)
    shown = capsys.readouterr().out
    assert not OBEYED.search(shown)
    assert "[red]" in shown
    assert not OBEYED.search(diagnosis.text())
    assert SHOWN in diagnosis.text()


def test_tracks_of_any_name_are_valid_xml() -> None:
    track = Track("lauv-1", [TrackPoint(-8.0, 41.0, 1.0, 1e9), TrackPoint(-8.0, 41.1, 1.0, 1e9 + 1)])
    title = printable(HOSTILE)
    for document in (tracks_gpx([track], title=title), tracks_kml([track], title=title)):
        assert SHOWN in "".join(ET.fromstring(document).itertext())  # noqa: S314 - our own


async def test_files_of_a_mission_with_any_name_can_be_taken_away(client: httpx.AsyncClient) -> None:
    name = 'a"\tSet-Cookie: x\u202e\x01=b'
    lines = await client.post("/missions", json=mission_spec(name=name.replace("\t", "\r\n")))
    assert (lines.status_code, lines.json()["errors"][0]["field"]) == (422, "name")
    mission = (await client.post("/missions", json=mission_spec(name=name))).json()
    path = f"/missions/{mission['id']}"
    answer = await client.post(f"{path}/measurements", json={"items": soundings(12)})
    assert answer.json()["accepted"] > 0
    for file in ("tracks.gpx", "tracks.kml", "map.kml", "map.geojson", "soundings.csv"):
        taken = await client.get(f"{path}/{file}")
        assert taken.status_code == 200, taken.text
        assert re.fullmatch(r'attachment; filename="[a-z0-9.-]+"', taken.headers["content-disposition"])
        assert "set-cookie" not in taken.headers
        if file.endswith((".gpx", ".kml")):
            ET.fromstring(taken.content)  # noqa: S314 - our own


async def test_a_nul_in_an_address_reaches_no_database(
    make_settings: Callable[..., Settings], databases: Databases
) -> None:
    async with (
        running(make_settings(database_url=databases.fresh("postgresql"))) as server,
        make_client(server) as client,
    ):
        for path, status in (
            ("/ogc/missions/%00/collections", 404),
            ("/wms/missions/%00?REQUEST=GetCapabilities", 404),
            ("/api/v1/alarms?mission=%00", 422),
        ):
            assert (await client.get(server.url + path)).status_code == status, path
        live = f"{server.url}/api/v1/missions/%00/live".replace("http", "ws", 1)
        async with connect(live) as viewer:
            with pytest.raises(ConnectionClosed) as closed:
                await viewer.recv()
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 4404
