"""A small mission over REST, and soundings that are posted to it."""

from typing import Any

import httpx

from tests.support.api.rest import mission_spec
from tests.support.missions.specs import rectangle

SIDE_M, CELL_M = 60.0, 2.0
START_S = 1_795_225_140.0


async def new_mission(client: httpx.AsyncClient, *vehicles: str, **fields: Any) -> str:
    kinds = [{"name": name, "kind": "rest"} | fields for name in vehicles]
    area = rectangle(0, 0, SIDE_M, SIDE_M)
    answer = await client.post("/missions", json=mission_spec(area=area, cell_m=CELL_M, vehicles=kinds))
    assert answer.status_code == 201, answer.text
    return f"/missions/{answer.json()['id']}"


async def post(client: httpx.AsyncClient, path: str, items: list[dict[str, Any]]) -> None:
    answer = await client.post(f"{path}/measurements", json={"items": items})
    assert answer.status_code == 200, answer.text
    assert answer.json()["accepted"] == len(items)
