"""How long it takes from soundings that arrive to the picture that holds them.

``python -m benchmarks.service.picture [--batches 40 --vehicles 4 --write]``. The real service flies a mission of
simulated vehicles, whose soundings keep it busy. A vehicle that speaks REST posts a batch of soundings now and then;
a watcher of the live view waits for the message that says that they are in the tiles, and fetches what changed of
these, as the page does, until the tile in which they lie is among it. Printed is one JSON object: milliseconds from
the request's first byte until the answer, a message and the tile came.
"""

import asyncio
import json
import math
import sys
import tempfile
import time
import zlib
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import websockets

from benchmarks.common.report import LOAD, make_parser, write_section
from benchmarks.service.beginning import corners
from tests.support.dashboard.service import Service

ASKED_MS = 1000.0
VISITOR = "visitor"
SIDE_M = 300.0
BATCH = 20


async def measure(service: Service, mission: str, batches: int, rng: np.random.Generator) -> dict[str, list[float]]:
    """Post batches; how long it took until each was answered, told of, and fetched, ms."""
    found: dict[str, list[float]] = {"answer_ms": [], "told_ms": [], "picture_ms": []}
    address = service.url.replace("http", "ws") + f"/api/v1/missions/{mission}/live"
    tiles = f"/api/v1/missions/{mission}/map/tiles"
    async with (
        httpx.AsyncClient(base_url=service.url, timeout=30.0) as client,
        websockets.connect(address, max_size=None) as line,
    ):
        tag = None
        for number in range(batches):
            tag = header_of(await client.get(tiles, params={"since": tag} if tag else {}))["tag"]
            await drained(line)
            west_m, south_m = rng.uniform(20.0, SIDE_M - 40.0, 2)
            items = soundings(number, west_m, south_m)
            began = time.perf_counter()
            posted = asyncio.create_task(client.post(f"/api/v1/missions/{mission}/measurements", json={"items": items}))
            told = asyncio.create_task(message(line, "map"))
            (await posted).raise_for_status()
            found["answer_ms"].append(1e3 * (time.perf_counter() - began))
            await told
            found["told_ms"].append(1e3 * (time.perf_counter() - began))
            while not shows(header_of(await client.get(tiles, params={"since": tag})), west_m, south_m):
                await message(line, "map")
            found["picture_ms"].append(1e3 * (time.perf_counter() - began))
            await asyncio.sleep(rng.uniform(0.5, 1.5))
    return found


def soundings(number: int, west_m: float, south_m: float) -> list[dict[str, Any]]:
    """A batch along a short line to the north of a place."""
    return [
        {
            "vehicle": VISITOR,
            "time_s": time.time() + 0.01 * k,
            "lat_deg": 41.185 + (south_m + 0.3 * k) / 111_200.0,
            "lon_deg": -8.705 + west_m / 83_700.0,
            "depth_m": 9.0 + 0.01 * ((number + k) % 10),
        }
        for k in range(BATCH)
    ]


def shows(header: dict[str, Any], west_m: float, south_m: float) -> bool:
    """Whether what changed has the tile in which a place lies."""
    row, col = int(south_m / SIDE_M * header["rows"]), int(west_m / SIDE_M * header["cols"])
    side = header["tile"]
    return row // side * math.ceil(header["cols"] / side) + col // side in header["tiles"]


async def drained(line: Any) -> None:
    """Read what has come already."""
    while True:
        try:
            await asyncio.wait_for(line.recv(), 0.01)
        except TimeoutError:
            return


async def message(line: Any, kind: str) -> dict[str, Any]:
    """Return the next message of a kind."""
    async for text in line:
        told: dict[str, Any] = json.loads(text)
        if told["type"] == kind:
            return told
    raise ConnectionError("the live view ended")


def header_of(answer: httpx.Response) -> dict[str, Any]:
    """Return the header of tiles of the map."""
    body = answer.raise_for_status().content
    if body[:4] != b"BFM1":
        body = zlib.decompress(body)
    length = int.from_bytes(body[4:8], "little")
    header: dict[str, Any] = json.loads(body[8 : 8 + length])
    return header


def main() -> int:
    """Run and print."""
    parser = make_parser(__doc__, LOAD)
    parser.add_argument("--vehicles", type=int, default=4)
    parser.add_argument("--batches", type=int, default=40)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="bathyfleet-picture-") as folder:
        service = Service(Path(folder), time_scale="1", log_level="warning")
        service.start()
        try:
            team = [{"name": f"sim-{i}", "kind": "sim", "sensor": "dvl"} for i in range(options.vehicles)]
            team.append({"name": VISITOR, "kind": "rest"})
            mission = service.create(area=corners(SIDE_M), vehicles=team, steps=1000)
            service.act(mission, "start")
            found = asyncio.run(measure(service, mission, options.batches, np.random.default_rng(0)))
            service.act(mission, "abort")
        finally:
            service.kill()
    result: dict[str, Any] = {"vehicles": options.vehicles, "batches": options.batches}
    for name, values in found.items():
        result[name] = f"median {np.median(values):.0f}, 95 % {np.quantile(values, 0.95):.0f}, worst {max(values):.0f}"
    print(json.dumps(result))
    write_section(options.write, LOAD, "From soundings to the picture", result)
    return 0 if max(found["picture_ms"]) <= ASKED_MS else 1


if __name__ == "__main__":
    sys.exit(main())
