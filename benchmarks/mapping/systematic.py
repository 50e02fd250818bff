"""Systematic errors that surveys are given, and what the service finds of them.

    python -m benchmarks.mapping.systematic [--floors NAME ...] [--seeds 0 1] [--write]

Two simulated vehicles with swath sonars of 120 degrees survey generated floors of 60 x 60 m on lines 8 m apart and
three crosslines. Depths of the second are too large, the sonars are mounted askew, and sound at them is faster than
they assume, each by a chance amount; positions scatter by 0.3 m from line to line. The service is the real one, over
REST: it gets the pings, is asked for systematic errors, and is told to take out what it proposes. Told are the errors
of what was taken out beside what there was, and the map's RMSE against the true floor before and after.
"""

import asyncio
import sys
import tempfile
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from app.api import logs
from app.arrays import FloatArray
from app.mapping.quality.crossovers import warm_up
from app.missions.settings import ImcSettings
from app.settings import Settings
from benchmarks.common.report import make_parser, write_section
from benchmarks.mapping.crossovers import QUALITY
from simulator.floors.seafloors import generate
from simulator.floors.terrain import Terrain
from simulator.sonars.swath import SwathErrors, SwathSonar, SwathSounder
from simulator.vehicles.vehicle import Motion
from tests.support.api.rest import make_client, mission_spec, running
from tests.support.mapping.tracks import flown, lawnmower
from tests.support.missions.specs import lon_lat, rectangle

FLOORS = ("flat", "slope", "smooth", "rugged", "ridge", "reef", "canyon", "harbour")
SIDE_M, CELL_M, DEPTH_M = 60.0, 1.0, 1.0
SCATTER_M, START_S, BATCH = 0.3, 1_795_225_140.0, 200
SONAR = SwathSonar(aperture_deg=120.0, beams=61, rate_hz=1.0, range_m=60.0)


def pings(terrain: Terrain, vehicle: str, way: FloatArray, errors: SwathErrors, off_m: float, seed: int) -> list[Any]:
    """Pings (JSON) along a way (n, 5) of a vehicle that rolls, and whose place is off by what its line is off by."""
    rng = np.random.default_rng(seed)
    sounder = SwathSounder(SONAR, errors, rng)
    east_step, north_step = np.gradient(way[:, 1]), np.gradient(way[:, 2])
    heading = np.arctan2(east_step, north_step)
    line = np.cumsum(np.abs(np.diff(heading, prepend=heading[0])) > 0.5)
    off = rng.normal(0.0, SCATTER_M, (int(line.max()) + 1, 2))[line]
    roll = np.radians(3.0) * np.sin(way[:, 0] / 1.7)
    items = []
    for k, (time_s, east, north, *_) in enumerate(way.tolist()):
        if not (0.0 <= east <= SIDE_M and 0.0 <= north <= SIDE_M):
            continue
        motion = Motion(east, north, DEPTH_M, heading_rad=float(heading[k]), roll_rad=float(roll[k]))
        ranges = sounder.ping(terrain, motion)
        lon, lat = lon_lat(east + off[k, 0], north + off[k, 1])
        heard = np.isfinite(ranges)
        if heard.sum() < 5:
            continue
        place = {"lat_deg": lat, "lon_deg": lon, "depth_m": DEPTH_M + off_m}
        attitude = {"heading_deg": float(np.degrees(heading[k]) % 360.0), "roll_deg": float(np.degrees(roll[k]))}
        angles_deg = np.degrees(sounder.angles_rad)[heard].tolist()
        beams = {"angles_deg": angles_deg, "ranges_m": ranges[heard].tolist()}
        items.append({"vehicle": vehicle, "time_s": time_s, "beams": beams} | place | attitude)
    return items


async def survey(client: httpx.AsyncClient, terrain: Terrain, seed: int) -> dict[str, Any]:
    rng = np.random.default_rng(1000 + seed)
    truth = {
        name: (off, float(rng.uniform(-1.0, 1.0)), float(rng.uniform(-8.0, 8.0)))
        for name, off in (("one", 0.0), ("two", float(rng.uniform(-0.2, 0.2))))
    }
    vehicles = [{"name": name, "kind": "rest", "sensor": "multibeam"} for name in truth]
    spec = mission_spec(area=rectangle(0, 0, SIDE_M, SIDE_M), cell_m=CELL_M, vehicles=vehicles)
    path = f"/missions/{(await client.post('/missions', json=spec)).json()['id']}"
    half = [(east + 3, north + 1) for east, north in lawnmower(SIDE_M - 6, SIDE_M - 2, 8.0)]
    across = [(1.0, 14.0), (59.0, 14.0), (59.0, 30.0), (1.0, 30.0), (1.0, 46.0), (59.0, 46.0)]
    ways = {
        "one": [half[: len(half) // 2], across[:4]],
        "two": [half[len(half) // 2 :], across[2:]],
    }
    for number, (name, corners) in enumerate(ways.items()):
        off, roll_deg, speed_mps = truth[name]
        errors = SwathErrors(roll_offset_deg=roll_deg, sound_speed_error_mps=speed_mps)
        for part, corner in enumerate(corners):
            way = flown(corner, spacing_m=1.3, start_s=START_S + 4000.0 * part)
            items = pings(terrain, name, way, errors, off, 10 * seed + 2 * number + part)
            for batch in _batches(items):
                (await client.post(f"{path}/measurements", json={"items": batch})).raise_for_status()
    before = await rmse_m(client, path, terrain)
    found = (await client.get(f"{path}/systematic-errors")).json()
    if found["proposal"] is not None:
        (await client.put(f"{path}/systematic-errors", json=found["proposal"])).raise_for_status()
    after = await rmse_m(client, path, terrain)
    taken = (await client.get(f"{path}/corrections")).json()["systematic_errors"]["vehicles"]
    right = {"depth_m": 0.0, "roll_offset_deg": 0.0, "sound_speed_mps": 0.0}
    out = {name: right | taken.get(name, {}) for name in truth}
    mean = float(np.mean([off for off, *_ in truth.values()]))
    return {
        "depth_off_m": [out[name]["depth_m"] - (off - mean) for name, (off, *_) in truth.items()],
        "roll_off_deg": [out[name]["roll_offset_deg"] - roll for name, (_, roll, _) in truth.items()],
        "speed_off_mps": [out[name]["sound_speed_mps"] - speed for name, (*_, speed) in truth.items()],
        "given": [list(values) for values in truth.values()],
        "rmse_m": (before, after),
    }


def _batches(items: list[Any]) -> list[list[Any]]:
    return [items[first : first + BATCH] for first in range(0, len(items), BATCH)]


async def rmse_m(client: httpx.AsyncClient, path: str, terrain: Terrain) -> float:
    """RMSE of the map without its mean error: a depth offset of the whole team cannot be seen."""
    found = (await client.get(f"{path}/map", timeout=120)).json()
    depth_m = np.array(found["depth_m"], dtype=float)
    rows, cols = depth_m.shape
    east, north = np.meshgrid((np.arange(cols) + 0.5) * CELL_M, (np.arange(rows) + 0.5) * CELL_M)
    off = depth_m - terrain.depth_at(east, north)
    return float(np.nanstd(off))


async def play(floors: list[str], seeds: list[int]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    every: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        settings = Settings(
            port=0,
            database_url=f"sqlite+aiosqlite:///{folder}/missions.db",
            pings_url=str(Path(folder) / "pings"),
            imc=ImcSettings(enabled=False),
        )
        async with running(settings) as server, make_client(server) as client:
            client.timeout = httpx.Timeout(120)
            for floor in floors:
                runs = []
                for seed in seeds:
                    terrain = generate(floor, width_m=SIDE_M, height_m=SIDE_M, cell_m=CELL_M, seed=seed)
                    runs.append(await survey(client, terrain, seed))
                found[floor] = summary(runs)
                print(floor, found[floor], flush=True)
                every += runs
    return found | {"all": summary(every)}


def summary(runs: list[dict[str, Any]]) -> dict[str, Any]:
    given = np.array([values for run in runs for values in run["given"]])
    rms = {
        key: float(np.sqrt(np.mean(np.square([value for run in runs for value in run[key]]))))
        for key in ("depth_off_m", "roll_off_deg", "speed_off_mps")
    }
    scale = np.sqrt((given**2).mean(axis=0))
    before, after = np.array([run["rmse_m"] for run in runs]).T
    return {
        "runs": len(runs),
        "roll given/left (rms, degrees)": f"{scale[1]:.2f} / {rms['roll_off_deg']:.2f}",
        "sound speed given/left (rms, m/s)": f"{scale[2]:.1f} / {rms['speed_off_mps']:.1f}",
        "depth left (rms, m)": round(rms["depth_off_m"], 3),
        "map RMSE after/before": f"mean {np.mean(after / before):.2f}, worst {np.max(after / before):.2f}",
    }


def main() -> None:
    parser = make_parser(__doc__, QUALITY, seeds=(0, 1))
    parser.add_argument("--floors", nargs="+", default=FLOORS, choices=FLOORS)
    options = parser.parse_args()
    logs.configure("error", "console", sys.stderr)
    warm_up()
    found = asyncio.run(play(list(options.floors), options.seeds))
    write_section(options.write, QUALITY, "Systematic errors, given and found", found, seeds=options.seeds)


if __name__ == "__main__":
    main()
