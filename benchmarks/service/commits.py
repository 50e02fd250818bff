"""How many writes missions get from one database: ``python -m benchmarks.service.commits [--missions 8 --seconds 10]``.

Missions of five vehicles each, which tell five soundings a second, write as they do at sea: what came in 0.1 s is
judged, then committed in one transaction. Here no time is waited in between: told is how many transactions and
soundings a second all missions of one process get, and what each costs that process's processor, with SQLite in a file
and with a PostgreSQL server on the same machine, where one is installed.
"""

import argparse
import asyncio
import os
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from app.missions.fleet.interface import Position, SoundingReport, VehicleReport
from app.missions.live.mission import LiveMission
from app.missions.service import MissionService
from app.missions.settings import ImcSettings, ServiceSettings
from app.storage.database import Database
from app.storage.upkeep.prepare import prepare_database
from benchmarks.common.report import LOAD, make_parser, write_section
from tests.support.missions.specs import FRAME, make_spec
from tests.support.storage.databases import KINDS, Databases
from tests.support.waiting import until

VEHICLES = 5
SOUNDINGS, POSITIONS = 3, 1
"""In 0.1 s of a mission, rounded up."""
START_S, SIDE_M = 1_795_225_140.0, 100.0


def note(live: LiveMission, number: int) -> None:
    """Tell a mission what its vehicles have measured in 0.1 s."""
    for k in range(SOUNDINGS):
        count = number * SOUNDINGS + k
        vehicle, time_s = f"v{count % VEHICLES}", START_S + 0.2 * (count // VEHICLES)
        north = 0.2 * (count // VEHICLES) % (2 * SIDE_M)
        lat, lon = FRAME.to_geographic(10.0 + 5.0 * (count % VEHICLES), min(north, 2 * SIDE_M - north))
        place = Position(float(lat), float(lon), 12.0)
        live.journal.sounding(SoundingReport(vehicle, time_s, place, 2.0, 10.0, "dvl", depth_sd_m=0.1))
        if k < POSITIONS:
            live.journal.position(VehicleReport(vehicle, time_s, Position(float(lat), float(lon), 2.0)))


async def write(live: LiveMission, until_s: float) -> int:
    """Write until the time is over; return how many transactions that were."""
    begun = number = live.journal.counts.accepted // SOUNDINGS
    while time.perf_counter() < until_s:
        note(live, number)
        await live.journal.flush()
        number += 1
    return number - begun


async def measure(url: str, missions: int, seconds: float) -> dict[str, Any]:
    await prepare_database(url, may_upgrade=True)
    database = Database(url)
    service = MissionService(ServiceSettings(database_url=url, imc=ImcSettings(enabled=False)), database)
    await service.startup()
    try:
        vehicles = [{"name": f"v{k}", "kind": "rest"} for k in range(VEHICLES)]
        created = [
            await service.create(make_spec(side_m=SIDE_M, vehicles=vehicles, name=f"{n}")) for n in range(missions)
        ]
        lives = [await service.get(one.id) for one in created]
        await until(lambda: not service.compiling, "all is compiled")
        await asyncio.gather(*(write(live, time.perf_counter() + 1.0) for live in lives))  # what the first ones load
        before = sum(live.journal.counts.accepted for live in lives)
        begun, processor_s = time.perf_counter(), time.process_time()
        written = sum(await asyncio.gather(*(write(live, begun + seconds) for live in lives)))
        took_s, processor_s = time.perf_counter() - begun, time.process_time() - processor_s
        soundings = sum(live.journal.counts.accepted for live in lives) - before
        return {
            "transactions_per_s": round(written / took_s),
            "soundings_per_s": round(soundings / took_s),
            "service_cores": round(processor_s / took_s, 2),
            "ms_cpu_each": round(1000.0 * processor_s / written, 2),
            "rejected": sum(live.journal.counts.rejected for live in lives),
        }
    finally:
        await service.shutdown()
        await database.close()


def main() -> None:
    parser = make_parser(__doc__, LOAD)
    parser.add_argument("--missions", type=int, default=8, help="that write at the same time")
    parser.add_argument("--seconds", type=float, default=10.0, help="for each database")
    options: argparse.Namespace = parser.parse_args()
    figures: dict[str, Any] = {"missions": options.missions, "vehicles_each": VEHICLES}
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        databases = Databases("sqlite", Path(name), stack)
        for kind in KINDS:
            try:
                url = databases.empty(kind)
            except pytest.skip.Exception as missing:
                figures[kind] = str(missing)
                continue
            figures[kind] = asyncio.run(measure(url, options.missions, options.seconds))
    figures["needed_by_1000_vehicles_in_200_missions_per_s"] = 200 * 10
    print(figures, os.getloadavg())
    write_section(options.write, LOAD, "Writes of many missions to one database", figures)


if __name__ == "__main__":
    main()
