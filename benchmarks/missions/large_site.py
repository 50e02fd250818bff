"""Half a day over a large site: ``python -m benchmarks.missions.large_site [--planner cao --side 3000 --hours 12]``.

The whole service flies ``--vehicles`` simulated vehicles in simulated time, which stands still while threads work, so
that a busy machine changes nothing but figures by the clock. Told are the time from the start of the mission until a
leg is sent (on the processor, and by the clock), what each decision, each map and each learning of its model took on
the processor (50 %, 99 % and the most, and 99 % in the first and last quarter of the mission), and memory by the hour
with its growth over the second half.
"""

import argparse
import asyncio
import gc
import json
import math
import os
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from app.api import logs
from app.commands.simulated_service import served
from app.mapping.coordinates.georeference import LocalFrame
from app.missions.flight.decisions import deciding
from app.missions.flight.legs.dispatch import Dispatch
from app.missions.live.mission import LiveMission
from app.missions.maps.builder import MapBuilder
from app.missions.service import MissionService
from app.missions.settings import SimulationSettings
from app.missions.spec.mission import MissionSpec
from app.missions.states import ENDED, Action
from benchmarks.common.report import FLIGHT, make_parser, write_section
from benchmarks.imc.mission import ORIGIN
from simulator.floors.seafloors import generate
from simulator.floors.terrain_files import save_npz

TIME_SCALE = 10.0
SPARE = 1.5
"""Vehicles last so many times as long as the mission."""
FLOOR_CELL_M = 5.0
HOUR_S = 3600.0


class Stopwatch:
    """Times what functions take, on their thread's processor."""

    def __init__(self) -> None:
        self.took_s: dict[str, list[float]] = {}
        self.first_leg: tuple[float, float] | None = None

    def on(self, owner: object, name: str, told: str) -> None:
        """Replace an attribute of a module or class by one that is timed."""
        real: Callable[..., Any] = getattr(owner, name)

        def timed(*arguments: Any, **named: Any) -> Any:
            begun_s = time.thread_time()
            try:
                return real(*arguments, **named)
            finally:
                self.took_s.setdefault(told, []).append(time.thread_time() - begun_s)

        setattr(owner, name, timed)

    def on_first_leg(self) -> None:
        """Note when the first leg is sent."""
        real = Dispatch.send

        async def send(*arguments: Any) -> None:
            await real(*arguments)
            if self.first_leg is None:
                self.first_leg = time.process_time(), time.monotonic()

        setattr(Dispatch, "send", send)  # noqa: B010 - it is not the class' to be replaced

    def figures(self) -> dict[str, str]:
        """Return what was timed, in words."""
        told = {}
        for name, took in self.took_s.items():
            took_s = np.array(took)
            quarter = math.ceil(len(took_s) / 4)
            first, last = (float(np.quantile(part, 0.99)) for part in (took_s[:quarter], took_s[-quarter:]))
            half, most = float(np.median(took_s)), float(np.quantile(took_s, 0.99))
            told[name] = (
                f"{len(took_s)}, 50 %: {half:.3f} s, 99 %: {most:.3f} s ({first:.3f} s in the first quarter, "
                f"{last:.3f} s in the last), most: {took_s.max():.3f} s"
            )
        return told


def mission(options: argparse.Namespace) -> MissionSpec:
    """Return the mission: a square, for so many hours."""
    frame, side = LocalFrame(*ORIGIN), options.side
    corners = [(0, 0), (side, 0), (side, side), (0, side), (0, 0)]
    ring = [[float(x) for x in reversed(frame.to_geographic(float(e), float(n)))] for e, n in corners]
    sensor = "multibeam" if options.planner == "swath" else "single_beam"
    return MissionSpec.model_validate(
        {
            "name": "large site",
            "area": {"type": "Polygon", "coordinates": [ring]},
            "vehicles": [
                {"name": f"v{k}", "kind": "sim", "sensor": sensor, "endurance_min": 60.0 * SPARE * options.hours}
                for k in range(options.vehicles)
            ],
            "budget": {"minutes": 60.0 * options.hours},
            "cell_m": options.cell,
            "limits": {"max_step_m": options.leg},
            "planner": {"name": options.planner},
            "seed": options.seed,
        }
    )


async def flown(service: MissionService, options: argparse.Namespace, watch: Stopwatch) -> dict[str, Any]:
    """Fly the mission and note every hour of it."""
    live = await service.get((await service.create(mission(options))).id)
    # A service that has been up for a minute has compiled what missions need.
    await service._compilation.search()
    process, memory_mb, handles = psutil.Process(), list[float](), list[int]()
    begun = time.process_time(), time.monotonic()
    await service.act(live, Action.START, actor="benchmark")
    while live.header.state not in ENDED:
        await asyncio.sleep(10.0 / TIME_SCALE)
        if hours_of(live) >= len(memory_mb):
            gc.collect()
            memory_mb.append(round(process.memory_info().rss / 1e6, 1))
            handles.append(process.num_fds())
            told = {"hour": len(memory_mb) - 1, "memory_mb": memory_mb[-1], "wall_s": wall_s(begun)}
            print(json.dumps(told), flush=True)
    await live.map.build()
    came, half = live.progress(), memory_mb[len(memory_mb) // 2 :]
    growth = float(np.polyfit(np.arange(len(half)), half, 1)[0]) if len(half) > 1 else math.nan
    first = watch.first_leg or (math.nan, math.nan)
    return {
        "state": str(live.header.state),
        "hours": round(hours_of(live), 1),
        "km": [round(member.flown.flown_m / 1000.0, 1) for member in live.team],
        "coverage_pct": round(came.coverage_pct, 1),
        "soundings": came.soundings,
        "first_leg_s": f"{first[0] - begun[0]:.2f} on the processor, {first[1] - begun[1]:.2f} by the clock",
        **watch.figures(),
        "memory_mb": memory_mb,
        "memory_growth_mb_per_hour": round(growth, 2),
        "handles": f"{min(handles)} to {max(handles)}",
        "times_real_time": round(hours_of(live) * HOUR_S / wall_s(begun)),
    }


def wall_s(begun: tuple[float, float]) -> float:
    """Return seconds by the clock since then."""
    return round(time.monotonic() - begun[1], 1)


def hours_of(live: LiveMission) -> float:
    """Return for how long a mission has been flown, hours of its vehicles."""
    return live.progress().elapsed_s * TIME_SCALE / HOUR_S


def main(arguments: Sequence[str] | None = None) -> None:
    """Fly and print."""
    parser = make_parser(__doc__, FLIGHT)
    parser.add_argument("--planner", default="cao")
    parser.add_argument("--vehicles", type=int, default=3)
    parser.add_argument("--side", type=float, default=3000.0, help="of the square, metres")
    parser.add_argument("--cell", type=float, default=25.0, help="of the map, metres")
    parser.add_argument("--leg", type=float, default=100.0, help="longest leg, metres")
    parser.add_argument("--hours", type=float, default=12.0)
    parser.add_argument("--family", default="rugged", help="of the generated floor")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    logs.configure("error", "json")
    watch = Stopwatch()
    watch.on(deciding, "decide", "decisions")
    watch.on(MapBuilder, "build", "maps")
    watch.on(MapBuilder, "learn", "learning")
    watch.on_first_leg()
    floor = generate(options.family, options.seed, width_m=options.side, height_m=options.side, cell_m=FLOOR_CELL_M)
    with tempfile.TemporaryDirectory(prefix="bathyfleet-large-site-") as folder:
        file = Path(folder) / "floor.npz"
        save_npz(floor, file)
        sea = SimulationSettings(terrain=file, seed=options.seed)
        found = served(sea, TIME_SCALE, lambda service: flown(service, options, watch))
    found["load_of_the_machine"] = round(os.getloadavg()[1], 1)
    print(json.dumps(found, indent=1))
    side = f"{options.side / 1000:g} x {options.side / 1000:g} km, {options.cell:g} m cells"
    title = f"{options.hours:g} hours over {side}: {options.planner}, {options.vehicles} vehicles"
    write_section(options.write, FLIGHT, title, found, seeds=[options.seed])


if __name__ == "__main__":
    main()
