"""Speed-up of training on a local Dask cluster: the same controllers scored by 1 and by N worker processes.

    python benchmarks/pcao_cluster.py [N]

Rounds of both alternate, and the best of each counts. The wall clock says something only when the cores are idle. By
processor time: what the one worker spends over what the busiest of N spends, with the scheduler and this process beside
it shared out among N cores; waiting does not count.
"""

import os
import sys
import time

import psutil
from distributed import Client, LocalCluster

from app.evaluation.pcao.scoring import DaskScorer
from app.evaluation.pcao.task import TrainingTask
from app.evaluation.pcao.terrains import sea_floor
from app.evaluation.pcao.training import make_optimiser
from app.evaluation.pcao.world import SeaFloor
from app.evaluation.runs.cluster import Cluster

ROUNDS = 2
CONTROLLERS = 8


def processor_s(pids: list[int]) -> list[float]:
    return [sum(psutil.Process(pid).cpu_times()[:2]) for pid in pids]


def main() -> None:
    workers = int(sys.argv[1]) if len(sys.argv) > 1 else 2
    task = TrainingTask((SeaFloor(sea_floor("harbour:1")), SeaFloor(sea_floor("rugged:1"))), (0, 1, 2, 3))
    generation = make_optimiser("cma", 0).ask()[:CONTROLLERS]
    wall: dict[int, float] = {}
    processor: dict[int, float] = {}
    for count in (1, workers):
        with LocalCluster(n_workers=count, threads_per_worker=1, dashboard_address=None) as local:
            cluster = Cluster(local.scheduler_address)
            with Client(local.scheduler_address, set_as_default=False) as client:
                pids = list(client.run(os.getpid).values())
            scorer = DaskScorer(task, cluster)
            scorer.score(generation)  # compiled machine code and sea floors reach every worker
            for _ in range(ROUNDS):
                before, began, own = processor_s(pids), time.perf_counter(), time.process_time()
                scorer.score(generation)
                wall[count] = min(wall.get(count, 1e9), time.perf_counter() - began)
                spent = [b - a for a, b in zip(before, processor_s(pids), strict=True)]
                # The scheduler lives in this process.
                taken = max(spent) + (time.process_time() - own) / count
                processor[count] = min(processor.get(count, 1e9), taken)
            cluster.close()
    for count in wall:
        print(
            f"{count} workers: {wall[count]:.2f} s by the clock, {processor[count]:.2f} s by processor time, for "
            f"{len(generation)} controllers, {len(task.cases)} missions each"
        )
    print(f"speed-up: {wall[1] / wall[workers]:.2f} by the clock, {processor[1] / processor[workers]:.2f} by processor")


if __name__ == "__main__":
    main()
