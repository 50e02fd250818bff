"""A whole mission over IMC: ``python benchmarks/imc_mission.py [--steps 100] [--loss 0.05] [--kill-at 50]``.

The mission service, its database and planner run as they do for real vehicles; two fake DUNE nodes on real sockets are
the vehicles. ``--radio-range 5000`` ends their radio at the surface, as in the recorded session ``wifi_gap_x5``;
``--kill-at`` kills one vehicle's DUNE at that step and starts it again where it was. Printed is one JSON object;
exit code 1 when the mission did not complete, a waypoint was refused, or soundings are off by more than 0.2 m.
"""

import argparse
import asyncio
import json
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from app.mapping.georeference import LocalFrame
from app.missions.fleet import WaypointStatus
from app.missions.service import MissionService
from app.missions.settings import ImcSettings, ServiceSettings
from app.missions.spec import MissionSpec
from app.missions.states import ENDED
from app.storage.database import Database
from app.storage.missions import waypoints_of_step
from app.storage.prepare import prepare_database
from simulator.dune import DuneFleet, DuneOptions, VehicleSpec
from simulator.network import NetworkFaults
from simulator.seafloors import generate
from simulator.terrain import Terrain

ORIGIN = (41.185, -8.705)
SIDE_M = 120.0
PORT, ANNOUNCE_PORTS = 32210, (32200, 32201, 32202, 32203, 32204)
NAMES = ("lauv-xplore-1", "lauv-xplore-2")
BACK_AFTER_WALL_S = 1.0


class Vehicle:
    """One vehicle of its own, which can be killed and started again."""

    def __init__(self, number: int, floor: Terrain, speed: float, options: DuneOptions) -> None:
        place = (SIDE_M * (number + 1) / 3.0, 10.0, 0.0)
        self._spec = VehicleSpec(NAMES[number], 0x1E + number, 32220 + 10 * number, place)
        self._floor, self._speed, self._options = floor, speed, options
        self.fleet: DuneFleet | None = None

    async def start(self) -> None:
        """Start its DUNE."""
        self.fleet = DuneFleet(self._floor, [self._spec], speed=self._speed, options=self._options)
        await self.fleet.start()

    async def kill(self) -> None:
        """End its DUNE without a word; it will start again where it is, at the surface."""
        if self.fleet is not None:
            here = self.fleet.nodes[0].vehicle.true_position
            spec = self._spec
            self._spec = VehicleSpec(spec.name, spec.imc_id, spec.port, (here.east_m, here.north_m, 0.0))
            await self.fleet.stop()
            self.fleet = None

    @property
    def collisions(self) -> int:
        """How often it touched the bottom in its present life."""
        return len(self.fleet.nodes[0].vehicle.collisions) if self.fleet is not None else 0


def mission(steps: int, planner: str) -> MissionSpec:
    """Two vehicles that map a square of 100 m."""
    frame = LocalFrame(*ORIGIN)
    corners = [(10, 10), (110, 10), (110, 110), (10, 110), (10, 10)]
    ring = [[float(x) for x in reversed(frame.to_geographic(float(e), float(n)))] for e, n in corners]
    return MissionSpec.model_validate(
        {
            "name": "IMC benchmark",
            "area": {"type": "Polygon", "coordinates": [ring]},
            "vehicles": [{"name": name, "kind": "imc", "depth_m": 2.0 + k} for k, name in enumerate(NAMES)],
            "steps": steps,
            "cell_m": 2.0,
            "limits": {"max_step_m": 20.0, "min_vertical_separation_m": 1.0, "min_altitude_m": 2.0},
            "planner": {"name": planner},
        }
    )


async def fly(options: argparse.Namespace) -> dict[str, Any]:
    """Fly the mission; what came of it."""
    floor = generate(options.family, options.seed, width_m=SIDE_M, height_m=SIDE_M, origin=ORIGIN)
    dune = DuneOptions(
        announce_ports=ANNOUNCE_PORTS,
        faults=NetworkFaults(loss=options.loss),
        radio_range_m=options.radio_range,
        chatter=options.chatter,
    )
    vehicles = [Vehicle(number, floor, options.speed, dune) for number in range(len(NAMES))]
    with tempfile.TemporaryDirectory() as folder:
        url = f"sqlite+aiosqlite:///{Path(folder) / 'mission.db'}"
        imc = ImcSettings(port=PORT, announce_ports=ANNOUNCE_PORTS, loopback_only=True)
        await prepare_database(url, may_upgrade=True)
        database = Database(url)
        service = MissionService(ServiceSettings(database_url=url, imc=imc, time_scale=options.speed), database)
        begun = time.monotonic()
        for vehicle in vehicles:
            await vehicle.start()
        await service.startup()
        try:
            identity = (await service.create(mission(options.steps, options.planner))).id
            while sum(view.link == "ready" for view in await service.vehicles()) < len(NAMES):  # noqa: ASYNC110
                await asyncio.sleep(0.1)
            await service.act(identity, "start", actor="benchmark")
            killed = options.kill_at is None
            while (view := await service.mission(identity)).state not in ENDED:
                if not killed and view.progress.step >= options.kill_at:
                    killed = True
                    await vehicles[0].kill()
                    await asyncio.sleep(BACK_AFTER_WALL_S)
                    await vehicles[0].start()
                if options.progress and sys.stderr.isatty():
                    print(f"\rstep {view.progress.step}", end="", file=sys.stderr)
                await asyncio.sleep(0.2)
            return await summary(service, database, identity, floor, begun) | {
                "collisions": sum(vehicle.collisions for vehicle in vehicles),
                "idle_at_the_end": all(v.fleet is None or v.fleet.nodes[0].plan.maneuver is None for v in vehicles),
            }
        finally:
            await service.shutdown()
            await database.close()
            for vehicle in vehicles:
                await vehicle.kill()


async def summary(
    service: MissionService, database: Database, identity: str, floor: Terrain, begun: float
) -> dict[str, Any]:
    """Steps, waypoints, soundings against the truth, and what the log says."""
    view = await service.mission(identity)
    statuses: dict[str, int] = {}
    async with database.reading() as session:
        for step in range(1, view.progress.step + 1):
            for row in await waypoints_of_step(session, identity, step):
                statuses[row.status] = statuses.get(row.status, 0) + 1
    errors, rejected = [], 0
    for row in await service.soundings(identity):
        east, north = floor.frame.to_local(row.lat_deg, row.lon_deg)
        rejected += row.verdict != "accepted"
        if row.verdict == "accepted" and floor.contains(east, north):
            errors.append(row.depth_m - floor.depth_at_point(east, north))
    log = await service.events(identity, limit=1000)
    details = {view.name: view.reason for view in await service.vehicles()}
    return {
        "state": view.state,
        "steps": view.progress.step,
        "wall_s": round(time.monotonic() - begun, 1),
        "waypoints": statuses,
        "soundings": len(errors),
        "rejected": rejected,
        "mean_error_m": round(float(np.mean(errors)), 4) if errors else None,
        "mean_abs_error_m": round(statistics.mean(map(abs, errors)), 4) if errors else None,
        "plan_failures": [event.message for event in log if "plan failed" in event.message],
        "alarms": [event.message for event in log if event.level == "alarm"],
        "links": details,
    }


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--speed", type=float, default=10.0)
    parser.add_argument("--loss", type=float, default=0.0)
    parser.add_argument("--kill-at", type=int)
    parser.add_argument("--radio-range", type=float, default=0.0, help="above 0 radio ends there and at the surface")
    parser.add_argument("--chatter", action="store_true", help="send attitude and servo messages at full rate, too")
    parser.add_argument("--planner", default="cao")
    parser.add_argument("--family", default="harbour")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--progress", action="store_true")
    options = parser.parse_args()
    result = asyncio.run(fly(options))
    print(json.dumps(result))
    accurate = result["mean_abs_error_m"] is not None and result["mean_abs_error_m"] <= 0.2
    whole = result["steps"] == options.steps and not result["waypoints"].get(WaypointStatus.REFUSED)
    sys.exit(0 if accurate and whole else 1)


if __name__ == "__main__":
    main()
