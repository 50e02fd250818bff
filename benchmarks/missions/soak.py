"""A day of a mission: ``python -m benchmarks.missions.soak [--hours 24] [--pace 60]``.

The real service with simulated vehicles runs a mission at ``--pace`` times the wall clock: a day takes 24 minutes.
Two pages watch it (one takes its time), a client reads missions and maps, and a vehicle of another mission posts
measurements under idempotency keys. Every hour of the mission is noted: memory, file handles, threads, the database's
size and its rows, and at the end the bytes of every table. Printed are the hours as they come and one JSON object.
"""

import argparse
import asyncio
import contextlib
import json
import sqlite3
import time
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import psutil
import websockets

from benchmarks.common.report import LOAD, make_parser, write_section
from benchmarks.service.boats import START_S, Boat, create_mission, running_service
from tests.support.dashboard.service import Service

TABLES = ("soundings", "positions", "telemetry", "steps", "waypoints", "events", "batches")
SIDE_M = 300.0


def create_soak(service: Service, vehicles: int) -> str:
    """A mission that does not end within a day."""
    from benchmarks.service.boats import FRAME

    corners = [(0, 0), (SIDE_M, 0), (SIDE_M, SIDE_M), (0, SIDE_M), (0, 0)]
    ring = [[float(lon), float(lat)] for lat, lon in (FRAME.to_geographic(e, n) for e, n in corners)]
    return service.create(
        name="A day",
        area={"type": "Polygon", "coordinates": [ring]},
        vehicles=[
            {"name": f"sim-{v}", "kind": "sim", "sensor": "single_beam", "endurance_min": 3000} for v in range(vehicles)
        ],
        cell_m=2.0,
        steps=4500,
        planner={"name": "cao"},
        limits={"max_step_m": 30, "max_depth_m": 8, "min_vertical_separation_m": 1, "min_separation_m": 0},
    )


async def watch(url: str, mission: str, pause_s: float) -> None:
    """Look at a mission; ``pause_s`` between two messages makes a slow viewer, who is let go and comes again."""
    address = url.replace("http", "ws") + f"/api/v1/missions/{mission}/live"
    while True:
        with contextlib.suppress(OSError, websockets.WebSocketException):
            async with websockets.connect(address, max_size=None) as line:
                async for _ in line:
                    await asyncio.sleep(pause_s)
        await asyncio.sleep(1.0)


async def read(client: httpx.AsyncClient, mission: str) -> None:
    """Read what pages and scripts read."""
    paths = (f"/missions/{mission}", "/missions", f"/missions/{mission}/map/tiles", "/vehicles", "/health/ready")
    while True:
        for path in paths:
            with contextlib.suppress(httpx.HTTPError):
                await client.get(path)
            await asyncio.sleep(0.5)


async def post(client: httpx.AsyncClient, mission: str, count: list[int]) -> None:
    """Post one measurement after the other, each under a key of its own."""
    while True:
        n = count[0]
        boat = Boat("boat-0", 5.0 + n % 480, 5.0 + n // 480 % 480, time_s=START_S + n)
        with contextlib.suppress(httpx.HTTPError):
            answer = await client.post(
                f"/missions/{mission}/measurements",
                json={"items": [boat.item(2.0, sounds=True)]},
                headers={"Idempotency-Key": f"soak-{n}"},
            )
            count[0] += answer.is_success
        await asyncio.sleep(0.2)


def sample(process: psutil.Process, file: Path, hour: float) -> dict[str, Any]:
    """What the service and its database are like now."""
    with sqlite3.connect(f"file:{file}?mode=ro", uri=True) as connection:
        # Numbers grow by one for each row; to count them all would disturb what is measured.
        rows = {t: connection.execute(f"SELECT count(*) FROM {t}").fetchone()[0] for t in TABLES}  # noqa: S608
        step = connection.execute("SELECT max(number) FROM steps").fetchone()[0] or 0
    connection.close()
    wal = file.with_name(file.name + "-wal")
    return {
        "hour": round(hour, 2),
        "memory_mb": round(process.memory_info().rss / 1e6, 1),
        "handles": process.num_fds(),
        "threads": process.num_threads(),
        "database_mb": round(file.stat().st_size / 1e6, 1),
        "wal_mb": round(wal.stat().st_size / 1e6, 1) if wal.exists() else 0.0,
        "step": step,
        "rows": rows,
    }


def sizes(file: Path) -> dict[str, float]:
    """Bytes of every table with its indexes, MB."""
    with sqlite3.connect(f"file:{file}?mode=ro", uri=True) as connection:
        indexed = dict(connection.execute("SELECT name, tbl_name FROM sqlite_master"))
        pages = connection.execute("SELECT name, pgsize FROM dbstat WHERE aggregate = TRUE").fetchall()
    connection.close()
    found: dict[str, float] = {}
    for name, size in pages:
        table = indexed.get(name, name)
        found[table] = found.get(table, 0.0) + size / 1e6
    return {name: round(size, 2) for name, size in sorted(found.items()) if size >= 0.1}


async def live(service: Service, file: Path, options: argparse.Namespace) -> dict[str, Any]:
    """Let the mission run and note every hour of it."""
    mission = create_soak(service, options.vehicles)
    other = create_mission(service, 1, cell_m=5.0)
    service.act(mission, "start")
    process, hours, count = psutil.Process(service.pid), [], [0]
    async with httpx.AsyncClient(base_url=f"{service.url}/api/v1", timeout=60) as client:
        async with asyncio.TaskGroup() as group:
            beside = [
                group.create_task(work)
                for work in (
                    watch(service.url, mission, 0.0),
                    watch(service.url, mission, 0.5),
                    read(client, mission),
                    post(client, other, count),
                )
            ]
            began, cpu = time.monotonic(), process.cpu_times()
            for number in range(round(options.hours) + 1):
                await asyncio.sleep(max(0.0, began + number * 3600 / options.pace - time.monotonic()))
                hour = (time.monotonic() - began) * options.pace / 3600
                hours.append(await asyncio.to_thread(sample, process, file, hour))
                print(json.dumps(hours[-1]), flush=True)
            after = process.cpu_times()
            wall = time.monotonic() - began
            for task in beside:
                task.cancel()
        state = (await client.get(f"/missions/{mission}")).json()
    return summary(hours, sizes(file), options) | {
        "state": state["state"],
        "soundings": state["progress"]["soundings"],
        "service_cores": round((after.user + after.system - cpu.user - cpu.system) / wall, 2),
        "posted_batches": count[0],
    }


def summary(hours: list[dict[str, Any]], tables: dict[str, float], options: argparse.Namespace) -> dict[str, Any]:
    """The day in a few figures; growth is that of the second half, when everything was used once."""
    half = hours[len(hours) // 2 :]

    def per_hour(name: str) -> float:
        if len(half) < 2:
            return 0.0
        return round(float(np.polyfit([h["hour"] for h in half], [h[name] for h in half], 1)[0]), 2)

    rows = {name: round((hours[-1]["rows"][name] - hours[0]["rows"][name]) / options.hours) for name in TABLES}
    return {
        "hours": options.hours,
        "pace": options.pace,
        "vehicles": options.vehicles,
        "steps": hours[-1]["step"],
        "memory_mb": [h["memory_mb"] for h in hours],
        "memory_growth_mb_per_hour": per_hour("memory_mb"),
        "handles": f"{min(h['handles'] for h in hours)} to {max(h['handles'] for h in hours)}",
        "threads": f"{min(h['threads'] for h in hours)} to {max(h['threads'] for h in hours)}",
        "database_mb": [h["database_mb"] for h in hours],
        "database_growth_mb_per_hour": per_hour("database_mb"),
        "log_of_writes_mb": max(h["wal_mb"] for h in hours),
        "rows_per_hour": rows,
        "mb_at_the_end": tables,
    }


def main() -> None:
    """Run and print."""
    parser = make_parser(__doc__, LOAD)
    parser.add_argument("--hours", type=float, default=24.0, help="of the mission's time")
    parser.add_argument("--pace", type=float, default=60.0, help="how much faster than the wall clock vehicles live")
    parser.add_argument("--vehicles", type=int, default=2)
    options = parser.parse_args()
    with running_service(log_level="warning", time_scale=f"{options.pace:g}") as service:
        result = asyncio.run(live(service, service.database, options))
    print(json.dumps(result))
    write_section(options.write, LOAD, f"{options.hours:g} hours of a mission", result)


if __name__ == "__main__":
    main()
