"""Speed-up of training on a local Dask cluster: the same controllers scored by 1 and by N worker processes.

    python -m benchmarks.planning.pcao_cluster [--workers 2] [--write]

Rounds of both alternate, and the best of each counts. The wall clock says something only when the cores are idle. By
processor time: what the one worker spends over what the busiest of N spends, with the scheduler and this process beside
it shared out among N cores; waiting does not count.
"""

import json
import os
import time

import psutil
from distributed import Client, LocalCluster

from app.evaluation.pcao.simulation.task import TrainingTask
from app.evaluation.pcao.simulation.world import SeaFloor
from app.evaluation.pcao.terrains import sea_floor
from app.evaluation.pcao.training.scoring import DaskScorer
from app.evaluation.pcao.training.training import make_optimiser
from app.evaluation.runs.cluster import RunCluster
from benchmarks.common.report import PLANNING, make_parser, write_section

ROUNDS = 2
CONTROLLERS = 8


def processor_s(pids: list[int]) -> list[float]:
    return [sum(psutil.Process(pid).cpu_times()[:2]) for pid in pids]


def main() -> None:
    parser = make_parser(__doc__, PLANNING, seeds=[0])
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    figures = {}
    for seed in options.seeds:
        figures[f"seed {seed}"] = measure(options.workers, seed)
        print(json.dumps({"seed": seed} | figures[f"seed {seed}"]), flush=True)
    title = f"Training by {options.workers} worker processes"
    write_section(options.write, PLANNING, title, figures, seeds=options.seeds)


def measure(workers: int, seed: int) -> dict[str, float]:
    """Seconds of one generation by one worker and by all, by the clock and by the processor."""
    task = TrainingTask((SeaFloor(sea_floor("harbour:1")), SeaFloor(sea_floor("rugged:1"))), (0, 1, 2, 3))
    generation = make_optimiser("cma", seed).ask()[:CONTROLLERS]
    wall: dict[int, float] = {}
    processor: dict[int, float] = {}
    for count in (1, workers):
        with LocalCluster(n_workers=count, threads_per_worker=1, dashboard_address=None) as local:
            cluster = RunCluster(local.scheduler_address)
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
    return {
        "one_s": round(wall[1], 2),
        "all_s": round(wall[workers], 2),
        "one_processor_s": round(processor[1], 2),
        "all_processor_s": round(processor[workers], 2),
        "speed_up": round(wall[1] / wall[workers], 2),
        "speed_up_by_processor": round(processor[1] / processor[workers], 2),
    }


if __name__ == "__main__":
    main()
