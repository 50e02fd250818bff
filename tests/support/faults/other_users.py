"""Services and programs of several users of one machine, which only root can start."""

import asyncio
import json
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.support.paths import PROJECT

STRANGER = 64_002
"""An ordinary user that no system has."""
SERVICE = 64_001
"""Another one, in whose name the service runs."""

needs_root = pytest.mark.skipif(os.geteuid() != 0, reason="only root can act as several users of the machine")


def as_user(uid: int) -> list[str]:
    """Words before a command that make it an ordinary user's, which may read the test's installation, but not write."""
    if uid == 0:
        return []
    found = shutil.which("setpriv")
    if found is None:
        pytest.skip("setpriv (util-linux) is not installed")
    caps = "-all,+dac_read_search"
    ids = [f"--reuid={uid}", f"--regid={uid}", "--clear-groups"]
    # What is compiled lies in a folder of the tests, which this user may not write to.
    cache = Path(tempfile.gettempdir()) / f"bathyfleet-compiled-{uid}"
    cache.mkdir(mode=0o700, exist_ok=True)
    os.chown(cache, uid, uid)
    own = ["env", f"NUMBA_CACHE_DIR={cache}"]
    return [found, *ids, f"--inh-caps={caps}", f"--ambient-caps={caps}", f"--bounding-set={caps}", *own]


@contextmanager
def open_folder(owner: int = 0) -> Iterator[Path]:
    """A folder that every user of the machine may look into, as working directories are; tests' own are closed."""
    folder = Path(tempfile.mkdtemp(prefix="bathyfleet-open-"))
    try:
        folder.chmod(0o755)
        os.chown(folder, owner, owner)
        yield folder
    finally:
        shutil.rmtree(folder)


async def stranger(task: str, *arguments: object) -> Any:
    """What a stranger's try gives, see ``stranger.py``."""
    process = await _begin(task, *arguments)
    out, _ = await process.communicate()
    assert process.returncode == 0, out
    return json.loads(out)


async def holding(*paths: Path) -> asyncio.subprocess.Process:
    """A stranger's process that holds locks on files; it ends with its input."""
    process = await _begin("hold", *paths)
    assert process.stdout is not None
    assert await process.stdout.readline() == b"held\n"
    return process


async def _begin(task: str, *arguments: object) -> asyncio.subprocess.Process:
    command = [sys.executable, "-m", "tests.support.faults.stranger", str(STRANGER), task, *map(str, arguments)]
    pipe = asyncio.subprocess.PIPE
    return await asyncio.create_subprocess_exec(*command, cwd=PROJECT, stdin=pipe, stdout=pipe)


def modes(folder: Path) -> dict[str, str]:
    """Who may do what with everything in a folder, in octal."""
    return {str(path.relative_to(folder)): f"{path.stat().st_mode & 0o777:o}" for path in sorted(folder.rglob("*"))}
