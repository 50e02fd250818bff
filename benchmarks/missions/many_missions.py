"""Many missions at once: ``python -m benchmarks.missions.many_missions [--missions 20] [--seconds 60]``.

The real service flies so many missions of simulated vehicles at the same time, each with planner, map and safety check
of its own. Measured are the steps that were committed, how long decisions took and how long vehicles circled for them,
whether any mission got less than its share, how long the event loop was held up, and memory. Printed is one JSON
object.
"""

import argparse
import json
import sqlite3
import time
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import psutil

from app.mapping.coordinates.georeference import LocalFrame
from benchmarks.common.report import LOAD, make_parser, write_section
from benchmarks.service.boats import running_service
from benchmarks.service.opening import Watch
from tests.support.dashboard.service import Service

SIDE_M = 120.0
APART_DEG = 0.01


def create(service: Service, number: int, vehicles: int) -> str:
    """Describe one mission; each has a sea floor of its own."""
    frame = LocalFrame(41.185 + APART_DEG * number, -8.705)
    corners = [(0, 0), (SIDE_M, 0), (SIDE_M, SIDE_M), (0, SIDE_M), (0, 0)]
    ring = [[float(lon), float(lat)] for lat, lon in (frame.to_geographic(e, n) for e, n in corners)]
    return service.create(
        name=f"Mission {number}",
        area={"type": "Polygon", "coordinates": [ring]},
        vehicles=[{"name": f"m{number}-{v}", "kind": "sim", "sensor": "dvl"} for v in range(vehicles)],
        cell_m=2.0,
        steps=200,
        planner={"name": "cao"},
        limits={"max_step_m": 10, "max_depth_m": 8, "min_vertical_separation_m": 1},
    )


def planning(service: Service) -> tuple[float, float, dict[float, float]]:
    """How many decisions were made, their seconds in all, and how many took at most so long."""
    text = httpx.get(f"{service.url}/metrics", timeout=60).text
    found: dict[str, float] = {}
    buckets: dict[float, float] = {}
    for line in text.splitlines():
        if line.startswith("bathyfleet_planning_seconds"):
            name, value = line.split(" ")
            if "le=" in name:
                buckets[float(name.split('"')[1])] = float(value)
            else:
                found[name] = float(value)
    return found["bathyfleet_planning_seconds_count"], found["bathyfleet_planning_seconds_sum"], buckets


def below(share: float, buckets: dict[float, float]) -> float:
    """Return the time within which so many of the decisions were made."""
    most = max(buckets.values())
    return min((le for le, count in buckets.items() if count >= share * most), default=float("nan"))


def steps_of(file: Path) -> dict[str, list[float]]:
    """When each mission committed its steps, Unix seconds."""
    with sqlite3.connect(f"file:{file}?mode=ro", uri=True) as connection:
        query = "SELECT mission_id, (julianday(committed_at) - 2440587.5) * 86400 FROM steps ORDER BY number"
        found: dict[str, list[float]] = {}
        for mission, at in connection.execute(query):
            found.setdefault(mission, []).append(at)
    connection.close()
    return found


def measure(service: Service, file: Path, options: argparse.Namespace) -> dict[str, Any]:
    """Fly for so many seconds."""
    missions = [create(service, number, options.vehicles) for number in range(options.missions)]
    process = psutil.Process(service.pid)
    for mission in missions:
        service.act(mission, "start")
    time.sleep(options.seconds / 3)  # every planner has begun, every loop is compiled
    before, at_first = planning(service), steps_of(file)
    cpu, memory, began = sum(process.cpu_times()[:2]), process.memory_info().rss / 1e6, time.monotonic()
    with Watch(service) as watch:
        time.sleep(options.seconds)
    wall = time.monotonic() - began
    after, steps = planning(service), steps_of(file)
    made = after[0] - before[0]
    done = [len(steps.get(m, ())) - len(at_first.get(m, ())) for m in missions]
    gaps = np.concatenate([np.diff(times) for times in steps.values()] or [np.zeros(1)])
    buckets = {le: after[2][le] - before[2].get(le, 0.0) for le in after[2]}
    states = [service.get(f"/missions/{mission}")["state"] for mission in missions]
    return {
        "missions": options.missions,
        "vehicles_each": options.vehicles,
        "pace": options.pace,
        "seconds": round(wall),
        "running_or_finished": sum(state in ("running", "finished") for state in states),
        "steps": sum(done),
        "steps_of_a_mission": f"{min(done)} to {max(done)}",
        "seconds_between_steps": f"{np.median(gaps):.2f} median, {np.percentile(gaps, 95):.2f} for 95 %",
        "mean_decision_s": round((after[1] - before[1]) / max(made, 1), 3),
        "decisions_within_s": {"50 %": below(0.5, buckets), "95 %": below(0.95, buckets)},
        "service_cores": round((sum(process.cpu_times()[:2]) - cpu) / wall, 2),
        "longest_hold_up_ms": round(1000 * watch.longest_s),
        "memory_mb": f"{memory:.0f} to {process.memory_info().rss / 1e6:.0f}",
    }


def main() -> None:
    """Run and print."""
    parser = make_parser(__doc__, LOAD)
    parser.add_argument("--missions", type=int, default=20)
    parser.add_argument("--vehicles", type=int, default=2, help="of each mission")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--pace", type=float, default=1.0, help="how much faster than the wall clock vehicles live")
    options = parser.parse_args()
    with running_service(log_level="warning", time_scale=f"{options.pace:g}") as service:
        result = measure(service, service.database, options)
    print(json.dumps(result))
    write_section(options.write, LOAD, f"{options.missions} missions at once", result)


if __name__ == "__main__":
    main()
