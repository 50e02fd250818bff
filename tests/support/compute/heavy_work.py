"""Work for clusters in tests: functions that workers find by their names."""

import os
import signal
import sys
from pathlib import Path

import numpy as np

from app.missions.errors import InvalidRequestError


def is_worker() -> bool:
    """Whether this process is a worker of the cluster."""
    return "distributed.worker" in sys.modules and "pytest" not in sys.modules


def process() -> int:
    return os.getpid()


def doubled(table: np.ndarray) -> tuple[np.ndarray, bool]:
    """Twice a table, and whether it could be written to."""
    writable = table.flags.writeable
    table *= 2.0
    return table, bool(writable)


def refuse() -> None:
    raise InvalidRequestError("format", "it cannot be", "ask for another")


def begin_and_hang_first(folder: Path) -> int:
    """Leave a file with this process's number; whoever is the first goes no further."""
    (folder / str(os.getpid())).touch()
    if len(list(folder.iterdir())) == 1:
        signal.pause()
    return os.getpid()


def hang_workers(folder: Path) -> int:
    """Go no further in a worker, which leaves a file."""
    if is_worker():
        (folder / str(os.getpid())).touch()
        while True:
            signal.pause()
    return os.getpid()


def kill_workers() -> int:
    """End the worker that does it, as one ends that has no memory left."""
    if is_worker():
        os.kill(os.getpid(), signal.SIGKILL)
    return os.getpid()
