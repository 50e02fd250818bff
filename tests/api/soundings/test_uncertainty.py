"""Where the uncertainty of soundings comes from, and what the map makes of it, over REST."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from app.settings import Settings
from tests.support.api.rest import mission_spec, soundings
from tests.support.mapping.tracks import DEPTH_M, flown, lawnmower, pinged
from tests.support.missions.specs import rectangle

START_S = 1_795_225_140.0
ROVER = [{"name": "rover", "kind": "rest", "sensor": "multibeam"}]


@pytest.fixture
def settings(make_settings: Callable[..., Settings], tmp_path: Path) -> Settings:
    return make_settings(pings_url=str(tmp_path / "pings"))


async def swept(client: httpx.AsyncClient, **fields: Any) -> str:
    area = rectangle(0, 0, 40, 40)
    answer = await client.post("/missions", json=mission_spec(area=area, cell_m=2, vehicles=ROVER, **fields))
    assert answer.status_code == 201, answer.text
    path = f"/missions/{answer.json()['id']}"
    way = [(east + 4, north + 2) for east, north in lawnmower(32, 36, 8)]
    items = pinged("rover", flown(way, spacing_m=1.0, start_s=START_S))
    assert (await client.post(f"{path}/measurements", json={"items": items})).json()["accepted"] == len(items)
    return path


async def test_the_budget_says_what_each_source_adds(client: httpx.AsyncClient) -> None:
    path = await swept(client)
    budget = (await client.get(f"{path}/uncertainty-budget")).json()
    assert budget["depth_m"] == pytest.approx(DEPTH_M, abs=0.01)
    assert budget["below_sonar_m"] == pytest.approx(DEPTH_M - 2.0, abs=0.01)
    parts = {one["name"]: one for one in budget["components"]}
    assert (parts["heave_m"]["sd"], parts["heave_m"]["unit"]) == (0.05, "m")
    for share in parts["heave_m"]["shares"]:
        assert (share["vertical_m"], share["horizontal_m"]) == (0.05, 0.0)
    assert [share["angle_deg"] for share in parts["tide"]["shares"]] == [0.0, 45.0, 60.0]
    for k, total in enumerate(budget["totals"]):
        vertical = np.sqrt(sum(one["shares"][k]["vertical_m"] ** 2 for one in budget["components"]))
        assert total["tvu_m"] == pytest.approx(1.96 * vertical, rel=1e-3)
    assert budget["totals"][0]["tvu_m"] < budget["totals"][2]["tvu_m"]
    allowed = {one["order"]: one for one in budget["allowed"]}
    assert allowed["1a"]["tvu_m"] == pytest.approx(np.hypot(0.5, 0.013 * DEPTH_M), abs=1e-3)
    assert allowed["1a"]["thu_m"] == pytest.approx(5.0 + 0.05 * DEPTH_M, abs=1e-2)
    assert allowed["special"]["thu_m"] == 2.0


async def test_a_mission_says_what_its_vehicles_are_worth(client: httpx.AsyncClient) -> None:
    usual = await swept(client)
    poor = await swept(client, uncertainty={"heave_m": 0.4, "position_m": 6.0})
    layers = {"layer": ["tvu", "thu"]}
    one, other = [(await client.get(f"{path}/map", params=layers)).json()["layers"] for path in (usual, poor)]
    one, other = ({name: np.array(layer, float) for name, layer in found.items()} for found in (one, other))
    seen = np.isfinite(one["thu"])
    assert seen.mean() > 0.8
    assert np.allclose(one["thu"][seen], 2.4477 * 1.5, atol=0.1)
    assert np.allclose(other["thu"][seen], 2.4477 * 6.0, atol=0.1)
    assert (one["tvu"][seen] > 1.96 * 0.05).all()
    assert (one["tvu"][seen] < 0.4).all()
    assert (other["tvu"][seen] > 1.96 * 0.4).all()
    quality = {one["order"]: one for one in (await client.get(f"{poor}/quality")).json()["tvu"]}
    assert quality["1a"]["horizontal_pct"] == 0.0
    assert quality["2"]["horizontal_pct"] == 100.0
    assert quality["1a"]["statement"].endswith(", THU estimate in 0.0 %")
    refused = await client.post("/missions", json=mission_spec(uncertainty={"heave_m": -1}))
    assert refused.status_code == 422
    assert [error["field"] for error in refused.json()["errors"]] == ["uncertainty.heave_m"]


async def test_a_map_without_swaths_knows_nothing_of_places(client: httpx.AsyncClient) -> None:
    path = f"/missions/{(await client.post('/missions', json=mission_spec())).json()['id']}"
    assert (await client.get(f"{path}/uncertainty-budget")).status_code == 404
    await client.post(f"{path}/measurements", json={"items": soundings()})
    shown = (await client.get(f"{path}/map", params={"layer": "tvu"})).json()
    tvu, sd = (np.array(values, float) for values in (shown["layers"]["tvu"], shown["sd_m"]))
    assert np.allclose(tvu, 1.96 * sd, atol=2e-3, equal_nan=True)
    refused = await client.get(f"{path}/map", params={"layer": "thu"})
    assert (refused.status_code, "swath" in refused.json()["detail"]) == (422, True)
    assert {one["horizontal_pct"] for one in (await client.get(f"{path}/quality")).json()["tvu"]} == {None}
