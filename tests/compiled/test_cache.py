"""The service starts for a user who may write nothing but temporary files, and compiles beside its start."""

import os
import shutil
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import pytest

from app.compiled import cache as compiled
from app.compiled.cache import FIRST, PARTS, PROCESSES, compile_beside, wait_for_compiling
from tests.support.faults.other_users import SERVICE, as_user, needs_root
from tests.support.paths import PROJECT

PROGRAM = """
from app.compiled.cache import keep_compiled
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


@pytest.mark.slow
def test_what_an_earlier_start_compiled_is_not_compiled_again() -> None:
    folder = Path(os.environ["NUMBA_CACHE_DIR"])
    for mark in folder.glob("bathyfleet-*.compiled"):
        mark.unlink()
    try:
        compile_beside()
        compile_beside()
        wait_for_compiling()
        compile_beside()
        assert len(set(compiled._beside.values())) == 2
        assert {name: process.wait() for name, process in compiled._beside.items()} == dict.fromkeys(PARTS, 0)
        assert len(list(folder.glob("bathyfleet-*.compiled"))) == len(PARTS)
    finally:
        compiled._beside.clear()


def test_each_part_is_compiled_by_one_process_after_what_it_calls() -> None:
    order = [part for parts in PROCESSES for part in parts]
    assert sorted(order) == sorted(PARTS)
    # What the first waypoint waits for waits for nothing else, and processes do not wait for each other in circles.
    assert {part for part in FIRST if PARTS[part].after} == set()
    done: set[str] = set()
    while len(done) < len(PARTS):
        ready = {part for part in PARTS if part not in done and done.issuperset(PARTS[part].after)}
        assert ready
        done |= ready


def test_a_service_that_ends_waits_for_no_other_process(monkeypatch: pytest.MonkeyPatch) -> None:
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as endless:
        monkeypatch.setattr(compiled, "_beside", {"maps": endless})
        monkeypatch.setattr(compiled, "_mark", lambda _part: Path("/nowhere/mark"))
        ending = threading.Event()
        ending.set()
        assert not wait_for_compiling("maps", ending=ending)
        assert endless.poll() is None
        endless.communicate(b"\n")
        assert wait_for_compiling("maps"), "a process that ended is waited for no longer"


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


@pytest.mark.slow
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


WHOLE = """
import numba
from app.floor import {imported}

@numba.njit(cache=True)
def whole(x):
    return scaled(x) + 1.0
"""
PARTIAL = """
import numba
from app.sizes import FACTOR

@numba.njit(cache=True)
def scaled(x):
    return FACTOR * x
"""
REPORT = (
    "import app.compiled.index; from app.whole import whole; print(whole(2.0), sum(whole.stats.cache_hits.values()))"
)


@pytest.mark.slow
def test_a_function_is_compiled_again_when_one_that_it_calls_or_a_constant_of_that_changed(tmp_path: Path) -> None:
    package = tmp_path / "app"
    package.mkdir()
    shutil.copy(PROJECT / "app" / "__init__.py", package)
    shutil.copytree(PROJECT / "app" / "compiled", package / "compiled")

    def result(*, factor: float, imported: str = "scaled", aside: str = "") -> list[float]:
        (package / "sizes.py").write_text(f"FACTOR = {factor}\n")
        (package / "floor.py").write_text(PARTIAL)
        (package / "whole.py").write_text(WHOLE.format(imported=imported))
        (package / "aside.py").write_text(aside)
        variables = {name: text for name, text in os.environ.items() if not name.startswith(("NUMBA_", "PYTHON"))}
        variables |= {"PYTHONPATH": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "compiled")}
        command = [sys.executable, "-B", "-c", REPORT]
        ended = subprocess.run(
            command, env=variables, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False
        )
        assert ended.returncode == 0, ended.stderr
        return [float(word) for word in ended.stdout.split()]

    assert result(factor=3.0) == [7.0, 0.0]
    assert result(factor=3.0, aside="FACTOR = 9.0\n") == [7.0, 1.0], "what it does not import is no matter"
    assert result(factor=5.0) == [11.0, 0.0], "a constant of a module that a called one imports"
    assert result(factor=5.0, imported="(\n    scaled,  # in more than one line\n)") == [11.0, 0.0]
    assert result(factor=4.0, imported="(\n    scaled,  # in more than one line\n)") == [9.0, 0.0]
