"""The real service, vehicles that speak REST to it, and pages that watch them, in processes of their own."""

import asyncio
import contextlib
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx

from app.mapping.coordinates.georeference import LocalFrame
from tests.support.dashboard.service import Service

FRAME = LocalFrame(41.185, -8.705)
SIDE_M = 500.0
RATE_HZ = 5.0
START_S = 1_795_000_000.0


@dataclass
class Boat:
    """A vehicle that goes where it is sent and posts where it is."""

    name: str
    east_m: float
    north_m: float
    step: int = -1
    target: tuple[float, float] | None = None
    time_s: float = START_S

    def item(self, depth_m: float, *, sounds: bool) -> dict[str, Any]:
        lat, lon = FRAME.to_geographic(self.east_m, self.north_m)
        item = {"vehicle": self.name, "time_s": self.time_s, "lat_deg": float(lat), "lon_deg": float(lon)}
        item |= {"depth_m": depth_m, "battery_pct": 80.0, "speed_mps": 2.0, "heading_deg": 45.0}
        return item | ({"range_m": bottom_m(self.east_m, self.north_m) - depth_m} if sounds else {})


def bottom_m(east_m: float, north_m: float) -> float:
    ridge = 6.0 * abs((east_m + north_m) % 200 - 100) / 100
    return 10.0 + 8.0 * north_m / SIDE_M + ridge


def create_mission(service: Service, vehicles: int, cell_m: float = 1.0) -> str:
    corners = [(0, 0), (SIDE_M, 0), (SIDE_M, SIDE_M), (0, SIDE_M), (0, 0)]
    ring = [[float(lon), float(lat)] for lat, lon in (FRAME.to_geographic(e, n) for e, n in corners)]
    names = [{"name": f"boat-{i}", "kind": "rest"} for i in range(vehicles)]
    return service.create(
        name="Load",
        area={"type": "Polygon", "coordinates": [ring]},
        vehicles=names,
        cell_m=cell_m,
        steps=100_000,
        step_deadline_s=60,
        planner={"name": "random"},
        limits={"max_step_m": 30, "max_depth_m": 10, "min_separation_m": 0},
    )


def begin(service: Service, mission: str, vehicles: int) -> None:
    """Let the vehicles be heard and start: from then on their ways are kept."""
    here = [Boat(f"boat-{v}", v * SIDE_M / vehicles, 0.0).item(2.0, sounds=True) for v in range(vehicles)]
    service.post(f"/missions/{mission}/measurements", {"items": here})
    service.act(mission, "start")


def lay_tracks(
    service: Service, mission: str, vehicles: int, points: int, every: int = 10, begin_s: float = 1.0
) -> None:
    """Post what the vehicles did before: lines to and fro, a sounding at every so many-th place."""
    per_vehicle = points // vehicles
    strip = SIDE_M / vehicles
    for v in range(vehicles):
        boat = Boat(f"boat-{v}", 0, 0)
        items = []
        for i in range(per_vehicle):
            line, along = divmod(i * 1.25, SIDE_M)
            boat.north_m = along if line % 2 == 0 else SIDE_M - along
            boat.east_m = v * strip + (line * 4.0 + 1.0) % strip
            boat.time_s = START_S + begin_s + i
            items.append(boat.item(2.0, sounds=i % every == 0))
        for first in range(0, len(items), 5000):
            service.post(f"/missions/{mission}/measurements", {"items": items[first : first + 5000]})
    ways = service.get(f"/missions/{mission}/tracks.geojson")["features"]
    kept = sum(len(way["geometry"]["coordinates"]) for way in ways)
    if kept < 0.95 * points:
        raise SystemExit(f"only {kept} of {points} track points were kept")


async def sail(url: str, mission: str, vehicles: int, pace: float) -> None:
    """Let the vehicles go where they are sent until this process is ended."""
    boats = [Boat(f"boat-{i}", 5.0 + i * SIDE_M / vehicles, 5.0, time_s=START_S + 1e6) for i in range(vehicles)]
    async with httpx.AsyncClient(base_url=f"{url}/api/v1/missions/{mission}", timeout=30, verify=False) as client:  # noqa: S501

        async def follow(boat: Boat) -> None:
            while True:
                answer = await client.get(
                    f"/vehicles/{boat.name}/waypoint", params={"after_step": max(boat.step, 0), "timeout_s": 20}
                )
                if answer.status_code == 200:
                    found = answer.json()
                    boat.step, boat.target = found["step"], (found["east_m"], found["north_m"])
                else:
                    await asyncio.sleep(0.5)

        async def report() -> None:
            ticks = 0
            while True:
                began = time.monotonic()
                for boat in boats:
                    boat.time_s += pace / RATE_HZ
                    move(boat, 2.0 * pace / RATE_HZ)
                items = [boat.item(3.0, sounds=ticks % 5 == 0) for boat in boats]
                await client.post("/measurements", json={"items": items})
                ticks += 1
                await asyncio.sleep(max(0.0, 1 / RATE_HZ - (time.monotonic() - began)))

        await asyncio.gather(report(), *(follow(boat) for boat in boats))


def move(boat: Boat, metres: float) -> None:
    if boat.target is None:
        return
    east, north = boat.target[0] - boat.east_m, boat.target[1] - boat.north_m
    left = (east**2 + north**2) ** 0.5
    share = min(1.0, metres / left) if left > 0 else 1.0
    boat.east_m += east * share
    boat.north_m += north * share


async def watch(url: str, mission: str, viewers: int) -> None:
    """Look at a mission as so many pages do: the live socket, and what changed in the map."""
    import websockets

    async def view(client: httpx.AsyncClient) -> None:
        tag, wanted = "", asyncio.Event()

        async def fetch() -> None:
            nonlocal tag
            while True:
                await wanted.wait()
                wanted.clear()
                answer = await client.get("/map/tiles", params={"since": tag})
                if answer.status_code == 200:
                    # The header is near the front; the rest is what a page would draw.
                    tag = re.search(rb'"tag": "([^"]+)"', answer.content)[1].decode()  # type: ignore[index]
                await asyncio.sleep(0.7)

        address = url.replace("http", "ws") + f"/api/v1/missions/{mission}/live"
        fetching = asyncio.create_task(fetch())
        async with websockets.connect(address, max_size=None) as socket:
            async for message in socket:
                if '"type":"map"' in message[:40] or '"type":"snapshot"' in message[:40]:
                    wanted.set()
        fetching.cancel()

    async with httpx.AsyncClient(base_url=f"{url}/api/v1/missions/{mission}", timeout=60, verify=False) as client:  # noqa: S501
        await asyncio.gather(*(view(client) for _ in range(viewers)))


@contextlib.contextmanager
def beside(*arguments: str) -> Iterator[None]:
    """Let vehicles sail or pages watch in a process of its own."""
    with subprocess.Popen(
        [sys.executable, "-m", "benchmarks.service.boats", *arguments], stderr=subprocess.DEVNULL
    ) as process:
        try:
            yield
        finally:
            process.kill()


@contextlib.contextmanager
def running_service(**settings: str) -> Iterator[Service]:
    """The service in a folder of its own; it is ended even where this process is."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    with tempfile.TemporaryDirectory() as folder:
        service = Service(Path(folder), **settings)
        service.start()
        try:
            yield service
        finally:
            service.kill()


if __name__ == "__main__":
    if sys.argv[1] == "sail":
        asyncio.run(sail(sys.argv[2], sys.argv[3], int(sys.argv[4]), float(sys.argv[5])))
    else:
        asyncio.run(watch(sys.argv[2], sys.argv[3], int(sys.argv[4])))
