"""Where compiled functions are kept from one start to the next, and compiling them beside a start that is under way."""

import atexit
import fcntl
import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
from contextlib import suppress
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"
PARTS = {"constraints": "app.exploration.core.constraints", "plans": "app.exploration.survey.value"}
"""What the first waypoint waits for, in parts of about the same size that share no function, with the modules whose
``warm_up`` compiles them."""
PACKAGE = "exploration"
"""What these are made of."""
PATIENCE_S = 60.0

_PROGRAM = "import sys; from app.compiled import compile_part; compile_part(sys.argv[1], sys.argv[2])"
_beside: dict[str, subprocess.Popen[bytes]] = {}


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
    """Have other processes compile what the first waypoint waits for, unless an earlier start of this code did.

    Importing the service takes as long as half of the compiling, and a process compiles one function at a time.
    Nothing is lost where it fails: what is missing then is compiled when it is first used.
    """
    for part in PARTS:
        with suppress(OSError, StopIteration):
            mark = _mark(part)
            if mark.exists() or part in _beside:
                continue
            command = [sys.executable, "-P", "-c", _PROGRAM, part, str(mark)]
            quiet = subprocess.DEVNULL
            process = subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet)  # noqa: S603 - our own words
            atexit.register(process.kill)
            _beside[part] = process


def wait_for_compiling() -> None:
    """Return when the other processes are done: numba's cache has no lock, so only one may compile a function."""
    for process in _beside.values():
        with suppress(subprocess.TimeoutExpired):
            process.wait(PATIENCE_S)


def compile_part(part: str, mark: str) -> None:
    """Compile one of ``PARTS``, and make the file ``mark`` when it is done.

    One process at a time does that, also of several services: the others wait for it.
    """
    with Path(f"{mark}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not Path(mark).exists():
            import_module(PARTS[part]).warm_up()
            Path(mark).touch()


def _mark(part: str) -> Path:
    """The file that says that a part was compiled, by the code as it is: raises StopIteration without a folder."""
    code = hashlib.sha256(f"{sys.version} {version('numba')} {part}".encode())
    for path in sorted(Path(__file__).parent.joinpath(PACKAGE).rglob("*.py")):
        stat = path.stat()
        code.update(f"{path} {stat.st_mtime_ns} {stat.st_size}".encode())
    chosen = os.environ.get(VARIABLE)
    folder = next(folder for folder in ([Path(chosen)] if chosen else _usual()) if _writable(folder))
    return folder / f"bathyfleet-{code.hexdigest()[:16]}.compiled"


def _usual() -> list[Path]:
    """Where numba looks: beside the code, and in the user's folder for what can be made again."""
    cache = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")  # noqa: PTH111 - a user may have no home
    return [Path(__file__).parent / "mapping" / "__pycache__", Path(cache) / "numba"]


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
