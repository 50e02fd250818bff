"""Whether many vehicles come home to one place: ``python -m benchmarks.missions.shared_recovery [--missions 16]``.

Missions of the whole service in simulated time: vehicles that start in a grid on 300 x 300 m survey for some minutes
where they may go 6 m deep at most, and come home to one recovery point at the area's border. So many have no depths of
their own there: who is about to meet another one gives way. Missions of even seeds are in still water.
"""

import json
import math
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from app.api import logs
from app.commands.home import ORIGIN, fly_mission
from app.mapping.coordinates.georeference import LocalFrame
from app.missions.recovery.berths import farthest_m
from app.missions.settings import SimulationSettings
from app.missions.spec.mission import MissionSpec
from benchmarks.common.report import FLIGHT, make_parser, write_section

SIDE_M, DEEPEST_M, CURRENT_MPS = 300.0, 6.0, 0.3
APART_M, FIRST_M = 60.0, 20.0
IN_A_ROW = 5
TIME_SCALE = 5.0


def mission(seed: int, vehicles: int, minutes: float) -> tuple[MissionSpec, SimulationSettings]:
    """Return a mission of so many vehicles, and the sea that it is flown in."""
    frame = LocalFrame(*ORIGIN)

    def lon_lat(east: float, north: float) -> list[float]:
        return [float(x) for x in reversed(frame.to_geographic(east, north))]

    corners = [(0.0, 0.0), (SIDE_M, 0.0), (SIDE_M, SIDE_M), (0.0, SIDE_M), (0.0, 0.0)]
    starts = [(FIRST_M + APART_M * (k % IN_A_ROW), FIRST_M + APART_M * (k // IN_A_ROW)) for k in range(vehicles)]
    spec = MissionSpec.model_validate(
        {
            "name": f"shared recovery {seed}",
            "area": {"type": "Polygon", "coordinates": [[lon_lat(*corner) for corner in corners]]},
            "vehicles": [{"name": f"v{k}", "kind": "sim", "start": lon_lat(*at)} for k, at in enumerate(starts)],
            "budget": {"minutes": minutes},
            "recovery": {"point": lon_lat(SIDE_M / 2, 10.0)},
            "limits": {"max_depth_m": DEEPEST_M, "max_step_m": 20.0},
            "planner": {"name": "lawnmower"},
            "seed": seed,
        }
    )
    course = np.random.default_rng(seed).uniform(0, 2 * math.pi)
    speed_mps = CURRENT_MPS * (seed % 2)
    current_mps = (speed_mps * math.sin(course), speed_mps * math.cos(course))
    return spec, SimulationSettings(seed=seed, current_mps=current_mps)


def fly(seed: int, vehicles: int, minutes: float) -> dict[str, Any]:
    """Fly a mission; how many came home, and how close they came to each other on the way."""
    spec, sea = mission(seed, vehicles, minutes)
    # Links are lost in missions that are flown with an odd number.
    flown = fly_mission(spec, sea, None, 2 * seed, TIME_SCALE)
    away_m = [one["from_point_m"] for one in flown["vehicles"].values()]
    # Each has a place of its own; one that drifts is taken out beside it.
    near_m = 10.0 + farthest_m(spec, range(vehicles), spec.vehicles)
    told = ("state", "minutes", "too_close", "touched", "touched_before", "closest_m")
    home = sum(m is not None and m <= near_m for m in away_m)
    return {"seed": seed, "current_mps": flown["current_mps"], "home": home} | {key: flown[key] for key in told}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line."""
    parser = make_parser(__doc__, FLIGHT)
    parser.add_argument("--missions", type=int, default=16)
    parser.add_argument("--first", type=int, default=0, help="seed of the first")
    parser.add_argument("--vehicles", type=int, default=20)
    parser.add_argument("--minutes", type=float, default=4.0, help="of survey")
    options = parser.parse_args(arguments)
    logs.configure("error", "json")
    begun, done = time.monotonic(), []
    for seed in range(options.first, options.first + options.missions):
        done.append(fly(seed, options.vehicles, options.minutes))
        print(json.dumps(done[-1]), flush=True)
    result = {
        "missions": len(done),
        "vehicles": options.vehicles * len(done),
        "home": sum(one["home"] for one in done),
        "too_close_in": sum(bool(one["too_close"]) for one in done),
        "touched_in": sum(bool(one["touched"]) for one in done),
        "touched_before_in": sum(bool(one["touched_before"]) for one in done),
        "closest_m": sorted(one["closest_m"] for one in done),
        "wall_s": round(time.monotonic() - begun, 1),
    }
    print(json.dumps(result, indent=2))
    seeds = [one["seed"] for one in done]
    write_section(options.write, FLIGHT, f"{options.vehicles} vehicles, one recovery point", result, seeds=seeds)
    return 1 if result["touched_in"] or result["home"] < result["vehicles"] else 0


if __name__ == "__main__":
    raise SystemExit(main())
