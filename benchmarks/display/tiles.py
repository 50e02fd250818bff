"""What GIS that follow a map cost the service: ``python -m benchmarks.display.tiles [--clients 50] [--rate 10]``.

The real service with ten vehicles that report five times a second and fly a mission; so many clients, in a process of
their own, each fetch tiles of all layers and several zooms over the area, one after the other at an even pace. Measured
are the service's processor time without and with them, how long a tile takes, and how long anything else was held up.
Printed is one JSON object.
"""

import asyncio
import json
import random
import sys
import time
from typing import Any

import httpx
import numpy as np
import psutil

from benchmarks.common.report import LOAD, make_parser, write_section
from benchmarks.service.boats import FRAME, SIDE_M, begin, beside, create_mission, running_service
from benchmarks.service.opening import Watch
from tests.support.dashboard.service import Service
from tests.support.mapping.gis import tile_of

VEHICLES = 10
ZOOMS = (15, 16, 17, 18)
LAYERS = ("depth", "uncertainty", "density", "coverage")


def addresses(url: str, mission: str) -> list[str]:
    """Every tile over the area."""
    (south, north), (west, east) = FRAME.to_geographic([0.0, SIDE_M], [0.0, SIDE_M])
    found = []
    for zoom in ZOOMS:
        (left, top), (right, bottom) = tile_of(north, west, zoom), tile_of(south, east, zoom)
        places = [(x, y) for x in range(left, right + 1) for y in range(top, bottom + 1)]
        found += [
            f"{url}/api/v1/missions/{mission}/tiles/{name}/{zoom}/{x}/{y}.png" for name in LAYERS for x, y in places
        ]
    return found


async def look(url: str, mission: str, clients: int, rate: float, seconds: float) -> dict[str, Any]:
    """Fetch tiles, and tell how long that took."""
    tiles, counts = addresses(url, mission), {"same": 0, "new": 0, "bytes": 0}
    took_s: list[float] = []
    until = time.monotonic() + seconds

    async def client(number: int) -> None:
        rng, tags = random.Random(number), dict[str, str]()  # noqa: S311 - no secret
        async with httpx.AsyncClient(timeout=60, verify=False, trust_env=False) as http:  # noqa: S501
            due = time.monotonic() + rng.random() / rate
            while due < until:
                await asyncio.sleep(max(0.0, due - time.monotonic()))
                tile, due = rng.choice(tiles), due + 1 / rate
                began = time.perf_counter()
                answer = await http.get(tile, headers={"If-None-Match": tags[tile]} if tile in tags else {})
                took_s.append(time.perf_counter() - began)
                answer.raise_for_status() if answer.status_code != httpx.codes.NOT_MODIFIED else None
                tags[tile] = answer.headers["etag"]
                counts["same" if answer.status_code == httpx.codes.NOT_MODIFIED else "new"] += 1
                counts["bytes"] += len(answer.content)

    began = time.monotonic()
    await asyncio.gather(*(client(number) for number in range(clients)))
    passed = time.monotonic() - began
    return {
        "different_tiles": len(tiles),
        "tiles_per_s": round(len(took_s) / passed, 1),
        "tile_ms": f"{1000 * np.median(took_s):.0f} median, {1000 * np.percentile(took_s, 95):.0f} for 95 %",
        "unchanged_pct": round(100 * counts["same"] / max(len(took_s), 1)),
        "mb": round(counts["bytes"] / 1e6, 1),
    }


def measured(service: Service, mission: str, clients: int, rate: float, seconds: float) -> dict[str, Any]:
    """Let so many clients look on, and count what it takes."""
    process = psutil.Process(service.pid)
    steps = service.get(f"/missions/{mission}")["progress"]["step"]
    cpu, began = sum(process.cpu_times()[:2]), time.monotonic()
    with Watch(service) as watch:
        if clients:
            found = asyncio.run(look(service.url, mission, clients, rate, seconds))
        else:
            found = {}
            time.sleep(seconds)
    wall = time.monotonic() - began
    steps = service.get(f"/missions/{mission}")["progress"]["step"] - steps
    return {
        "service_cores": round((sum(process.cpu_times()[:2]) - cpu) / wall, 3),
        **found,
        "steps_per_min": round(60 * steps / wall, 1),
        "longest_hold_up_ms": round(1000 * watch.longest_s),
        "memory_mb": round(process.memory_info().rss / 1e6),
    }


def main() -> None:
    """Run and print."""
    parser = make_parser(__doc__, LOAD)
    parser.add_argument("--clients", type=int, default=50)
    parser.add_argument("--rate", type=float, default=10.0, help="tiles a second that each asks for")
    parser.add_argument("--seconds", type=float, default=20.0)
    options = parser.parse_args()
    with running_service(log_level="warning", time_scale="1") as service:
        mission = create_mission(service, VEHICLES, cell_m=2.0)
        begin(service, mission, VEHICLES)
        with beside("sail", service.url, mission, str(VEHICLES), "1.0"):
            time.sleep(15.0)
            nobody = measured(service, mission, 0, 0.0, options.seconds)
            many = measured(service, mission, options.clients, options.rate, options.seconds)
    result = {"clients": options.clients, "asked_per_s_each": options.rate, "without": nobody, "with": many}
    result["more_cores"] = round(many["service_cores"] - nobody["service_cores"], 3)
    json.dump(result, sys.stdout)
    print()
    write_section(options.write, LOAD, f"{options.clients} clients of tiles", result)


if __name__ == "__main__":
    main()
