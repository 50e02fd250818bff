"""What a compiled function was made of: the source of its own module and of all that this imports of the project.

Functions of other modules are compiled into those that call them, and constants too.
"""

import hashlib
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("app", "simulator", "imc_bridge")
_NAME = rf"(?:{'|'.join(PACKAGES)})(?:\.\w+)*"
_IMPORT = re.compile(
    rf"^[ \t]*(?:from[ \t]+({_NAME})[ \t]+import[ \t]+(\([^)]*\)|[^\n]*)|import[ \t]+({_NAME}))", re.MULTILINE
)


def sources_of(file: Path) -> set[Path]:
    """Return a source file and all of the project that it imports, directly or through others."""
    found: set[Path] = set()
    new = {file}
    while new:
        found |= new
        new = {imported for path in new for imported in _read(path).imported} - found
    return found


def digest_of(file: Path) -> str:
    """Return what tells apart the sources that functions of ``file`` are compiled from."""
    known = hashlib.sha256()
    for path in sorted(sources_of(file)):
        known.update(f"{path.relative_to(ROOT)} {_read(path).digest}\n".encode())
    return known.hexdigest()


def is_ours(file: Path) -> bool:
    """Whether a file belongs to the service."""
    return file.is_relative_to(ROOT / "app")


def module_file(name: str) -> Path:
    """Return the file of a module of the project."""
    path = ROOT.joinpath(*name.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


class _Source(NamedTuple):
    digest: str
    imported: frozenset[Path]


def _read(file: Path) -> _Source:
    stat = file.stat()
    return _read_once(file, stat.st_mtime_ns, stat.st_size)


@cache
def _read_once(file: Path, _changed_ns: int, _bytes: int) -> _Source:
    content = file.read_bytes()
    return _Source(hashlib.sha256(content).hexdigest(), frozenset(_imported(content.decode(errors="replace"))))


def _imported(text: str) -> Iterator[Path]:
    for package, names, alone in _IMPORT.findall(text):
        # What follows an "as" is looked for too, and not found.
        modules = [package or alone, *(f"{package}.{name}" for name in re.findall(r"\w+", names))]
        yield from filter(Path.is_file, map(module_file, modules))
