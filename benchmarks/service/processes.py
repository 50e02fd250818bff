"""Several service processes on one database: ``python -m benchmarks.service.processes [--counts 1,2] [--kills 5]``.

A PostgreSQL server of its own, real services, simulated vehicles that live so fast that the missions are bounded by
processor time. Counted are the steps that all missions together commit in a while, for each number of processes; then
the owner of a mission is killed again and again, and timed until another process commits the mission's next step.
Printed is one JSON object.
"""

import argparse
import asyncio
import json
import statistics
import tempfile
import time
from contextlib import AsyncExitStack, ExitStack
from pathlib import Path
from typing import Any

import httpx

from benchmarks.common.report import LOAD, make_parser, write_section
from tests.support.faults.missions import mission_of
from tests.support.faults.service import Service, service_in
from tests.support.storage.databases import Databases, query

WARM_UP_S = 10.0
PATIENCE_S = 60.0

Running = tuple[Service, httpx.AsyncClient]


async def begin(api: httpx.AsyncClient, number: int) -> str:
    """Start a mission of two simulated vehicles; returns its id."""
    spec = mission_of([{"name": f"v{number}-{k}", "kind": "sim"} for k in range(2)], steps=100_000)
    created = (await api.post("/missions", json=spec)).raise_for_status().json()
    (await api.post(f"/missions/{created['id']}/start")).raise_for_status()
    return str(created["id"])


async def open_services(stack: AsyncExitStack, url: str, count: int, pace: float, folder: Path) -> list[Running]:
    """Services on one database."""
    running = []
    for number in range(count):
        (place := folder / f"{count}-{number}").mkdir()
        settings = {"TIME_SCALE": f"{pace:g}", "LOG_LEVEL": "warning"}
        running.append(await stack.enter_async_context(service_in(place, database_url=url, settings=settings)))
    return running


def steps(url: str) -> int:
    return int(query(url, "select count(*) from steps")[0][0])


async def carried(databases: Databases, count: int, options: argparse.Namespace, folder: Path) -> float:
    """Steps per second that so many processes make of the same missions."""
    url = databases.fresh()
    async with AsyncExitStack() as stack:
        services = await open_services(stack, url, count, options.pace, folder)
        for number in range(options.missions):
            await begin(services[number % count][1], number)
        await asyncio.sleep(WARM_UP_S)
        before, began_s = await asyncio.to_thread(steps, url), time.monotonic()
        await asyncio.sleep(options.seconds)
        return (await asyncio.to_thread(steps, url) - before) / (time.monotonic() - began_s)


async def takeovers(databases: Databases, options: argparse.Namespace, folder: Path) -> list[float]:
    """Seconds from the kill of a mission's owner until another process commits its next step."""
    url = databases.fresh()
    found = []
    async with AsyncExitStack() as stack:
        services = await open_services(stack, url, 2, 10.0, folder)
        mission = await begin(services[0][1], 0)
        for kill in range(options.kills):
            owner, other = services[kill % 2], services[1 - kill % 2]
            await until_more(url, mission, await asyncio.to_thread(count_of, url, mission) + 1, 0.1)
            before = await asyncio.to_thread(count_of, url, mission)
            await owner[0].kill()
            began_s = time.monotonic()
            await until_more(url, mission, before, 0.02)
            found.append(time.monotonic() - began_s)
            (await other[1].get(f"/missions/{mission}")).raise_for_status()
            await owner[0].start()
            await owner[0].await_ready(owner[1])
    return found


def count_of(url: str, mission: str) -> int:
    return int(query(url, "select count(*) from steps where mission_id = :id", id=mission)[0][0])


async def until_more(url: str, mission: str, count: int, pause_s: float) -> None:
    """Wait until more steps than ``count`` are committed."""
    async with asyncio.timeout(PATIENCE_S):
        while await asyncio.to_thread(count_of, url, mission) <= count:  # noqa: ASYNC110 - others commit them
            await asyncio.sleep(pause_s)


async def measure(options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """All of it."""
    with ExitStack() as stack:
        (kills := folder / "kills").mkdir()
        databases = Databases("postgresql", folder, stack)
        rates = {count: await carried(databases, count, options, folder) for count in options.counts}
        seconds = await takeovers(databases, options, kills)
    least = rates[options.counts[0]]
    return {
        "missions": options.missions,
        "steps_per_s": {f"{count} processes": round(rate, 2) for count, rate in rates.items()},
        "ratio": {f"{count} processes": round(rate / least, 2) for count, rate in rates.items()},
        "takeover_s": [round(s, 2) for s in seconds],
        "takeover_median_s": round(statistics.median(seconds), 2) if seconds else None,
        "takeover_longest_s": round(max(seconds), 2) if seconds else None,
    }


def main() -> None:
    """Run and print."""
    parser = make_parser(__doc__, LOAD)
    parser.add_argument("--counts", type=lambda text: [int(n) for n in text.split(",")], default=[1, 2])
    parser.add_argument("--missions", type=int, default=8)
    parser.add_argument("--seconds", type=float, default=60.0, help="for which steps are counted")
    parser.add_argument("--pace", type=float, default=60.0, help="how much faster than the wall clock vehicles live")
    parser.add_argument("--kills", type=int, default=5)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        result = asyncio.run(measure(options, Path(folder)))
    print(json.dumps(result))
    write_section(options.write, LOAD, "Several processes on one database", result)


if __name__ == "__main__":
    main()
