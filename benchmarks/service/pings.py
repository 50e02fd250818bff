"""What pings of swath sonars cost: ``python -m benchmarks.service.pings [--pings 8000] [--beams 256]``.

Two ways in. *Telemetry*: pings of four vehicles reach a mission in this process one by one, as from a link, faster than
they ever do. *REST*: the real service in a process of its own gets the same pings in batches of one second (5 pings)
and of 1000. Measured are processor time for 1000 pings, how long the event loop was held up, and what a beam takes in
the database and in a file; at the end all is read back. Printed is one JSON object.
"""

import argparse
import asyncio
import json
import math
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import psutil

from app.missions.fleet.interface import PingReport, Position
from app.missions.live.mission import LiveMission
from app.missions.spec.mission import MissionSpec
from benchmarks.common.report import LOAD, make_parser, write_section
from benchmarks.service.boats import FRAME, SIDE_M, START_S, bottom_m, running_service
from benchmarks.service.in_process import missions_in
from benchmarks.service.opening import Watch
from tests.support.dashboard.service import Service

VEHICLES = 4
RATE_HZ = 5.0
HALF_SWATH_DEG = 60.0
PER_SECOND = 200
"""Pings that come by telemetry: ten times what four vehicles send."""
WATCH_S = 0.005
QUIET = 0.03
"""Cores that a process takes in which nothing happens."""
MOST_IDLE = 0.5
"""Cores that the service takes at most for what the watch asks."""


def mission_json() -> dict[str, Any]:
    corners = [(0, 0), (SIDE_M, 0), (SIDE_M, SIDE_M), (0, SIDE_M), (0, 0)]
    ring = [[float(lon), float(lat)] for lat, lon in (FRAME.to_geographic(e, n) for e, n in corners)]
    return {
        "name": "Swaths",
        "area": {"type": "Polygon", "coordinates": [ring]},
        "vehicles": [{"name": f"boat-{i}", "kind": "rest", "sensor": "multibeam"} for i in range(VEHICLES)],
        "steps": 10,
    }


def make_pings(count: int, beams: int) -> list[PingReport]:
    """Pings of all vehicles in turn, along lines; ranges are noisy, as those of sonars are."""
    rng = np.random.default_rng(1)
    angles = np.radians(np.linspace(-HALF_SWATH_DEG, HALF_SWATH_DEG, beams)).astype(np.float32)
    found = []
    for number in range(count):
        vehicle, row = number % VEHICLES, number // VEHICLES
        east, north = 60.0 + 120.0 * vehicle, (row * 0.3) % SIDE_M
        height = bottom_m(east, north) - 2.0
        ranges = height / np.cos(angles) * (1.0 + 0.003 * rng.standard_normal(beams))
        ranges[rng.random(beams) < 0.01] = np.nan
        lat, lon = FRAME.to_geographic(east, north)
        found.append(
            PingReport(
                vehicle=f"boat-{vehicle}",
                time_s=START_S + row / RATE_HZ,
                position=Position(float(lat), float(lon), 2.0 + 0.01 * float(rng.standard_normal())),
                roll_rad=0.02 * float(rng.standard_normal()),
                pitch_rad=0.02 * float(rng.standard_normal()),
                heading_rad=0.02 * float(rng.standard_normal()),
                angles_rad=angles,
                ranges_m=ranges.astype(np.float32),
                source="sonar",
                position_sd_m=1.0,
            )
        )
    return found


class LoopWatch:
    """Notes the longest time that the event loop was held up, seconds."""

    def __init__(self) -> None:
        self.longest_s = 0.0
        self._task = asyncio.create_task(self._watch())

    async def _watch(self) -> None:
        while True:
            began = time.perf_counter()
            await asyncio.sleep(WATCH_S)
            self.longest_s = max(self.longest_s, time.perf_counter() - began - WATCH_S)

    def stop(self) -> None:
        self._task.cancel()


def used_s() -> float:
    return float(sum(psutil.Process().cpu_times()[:2]))


async def by_telemetry(pings: Sequence[PingReport], folder: Path) -> dict[str, Any]:
    """Take pings as from a link, end the mission, and read all of them back."""
    async with missions_in(folder) as service:
        live = await service.get((await service.create(MissionSpec.model_validate(mission_json()))).id)
        watch = LoopWatch()
        idle_s = await _idle_share()
        watch.longest_s = 0.0
        cpu, began = used_s(), time.perf_counter()
        for number, ping in enumerate(pings):
            live.receive(ping)
            wait_s = began + number / PER_SECOND - time.perf_counter()
            if wait_s > 0.0:
                await asyncio.sleep(wait_s)
        await live.journal.flush()
        taken_s = used_s() - cpu - idle_s * (time.perf_counter() - began)
        in_database = await _bytes_in_database(live)
        cpu = used_s()
        await live.pings.move()
        moved_s = used_s() - cpu
        watch.stop()
        files = [part.stat().st_size for part in (folder / "pings").rglob("*.parquet")]
        began = time.perf_counter()
        read = sum([pings.beams async for _, pings in live.pings.all_accepted()])
        reading_s = time.perf_counter() - began
        counts = live.journal.counts
    if (counts.pings, counts.beams) != (len(pings), read):
        raise SystemExit(f"{counts.pings} of {len(pings)} pings are stored, {read} of {counts.beams} beams are read")
    beams = len(pings) * len(pings[0].angles_rad)
    return {
        "ms_cpu_for_1000_pings": round(1e6 * taken_s / len(pings)),
        "ms_cpu_for_1000_pings_to_move_the_rest": round(1e6 * moved_s / len(pings)),
        "longest_hold_up_ms": round(1000 * watch.longest_s, 1),
        "bytes_of_a_beam_in_the_database": in_database,
        "bytes_of_a_beam_in_a_file": round(sum(files) / beams, 2),
        "files": len(files),
        "read_back_beams_per_s": round(read / reading_s),
    }


async def _idle_share() -> float:
    """Return how many cores the process takes while nothing comes, once it has compiled what it compiles."""
    for _ in range(60):
        cpu = used_s()
        await asyncio.sleep(3.0)
        share = (used_s() - cpu) / 3.0
        if share < QUIET:
            return share
    raise SystemExit("the process does not come to rest")


async def _bytes_in_database(live: LiveMission) -> float:
    """Return what a beam takes in blocks, without what the database adds."""
    from sqlalchemy import func, select

    from app.storage.models import PingBlockRow as Block

    async with live.database.reading() as session:
        sums = select(func.sum(func.length(Block.content) + func.length(Block.times)), func.sum(Block.beams))
        size, beams = (await session.execute(sums)).one()
    return round(float(size / beams), 2)


def by_rest(service: Service, pings: Sequence[PingReport], together: int) -> dict[str, Any]:
    """Post pings in batches of so many of one vehicle."""
    mission = service.create(**mission_json())
    items: dict[str, list[dict[str, Any]]] = {}
    for ping in pings:
        beams = {
            "angles_deg": np.degrees(ping.angles_rad).astype(float).round(2).tolist(),
            "ranges_m": [None if np.isnan(r) else round(float(r), 3) for r in ping.ranges_m],
        }
        place = ping.position
        item = {"vehicle": ping.vehicle, "time_s": ping.time_s, "lat_deg": place.lat_deg, "lon_deg": place.lon_deg}
        items.setdefault(ping.vehicle, []).append(item | {"depth_m": place.depth_m, "heading_deg": 1.0, "beams": beams})
    bodies = [
        json.dumps({"items": found[first : first + together]}).encode()
        for found in items.values()
        for first in range(0, len(found), together)
    ]
    process = psutil.Process(service.pid)
    answers = []
    with Watch(service) as watch, httpx.Client(timeout=120) as client:
        idle, before = 1.0, math.inf
        # What is left then is what the watch asks for.
        while idle > MOST_IDLE or before - idle > QUIET:
            cpu, began = sum(process.cpu_times()[:2]), time.perf_counter()
            time.sleep(3.0)
            before, idle = idle, (sum(process.cpu_times()[:2]) - cpu) / (time.perf_counter() - began)
        watch.longest_s = 0.0
        cpu, first = sum(process.cpu_times()[:2]), time.perf_counter()
        for body in bodies:
            began = time.perf_counter()
            url = f"{service.url}/api/v1/missions/{mission}/measurements"
            answer = client.post(url, content=body, headers={"Content-Type": "application/json"}).raise_for_status()
            answers.append(time.perf_counter() - began)
            if answer.json()["rejected"]:
                raise SystemExit(answer.text[:400])
        wall = time.perf_counter() - first
        used = sum(process.cpu_times()[:2]) - cpu - idle * wall
    return {
        "pings_together": together,
        "ms_cpu_for_1000_pings": round(1e6 * used / len(pings)),
        "pings_per_s": round(len(pings) / wall),
        "answer_ms": f"{1000 * np.median(answers):.0f} median, {1000 * max(answers):.0f} longest",
        "longest_hold_up_ms": round(1000 * watch.longest_s),
    }


def measure(options: argparse.Namespace) -> dict[str, Any]:
    pings = make_pings(options.pings, options.beams)
    with tempfile.TemporaryDirectory() as folder:
        telemetry = asyncio.run(by_telemetry(pings, Path(folder)))
    with running_service(log_level="warning") as service:
        rest = [by_rest(service, pings[: options.pings // 2], together) for together in (5, 1000)]
    return {"pings": options.pings, "beams_each": options.beams, "telemetry": telemetry, "rest": rest}


def main() -> None:
    """Run and print."""
    parser = make_parser(__doc__, LOAD)
    parser.add_argument("--pings", type=int, default=8000)
    parser.add_argument("--beams", type=int, default=256)
    options = parser.parse_args()
    result = measure(options)
    print(json.dumps(result))
    write_section(options.write, LOAD, "Pings of swath sonars", result)


if __name__ == "__main__":
    main()
