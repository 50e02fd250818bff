"""The service is killed while DUNE vehicles survey and nobody starts it again: they have to come home by themselves."""

import asyncio
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from shapely.geometry import LineString, Polygon, box

from simulator.dune import DuneFleet, DuneOptions, default_specs
from simulator.dune.node import FakeDune
from simulator.floors import seafloors
from simulator.water_column import SeaWater
from tests.support.faults.missions import FRAME, mission_of, started, steps_more
from tests.support.faults.sea import IDS, LIMITS, NAMES, OURS, imc_vehicles
from tests.support.faults.service import Service, service_in
from tests.support.ports import free_ports
from tests.support.waiting import until

FLOOR_M = 300.0
AREA = box(40.0, 80.0, 240.0, 260.0)
ZONE = box(110.0, 140.0, 170.0, 200.0)
HOME_M = (150.0, 30.0)
"""The recovery point, outside the area."""
NEAR_M = 25.0
TOUCH_M, TALL_M = 2.5, 0.8
"""Vehicles touch each other of which the centres are closer than one is long, and than one is tall that is pitched."""
SEPARATION_M = 5.0
"""So far apart the mission keeps them at similar depths."""
AFLOAT_M = 0.3
"""At most this deep a vehicle is at the surface."""
START_M = ((100.0, 90.0, 0.0), (180.0, 90.0, 0.0))
PATIENCE_S = 3600.0
"""Whoever is not home this long after the kill does not come, seconds of the vehicles' time."""


async def left_alone(
    folder: Path, *, seed: int, speed: float, timeout_s: float, current_mps: float = 0.0
) -> dict[str, Any]:
    """Kill the service at a moment drawn by ``seed``; what became of both vehicles, watched where they truly are.

    Parameters
    ----------
    speed
        Vehicle seconds per second of the wall clock.
    timeout_s
        After so long without a console ``LostComms`` starts the plan, vehicle seconds.
    current_mps
        Speed of the current; where it sets to is drawn.
    """
    rng = np.random.default_rng(seed)
    steps, further_s, towards = int(rng.integers(3, 16)), float(rng.uniform(0, 30)), float(rng.uniform(0, 2 * math.pi))
    *announce_ports, port, base = free_ports(24)[:7]
    floor = seafloors.generate(
        "harbour", seed, width_m=FLOOR_M, height_m=FLOOR_M, origin=(FRAME.origin_lat_deg, FRAME.origin_lon_deg)
    )
    specs = default_specs(len(NAMES), floor, names=NAMES, ids=IDS, starts=START_M, base_port=base)
    options = DuneOptions(announce_ports=tuple(announce_ports), lost_comms_s=timeout_s)
    current = (current_mps * math.sin(towards), current_mps * math.cos(towards))
    settings = {
        "IMC__ENABLED": "true",
        "IMC__LOOPBACK_ONLY": "true",
        "IMC__ANNOUNCE_PORTS": json.dumps(announce_ports),
        "IMC__PORT": str(port),
        "IMC__ID": str(OURS),
        "TIME_SCALE": f"{speed:g}",
    }
    async with (
        DuneFleet(floor, specs, speed=speed, water=SeaWater(current), options=options, seed=seed) as fleet,
        service_in(folder, settings=settings) as (service, api),
    ):

        async def ready() -> bool:
            vehicles = (await api.get("/vehicles")).json()
            return {v["name"] for v in vehicles if v["link"] == "ready"} >= set(NAMES)

        await until(ready, "both are ready")
        mission_id = await started(api, _mission())
        await steps_more(service, mission_id, steps)
        await asyncio.sleep(further_s / speed)
        return {"seed": seed, "steps": steps} | await _killed(service, fleet)


async def _killed(service: Service, fleet: DuneFleet) -> dict[str, Any]:
    """Kill the service, and watch until all are home or patience ends."""
    on_board = ["lostcomms" in node.database.plans for node in fleet.nodes]
    # The service may have led one home before, for example one that a busy machine did not hear for long.
    there = [not has and _is_up_at_home(node) for has, node in zip(on_board, fleet.nodes, strict=True)]
    await service.kill()
    begun_s, far = fleet.clock.now(), [round(_from_home_m(node), 1) for node in fleet.nodes]
    tracks: list[list[tuple[float, float]]] = [[] for _ in fleet.nodes]
    closest_m, arrived_s, touched, too_close = math.inf, [math.nan] * len(fleet.nodes), False, False
    while fleet.clock.now() - begun_s < PATIENCE_S and any(map(math.isnan, arrived_s)):
        places = [node.vehicle.true_position for node in fleet.nodes]
        first, second = places
        aside_m = first.horizontal_distance_m(second.east_m, second.north_m)
        below_m = abs(first.depth_m - second.depth_m)
        closest_m = min(closest_m, math.hypot(aside_m, below_m))
        touched |= aside_m < TOUCH_M and below_m < TALL_M
        # As the table of failsafes judges it.
        too_close |= aside_m < SEPARATION_M and below_m < LIMITS["min_vertical_separation_m"] / 2
        for number, (node, place) in enumerate(zip(fleet.nodes, places, strict=True)):
            tracks[number].append((place.east_m, place.north_m))
            if math.isnan(arrived_s[number]) and (_came_home(node) or (there[number] and _is_up_at_home(node))):
                arrived_s[number] = fleet.clock.now() - begun_s
        await asyncio.sleep(0.02)
    levels = [node.vehicle.battery.level_pct for node in fleet.nodes if node.vehicle.battery is not None]
    return {
        "kept_on_board": sum(on_board),
        "home_before": sum(there),
        "from_home_when_killed_m": far,
        "home": sum(map(math.isfinite, arrived_s)),
        "from_point_m": [round(_from_home_m(node), 1) for node in fleet.nodes],
        "home_after_s": [round(s) if math.isfinite(s) else None for s in arrived_s],
        "least_energy_pct": round(min(levels), 1) if levels else None,
        "zones_entered": sum(LineString(track).intersects(ZONE) for track in tracks if len(track) > 1),
        "closest_m": round(closest_m, 1),
        "too_close": int(too_close),
        "collided": int(touched),
    }


def _from_home_m(node: FakeDune) -> float:
    return node.vehicle.true_position.horizontal_distance_m(*HOME_M)


def _came_home(node: FakeDune) -> bool:
    """Whether it came by its plan, is near its point, and at the surface."""
    plan = node.plan.plan_control_state()
    return plan.plan_id == "lostcomms" and str(plan.man_id).endswith(" end") and _is_up_at_home(node)


def _is_up_at_home(node: FakeDune) -> bool:
    return _from_home_m(node) <= NEAR_M and node.vehicle.true_position.depth_m < AFLOAT_M


def _mission() -> dict[str, Any]:
    return mission_of(
        imc_vehicles(*NAMES),
        area=_geojson(AREA),
        keep_out=[_geojson(ZONE)],
        recovery={"point": _lon_lat(*HOME_M), "radius_m": NEAR_M},
        steps=500,
        limits=LIMITS | {"max_step_m": 20.0, "min_separation_m": SEPARATION_M},
        step_deadline_s=120.0,
        planner={"name": "lawnmower"},
        cell_m=4.0,
    )


def _geojson(polygon: Polygon) -> dict[str, Any]:
    return {"type": "Polygon", "coordinates": [[_lon_lat(*corner) for corner in polygon.exterior.coords]]}


def _lon_lat(east_m: float, north_m: float) -> list[float]:
    lat, lon = FRAME.to_geographic(east_m, north_m)
    return [float(lon), float(lat)]
