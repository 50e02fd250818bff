"""Many runs, one after the other, in several processes or on a cluster, with the same results in the same order."""

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import Any, Protocol

from app.estimation import Sensor
from app.evaluation.runs.cluster import RunCluster
from app.exploration.planners import warm_up

Progress = Callable[[int], None]


class Job(Protocol):
    """One run; must be picklable when several processes are used."""

    @property
    def title(self) -> str:
        """What it is, for the progress bar."""
        ...

    @property
    def steps(self) -> int:
        """Its length."""
        ...

    @property
    def sensor(self) -> Sensor | None:
        """What its vehicles measure with, for which planners are warmed up; None where no planner flies."""
        ...

    def run(self, progress: Progress) -> dict[str, Any]:
        """Run it, reporting every step, and return the object of the command's JSON."""
        ...


def run_jobs(
    jobs: Sequence[Job],
    processes: int,
    progress: Callable[[Job, int], None] = lambda job, step: None,
    scheduler: str | None = None,
) -> Iterator[dict[str, Any]]:
    """Yield the result of every job, in the order of ``jobs``.

    With one process ``progress`` is called for every step of the job that runs; with several, each job once it is done.
    Processes are spawned, so nothing depends on what this one has loaded. With the address of a Dask ``scheduler`` the
    cluster's workers do the jobs; raises ClusterError when there is none.
    """
    if scheduler is not None:
        cluster = RunCluster(scheduler)
        try:
            for job, result in zip(jobs, cluster.imap(_run, jobs), strict=True):
                progress(job, job.steps)
                yield result
        finally:
            cluster.close()
        return
    sensors = tuple(dict.fromkeys(job.sensor for job in jobs if job.sensor is not None))
    warm_up(*sensors)  # the spawned processes then find everything compiled
    if processes == 1 or len(jobs) < 2:
        for job in jobs:
            yield job.run(lambda step, job=job: progress(job, step))  # type: ignore[misc]
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(processes, len(jobs)), context, warm_up, sensors) as pool:
        for job, result in zip(jobs, pool.map(_run, jobs), strict=True):
            progress(job, job.steps)
            yield result


def _run(job: Job) -> dict[str, Any]:
    return job.run(lambda step: None)
