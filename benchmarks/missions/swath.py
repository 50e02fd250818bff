"""Full coverage as missions fly it: ``python -m benchmarks.missions.swath [--vehicles 2 --side 200 --family slope]``.

Missions of the service with its simulated vehicles and their multibeams, planner ``swath``, until nothing is left to
ensonify or the time is up. Told are what the map says in the end (``ensonified_pct``, ``dense_pct``, ``holidays``), the
kilometres and the vehicles' minutes, beams taken in, the longest time between a look at the event loop and the next
(``loop_held_s``), and processor time over the vehicles' time (``cores_at_pace_1``). Printed is one JSON object;
``--write`` puts it into a page.
"""

import argparse
import asyncio
import json
import resource
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from app.mapping.coordinates.georeference import LocalFrame
from app.missions.running.mission_views import mission_view
from app.missions.service import MissionService
from app.missions.settings import ServiceSettings, SimulationSettings
from app.missions.spec.mission import MissionSpec
from app.missions.states import ENDED, Action
from app.storage.database import Database
from app.storage.queries.missions import track_points
from app.storage.upkeep.prepare import prepare_database
from benchmarks.common.report import FLIGHT, make_parser, write_section
from benchmarks.imc.mission import ORIGIN

LOOK_S = 0.02


def mission(options: argparse.Namespace) -> MissionSpec:
    """Vehicles that cover a rectangle."""
    frame, side = LocalFrame(*ORIGIN), options.side
    corners = [(0, 0), (side, 0), (side, side), (0, side), (0, 0)]
    ring = [[float(x) for x in reversed(frame.to_geographic(float(e), float(n)))] for e, n in corners]
    return MissionSpec.model_validate(
        {
            "name": "swath",
            "area": {"type": "Polygon", "coordinates": [ring]},
            "vehicles": [
                {"name": f"auv-{k + 1}", "kind": "sim", "sensor": "multibeam", "depth_m": 2.0 + k}
                for k in range(options.vehicles)
            ],
            "budget": {"minutes": options.minutes},
            "cell_m": options.cell,
            "speed_mps": options.speed,
            "limits": {"max_step_m": options.leg, "min_vertical_separation_m": 1.0},
            "planner": {"name": "swath"},
            "sounding_noise": options.noise,
            "seed": options.seed,
        }
    )


async def fly(options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Fly the mission; how it came out."""
    url = f"sqlite+aiosqlite:///{folder / 'mission.db'}"
    await prepare_database(url, may_upgrade=True)
    database = Database(url)
    settings = ServiceSettings(
        database_url=url,
        time_scale=options.time_scale,
        simulation=SimulationSettings(terrain=options.terrain, family=options.family, seed=options.seed),
    )
    service = MissionService(settings, database)
    await service.startup()
    held = asyncio.create_task(_longest_hold())
    begun, used = time.monotonic(), time.process_time()
    try:
        identity = (await service.create(mission(options))).id
        live = await service.get(identity)
        await service.act(live, Action.START, actor="benchmark")
        while (view := mission_view(live)).state not in ENDED:  # noqa: ASYNC110
            await asyncio.sleep(0.5)
        await asyncio.sleep(1.0)
        await live.map.build()
        progress = live.progress()
        async with database.reading() as session:
            tracks = await track_points(session, identity)
    finally:
        held.cancel()
        await service.shutdown()
    frame = LocalFrame(*ORIGIN)
    drawn, minutes = {}, []
    for name, points in tracks.items():
        lon, lat, _, seconds = np.array(points).T
        drawn[name] = np.column_stack(frame.to_local(lat, lon))
        minutes.append(float(np.ptp(seconds)) / 60.0)
    if options.picture is not None:
        draw(options.picture, drawn, live.builder.newest)
    passed_s = time.monotonic() - begun
    return {
        "state": str(view.state),
        "reason": view.reason,
        "ensonified_pct": _rounded(progress.ensonified_pct),
        "dense_pct": _rounded(progress.dense_pct),
        "holidays": progress.holidays,
        "km": round(sum(float(np.hypot(*np.diff(t, axis=0).T).sum()) for t in drawn.values()) / 1000.0, 3),
        "minutes": round(max(minutes, default=0.0), 1),
        "beams": progress.beams,
        "rejected": progress.rejected,
        "wall_s": round(passed_s, 1),
        "loop_held_s": round(_HELD[0], 2),
        "cores_at_pace_1": round((time.process_time() - used) / max(60.0 * max(minutes, default=1.0), 1.0), 3),
        "memory_mib": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0, 1),
    }


_HELD = [0.0]


async def _longest_hold() -> float:
    """Look at the event loop all the time; keeps how long it was held at most."""
    _HELD[0] = 0.0
    while True:
        before = time.monotonic()
        await asyncio.sleep(LOOK_S)
        _HELD[0] = max(_HELD[0], time.monotonic() - before - LOOK_S)


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 2)


def draw(path: Path, tracks: dict[str, Any], built: Any) -> None:
    """Draw tracks over the soundings of each cell."""
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(9, 9))
    if built is not None:
        grid = built.map.grid
        extent = (0.0, grid.cols * grid.cell_m, 0.0, grid.rows * grid.cell_m)
        axes.imshow(built.map.count, origin="lower", extent=extent, vmax=40)
    for name, track in tracks.items():
        axes.plot(*track.T, label=name, linewidth=1.0)
    axes.legend()
    figure.savefig(path, dpi=60)


def main(arguments: Sequence[str] | None = None) -> None:
    """Fly and print."""
    parser = make_parser(__doc__, FLIGHT)
    parser.add_argument("--vehicles", type=int, default=2)
    parser.add_argument("--side", type=float, default=200.0, help="metres")
    parser.add_argument("--cell", type=float, default=1.0, help="metres")
    parser.add_argument("--leg", type=float, default=40.0, help="metres")
    parser.add_argument("--speed", type=float, default=1.5, help="metres per second")
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--family", default="slope")
    parser.add_argument("--terrain", type=Path, default=None)
    parser.add_argument("--noise", type=float, default=0.01, help="of a range, as a share of it")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--time-scale", type=float, default=10.0)
    parser.add_argument("--picture", type=Path, default=None, help="draw the tracks into this file")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="bathyfleet-swath-") as folder:
        found = asyncio.run(fly(options, Path(folder)))
    print(json.dumps(found))
    title = f"Full coverage, {options.vehicles} vehicles, {options.side:g} m, {options.family}"
    write_section(options.write, FLIGHT, title, found, seeds=[options.seed])


if __name__ == "__main__":
    main()
