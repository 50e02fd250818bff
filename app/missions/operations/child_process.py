"""Processes of this program's own modules, which the service starts beside itself and ends with what they start."""

import os
import signal
import sys
from asyncio import create_subprocess_exec
from asyncio.subprocess import Process
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO

import app

_ROOT = str(Path(app.__file__).resolve().parents[1])


def search_path() -> str:
    """Return the ``PYTHONPATH`` by which such a process finds this program."""
    return os.pathsep.join(filter(None, [_ROOT, os.environ.get("PYTHONPATH", "")]))


async def start(
    module: str,
    arguments: Sequence[str],
    *,
    files: Sequence[int],
    environment: Mapping[str, str],
    stdin: int | IO[bytes],
    stdout: int,
    stderr: int | None = None,
    folder: str | None = None,
) -> Process:
    """Run a module as a process that leads a session of its own: a signal from a terminal is not for it.

    Parameters
    ----------
    files
        Numbers of the open files that it has, too.
    stdin, stdout, stderr
        As of :func:`asyncio.create_subprocess_exec`.
    folder
        Where it runs; None: where the service does.

    Raises
    ------
    OSError
        When it cannot be started.
    """
    return await create_subprocess_exec(
        sys.executable,
        "-P",
        "-m",
        module,
        *arguments,
        stdin=stdin,
        stdout=stdout,
        stderr=stderr,
        pass_fds=tuple(files),
        env=environment,
        cwd=folder,
        start_new_session=True,
    )


def kill(process: Process) -> None:
    """End a process that runs yet, and what it has started."""
    if process.returncode is None:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
