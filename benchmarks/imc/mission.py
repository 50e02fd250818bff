"""A whole mission over IMC: ``python -m benchmarks.imc.mission [--steps 100] [--loss 0.05] [--kill-at 50]``.

The mission service, its database and planner run as they do for real vehicles; two fake DUNE nodes in processes of
their own are the vehicles. ``--radio-range 5000`` ends their radio at the surface, as in the recorded session
``wifi_gap_x5``, for which ``--guidance legs`` is made; ``--max-step 10 --speed 1`` are the short legs in real time
that need it most, ``dives_m`` says how deep each was. ``--stops`` pauses and aborts in the middle while a process keeps
a core busy, and times the answers; ``--kill-at`` kills one vehicle's DUNE at that step and starts
it again where it was. Afterwards the vehicles' own logs are imported, as an operator does: ``soundings`` came by
radio, ``soundings_with_logs`` is what the map has in the end, and ``measured_on_board`` what the vehicles measured in
all. Printed is one JSON object, ``--write`` puts it into a page; exit code 1 when the mission did not complete, a
waypoint was refused or missed, or soundings are off by more than 0.2 m.
"""

import argparse
import asyncio
import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from app.api import logs
from app.mapping.coordinates.georeference import LocalFrame
from app.missions.fleet.interface import WaypointStatus
from app.missions.metrics import PACKETS_DROPPED
from app.missions.operations.history import events_after
from app.missions.operations.imports.log_import import import_log
from app.missions.running.mission_views import mission_view
from app.missions.service import MissionService
from app.missions.settings import ImcSettings, ServiceSettings
from app.missions.spec.mission import MissionSpec
from app.missions.states import ENDED, Action
from app.storage.database import Database
from app.storage.queries.missions import waypoints_between
from app.storage.upkeep.prepare import prepare_database
from benchmarks.common.report import IMC, make_parser, write_section
from imc_bridge import BridgeSettings, NodeState, Sounding, StateReport
from imc_bridge.logs import VehicleLog
from simulator.floors.seafloors import generate
from simulator.floors.terrain import Terrain
from tests.support.missions.stored_soundings import soundings_of

ORIGIN = (41.185, -8.705)
SIDE_M = 120.0
PORT, ANNOUNCE_PORTS = 32210, (32200, 32201, 32202, 32203, 32204)
NAMES = ("lauv-xplore-1", "lauv-xplore-2", "lauv-xplore-3", "lauv-xplore-4")
UNDER_WATER_M = 0.5
BACK_AFTER_WALL_S = 1.0


class Vehicle:
    """One vehicle's DUNE in a process of its own, which can be killed and started again."""

    def __init__(self, number: int, options: argparse.Namespace, seed: int, logs: Path) -> None:
        self.name = NAMES[number]
        self._start_m = (SIDE_M * (number + 1) / (options.vehicles + 1.0), 10.0)
        self._command = [
            *(sys.executable, "-m", "simulator", "--vehicles", "1", "--names", self.name, "--ids", f"{0x1E + number}"),
            *("--family", options.family, "--size", f"{SIDE_M:g}", "--seed", f"{seed}"),
            *("--origin", ",".join(map(str, ORIGIN)), "--base-port", f"{32220 + 10 * number}"),
            *("--announce-ports", f"{ANNOUNCE_PORTS[0]}-{ANNOUNCE_PORTS[-1]}", "--speed", f"{options.speed:g}"),
            *("--loss", f"{options.loss:g}", "--radio-range", f"{options.radio_range:g}", "--log-dir", str(logs)),
            *(["--chatter"] if options.chatter else []),
        ]
        self._process: subprocess.Popen[str] | None = None
        self.collisions = 0

    def start(self, at_m: tuple[float, float] | None = None) -> None:
        """Start its DUNE, at the surface of a place or where the mission begins."""
        place = ",".join(f"{value:.2f}" for value in at_m or self._start_m)
        command = [*self._command, "--start", place]
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)

    def kill(self) -> None:
        """End its DUNE without a word."""
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None

    def end(self) -> None:
        """End its DUNE in peace, and note how often it touched the bottom."""
        if self._process is not None:
            self._process.terminate()
            self.collisions += self._process.communicate()[1].count("hit the bottom")
            self._process = None


def mission(options: argparse.Namespace) -> MissionSpec:
    """Vehicles that map a square of 100 m."""
    led = {"guidance": options.guidance}
    names = NAMES[: options.vehicles]
    frame = LocalFrame(*ORIGIN)
    corners = [(10, 10), (110, 10), (110, 110), (10, 110), (10, 10)]
    ring = [[float(x) for x in reversed(frame.to_geographic(float(e), float(n)))] for e, n in corners]
    return MissionSpec.model_validate(
        {
            "name": "IMC benchmark",
            "area": {"type": "Polygon", "coordinates": [ring]},
            "vehicles": [{"name": name, "kind": "imc", "depth_m": 2.0 + k} | led for k, name in enumerate(names)],
            "steps": options.steps,
            "cell_m": 2.0,
            "limits": {"max_step_m": options.max_step, "min_vertical_separation_m": 1.0, "min_altitude_m": 2.0},
            "planner": {"name": options.planner},
        }
    )


async def fly(options: argparse.Namespace, seed: int, folder: Path) -> dict[str, Any]:
    """Fly the mission; what came of it."""
    floor = generate(options.family, seed, width_m=SIDE_M, height_m=SIDE_M, origin=ORIGIN)
    logs = folder / "logs"
    vehicles = [Vehicle(number, options, seed, logs) for number in range(options.vehicles)]
    url = f"sqlite+aiosqlite:///{folder / 'mission.db'}"
    imc = ImcSettings(port=PORT, announce_ports=ANNOUNCE_PORTS, loopback_only=True)
    await prepare_database(url, may_upgrade=True)
    database = Database(url)
    service = MissionService(ServiceSettings(database_url=url, imc=imc, time_scale=options.speed), database)
    begun = time.monotonic()
    try:
        for vehicle in vehicles:
            vehicle.start()
        await service.startup()
        identity = (await service.create(mission(options))).id
        while sum(view.link == "ready" for view in await service.vehicles()) < options.vehicles:  # noqa: ASYNC110
            await asyncio.sleep(0.1)
        await service.act(await service.get(identity), Action.START, actor="benchmark")
        killed = options.kill_at is None
        answers: dict[str, float] = {}
        while (view := mission_view(await service.get(identity))).state not in ENDED:
            if options.stops and not answers and view.progress.step >= options.steps // 2:
                answers = await stopped(service, identity)
            if not killed and view.progress.step >= options.kill_at:
                killed = True
                [place] = [v for v in view.vehicles if v.name == vehicles[0].name]
                if place.lat_deg is None or place.lon_deg is None:
                    raise SystemExit(f"nobody knows where {place.name} is")
                vehicles[0].kill()
                await asyncio.sleep(BACK_AFTER_WALL_S)
                vehicles[0].start(floor.frame.to_local(place.lat_deg, place.lon_deg))
            if options.progress and sys.stderr.isatty():
                print(f"\rstep {view.progress.step}", end="", file=sys.stderr)
            await asyncio.sleep(0.2)
        result = await summary(service, database, identity, floor, begun)
        result["idle_at_the_end"] = all(view.link == "ready" for view in await service.vehicles())
        for vehicle in vehicles:
            vehicle.end()
        result |= answers
        result["collisions"] = sum(vehicle.collisions for vehicle in vehicles)
        return result | await with_logs(service, identity, floor, sorted(logs.glob("*/*/Data.lsf")))
    finally:
        await service.shutdown()
        await database.close()
        for vehicle in vehicles:
            vehicle.kill()


async def stopped(service: MissionService, identity: str) -> dict[str, float]:
    """Pause, resume and abort while another process keeps a core busy; how long the answers took, seconds."""
    busy = await asyncio.create_subprocess_exec(sys.executable, "-c", "while True: pass")
    answers: dict[str, float] = {}
    try:
        await asyncio.sleep(2.0)
        for action in (Action.PAUSE, Action.RESUME, Action.ABORT):
            begun = time.monotonic()
            view = await service.act(await service.get(identity), action, actor="benchmark")
            answers[f"{action}_answered_s"] = round(time.monotonic() - begun, 2)
            if view.stops:
                answers[f"{action}_acknowledged"] = sum(stop.acknowledged for stop in view.stops)
            await asyncio.sleep(5.0)
    finally:
        busy.kill()
        await busy.wait()
    return answers


def dives_m(log: VehicleLog) -> list[float]:
    """How deep each dive of a vehicle was."""
    dives, deepest = [], 0.0
    for event in log.events():
        depth = event.depth_m if isinstance(event, StateReport) else None
        if depth is None:
            continue
        if depth > UNDER_WATER_M:
            deepest = max(deepest, depth)
        elif deepest:
            dives.append(round(deepest, 2))
            deepest = 0.0
    return dives


async def summary(
    service: MissionService, database: Database, identity: str, floor: Terrain, begun: float
) -> dict[str, Any]:
    """Steps, waypoints, soundings against the truth, and what the log says."""
    view = mission_view(await service.get(identity))
    statuses: dict[str, int] = {}
    async with database.reading() as session:
        for row in await waypoints_between(session, identity, 1, view.progress.step):
            statuses[row.status] = statuses.get(row.status, 0) + 1
    errors, rejected = await errors_m(service, identity, floor)
    log = await events_after(await service.get(identity), limit=1000)
    details = {view.name: view.reason for view in await service.vehicles()}
    return {
        "state": view.state,
        "steps": view.progress.step,
        "wall_s": round(time.monotonic() - begun, 1),
        "waypoints": statuses,
        "waypoints_per_minute": round(60.0 * statuses.get("reached", 0) / (time.monotonic() - begun), 1),
        "dropped_packets": sum(sample.value for sample in next(iter(PACKETS_DROPPED.collect())).samples[:1]),
        "lost": [
            f"{vehicle.name} {'engaged' if change.engaged else 'not engaged'}: {change.reason}"
            for vehicle in service.doctor().vehicles
            for change in vehicle.history
            if change.state is NodeState.LOST
        ],
        "reasons": sorted({waypoint.reason for waypoint in view.waypoints if waypoint.reason}),
        "soundings": len(errors),
        "rejected": rejected,
        "mean_error_m": round(float(np.mean(errors)), 4) if errors else None,
        "mean_abs_error_m": round(statistics.mean(map(abs, errors)), 4) if errors else None,
        "plan_failures": [event.message for event in log if "plan failed" in event.message],
        "alarms": [event.message for event in log if event.level == "alarm"],
        "links": details,
    }


async def errors_m(service: MissionService, identity: str, floor: Terrain) -> tuple[list[float], int]:
    """Sounded minus true depth of every accepted sounding, and how many were rejected."""
    errors, rejected = [], 0
    for row in await soundings_of(await service.get(identity)):
        east, north = floor.frame.to_local(row.lat_deg, row.lon_deg)
        rejected += row.verdict != "accepted"
        if row.verdict == "accepted" and floor.contains(east, north):
            errors.append(row.depth_m - floor.depth_at_point(east, north))
    return errors, rejected


async def with_logs(service: MissionService, identity: str, floor: Terrain, logs: list[Path]) -> dict[str, Any]:
    """What the mission has once the vehicles' own logs are in it, beside what they measured."""
    measured, dives = 0, {}
    for path in logs:
        await import_log(await service.get(identity), service.settings, path, actor="benchmark")
        log = VehicleLog(path, BridgeSettings())
        dives[path.parent.parent.name] = dives_m(VehicleLog(path, BridgeSettings()))
        measured += sum(isinstance(event, Sounding) for event in log.events())
    errors, rejected = await errors_m(service, identity, floor)
    return {
        "measured_on_board": measured,
        "dives_m": dives,
        "soundings_with_logs": len(errors),
        "rejected_with_logs": rejected,
        "mean_abs_error_with_logs_m": round(statistics.mean(map(abs, errors)), 4) if errors else None,
    }


def title(options: argparse.Namespace) -> str:
    """What a run is called in the page of results."""
    parts = [f"A mission of {options.steps} steps"]
    parts += [f"{100 * options.loss:g} % of the packets lost"] if options.loss else []
    parts += [f"one vehicle killed at step {options.kill_at}"] if options.kill_at is not None else []
    parts += ["radio ends at the surface"] if options.radio_range else []
    parts += [f"{options.vehicles} vehicles"] if options.vehicles != 2 else []
    parts += [f"legs of {options.max_step:g} m at {options.speed:g}x"] if options.max_step != 20.0 else []
    parts += ["servo and attitude messages at full rate"] if options.chatter else []
    parts += [f"led by {options.guidance}"] if options.guidance != "follow" else []
    return ", ".join(parts)


def main() -> None:
    """Run and print."""
    parser = make_parser(__doc__, IMC, seeds=[0])
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--speed", type=float, default=10.0)
    parser.add_argument("--loss", type=float, default=0.0)
    parser.add_argument("--kill-at", type=int)
    parser.add_argument("--radio-range", type=float, default=0.0, help="above 0 radio ends there and at the surface")
    parser.add_argument("--chatter", action="store_true", help="send attitude and servo messages at full rate, too")
    parser.add_argument("--vehicles", type=int, default=2, choices=range(1, len(NAMES) + 1))
    parser.add_argument("--max-step", type=float, default=20.0, help="metres of a leg, at the most")
    parser.add_argument("--stops", action="store_true", help="pause and abort in the middle, with a busy core")
    parser.add_argument("--planner", default="cao")
    parser.add_argument("--family", default="harbour")
    parser.add_argument("--guidance", choices=("follow", "legs"), default="follow")
    parser.add_argument("--progress", action="store_true")
    options = parser.parse_args()
    logs.configure("warning", "console", sys.stderr)
    failed = False
    for seed in options.seeds:
        with tempfile.TemporaryDirectory() as folder:
            result = asyncio.run(fly(options, seed, Path(folder)))
        print(json.dumps(result), flush=True)
        write_section(options.write, IMC, title(options), result, seeds=[seed])
        accurate = result["mean_abs_error_m"] is not None and result["mean_abs_error_m"] <= 0.2
        astray = [result["waypoints"].get(status, 0) for status in (WaypointStatus.REFUSED, WaypointStatus.MISSED)]
        whole = result["steps"] == options.steps or options.stops
        failed |= not (accurate and whole) or any(astray)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
