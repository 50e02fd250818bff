"""Surveys over shoals that nobody knew of: ``python -m benchmarks.missions.unknown_shoals [--floors 12]``.

Each floor is drawn by its number: an area of 60 to 160 m, 3 to 12 m deep, with one to five round shoals of 4 to 14 m of
radius that rise to 0.3 to 0.8 m below the surface with slopes of 0.1 to 1; every third one rises to a shore along its
southern border instead, where the vehicles begin. One to three simulated vehicles, which need 1 m of water, fly it by
lines and by what the service has by default, in simulated time; their minutes are enough for lines 8 m apart. Told are
the part of the area that is known to the wanted accuracy at the end, as the map has it, the true error of the map where
it is deep enough, the longest time that a vehicle stayed within 12 m of one place, for how long vehicles were over
ground where not even four fifths of what they need is left, all of them together, and how much of the area is deep
enough.
"""

import asyncio
import json
import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np

from app.api import logs
from app.arrays import FloatArray
from app.commands.simulated_service import served
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.types import BathymetricMap
from app.missions.running.mission_views import mission_view
from app.missions.service import MissionService
from app.missions.settings import SimulationSettings
from app.missions.spec.mission import MissionSpec
from app.missions.states import ENDED, Action
from benchmarks.common.report import FLIGHT, make_parser, write_section
from benchmarks.imc.mission import ORIGIN
from simulator.floors.terrain import Terrain
from simulator.floors.terrain_files import save_npz

PLANNERS = ("lawnmower", "cao")
LEAST_M = 1.0
"""Height above the bottom that vehicles need."""
SPEED_MPS, APART_M = 1.3, 8.0
STAY_M = 12.0
TOO_SHOAL_M = 0.8 * LEAST_M
LOOK_S = 1.0
TIME_SCALE = 10.0
SHORE = 3
"""One floor in so many has a shore."""

Way = list[tuple[float, float]]
"""Where a vehicle was at every look, east and north, metres."""


@dataclass(frozen=True)
class Floor:
    """A sea floor with its shoals, metres deep on cells of one metre, and how many vehicles survey it."""

    side_m: int
    vehicles: int
    depth_m: FloatArray

    @property
    def deep_enough_pct(self) -> float:
        """The part of the area that vehicles may go over."""
        return round(100.0 * float((self.depth_m >= LEAST_M).mean()), 1)

    def over_shoals(self, way_m: Way) -> int:
        """Return how many places of a way, east and north, are over ground that is too shoal."""
        cells = np.floor(way_m).astype(int)
        east, north = cells[((cells >= 0) & (cells < self.side_m)).all(axis=1)].T
        return int((self.depth_m[north, east] < TOO_SHOAL_M).sum())

    def error_m(self, made: BathymetricMap) -> float:
        """Return the root mean square error of a map of it, in the middle of its cells, where it is deep enough."""
        north, east = (
            np.clip(begin_m + (np.arange(count) + 0.5) * made.grid.cell_m, 0, self.side_m - 1).astype(int)
            for begin_m, count in zip((made.grid.south_m, made.grid.west_m), made.depth_m.shape, strict=True)
        )
        true_m = self.depth_m[np.ix_(north, east)]
        told = np.isfinite(made.depth_m) & (true_m >= LEAST_M)
        return float(np.sqrt(np.mean((made.depth_m - true_m)[told] ** 2)))


def drawn(number: int) -> Floor:
    """Return the floor of a number."""
    rng = np.random.default_rng([73, number])
    side, vehicles = int(rng.integers(60, 161)), int(rng.integers(1, 4))
    middle = np.arange(0.5, side)
    east, north = np.meshgrid(middle, middle)
    depth_m = rng.uniform(3.0, 12.0) + np.sin(east / rng.uniform(8.0, 20.0)) * np.cos(north / rng.uniform(8.0, 20.0))
    if number % SHORE == SHORE - 1:
        return Floor(side, vehicles, np.minimum(depth_m, rng.uniform(0.4, 0.8) + rng.uniform(0.04, 0.15) * north))
    for _ in range(int(rng.integers(1, 6))):
        x, y = rng.uniform(0.1 * side, 0.9 * side, 2)
        beside_m = np.clip(np.hypot(east - x, north - y) - rng.uniform(4.0, 14.0), 0.0, None)
        depth_m = np.minimum(depth_m, rng.uniform(0.3, 0.8) + rng.uniform(0.1, 1.0) * beside_m)
    return Floor(side, vehicles, depth_m)


def mission(floor: Floor, planner: str, seed: int) -> MissionSpec:
    """Return the survey of a floor."""
    frame, side = LocalFrame(*ORIGIN), floor.side_m
    corners = [(0, 0), (side, 0), (side, side), (0, side), (0, 0)]
    ring = [[float(x) for x in reversed(frame.to_geographic(float(e), float(n)))] for e, n in corners]
    minutes = max(side**2 / APART_M / SPEED_MPS / floor.vehicles / 60.0, 4.0)
    return MissionSpec.model_validate(
        {
            "name": "unknown shoals",
            "area": {"type": "Polygon", "coordinates": [ring]},
            "vehicles": [{"name": name, "kind": "sim"} for name in "abc"[: floor.vehicles]],
            "budget": {"minutes": round(minutes, 1)},
            "cell_m": 2.0,
            "speed_mps": SPEED_MPS,
            "limits": {"max_step_m": 20, "min_altitude_m": LEAST_M},
            "planner": {"name": planner},
            "seed": seed,
        }
    )


def fly(number: int, planner: str) -> dict[str, Any]:
    """Fly the survey of one floor by one planner; what came of it."""
    floor = drawn(number)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "floor.npz"
        save_npz(Terrain(floor.depth_m, 1.0), file)
        work = partial(_flown, mission(floor, planner, number), floor)
        coverage_pct, error_m, ways, stopped = served(SimulationSettings(terrain=file), TIME_SCALE, work)
    return {
        "side_m": floor.side_m,
        "vehicles": floor.vehicles,
        "deep_enough_pct": floor.deep_enough_pct,
        "coverage_pct": round(coverage_pct, 1),
        "error_m": round(error_m, 2),
        "longest_stay_s": round(LOOK_S * max(longest_stay(way) for way in ways)),
        "over_shoals_s": round(LOOK_S * sum(floor.over_shoals(way) for way in ways)),
        "finished": not stopped,
    }


async def _flown(spec: MissionSpec, floor: Floor, service: MissionService) -> tuple[float, float, list[Way], bool]:
    """Return how much is known, how wrong the map is, the vehicles' ways, and whether the mission ended early."""
    live = await service.get((await service.create(spec)).id)
    await service.act(live, Action.START, actor="benchmark")
    ways: dict[str, Way] = {vehicle.name: [] for vehicle in spec.vehicles}
    while (view := mission_view(live)).state not in ENDED:
        for member in live.team.plannable:
            if member.report is not None:
                east_m, north_m = member.place_m(live.frame)
                ways[member.name].append((float(east_m), float(north_m)))
        await asyncio.sleep(LOOK_S / TIME_SCALE)
    await live.map.build()
    built = live.builder.newest
    error_m = math.nan if built is None else floor.error_m(built.map)
    return live.progress().coverage_pct or 0.0, error_m, list(ways.values()), view.state != "finished"


def longest_stay(way: Way) -> int:
    """Return how many looks in a row a vehicle was within :data:`STAY_M` of where it was at the first of them."""
    longest = begin = 0
    for at, place in enumerate(way):
        while math.dist(way[begin], place) > STAY_M:
            begin += 1
        longest = max(longest, at - begin)
    return longest


def main(arguments: Sequence[str] | None = None) -> None:
    """Fly and print."""
    parser = make_parser(__doc__, FLIGHT)
    parser.add_argument("--floors", type=int, default=12)
    parser.add_argument("--first", type=int, default=0, help="number of the first")
    options = parser.parse_args(arguments)
    logs.configure("error", "json")
    numbers = range(options.first, options.first + options.floors)
    figures: dict[str, Any] = {}
    for planner in PLANNERS:
        flown = {number: fly(number, planner) for number in numbers}
        figures[f"{planner}: mean coverage_pct"] = round(fmean(one["coverage_pct"] for one in flown.values()), 1)
        figures[f"{planner}: least coverage_pct"] = min(one["coverage_pct"] for one in flown.values())
        figures[f"{planner}: mean error_m"] = round(fmean(one["error_m"] for one in flown.values()), 2)
        figures[f"{planner}: over_shoals_s"] = sum(one["over_shoals_s"] for one in flown.values())
        figures[f"{planner}: longest_stay_s"] = max(one["longest_stay_s"] for one in flown.values())
        for number, one in flown.items():
            figures[f"{planner}, floor {number}"] = ", ".join(f"{name} {value}" for name, value in one.items())
    print(json.dumps(figures, indent=1))
    write_section(options.write, FLIGHT, "Shoals that nobody knew of", figures, seeds=list(numbers))


if __name__ == "__main__":
    main()
