"""How often legs are barred at the corners of zones: ``python -m benchmarks.missions.corners [--layouts ...]``.

A mission of the service with its simulated vehicles surveys a square of 200 m with keep-out zones in it, once for each
layout, planner and seed. A leg is *barred* where its vehicle, when it is to begin it, is elsewhere than planned, so
that the straight way from there would lead through a zone or its margin: then that leg and those after it are not
flown. Of each mission is told how often that was, how many legs were to be flown, and whether a track led through a
zone. ``--write`` puts it into a page.
"""

import argparse
import asyncio
import json
import os
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon

from app.mapping.coordinates.georeference import LocalFrame
from app.missions.running.mission_views import mission_view
from app.missions.service import MissionService
from app.missions.settings import ServiceSettings
from app.missions.spec.mission import MissionSpec
from app.missions.states import ENDED, Action
from app.storage.database import Database
from app.storage.queries.events import events_of_levels
from app.storage.queries.missions import track_points, waypoints_between
from app.storage.upkeep.prepare import prepare_database
from benchmarks.common.report import FLIGHT, make_parser, write_section
from benchmarks.imc.mission import NAMES, ORIGIN

SIDE_M = 200.0
LAYOUTS: dict[str, list[list[tuple[float, float]]]] = {
    "square": [[(80, 80), (120, 80), (120, 120), (80, 120)]],
    "four": [
        [(45, 45), (65, 45), (65, 65), (45, 65)],
        [(130, 50), (155, 40), (150, 70)],
        [(40, 130), (70, 135), (55, 160)],
        [(125, 125), (155, 125), (155, 150), (125, 150)],
    ],
    "hook": [[(70, 60), (140, 60), (140, 140), (125, 140), (125, 75), (70, 75)]],
    "wall": [[(95, 50), (105, 50), (105, 200), (95, 200)]],
}
"""Zones, their corners east and north in metres."""
SAYS = "does not fly its next leg: from where it is"


def mission(layout: str, planner: str, seed: int, options: argparse.Namespace) -> MissionSpec:
    """Vehicles that survey a square with zones."""
    return MissionSpec.model_validate(
        {
            "name": "corners",
            "area": _ring([(0, 0), (SIDE_M, 0), (SIDE_M, SIDE_M), (0, SIDE_M)]),
            "keep_out": [_ring(zone) for zone in LAYOUTS[layout]],
            "vehicles": [
                {"name": name, "kind": "sim", "depth_m": 2.0 + k} for k, name in enumerate(NAMES[: options.vehicles])
            ],
            "budget": {"km_per_vehicle": options.km},
            "cell_m": 2.0,
            "speed_mps": 1.3,
            "limits": {
                "max_step_m": options.leg,
                "keep_out_margin_m": options.margin,
                "min_vertical_separation_m": 0.5,
                "min_altitude_m": 2.0,
            },
            "planner": {"name": planner},
            "seed": seed,
        }
    )


def _ring(corners: list[tuple[float, float]]) -> dict[str, Any]:
    frame = LocalFrame(*ORIGIN)
    ring = [[float(x) for x in reversed(frame.to_geographic(np.float64(e), np.float64(n)))] for e, n in corners]
    return {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}


async def fly(spec: MissionSpec, layout: str, time_scale: float, folder: Path) -> dict[str, int]:
    """Fly one mission; what came of its legs."""
    url = f"sqlite+aiosqlite:///{folder / 'mission.db'}"
    await prepare_database(url, may_upgrade=True)
    database = Database(url)
    service = MissionService(ServiceSettings(database_url=url, time_scale=time_scale), database)
    await service.startup()
    try:
        live = await service.get((await service.create(spec)).id)
        await service.act(live, Action.START, actor="benchmark")
        while mission_view(live).state not in ENDED:  # noqa: ASYNC110
            await asyncio.sleep(0.5)
        async with database.reading() as session:
            tracks = await track_points(session, live.id)
            waypoints = await waypoints_between(session, live.id, 1, 1_000_000)
            said = await events_of_levels(session, live.id, ["warning"])
    finally:
        await service.shutdown()
    zones = shapely.union_all([Polygon(zone) for zone in LAYOUTS[layout]])
    margins = zones.buffer(spec.limits.keep_out_margin_m, join_style="mitre")
    flown = [_track(points) for points in tracks.values() if len(points) > 1]
    status = Counter(str(row.status) for row in waypoints)
    return {
        "legs": len(waypoints),
        "barred": sum(SAYS in row.message for row in said),
        "legs_not_flown": len(waypoints) - status["reached"],
        "zones_entered": sum(track.intersects(zones) for track in flown),
        "in_margins_m": round(sum(track.intersection(margins).length for track in flown)),
        "flown_m": round(sum(track.length for track in flown)),
    }


def _track(points: Any) -> LineString:
    lon, lat, *_ = np.array(points).T
    return LineString(np.column_stack(LocalFrame(*ORIGIN).to_local(lat, lon)))


def main() -> None:
    """Fly and print."""
    parser = make_parser(__doc__, FLIGHT, seeds=[0])
    parser.add_argument("--layouts", nargs="*", default=list(LAYOUTS), choices=list(LAYOUTS))
    parser.add_argument("--planners", nargs="*", default=["cao", "lawnmower", "rollout"])
    parser.add_argument("--vehicles", type=int, default=3)
    parser.add_argument("--km", type=float, default=0.6, help="of each vehicle")
    parser.add_argument("--leg", type=float, default=10.0, help="longest leg, metres")
    parser.add_argument("--margin", type=float, default=10.0, help="about zones, metres")
    parser.add_argument("--time-scale", type=float, default=10.0)
    options = parser.parse_args()
    found: dict[str, Any] = {}
    for layout in options.layouts:
        for planner in options.planners:
            runs = []
            for seed in options.seeds:
                with tempfile.TemporaryDirectory(prefix="bathyfleet-corners-") as folder:
                    spec = mission(layout, planner, seed, options)
                    runs.append(asyncio.run(fly(spec, layout, options.time_scale, Path(folder))))
            found[f"{layout}, {planner}"] = {key: sum(run[key] for run in runs) for key in runs[0]}
            print(layout, planner, json.dumps(found[f"{layout}, {planner}"]), flush=True)
    found["load_of_the_machine"] = f"{os.getloadavg()[2]:.1f}"
    write_section(options.write, FLIGHT, "Legs at the corners of zones", found, seeds=options.seeds)


if __name__ == "__main__":
    main()
