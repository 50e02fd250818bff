"""Where controllers are scored: on this machine's cores or on a Dask cluster, the same runs either way."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Protocol

from app.arrays import FloatArray
from app.evaluation.pcao.simulation.task import TrainingTask
from app.evaluation.runs.cluster import RunCluster

Cases = tuple[tuple[int, int], ...]


class Scorer(Protocol):
    """Scores controllers (SIZE,); the same scores on any machine."""

    def score(self, controllers: Sequence[FloatArray]) -> list[float]:
        """Return E(P) of each."""
        ...


class LocalScorer:
    """Threads on this machine: the simulation is compiled and holds no interpreter lock."""

    def __init__(self, task: TrainingTask, threads: int) -> None:
        self._task = task
        self._pool = ThreadPoolExecutor(threads)

    def score(self, controllers: Sequence[FloatArray]) -> list[float]:
        """Return E(P) of each; single runs are the pieces of work."""
        task = self._task
        pieces = [(parameters, (case,)) for parameters in controllers for case in task.cases]
        costs = [c for part in self._pool.map(lambda piece: task.costs(*piece), pieces) for c in part]
        return _scores(task, costs, len(controllers))


class DaskScorer:
    """Workers of a cluster. A worker that dies is made up for by the others: its runs are flown again."""

    def __init__(self, task: TrainingTask, cluster: RunCluster) -> None:
        self._task = task
        self._cluster = cluster
        self._shared = cluster.share(task)

    def score(self, controllers: Sequence[FloatArray]) -> list[float]:
        """Return E(P) of each; a worker gets several runs at a time, as asking costs milliseconds."""
        cases = self._task.cases
        runs = len(controllers) * len(cases)
        each = max(1, min(len(cases), runs // (2 * max(1, self._cluster.threads))))
        parts = [cases[k : k + each] for k in range(0, len(cases), each)]
        pieces = [(parameters, part) for parameters in controllers for part in parts]
        costs = [c for part in self._cluster.map(_costs, self._shared, pieces) for c in part]
        return _scores(self._task, costs, len(controllers))


def _costs(task: TrainingTask, piece: tuple[FloatArray, Cases]) -> list[float]:
    return task.costs(*piece)


def _scores(task: TrainingTask, costs: Sequence[float], controllers: int) -> list[float]:
    count = len(task.cases)
    return [task.score(costs[k * count : (k + 1) * count]) for k in range(controllers)]
