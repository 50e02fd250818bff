"""Where compiled functions are kept from one start to the next, and compiling them beside a start that is under way."""

import atexit
import fcntl
import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

from app.compiled.sources import digest_of, module_file

VARIABLE = "NUMBA_CACHE_DIR"
PATIENCE_S = 120.0
GLANCE_S = 0.05
NICENESS = 10
"""Of processes that compile what no first waypoint waits for."""


@dataclass(frozen=True)
class Part:
    """Functions that are compiled together.

    Attributes
    ----------
    modules
        Their ``warm_up`` compiles them.
    after
        Parts that have to be compiled before, since their functions are called here. Parts share no other function.
    """

    modules: tuple[str, ...]
    after: tuple[str, ...] = ()


RAYS = "rays"
"""What simulated vehicles wait for."""
PARTS = {
    "constraints": Part(("app.exploration.core.constraints",)),
    RAYS: Part(("simulator.sonars.raycasting",)),
    "plans": Part(("app.exploration.survey.value", "app.exploration.core.routes")),
    "maps": Part(("app.mapping.gaussian_process.gp",)),
    "search": Part(("app.exploration.survey.local_search",), after=("constraints", "plans")),
    "checks": Part(("app.mapping.quality.crossovers", "app.estimation.adjustment"), after=("maps",)),
}
FIRST = ("constraints", "plans")
"""What a vehicle's first waypoint waits for."""
PROCESSES = ((RAYS, "constraints", "maps"), ("plans", "search", "checks"))
"""Who compiles what, in which order."""

_PROGRAM = "import sys; from app.compiled.cache import compile_parts; compile_parts(sys.argv[1:])"
_beside: dict[str, subprocess.Popen[bytes]] = {}
"""The process that compiles each part."""


def keep_compiled() -> Path | None:
    """Let functions be compiled also where the user who runs this can write neither beside the code nor at home.

    Where numba finds no folder for what it compiles, modules with such functions cannot be imported. A service that may
    write nothing but its data compiles into a temporary folder, anew with each start. Call before numba is imported.

    Returns
    -------
    The temporary folder; None where compiled functions can be kept.

    Raises
    ------
    OSError
        When there is no folder for temporary files either.
    """
    if VARIABLE in os.environ or any(_writable(folder) for folder in _usual()):
        return None
    folder = Path(tempfile.mkdtemp(prefix="bathyfleet-compiled-"))
    atexit.register(_remove, folder, os.getpid())
    os.environ[VARIABLE] = str(folder)
    return folder


def compile_beside() -> None:
    """Have other processes compile what nearly every mission needs, unless an earlier start of this code did.

    Importing the service takes as long as half of what the first waypoint waits for. A process compiles one function
    at a time, and whatever else it does waits for that: so the service compiles nothing itself that is needed often.
    Nothing is lost where it fails: what is missing then is compiled when it is first used.
    """
    with suppress(OSError, StopIteration):
        for parts in PROCESSES:
            missing = [part for part in parts if part not in _beside and not _mark(part).exists()]
            if not missing:
                continue
            command = [sys.executable, "-P", "-c", _PROGRAM, *missing]
            quiet = subprocess.DEVNULL
            process = subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet)  # noqa: S603 - our own words
            atexit.register(process.kill)
            _beside.update(dict.fromkeys(missing, process))


def wait_for_compiling(*parts: str, ending: threading.Event | None = None) -> bool:
    """Return when the other processes have compiled these parts: all where none are named.

    numba's cache has no lock, so only one process may compile a function.

    Returns
    -------
    False where ``ending`` was set meanwhile.
    """
    ending = ending or threading.Event()
    deadline = time.monotonic() + PATIENCE_S
    for part in parts or PARTS:
        process = _beside.get(part)
        mark = None if process is None else _mark(part)
        while mark and process and process.poll() is None and not mark.exists() and time.monotonic() < deadline:
            if ending.wait(GLANCE_S):
                break
    return not ending.is_set()


def compile_parts(parts: Sequence[str]) -> None:
    """Compile some of ``PARTS`` one after the other, and leave a mark for each that is done.

    One process at a time compiles a part, also of several services: the others wait for it.
    """
    for part in parts:
        if part not in (RAYS, *FIRST):
            os.nice(NICENESS - os.nice(0))
        _compile(part)


def _compile(part: str) -> None:
    for other in PARTS[part].after:
        _compile(other)
    mark = _mark(part)
    with Path(f"{mark}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not mark.exists():
            for module in PARTS[part].modules:
                import_module(module).warm_up()
            mark.touch()


def _mark(part: str) -> Path:
    """The file that says that a part was compiled, by the code as it is: raises StopIteration without a folder."""
    chosen = os.environ.get(VARIABLE)
    folder = next(folder for folder in ([Path(chosen)] if chosen else _usual()) if _writable(folder))
    code = hashlib.sha256(f"{sys.version} {version('numba')} {part}".encode())
    for module in PARTS[part].modules:
        code.update(digest_of(module_file(module)).encode())
    return folder / f"bathyfleet-{code.hexdigest()[:16]}.compiled"


def _usual() -> list[Path]:
    """Where numba looks: beside the code, and in the user's folder for what can be made again."""
    cache = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")  # noqa: PTH111 - a user may have no home
    return [Path(__file__).parents[1] / "mapping" / "__pycache__", Path(cache) / "numba"]


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _remove(folder: Path, owner: int) -> None:
    # Not by processes that were forked meanwhile.
    if os.getpid() == owner:
        shutil.rmtree(folder, ignore_errors=True)
