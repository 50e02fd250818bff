"""Speed-up of training on a local Dask cluster: the same controllers scored by 1 and by N worker processes.

    python benchmarks/pcao_cluster.py [N]

The cores have to be idle. Rounds of both alternate, and the best of each counts.
"""

import sys
import time

from distributed import LocalCluster

from app.evaluation.cluster import Cluster
from app.evaluation.pcao.scoring import DaskScorer
from app.evaluation.pcao.task import TrainingTask
from app.evaluation.pcao.terrains import sea_floor
from app.evaluation.pcao.training import make_optimiser
from app.evaluation.pcao.world import SeaFloor

ROUNDS = 3


def main() -> None:
    workers = int(sys.argv[1]) if len(sys.argv) > 1 else 2
    task = TrainingTask((SeaFloor(sea_floor("harbour:1")), SeaFloor(sea_floor("rugged:1"))), (0, 1, 2, 3))
    generation = make_optimiser("cma", 0).ask()
    best: dict[int, float] = {}
    with (
        LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as one,
        LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as many,
    ):
        scorers = {1: Cluster(one.scheduler_address), workers: Cluster(many.scheduler_address)}
        ready = {count: DaskScorer(task, cluster) for count, cluster in scorers.items()}
        for scorer in ready.values():
            scorer.score(generation)  # compiled machine code and sea floors reach every worker
        for _ in range(ROUNDS):
            for count, scorer in ready.items():
                began = time.perf_counter()
                scorer.score(generation)
                taken = time.perf_counter() - began
                best[count] = min(best.get(count, taken), taken)
        for cluster in scorers.values():
            cluster.close()
    for count, taken in best.items():
        print(f"{count} workers: {taken:.2f} s for {len(generation)} controllers, {len(task.cases)} missions each")
    print(f"speed-up: {best[1] / best[workers]:.2f}")


if __name__ == "__main__":
    main()
