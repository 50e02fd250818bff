"""``bathyfleet evaluate home``: missions of the whole service, simulated, until everybody is home.

Areas of 100 to 300 m, two or three vehicles with 20 to 60 minutes of endurance each, a recovery point inside or outside
the area, at times a keep-out zone, currents to 0.5 m/s, in every fifth mission batteries that empty 30 % faster than
told, in every third one that joins later. The missions' length is no limit: energy is.
"""

import asyncio
import json
import logging
import math
import statistics
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from app.missions.settings import SimulationSettings
    from app.missions.spec.mission import MissionSpec, VehicleSpec

NEAR_M = 25.0
"""A vehicle this near its recovery point is home."""

ORIGIN = (41.1850, -8.7050)

SPEED_MPS = 1.3
WORSE = 1.3
JOINER = "late"


def drawn(seed: int, *, still: bool) -> "tuple[MissionSpec, SimulationSettings, VehicleSpec | None]":
    """Return a mission, the sea that it is flown in, and who joins it later."""
    import numpy as np

    from app.mapping.georeference import LocalFrame
    from app.missions.settings import SimulationSettings
    from app.missions.spec.mission import MissionSpec, VehicleSpec

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


async def fly(seed: int, time_scale: float, migrating: asyncio.Lock, *, still: bool) -> dict[str, Any]:
    """Fly one mission to its end; what became of its vehicles. One database is made at a time."""
    from app.missions.operations.history import events_after
    from app.missions.running.mission_views import mission_view
    from app.missions.service import MissionService
    from app.missions.settings import ImcSettings, ServiceSettings
    from app.missions.states import ENDED, Action
    from app.storage.database import Database
    from app.storage.prepare import prepare_database

    spec, sea, late = drawn(seed, still=still)
    with tempfile.TemporaryDirectory() as folder:
        url = f"sqlite+aiosqlite:///{Path(folder) / 'mission.db'}"
        async with migrating:
            await prepare_database(url, may_upgrade=True)
        database = Database(url)
        settings = ServiceSettings(
            database_url=url, imc=ImcSettings(enabled=False), time_scale=time_scale, simulation=sea
        )
        service = MissionService(settings, database)
        await service.startup()
        try:
            identity = (await service.create(spec)).id
            live = await service.get(identity)
            await service.act(live, Action.START, actor="evaluation")
            while live.header.state not in ENDED:
                if late is not None and live.header.step >= 5:
                    await service.team_changes.join(live, late, "evaluation")
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


async def fly_all(
    seeds: Sequence[int], time_scale: float, at_once: int, told: Callable[[dict[str, Any]], None], *, still: bool
) -> dict[str, Any]:
    """Fly a mission for every seed, some at once; what became of all their vehicles.

    ``told`` gets what became of each mission when it has ended.
    """
    room, migrating = asyncio.Semaphore(at_once), asyncio.Lock()
    done: list[dict[str, Any]] = []

    async def one(seed: int) -> None:
        async with room:
            done.append(await fly(seed, time_scale, migrating, still=still))
            told(done[-1])

    await asyncio.gather(*(one(seed) for seed in seeds))
    return summary(done)


def summary(missions: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return what became of the vehicles of all missions together."""
    vehicles = [vehicle for mission in missions for vehicle in mission["vehicles"].values()]
    home = [v for v in vehicles if v["from_point_m"] is not None and v["from_point_m"] <= NEAR_M]
    shares = [vehicle["surveyed_pct"] for vehicle in vehicles if vehicle["surveyed_pct"] is not None]
    return {
        "missions": len(missions),
        "vehicles": len(vehicles),
        "home_pct": round(100.0 * len(home) / len(vehicles), 2),
        "worst_m": max((v["from_point_m"] for v in vehicles if v["from_point_m"] is not None), default=None),
        "least_energy_pct": min((v["energy_left_pct"] or 0.0 for v in vehicles), default=None),
        "survey_share_pct": round(statistics.median(shares), 1) if shares else None,
        "least_survey_share_pct": min(shares, default=None),
        "zones_entered": sum(mission["zones_entered"] for mission in missions),
        "too_close": sum(mission["too_close"] for mission in missions),
    }


def home(
    missions: Annotated[int, typer.Option(min=1, max=100_000, help="How many.")] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first; the others have the next ones.")] = 0,
    at_once: Annotated[int, typer.Option(min=1, max=64, help="Missions that are flown at the same time.")] = 2,
    time_scale: Annotated[
        float, typer.Option(min=0.1, max=200.0, help="How much faster than wall time the vehicles live.")
    ] = 20.0,
    still: Annotated[bool, typer.Option("--still", help="No current.")] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object, nothing else, to standard output.")
    ] = False,
) -> None:
    """Fly missions of the service with simulated vehicles until all are home; exit code 1 when one is not.

    survey_share_pct: of the energy that the way home did not need, which part was used before turning back (median).
    """
    from app.api import logs

    logs.configure("error", "json")
    logging.getLogger("asyncio").setLevel(logging.ERROR)
    seeds = range(seed, seed + missions)

    def told(mission: dict[str, Any]) -> None:
        if not as_json:
            typer.echo(json.dumps(mission))

    result = asyncio.run(fly_all(seeds, time_scale, at_once, told, still=still))
    typer.echo(json.dumps(result, indent=None if as_json else 2))
    if result["home_pct"] < 100.0:
        raise typer.Exit(1)
