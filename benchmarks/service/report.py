"""How long a survey's report takes: ``python -m benchmarks.service.report [--side 1000 --cell 1]``.

A square that a swath sonar swept in lines from south to north, with a crossline and gaps: its pings are taken in as
from a link, the map is made, then the report as PDF and as a web page in each language. Told are the seconds of each,
where the first one finds crossings too, its size, the seconds for what REST answers and for checksums of files again
(``answers_s``) and for ``map.tif``, the processor's time, also of other processes, and the longest time between a look
at the event loop and the next. ``--keep FOLDER`` leaves the reports there.
"""

import argparse
import asyncio
import resource
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from app.mapping.coordinates.georeference import LocalFrame
from app.missions.fleet.interface import PingReport, Position
from app.missions.operations.maps.mission_maps import export
from app.missions.operations.reports import ReportOptions
from app.missions.report.kinds import REPORTS
from app.missions.report.texts import Language
from app.missions.spec.mission import MissionSpec
from benchmarks.common.report import LOAD, make_parser, write_section
from benchmarks.imc.mission import ORIGIN
from benchmarks.service.in_process import missions_in
from benchmarks.service.pings import LoopWatch

START_S = 1_795_000_000.0
LINE_M, PING_M, SONAR_M, HALF_SWATH_DEG, BEAMS = 75.0, 0.9, 2.0, 62.0, 256
GAP_M, GAP_EVERY_M = 6.0, 170.0
"""Pings are missing here and there, so that there are holidays."""


def bottom_m(east: float, north: float) -> float:
    return float(26.0 + 4.0 * np.sin(east / 90.0) * np.cos(north / 130.0) + 1.5 * np.sin(north / 25.0))


def mission(options: argparse.Namespace) -> MissionSpec:
    frame, side = LocalFrame(*ORIGIN), options.side
    corners = [(0.0, 0.0), (side, 0.0), (side, side), (0.0, side), (0.0, 0.0)]
    ring = [[float(x) for x in reversed(frame.to_geographic(e, n))] for e, n in corners]
    return MissionSpec.model_validate(
        {
            "name": f"Report of {side:g} m",
            "area": {"type": "Polygon", "coordinates": [ring]},
            "vehicles": [{"name": "boat", "kind": "rest", "sensor": "multibeam"}],
            "steps": 10,
            "cell_m": options.cell,
            "tide": {"level_m": 1.2, "sd_m": 0.05, "source": "gauge", "datum_epsg": 5861},
        }
    )


def pings(side: float) -> list[PingReport]:
    """Lines to the north and back, then one across."""
    frame, rng = LocalFrame(*ORIGIN), np.random.default_rng(1)
    angles = np.radians(np.linspace(-HALF_SWATH_DEG, HALF_SWATH_DEG, BEAMS)).astype(np.float32)
    along = np.arange(0.0, side, PING_M)
    ways = []
    for number, east in enumerate(np.arange(0.5 * LINE_M, side, LINE_M)):
        norths = along[(along + 61.0 * number) % GAP_EVERY_M > GAP_M]
        ways.append(np.column_stack([np.full(len(norths), east), norths])[:: 1 if number % 2 == 0 else -1])
    ways.append(np.column_stack([along, np.full(len(along), 0.5 * side)]))
    found, seconds = [], START_S
    for way in ways:
        heading = float(np.arctan2(*(way[1] - way[0])))
        seconds += 120.0
        for east, north in way.tolist():
            seconds += 0.5
            ranges = (bottom_m(east, north) - SONAR_M) / np.cos(angles) * (1.0 + 0.002 * rng.standard_normal(BEAMS))
            lat, lon = frame.to_geographic(east, north)
            found.append(
                PingReport(
                    vehicle="boat",
                    time_s=seconds,
                    position=Position(float(lat), float(lon), SONAR_M),
                    roll_rad=0.0,
                    pitch_rad=0.0,
                    heading_rad=heading,
                    angles_rad=angles,
                    ranges_m=ranges.astype(np.float32),
                    source="sonar",
                    position_sd_m=1.0,
                )
            )
    return found


async def measure(options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    async with missions_in(folder) as service:
        live = await service.get((await service.create(mission(options))).id)
        taken = pings(options.side)
        for number, ping in enumerate(taken):
            live.receive(ping)
            if number % 50 == 49:
                await live.journal.flush()
        await live.journal.flush()
        await live.map.build()
        progress = live.progress()
        used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        processor_s = sum(one.ru_utime + one.ru_stime for one in used)
        watch = LoopWatch()
        found: dict[str, Any] = {
            "pings": progress.pings,
            "beams": progress.beams,
            "ensonified_pct": round(progress.ensonified_pct or 0.0, 1),
            "holidays": progress.holidays,
        }
        for name, kind in REPORTS.items():
            for language in Language:
                begun = time.perf_counter()
                product = await service.reports.report(live, ReportOptions(kind, language))
                found[f"{name}_{language}_s"] = round(time.perf_counter() - begun, 2)
                found[f"{name}_{language}_bytes"] = product.content.size_bytes
                if options.keep is not None:
                    (options.keep / f"report-{language}.{name}").write_bytes(product.content.whole())
        begun = time.perf_counter()
        product = await export(live, service.maps, service.settings.provider, service.compute, "tif")
        found["map_tif_s"] = round(time.perf_counter() - begun, 2)
        found["map_tif_bytes"] = product.content.size_bytes
        begun = time.perf_counter()
        await service.reports.answers(live)
        found["answers_s"] = round(time.perf_counter() - begun, 2)
        watch.stop()
        found["loop_held_ms"] = round(1000 * watch.longest_s, 1)
        used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        found["processor_s"] = round(sum(one.ru_utime + one.ru_stime for one in used) - processor_s, 1)
        found["memory_mib"] = round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0)
        return found


def main() -> None:
    parser = make_parser(__doc__, LOAD)
    parser.add_argument("--side", type=float, default=1000.0, help="of the square, metres")
    parser.add_argument("--cell", type=float, default=1.0, help="of the map, metres")
    parser.add_argument("--keep", type=Path, help="folder for the reports")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        figures = asyncio.run(measure(options, Path(name)))
    print(figures)
    title = f"Reports of {options.side:g} m at {options.cell:g} m"
    write_section(options.write, LOAD, title, figures, hidden={options.keep: "FOLDER"})


if __name__ == "__main__":
    main()
