"""A map along a line, over REST."""

from collections.abc import Sequence
from typing import Any

import httpx
import numpy as np
import pytest

from app.missions.views.maps.profile import ProfileView
from tests.support.api.rest import soundings

LINE = "-8.70495,41.18503;-8.7041,41.1856"


@pytest.fixture
async def measured(client: httpx.AsyncClient, mission: dict[str, Any]) -> str:
    """Path of a mission that has a map."""
    path = f"/missions/{mission['id']}"
    answer = await client.post(f"{path}/measurements", json={"items": soundings(40)})
    assert answer.json()["accepted"] == 40
    return path


async def test_a_profile_has_the_map_and_the_soundings_beside_it(client: httpx.AsyncClient, measured: str) -> None:
    asked: dict[str, Any] = {"line": LINE, "within_m": 30, "layer": ["slope", "tvu"]}
    answer = await client.get(f"{measured}/profile", params=asked)
    assert answer.status_code == 200, answer.text
    found = ProfileView.model_validate(answer.json())
    shown = (await client.get(f"{measured}/map")).json()
    count = len(found.along_m)
    assert found.length_m == pytest.approx(found.along_m[-1], abs=1e-3)
    assert found.spacing_m <= shown["cell_m"] / 2
    lists: list[Sequence[object]] = [found.positions, found.depth_m, found.sd_m, found.sounded, *found.layers.values()]
    assert {len(values) for values in lists} == {count}
    assert set(found.layers) == {"slope", "tvu"}
    known = [depth for depth in found.depth_m if depth is not None]
    assert shown["min_depth_m"] <= min(known) < max(known) <= shown["max_depth_m"]
    assert 0 < len(found.soundings) == found.soundings_found <= 40
    assert [one.along_m for one in found.soundings] == sorted(one.along_m for one in found.soundings)
    assert max(abs(one.across_m) for one in found.soundings) <= 30
    assert np.allclose(found.positions[0], [-8.70495, 41.18503], atol=1e-6)
    few = await client.get(f"{measured}/profile", params={"line": LINE, "spacing_m": 20, "within_m": 0.01})
    assert len(few.json()["along_m"]) < 10
    assert few.json()["soundings"] == []


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({}, "required"),
    ({"line": "-8.7,41.1"}, "2 to 100"),
    ({"line": "here;there"}, "match"),
    ({"line": ";".join(["-8.7,41.1"] * 101)}, "2 to 100"),
    ({"line": "-8.7,41.1;-8.7"}, "no longitude,latitude"),
    ({"line": "-8.7,41.1;-8.7,4-1"}, "no longitude,latitude"),
    ({"line": "-8.7,91;-8.7,41"}, "latitude within ±90"),
    ({"line": "181,41;-8.7,41"}, "longitude within ±180"),
    ({"line": "-8.7049,41.1851;-8.7049,41.1851"}, "same place"),
    ({"line": "-8.71,41.19;-8.711,41.191"}, "does not cross"),
    ({"line": "8.7,41.19;8.8,41.191"}, "km from the mission"),
    ({"line": LINE, "spacing_m": 0.001}, "at least"),
    ({"line": LINE, "spacing_m": 0}, "> 0"),
    ({"line": LINE, "within_m": 1e6}, "1000"),
    ({"line": LINE, "layer": "taste"}, "slope"),
    ({"line": LINE, "layer": "difference"}, "reference"),
]


async def test_a_line_that_cannot_be_is_refused_with_the_reason(client: httpx.AsyncClient, measured: str) -> None:
    for asked, reason in REFUSED:
        answer = await client.get(f"{measured}/profile", params=asked)
        assert (answer.status_code, answer.json()["type"]) == (422, "urn:bathyfleet:problem:invalid-request"), asked
        assert reason in str(answer.json()), asked


async def test_without_a_map_there_is_no_profile(client: httpx.AsyncClient, mission: dict[str, Any]) -> None:
    answer = await client.get(f"/missions/{mission['id']}/profile", params={"line": LINE})
    assert (answer.status_code, answer.json()["type"]) == (404, "urn:bathyfleet:problem:map-not-ready")
