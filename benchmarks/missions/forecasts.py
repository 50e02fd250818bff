"""Whether missions end as they were forecast: ``python -m benchmarks.missions.forecasts [--missions 20 --first 0]``.

For each seed a mission is drawn (a floor, real where ``--terrains`` has some and generated else; one to four vehicles;
an hour's part or kilometres; a planner), its forecast is asked for before the start and again after a third of it, and
it is flown by the service with its simulated vehicles in simulated time. Told is of how many figures the outcome lies
within the forecast's 10–90 % range (``within``, as so many of 20), how far outcomes lie from the range's middle in its
width (``off``: the median, -0.5 and 0.5 are its ends), how often they are below and above it, and how wide ranges are
beside outcomes (``width``: median, share of the outcome; of coverage in percentage points). Even seeds are flown over
other floors than odd ones. A busy machine takes no floor away from a forecast here. After ``--minutes`` no other
mission is begun.
"""

import argparse
import asyncio
import json
import math
import os
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from app.api import logs
from app.commands.simulated_service import served
from app.mapping.coordinates.georeference import LocalFrame
from app.missions.forecast import request
from app.missions.forecast.ranges import ForecastRange
from app.missions.forecast.request import ForecastView
from app.missions.live.mission import LiveMission
from app.missions.service import MissionService
from app.missions.settings import SimulationSettings
from app.missions.spec.mission import MissionSpec
from app.missions.states import ENDED, Action
from benchmarks.common.report import FLIGHT, make_parser, write_section
from benchmarks.imc.mission import ORIGIN
from simulator.floors.terrain import Terrain
from simulator.floors.terrain_files import load_terrain, save_npz
from simulator.floors.unseen_floors import UNSEEN, unseen_floor

TIME_SCALE = 5.0
SIDES_M = (90.0, 250.0)
DEEP_ENOUGH_M = 4.5
"""Floors are used a tenth of which, at most, is shoaler."""
PLANNERS, SHARES = ("cao", "lawnmower", "swath"), (0.45, 0.25, 0.3)
TRIES = 200
ASKED_AGAIN = 1.0 / 3.0
TEAM_OF = 20
"""What shares are told of."""


@dataclass(frozen=True)
class Figure:
    """What was forecast of one quantity, beside what came of it."""

    of: str
    low: float
    high: float
    came: float

    @property
    def within(self) -> bool:
        return self.low <= self.came <= self.high

    @property
    def off(self) -> float:
        """How far it lies from the middle of the range, in widths of the range."""
        return (self.came - 0.5 * (self.low + self.high)) / max(self.high - self.low, 1e-9)

    @property
    def width(self) -> float:
        wide = self.high - self.low
        return wide if "coverage" in self.of else wide / max(abs(self.came), 1e-9)


def real_floor(folder: Path, rng: np.random.Generator, *, odd: bool) -> Terrain:
    """Return a part of a real floor; every other file is one of odd seeds only."""
    names = sorted(folder.glob("*.npz"))[int(odd) :: 2]
    for _ in range(TRIES):
        file = names[int(rng.integers(len(names)))]
        whole = load_terrain(file)
        size = [int(rng.uniform(*SIDES_M) / whole.cell_m) for _ in range(2)]
        rows, cols = (min(cells, whole.z_m.shape[k]) for k, cells in enumerate(size))
        row, col = (int(rng.integers(whole.z_m.shape[k] - n + 1)) for k, n in enumerate((rows, cols)))
        z = whole.z_m[row : row + rows, col : col + cols]
        if min(rows, cols) * whole.cell_m >= 0.4 * SIDES_M[0] and usable(z):
            return Terrain(z, whole.cell_m, name=file.stem)
    raise ValueError(f"{folder} has no floor that is deep enough")


def usable(z_m: np.ndarray) -> bool:
    """Return whether a floor, (rows, cols), is known everywhere and deep enough."""
    return bool(np.isfinite(z_m).all()) and float(np.quantile(z_m, 0.1)) >= DEEP_ENOUGH_M


def generated_floor(seed: int, rng: np.random.Generator) -> Terrain:
    """Return a floor of a family that nobody develops on."""
    for number in range(TRIES):
        family = sorted(UNSEEN)[int(rng.integers(len(UNSEEN)))]
        width, height = rng.uniform(*SIDES_M, 2)
        floor = unseen_floor(family, seed + 1000 * number, width_m=float(width), height_m=float(height))
        if usable(floor.z_m):
            return floor
    raise ValueError("no generated floor is deep enough")


def drawn(seed: int, terrains: Path | None) -> tuple[MissionSpec, Terrain, float | None]:
    """Return the mission of a seed, its floor, and how deep its operator says that is; None: that is not known."""
    rng = np.random.default_rng([seed, 25])
    real = terrains is not None and rng.random() < 0.5
    floor = real_floor(terrains, rng, odd=seed % 2 == 1) if real and terrains else generated_floor(seed, rng)
    frame = LocalFrame(*ORIGIN)
    east, north = floor.width_m - 1.0, floor.height_m - 1.0
    corners = [(0, 0), (east, 0), (east, north), (0, north), (0, 0)]
    ring = [[float(x) for x in reversed(frame.to_geographic(float(e), float(n)))] for e, n in corners]
    planner = str(rng.choice(PLANNERS, p=SHARES))
    vehicles = [
        {
            "name": f"v{k}",
            "kind": "sim",
            "sensor": "multibeam" if planner == "swath" else "single_beam",
        }
        for k in range(int(rng.integers(1, 5)))
    ]
    minutes = float(np.round(rng.uniform(8.0, 16.0)))
    by_time = rng.random() < 0.5
    spec = MissionSpec.model_validate(
        {
            "name": f"forecast {seed}",
            "area": {"type": "Polygon", "coordinates": [ring]},
            "vehicles": vehicles,
            "budget": {"minutes": minutes} if by_time else {"km_per_vehicle": round(0.06 * 1.3 * minutes, 2)},
            "cell_m": max(1.0, round(max(east, north) / 100.0, 1)),
            "limits": {"max_step_m": float(rng.choice([10.0, 25.0]))},
            "planner": {"name": planner},
            "seed": seed,
        }
    )
    charted = rng.random() < 0.5
    return spec, floor, float(np.round(np.median(floor.z_m))) if charted else None


def fly(seed: int, terrains: Path | None) -> dict[str, Any]:
    """Ask for forecasts of a seed's mission, and fly it."""
    spec, floor, depth_m = drawn(seed, terrains)
    with tempfile.TemporaryDirectory(prefix="bathyfleet-forecasts-") as folder:
        file = Path(folder) / "floor.npz"
        save_npz(floor, file)

        async def work(service: MissionService) -> dict[str, Any]:
            return await forecast_and_flown(service, spec, floor, depth_m)

        found = served(SimulationSettings(terrain=file, seed=seed), TIME_SCALE, work)
    return {
        "seed": seed,
        "floor": floor.name,
        "depth_told": depth_m is not None,
        "planner": spec.planner.name,
        "vehicles": len(spec.vehicles),
    } | found


async def forecast_and_flown(
    service: MissionService, spec: MissionSpec, floor: Terrain, depth_m: float | None
) -> dict[str, Any]:
    """Return what was forecast of a mission before it and on its way, and what came of it."""
    begun_s = time.process_time()
    before = await service.forecaster.of_description(spec, depth_m)
    forecast_s = time.process_time() - begun_s
    live = await service.get((await service.create(spec)).id)
    await service.act(live, Action.START, actor="benchmark")
    after = None
    while live.header.state not in ENDED:
        await asyncio.sleep(1.0 / TIME_SCALE)
        if after is None and seconds_of(live) >= ASKED_AGAIN * before.duration_s and live.builder.newest is not None:
            done = seconds_of(live), {member.name: member.flown.flown_m for member in live.team}
            after = await service.forecaster.of_mission(live, depth_m)
    took_s = seconds_of(live)
    flown_m = {member.name: member.flown.flown_m for member in live.team}
    await asyncio.sleep(1.0)
    await live.map.build()
    came = live.progress()
    ends = {"coverage": came.coverage_pct, "deviation": came.mean_sd_m or 0.0}
    figures = compared("before", before, took_s, flown_m, ends)
    if after is not None:
        left_m = {name: flown_m[name] - way_m for name, way_m in done[1].items()}
        figures += compared("on the way", after, took_s - done[0], left_m, ends)
    return {
        "state": str(live.header.state),
        "minutes": round(took_s / 60.0, 1),
        "forecast_s": round(forecast_s, 1),
        "floors": before.floors,
        "true_rmse_m": round(true_rmse_m(live, floor), 3),
        "figures": [asdict(figure) for figure in figures],
    }


def seconds_of(live: LiveMission) -> float:
    """Return how long a mission has been flown, seconds of its vehicles."""
    return live.progress().elapsed_s * TIME_SCALE


def compared(
    when: str, view: ForecastView, took_s: float, flown_m: dict[str, float], ends: dict[str, float]
) -> list[Figure]:
    """Return the figures of a forecast beside what came."""

    def figure(of: str, told: ForecastRange | None, came: float) -> Figure:
        low, high = (0.0, 0.0) if told is None else (told.low, told.high)
        return Figure(f"{of}, {when}", low, high, came)

    found = [figure("minutes", view.duration_s_range, took_s)]
    found += [figure("km", one.distance_m_range, flown_m[one.vehicle]) for one in view.vehicles]
    found.append(figure("coverage", view.coverage_pct_range, ends["coverage"]))
    return [*found, figure("deviation", view.mean_sd_m_range, ends["deviation"])]


def true_rmse_m(live: LiveMission, floor: Terrain) -> float:
    """Return how far the last map is off where it shows a depth."""
    built = live.builder.newest
    if built is None:
        return float("nan")
    centres = built.map.grid.centres_m
    off = built.map.depth_m.ravel() - floor.depth_at(centres[:, 0], centres[:, 1])
    return float(np.sqrt(np.nanmean(off**2)))


def summary(missions: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return how the figures of all missions lie in their ranges."""
    figures = [Figure(**one) for mission in missions for one in mission["figures"]]
    told: dict[str, Any] = {"missions": len(missions)}
    for of in dict.fromkeys(figure.of for figure in figures):
        these = [figure for figure in figures if figure.of == of]
        told[of] = {
            "within": f"{TEAM_OF * np.mean([f.within for f in these]):.1f} of {TEAM_OF}",
            "figures": len(these),
            "below": sum(f.came < f.low for f in these),
            "above": sum(f.came > f.high for f in these),
            "off": round(float(np.median([f.off for f in these])), 2),
            "width": round(float(np.median([f.width for f in these])), 3),
        }
    ratios = [
        mission["true_rmse_m"] / figure["came"]
        for mission in missions
        for figure in mission["figures"]
        if figure["of"] == "deviation, before" and figure["came"]
    ]
    told["true_error_over_deviation"] = round(float(np.nanmedian(ratios)), 2)
    told["slowest_forecast_s"] = max(mission["forecast_s"] for mission in missions)
    return told


def parsed(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = make_parser(__doc__, FLIGHT)
    parser.add_argument("--missions", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="seed of the first")
    parser.add_argument("--apart", type=int, default=1, help="from one seed to the next; 2: all even, or all odd")
    parser.add_argument("--minutes", type=float, default=math.inf, help="by the clock")
    parser.add_argument("--terrains", type=Path, default=None, help="folder of real floors")
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    options = parsed(arguments)
    logs.configure("error", "json")
    request.PATIENCE_S = math.inf
    seeds = range(options.first, options.first + options.apart * options.missions, options.apart)
    done: list[dict[str, Any]] = []
    begun_s = time.monotonic()
    for seed in seeds:
        if done and time.monotonic() - begun_s > 60.0 * options.minutes:
            break
        done.append(fly(seed, options.terrains))
        print(json.dumps(done[-1]), flush=True)
    result = summary(done)
    result["processor_s"] = round(time.process_time(), 1)
    result["load_of_the_machine"] = round(os.getloadavg()[1], 1)
    print(json.dumps(result, indent=2))
    title = f"Forecasts, and what came: {len(done)} missions from seed {options.first}"
    write_section(options.write, FLIGHT, title, result, seeds=seeds[: len(done)], hidden={options.terrains: "TERRAINS"})


if __name__ == "__main__":
    main()
