"""What a Dask cluster of two workers carries: ``python -m benchmarks.service.cluster [--maps 4 --soundings 200000]``.

The same heavy work twice: thorough maps of many soundings, and forecasts over all floors each, as the service gives
them away. First this process does it, on one core; then two workers, each on one core of its own, behind a scheduler.
Results have to be the same. Told are seconds by the clock, and seconds of the processor of each process: on a machine
where other programs run, and where scheduler, service and workers share two cores, the clock says little. A worker
takes ``idle_share`` of a core for being there, for as long as it lasts by the clock; the time that it would need on a
core of its own is what it spent without that, made longer by that share. ``ratio`` is this process's time over the
busiest worker's. ``ratio_as_spent`` leaves the idle seconds in, ``ratio_by_the_clock`` is what came of it
here. Beside that stands what giving it away costs the service and the scheduler.
"""

import argparse
import asyncio
import os
import tempfile
import time
from collections.abc import Awaitable, Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ParamSpec

import numpy as np
import psutil

from app.arrays import FloatArray
from app.compute.compute import Compute
from app.compute.settings import ComputeSettings
from app.missions.fleet.interface import LinkCapabilities
from app.missions.forecast.request import starts_of
from app.missions.forecast.simulate import floors_under, fly_over
from app.missions.forecast.swarm import FlightOutcome, SoFar
from app.missions.maps.builder import MapBuilder
from app.missions.operations.work_processes import WorkProcesses
from app.missions.spec.mission import MissionSpec
from app.missions.team import Team
from benchmarks.common.report import LOAD, make_parser, write_section
from tests.support.compute.cluster import DaskCluster, dask_cluster
from tests.support.missions.harbour import sim_spec
from tests.support.waiting import until

P = ParamSpec("P")

WORKERS = 2
IDLE_S = 15.0

NO_END_S = 600.0
"""Of forecasts: all steps are flown."""


@dataclass(frozen=True)
class Spent:
    """Seconds that something took: by the clock, and of each process's processor."""

    clock_s: float
    service_s: float
    scheduler_s: float = 0.0
    workers_s: Sequence[float] = ()


def soundings(count: int, seed: int, side_m: float) -> FloatArray:
    rng = np.random.default_rng(seed)
    east, north = rng.uniform(0.0, side_m, (2, count))
    depth = 20.0 + 4.0 * np.sin(east / 60.0) * np.cos(north / 90.0) + np.sin(east / 17.0)
    return np.column_stack([east, north, depth + 0.05 * rng.standard_normal(count), np.full(count, 0.05)])


def thorough_map(rows: FloatArray, side_m: float, compute: Compute | None) -> str:
    """Make a mission's map, as when it has ended; return what tells it from others."""
    area = np.array([[0.0, 0.0], [side_m, 0.0], [side_m, side_m], [0.0, side_m]])
    builder = MapBuilder(area, 2.0, 0.25)
    if compute is not None:
        builder.elsewhere = compute.in_thread
    builder.add(rows)
    built = builder.build(thorough=True)
    return "" if built is None else built.digest


async def maps(tables: Sequence[FloatArray], side_m: float, compute: Compute | None) -> list[str]:
    loop = asyncio.get_running_loop()
    with ThreadPoolExecutor(len(tables) if compute is not None else 1) as pool:
        made = [loop.run_in_executor(pool, thorough_map, rows, side_m, compute) for rows in tables]
        return list(await asyncio.gather(*made))


async def forecasts(specs: Sequence[MissionSpec], compute: Compute | None) -> list[FlightOutcome]:
    team = Team(lambda _kind: LinkCapabilities())
    flights: list[Awaitable[FlightOutcome]] = []
    for spec in specs:
        members = [team.join(vehicle, slot) for slot, vehicle in enumerate(spec.vehicles)]
        starts, _ = starts_of(spec, members)
        for floor in floors_under(spec, members, SoFar()):
            run = compute.run if compute is not None else _here
            flights.append(run(fly_over, floor, spec, members, starts, SoFar(), NO_END_S))
    return list(await asyncio.gather(*flights))


async def _here(work: Callable[P, FlightOutcome], *arguments: P.args, **named: P.kwargs) -> FlightOutcome:
    return work(*arguments, **named)


@contextmanager
def on_one_core() -> Iterator[None]:
    """Keep all threads of this process on one core until the end of the block, as each worker is."""
    cores = os.sched_getaffinity(0)
    threads = [thread.id for thread in psutil.Process().threads()]
    for thread in threads:
        os.sched_setaffinity(thread, {min(cores)})
    try:
        yield
    finally:
        for thread in psutil.Process().threads():
            os.sched_setaffinity(thread.id, cores)


def _processor_s(process: psutil.Process) -> float:
    times = process.cpu_times()
    return float(times.user + times.system)


async def timed(work: Callable[[], Awaitable[Any]], dask: DaskCluster | None = None) -> tuple[Any, Spent]:
    """Return what came of work and what it took."""
    others = [] if dask is None else [one.pid for one in (dask.scheduler, *dask.workers) if one is not None]
    processes = [psutil.Process(), *map(psutil.Process, others)]
    before, begun = [_processor_s(process) for process in processes], time.perf_counter()
    made = await work()
    clock_s = time.perf_counter() - begun
    service, *rest = [_processor_s(process) - was for process, was in zip(processes, before, strict=True)]
    return made, Spent(clock_s, service, sum(rest[:1]), rest[1:])


async def idle_share(dask: DaskCluster) -> float:
    """Return how much of a core a worker takes that has nothing to do."""
    workers = [psutil.Process(worker.pid) for worker in dask.workers]
    before, begun = sum(map(_processor_s, workers)), time.perf_counter()
    await asyncio.sleep(IDLE_S)
    return (sum(map(_processor_s, workers)) - before) / (time.perf_counter() - begun) / len(workers)


def told(alone: Spent, shared: Spent, idle: float) -> dict[str, Any]:
    own_s = max((spent - idle * shared.clock_s) / (1.0 - idle) for spent in shared.workers_s)
    return {
        "alone_clock_s": round(alone.clock_s, 1),
        "alone_processor_s": round(alone.service_s, 1),
        "shared_clock_s": round(shared.clock_s, 1),
        "workers_processor_s": [round(one, 1) for one in shared.workers_s],
        "service_processor_s": round(shared.service_s, 2),
        "scheduler_processor_s": round(shared.scheduler_s, 2),
        "ratio": round(alone.service_s / own_s, 2),
        "ratio_as_spent": round(alone.service_s / max(shared.workers_s), 2),
        "ratio_by_the_clock": round(alone.clock_s / shared.clock_s, 2),
    }


async def measure(options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    tables = [soundings(options.soundings, seed, options.side) for seed in range(options.maps)]
    small = [soundings(20_000, seed, options.side) for seed in range(2 * WORKERS)]
    specs = [sim_spec(seed=seed, steps=options.steps) for seed in range(options.forecasts)]
    brief = [sim_spec(seed=seed, steps=4) for seed in range(WORKERS)]
    work: dict[str, Callable[[Compute | None], Awaitable[Any]]] = {
        "maps": partial(maps, tables, options.side),
        "forecasts": partial(forecasts, specs),
    }
    cores = sorted(os.sched_getaffinity(0))
    with dask_cluster(folder, 0) as dask:
        for number in range(WORKERS):
            worker = dask.start_worker("--preload=app.compute.preload")
            # Before it has threads, which are on the same core then.
            os.sched_setaffinity(worker.pid, {cores[number % len(cores)]})
        processes = WorkProcesses()
        compute = Compute(ComputeSettings(scheduler=dask.address), processes)
        compute.start()
        await until(lambda: compute.workers == WORKERS, "all workers are there")
        for one in (compute, None):  # what is only made ready by doing it
            await maps(small, options.side, one)
            await forecasts(brief, one)
        idle = await idle_share(dask)
        figures: dict[str, Any] = {"idle_share": round(idle, 4), "cores": len(cores), "workers": WORKERS}
        for name, do in work.items():
            there, shared = await timed(partial(do, compute), dask)
            with on_one_core():
                here, alone = await timed(partial(do, None))
            figures[name] = told(alone, shared, idle) | {"same": there == here}
        await compute.close()
        await processes.close()
    return figures


def main() -> None:
    parser = make_parser(__doc__, LOAD)
    parser.add_argument("--maps", type=int, default=4, help="how many")
    parser.add_argument("--soundings", type=int, default=200_000, help="of each map")
    parser.add_argument("--side", type=float, default=1000.0, help="of each map's area, metres")
    parser.add_argument("--forecasts", type=int, default=2, help="how many, over all floors each")
    parser.add_argument("--steps", type=int, default=40, help="of each mission that is forecast")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        figures = asyncio.run(measure(options, Path(name)))
    print(figures)
    write_section(options.write, LOAD, "Maps and forecasts by a cluster of two workers", figures)


if __name__ == "__main__":
    main()
