"""A Dask cluster of real processes: a scheduler and workers that can be killed, and started again on the same port.

A piece of work that two workers died of is taken to be the reason.
"""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from tests.support.paths import PROJECT
from tests.support.ports import free_ports

QUIET = {
    "DASK_DISTRIBUTED__LOGGING__DISTRIBUTED": "critical",
    "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1",
    "DASK_DISTRIBUTED__ADMIN__TICK__INTERVAL": "1s",
    "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False",
    "DASK_DISTRIBUTED__ADMIN__LARGE_GRAPH_WARNING_THRESHOLD": "1TiB",
}


class DaskCluster:
    """A scheduler at ``address`` and its workers, as ``dask scheduler`` and ``dask worker`` start them.

    ``options``: of both commands; ``environment``: of the workers.
    """

    def __init__(self, folder: Path, scheme: str = "tcp", options: Sequence[str] = ()) -> None:
        (self.port,) = free_ports(1)
        self.address = f"{scheme}://127.0.0.1:{self.port}"
        self._folder, self._options = folder, options
        self.scheduler: subprocess.Popen[bytes] | None = None
        self.workers: list[subprocess.Popen[bytes]] = []

    def start_scheduler(self) -> None:
        """Start it; who asks before it listens is refused."""
        self.scheduler = self._start("scheduler", f"--host={self.address}", "--no-dashboard", "--no-show")

    def start_worker(self, *options: str, **environment: str) -> subprocess.Popen[bytes]:
        """Start one with one thread; it looks for the scheduler until that is there."""
        usual = "--nthreads=1", "--no-nanny", "--no-dashboard", "--death-timeout=240"
        worker = self._start("worker", self.address, *usual, *options, **environment)
        self.workers.append(worker)
        return worker

    def _start(self, command: str, *arguments: str, **environment: str) -> subprocess.Popen[bytes]:
        program = [sys.executable, "-W", "ignore", "-m", "dask", command, *arguments, *self._options]
        own = {"PYTHONPATH": str(PROJECT), "DASK_TEMPORARY_DIRECTORY": str(self._folder)}
        return subprocess.Popen(
            program,
            env=os.environ | QUIET | own | environment,
            cwd=self._folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    def kill_workers(self) -> None:
        """End all at once."""
        for worker in self.workers:
            worker.kill()
            worker.wait()
        self.workers.clear()

    def kill_scheduler(self) -> None:
        """End it at once; its workers end by themselves or are killed later."""
        assert self.scheduler is not None
        self.scheduler.kill()
        self.scheduler.wait()
        self.scheduler = None

    def close(self) -> None:
        """End all, hung ones too."""
        for process in [*self.workers, *filter(None, [self.scheduler])]:
            if process.poll() is None:
                process.send_signal(signal.SIGKILL)
            process.wait()
        self.workers.clear()


@contextmanager
def dask_cluster(folder: Path, workers: int, scheme: str = "tcp", options: Sequence[str] = ()) -> Iterator[DaskCluster]:
    """Have a cluster until the end of the block."""
    cluster = DaskCluster(folder, scheme, options)
    try:
        cluster.start_scheduler()
        for _ in range(workers):
            cluster.start_worker()
        yield cluster
    finally:
        cluster.close()
