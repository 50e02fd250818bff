"""Crossings of flown missions beside those that GMT finds on the same tracks.

    python -m benchmarks.mapping.crossovers [--terrains FOLDER] [--only NAME ...] [--pace 30] [--write]

Missions of the service with its simulated vehicles, over real and generated sea floors, by several planners and with
several sonars. GMT (Debian: ``apt-get install gmt``) gets each vehicle's track as a file, and ``x2sys_cross`` says with
linear interpolation where they cross. Told are both counts, means and standard deviations of the differences, the
largest difference between the two at a crossing that both have, and the seconds that each took. GMT's differences
within a track have no order: they are turned so that the earlier is subtracted from the later.
"""

import asyncio
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from app.arrays import FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.quality.crossovers import Crossings, warm_up
from app.mapping.quality.survey import SurveyCheck
from app.mapping.quality.tracks import GAP_M, GAP_S, Tracks
from app.missions.operations.corrections.crossovers import survey_tracks
from app.missions.running.mission_views import mission_view
from app.missions.service import MissionService
from app.missions.settings import ImcSettings, ServiceSettings, SimulationSettings
from app.missions.spec.mission import MissionSpec
from app.missions.states import ENDED, Action
from app.storage.database import Database
from app.storage.upkeep.prepare import prepare_database
from benchmarks.common.report import Page, make_parser, write_section
from benchmarks.imc.mission import ORIGIN
from tests.support.mapping.tracks import GMT, gmt_crossings
from tests.support.paths import TERRAINS

QUALITY = Page(
    "quality.md",
    """# Surveys held against themselves: what was measured

Every section is written by the command that stands in it (`--write`).

Pairs are ours / GMT's. Of GMT's crossings those are left out that lie within steps of more than 25 m, which it is told
to but does not leave out. What our side takes for the scatter of positions, 0.5 m, was chosen after earlier flights of
the same missions had been compared. Vehicles that wait circle, and cross their circles: most crossings of the first
mission are that.
""",
)

SIDE_M = 90.0
SAME_M = 1e-3
"""Crossings this near to each other are the same."""


@dataclass(frozen=True)
class Flight:
    """A mission to fly: its sea floor (a terrain file's name, or a generated family), planner, sonar and vehicles."""

    floor: str
    planner: str
    sensor: str
    vehicles: int

    @property
    def name(self) -> str:
        return f"{self.floor}, {self.planner}, {self.vehicles} x {self.sensor}"


FLIGHTS = (
    Flight("monterey_canyon", "lawnmower", "single_beam", 2),
    Flight("leixoes_sharp_diagonal", "cao", "single_beam", 3),
    Flight("fortbragg_gully", "random", "single_beam", 2),
    Flight("monterey_coast_range", "cao", "dvl", 2),
    Flight("leixoes_noptilus_quad", "swath", "multibeam", 2),
    Flight("reef", "random", "single_beam", 3),
    Flight("harbour", "swath", "multibeam", 1),
)


def mission(flight: Flight) -> MissionSpec:
    """Vehicles over a square."""
    frame = LocalFrame(*ORIGIN)
    corners = [(0, 0), (SIDE_M, 0), (SIDE_M, SIDE_M), (0, SIDE_M), (0, 0)]
    ring = [[float(x) for x in reversed(frame.to_geographic(float(e), float(n)))] for e, n in corners]
    return MissionSpec.model_validate(
        {
            "name": flight.name,
            "area": {"type": "Polygon", "coordinates": [ring]},
            "vehicles": [
                {"name": f"auv-{k + 1}", "kind": "sim", "sensor": flight.sensor, "depth_m": 0.5 + 0.5 * k}
                for k in range(flight.vehicles)
            ],
            "budget": {"minutes": 8},
            "cell_m": 1.0,
            "limits": {"max_step_m": 25.0, "min_vertical_separation_m": 0.4, "min_depth_m": 0.0},
            "planner": {"name": flight.planner},
        }
    )


async def flown(flight: Flight, folder: Path, terrains: Path, pace: float) -> Tracks:
    """Fly a mission; what it sounded along the vehicles' ways."""
    url = f"sqlite+aiosqlite:///{folder / 'mission.db'}"
    await prepare_database(url, may_upgrade=True)
    database = Database(url)
    file = terrains / f"{flight.floor}.npz"
    simulation = SimulationSettings(terrain=file) if file.exists() else SimulationSettings(family=flight.floor, seed=1)
    settings = ServiceSettings(
        database_url=url,
        pings_url=str(folder / "pings"),
        time_scale=pace,
        simulation=simulation,
        imc=ImcSettings(enabled=False),
    )
    service = MissionService(settings, database)
    await service.startup()
    try:
        live = await service.get((await service.create(mission(flight))).id)
        await service.act(live, Action.START, actor="benchmark")
        while (view := mission_view(live)).state not in ENDED:  # noqa: ASYNC110
            await asyncio.sleep(0.5)
        if str(view.state) != "finished":
            raise RuntimeError(f"{flight.name}: {view.state}, {view.reason}")
        return await survey_tracks(live)
    finally:
        await service.shutdown()


def table_of(tracks: Tracks, vehicle: int) -> FloatArray:
    """One vehicle's track, (n, 5)."""
    columns = (tracks.time_s, tracks.east_m, tracks.north_m, tracks.depth_m, tracks.sd_m)
    return np.column_stack([column[tracks.vehicle == vehicle] for column in columns])


def compared(tracks: Tracks, folder: Path) -> dict[str, Any]:
    """Both programs' figures on the same tracks."""
    begun = time.perf_counter()
    check = SurveyCheck.of(tracks)
    ours_s = time.perf_counter() - begun
    begun = time.perf_counter()
    tables = {name: table_of(tracks, k) for k, name in enumerate(tracks.names)}
    gmt = gmt_crossings(tables, folder, gap_s=GAP_S, gap_m=GAP_M)
    gmt_s = time.perf_counter() - begun
    off = check.crossings.difference_m
    return {
        "soundings": len(tracks),
        "lines": len(check.lines),
        "count": f"{len(off)} / {len(gmt)}",
        "mean_m": f"{off.mean():.4f} / {gmt[:, 4].mean():.4f}",
        "sd_m": f"{off.std():.4f} / {gmt[:, 4].std():.4f}",
        "largest_m": f"{differ(check.crossings, gmt):.5f}",
        "seconds": f"{ours_s:.2f} / {gmt_s:.2f}",
        "crosslines_pct": round(100.0 * check.crosslines_m / check.length_m, 1),
    }


def differ(ours: Crossings, gmt: FloatArray) -> float:
    """How much the two disagree at most at a crossing that both have, metres."""
    found = cKDTree(np.column_stack([ours.east_m, ours.north_m])).query(gmt[:, :2])
    away, at = np.asarray(found[0]), np.asarray(found[1])
    same = away < SAME_M
    return float(np.abs(ours.difference_m[at[same]] - gmt[same, 4]).max(initial=0.0))


def main() -> None:
    parser = make_parser(__doc__, QUALITY)
    parser.add_argument("--terrains", type=Path, default=TERRAINS)
    parser.add_argument("--only", nargs="*", default=[], help="sea floors")
    parser.add_argument("--pace", type=float, default=30.0, help="how much faster than the clock vehicles live")
    options = parser.parse_args()
    if GMT is None:
        parser.error("gmt is not installed; Debian: apt-get install gmt")
    warm_up()
    rows = {}
    for flight in FLIGHTS:
        if options.only and flight.floor not in options.only:
            continue
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            tracks = asyncio.run(flown(flight, folder, options.terrains, options.pace))
            rows[flight.name] = compared(tracks, folder)
        print(flight.name, rows[flight.name], flush=True)
    hidden = {options.terrains: "FOLDER"}
    write_section(options.write, QUALITY, "Crossings: bathyfleet / GMT 6", rows, hidden=hidden)


if __name__ == "__main__":
    main()
