"""A disk for the database that can be filled and freed again."""

import os
import resource
import sqlite3
import subprocess
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from tests.support.faults.service import Service

SIZE_MB = 24
BLOCK = bytes(1 << 16)


class Disk:
    """A folder on a small disk of its own.

    Attributes
    ----------
    kind
        How it is made small.
    """

    kind = "a tmpfs that another file fills"

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._filler = folder / "filler"

    def fill(self, _service: Service) -> None:
        """Leave not a byte on it, and none in the log of the database that could be written over."""
        with self._empty_log(), self._filler.open("wb", buffering=0) as file:
            size = len(BLOCK)
            while size:
                try:
                    file.write(BLOCK[:size])
                except OSError:
                    size //= 2

    def free(self, _service: Service) -> None:
        """Give it room again."""
        self._filler.unlink()

    @contextmanager
    def _empty_log(self) -> Iterator[None]:
        """Empty the log of the database and keep it empty: nobody else writes meanwhile."""
        [database] = self.folder.glob("*.db")
        log = database.with_name(f"{database.name}-wal")
        with closing(sqlite3.connect(database, timeout=10.0, isolation_level=None)) as connection:
            while True:
                connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
                connection.execute("BEGIN IMMEDIATE")
                if log.stat().st_size == 0:
                    break
                connection.execute("ROLLBACK")
            yield
            connection.execute("ROLLBACK")


class Ration(Disk):
    """For machines where nothing may be mounted: no file of the service may grow any more."""

    kind = "a limit on the size of the service's files"

    def fill(self, service: Service) -> None:
        """Let no file grow beyond its present size."""
        with self._empty_log():
            largest = max(path.stat().st_size for path in self.folder.iterdir())
            self._limit(service, min(largest, 1 << 14))

    def free(self, service: Service) -> None:
        """Let files grow."""
        self._limit(service, resource.RLIM_INFINITY)

    def _limit(self, service: Service, size: int) -> None:
        assert service.process is not None
        resource.prlimit(service.process.pid, resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))


@contextmanager
def small_disk(folder: Path) -> Iterator[Disk]:
    """A disk that can be filled: a real one for root, else a limit on the size of files."""
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={SIZE_MB}m", "tmpfs", str(folder)]
    if os.geteuid() != 0 or subprocess.run(mount, capture_output=True, check=False).returncode != 0:
        yield Ration(folder)
        return
    try:
        yield Disk(folder)
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)
