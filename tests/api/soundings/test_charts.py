"""Charts over REST: read locked in, as depths for a mission and as zones that somebody has to choose."""

import asyncio
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.mapping.readers.enc import HAZARDS
from app.missions.operations.imports import reader_process
from tests.support.api.rest import mission_spec
from tests.support.mapping.enc import Cell
from tests.support.missions.specs import AREA
from tests.support.waiting import until

WEST, SOUTH = AREA["coordinates"][0][0]
EAST, NORTH = AREA["coordinates"][0][2]
ENDS = {"west_deg": WEST, "south_deg": SOUTH, "east_deg": EAST, "north_deg": NORTH}


def square(west: float, south: float, side: float) -> list[tuple[float, float]]:
    return [(west, south), (west + side, south), (west + side, south + side), (west, south + side)]


@pytest.fixture
async def cell(tmp_path: Path) -> bytes:
    made = Cell()
    made.area("M_QUAL", square(WEST - 0.01, SOUTH - 0.01, 0.03), CATZOC=1)
    made.soundings([(WEST + 1e-4 * i, SOUTH + 1e-4 * i, 9.0 + i) for i in range(4)])
    made.point("UWTROC", (WEST + 2e-4, SOUTH + 2e-4), VALSOU=1.5, OBJNAM="<b>Rock</b>")
    made.area("LNDARE", square(WEST - 0.005, SOUTH - 0.005, 0.005), OBJNAM="Quay")
    for kind in set(HAZARDS) - {"UWTROC", "LNDARE"}:
        made.area(kind, square(WEST, SOUTH, 1e-4))
    return await asyncio.to_thread(made.write, tmp_path / "cell.000")


@pytest.mark.slow
async def test_a_mission_begins_with_a_chart_s_depths(
    client: httpx.AsyncClient, mission: dict[str, Any], cell: bytes
) -> None:
    path = f"/missions/{mission['id']}/imports"
    answer = await client.post(path, content=cell, params={"filename": "PT426101.000", "source": "ENC"})
    assert answer.status_code == 201, answer.text
    taken = answer.json()
    assert taken["found"] == 4
    assert taken["median_sd_m"] == pytest.approx((0.5 + 0.01 * 10.5) / 1.96, rel=0.01)
    again = await client.post(path, content=cell, params={"filename": "PT426101.000", "source": "ENC"})
    assert again.status_code == 200


@pytest.mark.parametrize(("path", "params"), [("/chart-zones", ENDS), ("/drawings", {"filename": "plan.kml"})])
async def test_a_file_that_nobody_waits_for_any_more_is_not_read_on(
    client: httpx.AsyncClient, cell: bytes, monkeypatch: pytest.MonkeyPatch, path: str, params: dict[str, Any]
) -> None:
    begun, ended = asyncio.Event(), asyncio.Event()

    async def for_ever(*_: Any) -> Any:
        begun.set()
        try:
            await asyncio.Event().wait()
        finally:
            ended.set()

    with monkeypatch.context() as patch:
        patch.setattr(reader_process, "_run", for_ever)
        asking = asyncio.create_task(client.post(path, content=cell, params=params))
        await until(begun.is_set, "it is being read")
        asking.cancel()
        await until(ended.is_set, "nobody reads it any more")
    assert (await client.post("/chart-zones", content=cell, params=ENDS)).status_code == 200, "the turn is free"


@pytest.mark.slow
async def test_zones_are_proposed_and_nothing_changes(
    client: httpx.AsyncClient, mission: dict[str, Any], cell: bytes
) -> None:
    before = (await client.get("/missions")).json()
    answer = await client.post("/chart-zones", content=cell, params=ENDS | {"margin_m": 2.0})
    assert answer.status_code == 200, answer.text
    zones = {zone["object"]: zone for zone in answer.json()["zones"]}
    assert set(zones) == set(HAZARDS)
    assert all(zone["reason"] for zone in zones.values())
    rock = zones["UWTROC"]
    assert (rock["reason"], rock["depth_m"], rock["position_m"], rock["name"]) == ("rock", 1.5, 5.0, "<b>Rock</b>")
    assert (await client.get("/missions")).json() == before
    assert (await client.get(f"/missions/{mission['id']}")).json()["spec"]["keep_out"] == []
    made = await client.post("/missions", json=mission_spec(keep_out=[rock["zone"]]))
    assert made.status_code == 201, made.text


@pytest.mark.parametrize(
    ("ends", "content", "said"),
    [
        ({"east_deg": WEST - 1}, b"x", "ends before it begins"),
        ({"east_deg": WEST + 5}, b"x", "km wide"),
        ({}, b"", "empty"),
        ({}, b"hunter2 is no chart" * 5, "ENC cell"),
    ],
)
async def test_what_cannot_be_answered_is_said(
    client: httpx.AsyncClient, ends: dict[str, float], content: bytes, said: str
) -> None:
    answer = await client.post("/chart-zones", content=content, params=ENDS | ends)
    assert answer.status_code == 422
    assert said in answer.text
    assert "hunter2" not in answer.text
