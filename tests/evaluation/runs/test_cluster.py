"""Training and evaluating on a real Dask cluster of worker processes, one of which is killed in the middle."""

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from distributed import LocalCluster

from app.evaluation.pcao.experiments import FlightJob
from app.evaluation.pcao.simulation.task import TrainingTask
from app.evaluation.pcao.simulation.world import SeaFloor
from app.evaluation.pcao.terrains import sea_floor
from app.evaluation.pcao.training.scoring import DaskScorer, LocalScorer
from app.evaluation.pcao.training.training import Checkpoint, make_optimiser, train
from app.evaluation.runs.cluster import ClusterError, RunCluster
from app.evaluation.runs.jobs import run_jobs
from app.exploration.pcao.model import default_model

TASK = TrainingTask((SeaFloor(sea_floor("ridge:3")),), (0, 1, 2, 3), robots=2, landmarks=60, steps=12)


@pytest.fixture(scope="module")
def workers() -> Iterator[Any]:
    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    ) as cluster:
        yield cluster


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # a dying worker leaves sockets behind
def test_a_worker_killed_in_training_costs_nothing(workers: Any, tmp_path: Path) -> None:
    cluster = RunCluster(workers.scheduler_address)
    killed: list[Any] = []

    def kill_one(curve: Any) -> None:
        if len(curve.scores) >= 2 and not killed:
            killed.append(workers.workers[0].process.pid)
            os.kill(killed[0], signal.SIGKILL)

    optimiser, reference = make_optimiser("pcao", 1), make_optimiser("pcao", 1)
    try:
        curve = train(optimiser, DaskScorer(TASK, cluster), Checkpoint(tmp_path / "dask", {}), 5, kill_one)
    finally:
        cluster.close()
    assert killed
    alone = train(reference, LocalScorer(TASK, 1), Checkpoint(tmp_path / "here", {}), 5)
    assert curve.scores == alone.scores
    np.testing.assert_array_equal(optimiser.best, reference.best)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_evaluations_on_a_cluster_are_those_made_here(workers: Any) -> None:
    jobs = [
        FlightJob(sea_floor("ridge:3"), "pcao", seed, default_model().parameters, 2, 60, 12) for seed in (100, 101, 102)
    ]
    there = list(run_jobs(jobs, 1, scheduler=workers.scheduler_address))
    here = list(run_jobs(jobs, 1))
    assert [run["history"] for run in there] == [run["history"] for run in here]
    assert [run["seed"] for run in there] == [100, 101, 102]


def test_a_scheduler_that_is_not_there_is_named(unused_tcp_port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.evaluation.runs.cluster.CONNECT_S", 0.3)
    with pytest.raises(ClusterError, match=rf"no Dask cluster answers at 'tcp://127.0.0.1:{unused_tcp_port}'"):
        RunCluster(f"tcp://127.0.0.1:{unused_tcp_port}")
