"""How long it takes from ``bathyfleet serve`` to a vehicle's first waypoint where nothing was compiled yet.

``python -m benchmarks.service.beginning [--vehicles 4 --runs 3] [--kept] [--functions]``. The real service is started
with an empty folder for compiled functions (``--kept``: once more with what the first start left there), a mission of
simulated vehicles is made and started as soon as requests are answered, and its live view is watched until it tells of
the first waypoint that is on its way. The processor time until then is told too, of the service and of the processes
that compile beside it: on a busy machine it says more than the clock. ``--functions`` lists what was compiled until
then, by process; of such a run the times are those of a start that is watched. Printed is one JSON object, in seconds
since the start of the command.
"""

import asyncio
import json
import os
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

import psutil
import websockets

from benchmarks.common.report import LOAD, make_parser, write_section
from tests.support.dashboard.service import Service

ASKED_S = 10.0
ON_ITS_WAY = ("sent", "underway", "reached")
LISTENER = """
import os, time
from pathlib import Path

def listen():
    import numba.core.event as event

    class Told(event.Listener):
        def __init__(self):
            self.open = []
        def on_start(self, event):
            self.open.append([time.time(), time.thread_time(), 0.0])
        def on_end(self, event):
            began, busy, inside = self.open.pop()
            took = time.thread_time() - busy
            if self.open:
                self.open[-1][2] += took
            names = f"{event.data['dispatcher'].__module__}.{event.data['dispatcher'].__name__}"
            line = f"{os.getpid()}\\t{began}\\t{took}\\t{took - inside}\\t{names}\\t{event.data['args']}\\n"
            with open(os.environ["COMPILED_FUNCTIONS"], "a") as file:
                file.write(line)

    event.register("numba:compile", Told())

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == "app.compiled.index":
            sys.meta_path.remove(self)
            listen()
        return None

import sys
sys.meta_path.insert(0, Finder())
"""
"""Put before the service's own words, in ``usercustomize``: writes down each function that is compiled."""


def corners(side_m: float) -> dict[str, Any]:
    """A square of the sea off Leixoes."""
    north, east = side_m / 111_200.0, side_m / 83_700.0
    ring = [[0.0, 0.0], [east, 0.0], [east, north], [0.0, north], [0.0, 0.0]]
    return {"type": "Polygon", "coordinates": [[[-8.705 + lon, 41.185 + lat] for lon, lat in ring]]}


async def first_waypoint(service: Service, mission: str) -> None:
    """Return when a vehicle has a waypoint."""
    address = service.url.replace("http", "ws") + f"/api/v1/missions/{mission}/live"
    async with websockets.connect(address, max_size=None) as line:
        await asyncio.to_thread(service.act, mission, "start")
        async for text in line:
            told = json.loads(text)
            if told["type"] == "waypoints" and any(one["status"] in ON_ITS_WAY for one in told["waypoints"]):
                return


def begin(folder: Path, vehicles: int, side_m: float, *, kept: bool) -> dict[str, float]:
    """Start the service and a mission; seconds until it answers, the mission is made, and the first waypoint is sent.

    With ``kept`` the processes that compile beside it are let end.
    """
    service = Service(folder, time_scale="1", log_level="warning")
    began = time.perf_counter()
    service.start()
    try:
        found = {"answers_s": time.perf_counter() - began}
        team = [{"name": f"sim-{i}", "kind": "sim", "sensor": "dvl"} for i in range(vehicles)]
        mission = service.create(area=corners(side_m), vehicles=team, planner={"name": "cao"})
        found["mission_s"] = time.perf_counter() - began
        asyncio.run(first_waypoint(service, mission))
        found["waypoint_s"] = time.perf_counter() - began
        found["service_cpu_s"] = cpu_s(psutil.Process(service.pid))
        beside = psutil.Process(service.pid).children()
        found["beside_cpu_s"] = sum(map(cpu_s, beside))
        if kept:
            psutil.wait_procs(beside)
    finally:
        for process in psutil.Process(service.pid).children():
            process.kill()
            process.wait()
        service.kill()
    return {name: round(value, 2) for name, value in found.items()}


def cpu_s(process: psutil.Process) -> float:
    """What a process has computed."""
    times = process.cpu_times()
    return float(times.user + times.system)


def compiled(file: Path) -> list[str]:
    """What was compiled, in lines: the process's number, when, how long with what it calls, how long alone, which."""
    if not file.exists():
        return []
    lines = [line.split("\t") for line in file.read_text().splitlines()]
    first = min(float(line[1]) for line in lines)
    own: dict[str, float] = defaultdict(float)
    for line in lines:
        own[line[0]] += float(line[3])
    told = [
        f"{process} {float(began) - first:6.2f} {float(took):6.2f} {float(alone):6.2f} {name} {types[:150]}"
        for process, began, took, alone, name, types in lines
    ]
    return [*told, *(f"{process} {seconds:6.2f} s in all" for process, seconds in own.items())]


def main() -> int:
    """Run and print."""
    parser = make_parser(__doc__, LOAD)
    parser.add_argument("--vehicles", type=int, default=4)
    parser.add_argument("--side-m", type=float, default=500.0)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--kept", action="store_true", help="start again with what the first start compiled")
    parser.add_argument("--functions", action="store_true", help="list what was compiled")
    options = parser.parse_args()
    result: dict[str, Any] = {"vehicles": options.vehicles, "side_m": options.side_m}
    for run in range(options.runs):
        with tempfile.TemporaryDirectory(prefix="bathyfleet-beginning-") as name:
            folder = Path(name)
            os.environ["NUMBA_CACHE_DIR"] = str(folder / "compiled")
            if options.functions:
                (folder / "sitecustomize.py").write_text(LISTENER)
                os.environ["PYTHONPATH"] = name
                os.environ["COMPILED_FUNCTIONS"] = str(folder / "functions.tsv")
            result[f"empty_{run}"] = begin(folder, options.vehicles, options.side_m, kept=options.kept)
            if options.functions:
                print(*compiled(folder / "functions.tsv"), sep="\n")
            if options.kept:
                (folder / "service.db").unlink()
                result[f"kept_{run}"] = begin(folder, options.vehicles, options.side_m, kept=False)
    worst = max(one["waypoint_s"] for name, one in result.items() if name.startswith("empty"))
    print(json.dumps(result))
    write_section(options.write, LOAD, "From the start to the first waypoint", result)
    return 0 if worst <= ASKED_S else 1


if __name__ == "__main__":
    sys.exit(main())
