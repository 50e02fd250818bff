"""``bathyfleet serve`` in a world where something is wrong; the arguments are the command's own.

Environment: ``FAULTS_CLOCK`` names a file with the seconds that the wall clock is off, read at every look at it;
``FAULTS_BUSY_MS`` is how long a writer waits for another process; ``FAULTS_HUNG_LOOKS``: after so many looks in vain
another process is taken for dead; ``FAULTS_FTP_TIMEOUT_S``: how long a silent FTP server is waited for.
"""

import os
import time
from datetime import datetime, tzinfo
from functools import partialmethod
from pathlib import Path
from typing import Self

_true_time = time.time


def off_s() -> float:
    """How far the wall clock is off now."""
    return float(Path(os.environ["FAULTS_CLOCK"]).read_text())


class Shifted(datetime):
    """A datetime whose present can be moved."""

    @classmethod
    def now(cls, tz: tzinfo | None = None) -> Self:
        """The present by the wrong clock."""
        return cls.fromtimestamp(_true_time() + off_s(), tz)


if __name__ == "__main__":
    if "FAULTS_CLOCK" in os.environ:
        time.time = lambda: _true_time() + off_s()
        from app.api.accounts import tokens
        from app.missions import clock

        for module in (clock, tokens):
            vars(module)["datetime"] = Shifted
    if "FAULTS_HUNG_LOOKS" in os.environ:
        from app.storage.processes import membership

        membership.HUNG_LOOKS = int(os.environ["FAULTS_HUNG_LOOKS"])
    if "FAULTS_BUSY_MS" in os.environ:
        from app.storage import database

        database.BUSY_TIMEOUT_MS = int(os.environ["FAULTS_BUSY_MS"])
    if "FAULTS_FTP_TIMEOUT_S" in os.environ:
        from fsspec.implementations import ftp

        patience_s = float(os.environ["FAULTS_FTP_TIMEOUT_S"])
        setattr(ftp.FTPFileSystem, "__init__", partialmethod(ftp.FTPFileSystem.__init__, timeout=patience_s))  # noqa: B010
    from app.cli import main

    main()
