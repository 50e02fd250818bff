"""Where compiled functions are kept from one start to the next."""

import atexit
import os
import shutil
import tempfile
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"


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
