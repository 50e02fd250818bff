"""``bathyfleet evaluate home``: missions of the whole service, simulated, until everybody is home.

Areas of 100 to 300 m, two or three vehicles with 20 to 60 minutes of endurance each, a recovery point inside or outside
the area, at times a keep-out zone, currents to 0.5 m/s, in every fifth mission batteries that empty 30 % faster than
told, in every third one that joins later, in every other one vehicles that are out of reach at times. The missions'
length is no limit: energy is. Time is simulated, of the service, too: it goes on only when nobody has anything left to
do, so that no energy is used while a slow or busy machine decides. Threads may finish in another order in another run:
a seed's missions are alike, not the same to the last step.
"""

import asyncio
import json
import logging
import math
import statistics
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    import numpy as np

    from app.missions.fleet.links.sim import SimFleetLink
    from app.missions.live.mission import LiveMission
    from app.missions.service import MissionService
    from app.missions.settings import SimulationSettings
    from app.missions.spec.mission import MissionSpec
    from app.missions.spec.vehicle import VehicleSpec

NEAR_M = 25.0
"""A vehicle this near its recovery point is home."""

ORIGIN = (41.1850, -8.7050)

SPEED_MPS = 1.3
WORSE = 1.3
JOINER = "late"

WITHIN_REACH_S, OUT_OF_REACH_S = (240.0, 1200.0), (10.0, 180.0)
"""How long a vehicle can be heard, and then cannot, by its clock: drawn evenly."""

LONGEST_S = 4 * 3600.0
"""A mission that is not over after so long of its vehicles' time has failed."""

STILL_MPS = 0.06
"""Up to this current the water is still."""

LEAST_SURVEY_PCT = 90.0
"""In still water so much of the energy that ways there and home do not take is to be used for the survey (median)."""


def drawn(seed: int, *, still: bool) -> "tuple[MissionSpec, SimulationSettings, VehicleSpec | None]":
    """Return a mission, the sea that it is flown in, and who joins it later."""
    import numpy as np

    from app.mapping.coordinates.georeference import LocalFrame
    from app.missions.settings import SimulationSettings
    from app.missions.spec.mission import MissionSpec
    from app.missions.spec.vehicle import VehicleSpec

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


def fly(seed: int, time_scale: float, *, still: bool) -> dict[str, Any]:
    """Fly the mission of a seed to its end, in a simulated time of its own; what became of its vehicles."""
    return fly_mission(*drawn(seed, still=still), seed, time_scale)


def fly_mission(
    spec: "MissionSpec", sea: "SimulationSettings", late: "VehicleSpec | None", seed: int, time_scale: float
) -> dict[str, Any]:
    """Fly a mission to its end, in a simulated time of its own; of an odd seed links are lost."""
    from app.commands.simulated_service import served

    async def work(service: "MissionService") -> dict[str, Any]:
        return await _flown(service, spec, late, seed, time_scale)

    found = served(sea, time_scale, work)
    told = {
        "seed": seed,
        "current_mps": round(math.hypot(*sea.current_mps), 2),
        "consumption_factor": sea.consumption_factor,
    } | found
    return told | {"wrong": wrong_with(told)}


async def _flown(
    service: "MissionService", spec: "MissionSpec", late: "VehicleSpec | None", seed: int, time_scale: float
) -> dict[str, Any]:
    """Fly a mission and watch it."""
    import numpy as np

    from app.commands.home_watch import Watch
    from app.missions.fleet.links.sim import SimFleetLink
    from app.missions.spec.vehicle import VehicleKind
    from app.missions.states import ENDED, Action

    link = service.hub.link(VehicleKind.SIM)
    if not isinstance(link, SimFleetLink):
        raise TypeError("the service simulates no vehicles")
    live = await service.get((await service.create(spec)).id)
    await service.act(live, Action.START, actor="evaluation")
    watch, losses = Watch(live, link), [0]
    beside = [asyncio.create_task(watch.keep())]
    if seed % 2 == 1:
        rng = np.random.default_rng([seed, 1])
        beside.append(asyncio.create_task(_lose_links(live, link, rng, time_scale, losses)))
    loop = asyncio.get_running_loop()
    begun_s = loop.time()
    while live.header.state not in ENDED and (loop.time() - begun_s) * time_scale < LONGEST_S:
        if late is not None and live.header.step >= 5:
            await service.team_changes.join(live, late, "evaluation")
            late = None
        await asyncio.sleep(0.2)
    watch.look()
    for task in beside:
        task.cancel()
    await asyncio.gather(*beside, return_exceptions=True)
    return {
        "state": str(live.header.state),
        "minutes": round((loop.time() - begun_s) * time_scale / 60.0, 1),
        "links_lost": losses[0],
        "zones_entered": len(watch.in_zones - watch.drifted_into_zones),
        "zones_drifted_into": len(watch.drifted_into_zones),
        "too_close": len(watch.too_close),
        "touched": len(watch.touched),
        "touched_before": len(watch.touched_before),
        "closest_m": round(watch.closest_m, 1) if math.isfinite(watch.closest_m) else None,
        "meetings": list(watch.meetings.values()),
        "vehicles": watch.found(),
    }


async def _lose_links(
    live: "LiveMission", link: "SimFleetLink", rng: "np.random.Generator", time_scale: float, losses: list[int]
) -> None:
    """Take vehicles out of reach at times, each by itself, until cancelled."""
    due: dict[str, tuple[float, bool]] = {}
    loop = asyncio.get_running_loop()
    while True:
        await asyncio.sleep(1.0 / time_scale)
        now_s = loop.time() * time_scale
        for member in live.team:
            at_s, silent = due.setdefault(member.name, (now_s + rng.uniform(*WITHIN_REACH_S), False))
            if now_s < at_s:
                continue
            if silent:
                link.reach(member.name)
            elif not member.is_home:
                link.silence(member.name)
                losses[0] += 1
            spans = WITHIN_REACH_S if silent else OUT_OF_REACH_S
            due[member.name] = now_s + rng.uniform(*spans), not silent


def wrong_with(mission: dict[str, Any]) -> list[str]:
    """Return in words what is not as it has to be after a mission."""
    wrong = [] if mission["state"] == "finished" else [f"the mission is {mission['state']}"]
    for name, vehicle in mission["vehicles"].items():
        if vehicle["from_point_m"] is None:
            wrong.append(f"{name} is not home")
        elif vehicle["from_point_m"] > NEAR_M:
            wrong.append(f"{name} is {vehicle['from_point_m']:g} m from its recovery point")
        elif not vehicle["energy_left_pct"]:
            wrong.append(f"{name} has no energy left")
    for key, words in (
        ("zones_entered", "in a keep-out zone"),
        ("too_close", "too close to each other on the way home"),
        ("touched", "touched each other on the way home"),
    ):
        if mission[key]:
            wrong.append(f"{words}: {mission[key]}")
    return wrong


def fly_all(
    seeds: Sequence[int],
    time_scale: float,
    told: Callable[[dict[str, Any]], None],
    *,
    still: bool,
    most_s: float = math.inf,
) -> dict[str, Any]:
    """Fly a mission for every seed, each in its own simulated time; what became of all their vehicles.

    ``told`` gets what became of each mission when it has ended. After ``most_s`` seconds of processor no other one is
    begun.
    """
    done: list[dict[str, Any]] = []
    begun_s = time.process_time()
    for seed in seeds:
        if done and time.process_time() - begun_s >= most_s:
            break
        done.append(fly(seed, time_scale, still=still))
        told(done[-1])
    return summary(done, still=still)


def summary(missions: Sequence[dict[str, Any]], *, still: bool) -> dict[str, Any]:
    """Return what became of the vehicles of all missions together, and in words what is not as it has to be."""
    vehicles = [vehicle for mission in missions for vehicle in mission["vehicles"].values()]
    home = [v for v in vehicles if v["from_point_m"] is not None and v["from_point_m"] <= NEAR_M]
    shares, in_still_water = _shares(missions), _shares([m for m in missions if m["current_mps"] <= STILL_MPS])
    away_m = [v["from_point_m"] for v in vehicles if v["from_point_m"] is not None]
    left_pct = [v["energy_left_pct"] or 0.0 for v in vehicles]
    wrong = [f"seed {mission['seed']}: {words}" for mission in missions for words in mission["wrong"]]
    share_pct = round(statistics.median(shares), 1) if shares else None
    if still and (share_pct is None or share_pct < LEAST_SURVEY_PCT):
        wrong.append(f"survey_share_pct is {share_pct}, at least {LEAST_SURVEY_PCT:g} is asked for in still water")
    closest_m = [mission["closest_m"] for mission in missions if mission["closest_m"] is not None]
    return {
        "missions": len(missions),
        "vehicles": len(vehicles),
        "home_pct": round(100.0 * len(home) / len(vehicles), 2) if vehicles else 0.0,
        "median_m": round(statistics.median(away_m), 1) if away_m else None,
        "worst_m": max(away_m, default=None),
        "median_energy_pct": round(statistics.median(left_pct), 1) if left_pct else None,
        "least_energy_pct": min(left_pct, default=None),
        "survey_share_pct": share_pct,
        "least_survey_share_pct": min(shares, default=None),
        "survey_share_in_still_water_pct": round(statistics.median(in_still_water), 1) if in_still_water else None,
        "vehicles_in_still_water": len(in_still_water),
        "links_lost": sum(mission["links_lost"] for mission in missions),
        "zones_entered": sum(mission["zones_entered"] for mission in missions),
        "zones_drifted_into": sum(mission["zones_drifted_into"] for mission in missions),
        "too_close": sum(mission["too_close"] for mission in missions),
        "touched": sum(mission["touched"] for mission in missions),
        "touched_before": sum(mission["touched_before"] for mission in missions),
        "closest_m": min(closest_m, default=None),
        "wrong": wrong,
    }


def _shares(missions: Sequence[dict[str, Any]]) -> list[float]:
    vehicles = [vehicle for mission in missions for vehicle in mission["vehicles"].values()]
    return [vehicle["surveyed_pct"] for vehicle in vehicles if vehicle["surveyed_pct"] is not None]


def home(
    missions: Annotated[int, typer.Option(min=1, max=100_000, help="How many.")] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first; the others have the next ones.")] = 0,
    time_scale: Annotated[
        float,
        typer.Option(min=0.1, max=200.0, help="Vehicle seconds per second of the service's own; both simulated."),
    ] = 20.0,
    still: Annotated[bool, typer.Option("--still", help="No current.")] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object, nothing else, to standard output.")
    ] = False,
) -> None:
    """Fly missions of the service with simulated vehicles, in simulated time, until all are home.

    Exit code 1 when a vehicle is not home with energy left, was in a zone, or came too close to another one on the way,
    and in still water when too little was surveyed: `wrong` says which. survey_share_pct: of the energy that ways
    there and home did not need, which part was used on legs of the survey (median); circling is none.
    """
    from app.api import logs

    logs.configure("error", "json")
    logging.getLogger("asyncio").setLevel(logging.ERROR)
    seeds = range(seed, seed + missions)

    def told(mission: dict[str, Any]) -> None:
        if not as_json:
            typer.echo(json.dumps(mission))

    result = fly_all(seeds, time_scale, told, still=still)
    typer.echo(json.dumps(result, indent=None if as_json else 2))
    if result["wrong"]:
        raise typer.Exit(1)
