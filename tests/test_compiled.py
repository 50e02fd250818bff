"""The service starts for a user who may write nothing but temporary files, and compiles beside its start."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from app import compiled
from app.compiled import PARTS, compile_beside, wait_for_compiling
from tests.support.faults.other_users import SERVICE, as_user, needs_root
from tests.support.paths import PROJECT

PROGRAM = """
from app.compiled import keep_compiled
folder = keep_compiled()
import app.mapping.gaussian
print(folder, f"{folder.stat().st_mode & 0o777:o}" if folder else "-")
"""


def imported(home: str) -> list[str]:
    """Where a user to whom the code does not belong compiles, and who may look there."""
    chosen = ["NUMBA_CACHE_DIR", "NUMBA_CACHE_LOCATOR_CLASSES", "XDG_CACHE_HOME"]
    unset = [word for name in chosen for word in ("-u", name)]
    own = [f"HOME={home}", f"PYTHONPATH={PROJECT}", "PYTHONDONTWRITEBYTECODE=1"]
    command = [*as_user(SERVICE), "env", *unset, *own, sys.executable, "-c", PROGRAM]
    ended = subprocess.run(command, cwd=PROJECT, capture_output=True, text=True, timeout=120, check=False)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout.split()


@needs_root
def test_functions_are_compiled_where_nothing_can_be_kept() -> None:
    folder, mode = imported("/proc/none")
    assert Path(folder).parent == Path(tempfile.gettempdir())
    assert mode == "700"
    assert not Path(folder).exists(), "it ends with the process"


@needs_root
def test_a_folder_of_the_user_is_used() -> None:
    with tempfile.TemporaryDirectory() as home:
        Path(home).chmod(0o777)
        assert imported(home) == ["None", "-"]


def test_what_an_earlier_start_compiled_is_not_compiled_again() -> None:
    folder = Path(os.environ["NUMBA_CACHE_DIR"])
    for mark in folder.glob("bathyfleet-*.compiled"):
        mark.unlink()
    try:
        compile_beside()
        compile_beside()
        wait_for_compiling()
        compile_beside()
        assert {name: process.returncode for name, process in compiled._beside.items()} == dict.fromkeys(PARTS, 0)
        assert len(list(folder.glob("bathyfleet-*.compiled"))) == len(PARTS)
    finally:
        compiled._beside.clear()


KERNEL = """
from typing import NamedTuple
import numba
from sizes import {name}

@numba.njit(cache=True)
def area(size):
    return size.width * size.height
"""
SIZES = """
from typing import NamedTuple

class {name}(NamedTuple):
    width: float
    height: float
"""


def test_code_compiled_for_names_of_an_earlier_version_is_compiled_again(tmp_path: Path) -> None:
    for name in ("Size", "Extent"):  # the class has another name in the next version, the function is as it was
        (tmp_path / "sizes.py").write_text(SIZES.format(name=name))
        (tmp_path / "kernel.py").write_text(KERNEL.format(name="*"))
        os.utime(tmp_path / "kernel.py", (1, 1))
        program = f"import app.exploration, kernel, sizes; print(kernel.area(sizes.{name}(2.0, 3.0)))"
        variables = os.environ | {"PYTHONPATH": f"{tmp_path}:{PROJECT}", "NUMBA_CACHE_DIR": str(tmp_path / "compiled")}
        command = [sys.executable, "-B", "-c", program]
        ended = subprocess.run(command, env=variables, capture_output=True, text=True, timeout=120, check=False)
        assert ended.stdout.strip() == "6.0", ended.stderr
