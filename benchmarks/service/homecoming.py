"""Whether everybody comes home: ``python -m benchmarks.service.homecoming [--missions 20 --at-once 4]``.

Seeded missions of the service with its simulated vehicles: areas of 100 to 300 m, two or three vehicles with 20 to 60
minutes of endurance each, a recovery point inside or outside the area, at times a keep-out zone, currents to 0.5 m/s
(``--still``: none), in every fifth mission batteries that empty 30 % faster than told, in every third one that
joins later. The missions' length is no limit: energy is. Told are, by vehicle: how far from its recovery point it was
when it was home, what was left of its energy then, and which part of what it did not need for the way home it used
before it turned back.
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

import numpy as np

from app.mapping.georeference import LocalFrame
from app.missions.operations.history import events_after
from app.missions.running.mission_views import mission_view
from app.missions.service import MissionService
from app.missions.settings import ImcSettings, ServiceSettings, SimulationSettings
from app.missions.spec.mission import MissionSpec, VehicleSpec
from app.missions.states import ENDED, Action
from app.storage.database import Database
from app.storage.prepare import prepare_database
from benchmarks.common.report import FLIGHT, make_parser, write_section
from benchmarks.imc.mission import ORIGIN

SPEED_MPS = 1.3
WORSE = 1.3
JOINER = "late"


def drawn(seed: int, *, still: bool) -> tuple[MissionSpec, SimulationSettings, VehicleSpec | None]:
    """Return a mission, the sea that it is flown in, and who joins it later."""
    rng = np.random.default_rng(seed)
    frame, side = LocalFrame(*ORIGIN), float(rng.uniform(100, 300))

    def lon_lat(east: float, north: float) -> list[float]:
        return [float(x) for x in reversed(frame.to_geographic(east, north))]

    def box(west: float, south: float, size: float) -> dict[str, Any]:
        ring = [(west, south), (west + size, south), (west + size, south + size), (west, south + size), (west, south)]
        return {"type": "Polygon", "coordinates": [[lon_lat(*corner) for corner in ring]]}

    home = (side * rng.uniform(0.05, 0.95), float(rng.choice([-150.0, side * 0.05])))
    vehicles = [
        {"name": f"v{k}", "kind": "sim", "depth_m": 2.0 + k, "endurance_min": float(rng.uniform(20, 60))}
        for k in range(int(rng.integers(2, 4)))
    ]
    course, speed = rng.uniform(0, 2 * math.pi), 0.0 if still else rng.uniform(0, 0.5)
    spec = MissionSpec.model_validate(
        {
            "name": f"homecoming {seed}",
            "area": box(0, 0, side),
            "keep_out": [box(side * 0.4, side * 0.45, side * 0.2)] if rng.random() < 0.5 else [],
            "vehicles": vehicles,
            "budget": {"minutes": 600},
            "cell_m": max(2.0, side / 60),
            "speed_mps": SPEED_MPS,
            "recovery": {"point": lon_lat(*home)},
            "limits": {"max_step_m": 20.0, "min_altitude_m": 1.0},
            "planner": {"name": "lawnmower"},
            "seed": seed,
        }
    )
    sea = SimulationSettings(
        seed=seed,
        current_mps=(speed * math.sin(course), speed * math.cos(course)),
        consumption_factor=WORSE if seed % 5 == 4 else 1.0,
    )
    late = {"name": JOINER, "kind": "sim", "depth_m": 6.0, "endurance_min": float(rng.uniform(20, 40))}
    return spec, sea, VehicleSpec.model_validate(late) if seed % 3 == 2 else None


async def fly(seed: int, options: argparse.Namespace, migrating: asyncio.Lock) -> dict[str, Any]:
    """Fly one mission to its end; what became of its vehicles. One database is made at a time."""
    spec, sea, late = drawn(seed, still=options.still)
    with tempfile.TemporaryDirectory() as folder:
        url = f"sqlite+aiosqlite:///{Path(folder) / 'mission.db'}"
        async with migrating:
            await prepare_database(url, may_upgrade=True)
        database = Database(url)
        settings = ServiceSettings(
            database_url=url, imc=ImcSettings(enabled=False), time_scale=options.time_scale, simulation=sea
        )
        service = MissionService(settings, database)
        await service.startup()
        try:
            identity = (await service.create(spec)).id
            live = await service.get(identity)
            await service.act(live, Action.START, actor="benchmark")
            while live.header.state not in ENDED:
                if late is not None and live.header.step >= 5:
                    await service.team_changes.join(live, late, "benchmark")
                    late = None
                await asyncio.sleep(0.2)
            view = mission_view(live)
            lines = await events_after(live, 0, 100_000)
        finally:
            await service.shutdown()
            await database.close()
    found = {}
    for vehicle in view.vehicles:
        own = [line for line in lines if line.data.get("vehicle") == vehicle.name]
        turned = max((line for line in own if "goes home" in line.message), key=lambda line: line.time, default=None)
        arrival = max((line for line in own if "is home" in line.message), key=lambda line: line.time, default=None)
        share = None
        if turned is not None and arrival is not None:
            left_pct = turned.data["energy_left_pct"]
            share = round(100 * (100.0 - left_pct) / (100.0 - (left_pct - arrival.data["energy_left_pct"])), 1)
        found[vehicle.name] = {
            "phase": str(vehicle.phase),
            "from_point_m": None if arrival is None else arrival.data["from_point_m"],
            "energy_left_pct": None if arrival is None else arrival.data["energy_left_pct"],
            "surveyed_pct": share,
            "why": vehicle.withdrawn,
        }
    return {
        "seed": seed,
        "state": str(view.state),
        "current_mps": round(math.hypot(*sea.current_mps), 2),
        "consumption_factor": sea.consumption_factor,
        "zones_entered": sum(line.kind == "boundary" and bool(line.data.get("zone")) for line in lines),
        "too_close": sum(line.data.get("failsafe") == "separation_lost" for line in lines),
        "vehicles": found,
    }


async def fly_all(options: argparse.Namespace) -> dict[str, Any]:
    """Fly all missions, some at once; what became of them together."""
    room, migrating = asyncio.Semaphore(options.at_once), asyncio.Lock()
    done: list[dict[str, Any]] = []

    async def one(seed: int) -> None:
        async with room:
            done.append(await fly(seed, options, migrating))
            print(json.dumps(done[-1]), flush=True)

    begun = time.monotonic()
    await asyncio.gather(*(one(seed) for seed in range(options.first, options.first + options.missions)))
    vehicles = [vehicle for mission in done for vehicle in mission["vehicles"].values()]
    shares = [vehicle["surveyed_pct"] for vehicle in vehicles if vehicle["surveyed_pct"] is not None]
    return {
        "missions": len(done),
        "vehicles": len(vehicles),
        "home": sum(v["from_point_m"] is not None and v["from_point_m"] <= 25.0 for v in vehicles),
        "with_energy_left": sum((v["energy_left_pct"] or 0.0) > 0.0 for v in vehicles),
        "least_energy_left_pct": min((v["energy_left_pct"] or 0.0 for v in vehicles), default=None),
        "surveyed_pct": {"median": float(np.median(shares)), "least": min(shares)} if shares else None,
        "zones_entered": sum(mission["zones_entered"] for mission in done),
        "too_close": sum(mission["too_close"] for mission in done),
        "wall_s": round(time.monotonic() - begun, 1),
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line."""
    parser = make_parser(__doc__, FLIGHT)
    parser.add_argument("--missions", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="seed of the first")
    parser.add_argument("--at-once", type=int, default=4)
    parser.add_argument("--time-scale", type=float, default=60.0)
    parser.add_argument("--still", action="store_true", help="no current")
    options = parser.parse_args(arguments)
    result = asyncio.run(fly_all(options))
    print(json.dumps(result, indent=2))
    seeds = range(options.first, options.first + options.missions)
    title = f"Coming home, {'in still water' if options.still else 'in currents'}"
    write_section(options.write, FLIGHT, title, result, seeds=seeds)
    return 0 if result["home"] == result["vehicles"] else 1


if __name__ == "__main__":
    raise SystemExit(main())
