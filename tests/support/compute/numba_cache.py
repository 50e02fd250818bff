"""One folder of compiled functions for all processes of a test run, also for those that the tests start.

numba numbers the files of its cache without a lock: processes that compile the same function for different arguments at
once could take each other's machine code for theirs. And they would all compile what all need first; here one does, and
the others wait for it. Functions do not call each other in circles, so nobody waits for those who wait for him. Its
setting of a class that finds the cache is how this module gets into every process. The folder is named after their
sources, since numba itself does not notice a change in a function that was compiled into another one.
"""

import fcntl
import hashlib
import os
import re
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TextIO

import numba
from numba.core import caching

from tests.support.paths import PROJECT

PACKAGES = ("app", "simulator", "imc_bridge")
IMPORT = re.compile(rf"^from ((?:{'|'.join(PACKAGES)})[\w.]*) import (\([^)]*\)|.*)", re.MULTILINE)
ALL = PROJECT / ".pytest_cache" / "numba"
PATIENCE_S = 60.0


class _Locked(caching.IndexDataCacheFile):
    """Index and machine code of one function, which one process at a time reads or writes, and one compiles."""

    _compiling: TextIO | None = None

    @contextmanager
    def _alone(self) -> Iterator[None]:
        with Path(f"{self._index_path}.lock").open("w") as file:
            fcntl.flock(file, fcntl.LOCK_EX)  # closing the file gives it free
            yield

    def _load(self, key: Any) -> Any:
        with self._alone():
            return super().load(key)  # type: ignore[no-untyped-call]

    def load(self, key: Any) -> Any:
        """Return what was compiled, perhaps by a process that was waited for; None where this one has to compile."""
        found = self._load(key)
        if found is None and self._compiling is None:
            self._compiling = _taken(Path(f"{self._index_path}.compiling"))
            found = self._load(key)
            if found is not None:
                self._end()
        return found

    def save(self, key: Any, data: Any) -> None:
        with self._alone():
            super().save(key, data)  # type: ignore[no-untyped-call]
        self._end()

    def _end(self) -> None:
        if self._compiling is not None:
            self._compiling.close()
            self._compiling = None


def _taken(path: Path) -> TextIO:
    """Lock a file; not at any price, since what cannot be compiled is never saved and its lock given free."""
    file = path.open("w")
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        with suppress(BlockingIOError):
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            break
        time.sleep(0.05)
    return file


class Locator(caching.UserProvidedCacheLocator):
    """Where ``NUMBA_CACHE_DIR`` says, as without it."""


vars(caching)["IndexDataCacheFile"] = _Locked


def _compiled_sources() -> set[Path]:
    """Files with compiled functions, and all that they import: constants are compiled in."""
    files = [path for package in PACKAGES for path in (PROJECT / package).rglob("*.py")]
    texts = {path: path.read_text() for path in files if "node_modules" not in path.parts}
    found: set[Path] = set()
    new = {path for path, text in texts.items() if "njit" in text}
    while new:
        found |= new
        new = {path for file in new for path in _imported(texts[file])} & texts.keys() - found
    return found


def _imported(text: str) -> Iterator[Path]:
    for module, names in IMPORT.findall(text):
        path = PROJECT.joinpath(*module.split("."))
        yield from (path.with_suffix(".py"), path / "__init__.py")
        yield from (path / f"{name}.py" for name in re.findall(r"\w+", names))


def share() -> None:
    """Let this process and those that it starts use the folder of the sources as they are; forget older ones."""
    sources = hashlib.sha256()
    for path in sorted(_compiled_sources()):
        sources.update(path.read_bytes())
    folder = ALL / sources.hexdigest()[:16]
    if "PYTEST_XDIST_WORKER" not in os.environ and ALL.is_dir():
        for older in ALL.iterdir():
            if older != folder:
                shutil.rmtree(older)
    name = f"{Locator.__module__}.{Locator.__qualname__}"
    # For the processes, which have to find this module, and no other one of its name.
    search_path = os.pathsep.join([str(PROJECT), os.environ.get("PYTHONPATH", "")])
    os.environ |= {"NUMBA_CACHE_DIR": str(folder), "NUMBA_CACHE_LOCATOR_CLASSES": name, "PYTHONPATH": search_path}
    # Here numba may have been imported already.
    vars(numba.config).update({"CACHE_DIR": str(folder), "CACHE_LOCATOR_CLASSES": name})
