"""Files and folders for their owner only, whatever the user's umask: what the service stores is private."""

import contextlib
import os
import secrets
import stat
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import BinaryIO, Literal, TextIO, cast, overload

FILE_MODE = 0o600
FOLDER_MODE = 0o700
OTHERS = 0o077


@contextlib.contextmanager
def for_owner_only() -> Iterator[None]:
    """Make everything for its owner only that this process and those that it starts create meanwhile."""
    before = os.umask(OTHERS)
    try:
        yield
    finally:
        os.umask(before)


def make_folder(folder: Path) -> None:
    """Make a folder, and those above it that are missing; what is there already stays as its owner wants it."""
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    for path in reversed(missing):
        # Another process may be making it, too.
        with contextlib.suppress(FileExistsError):
            path.mkdir(FOLDER_MODE)
    folder.mkdir(FOLDER_MODE, exist_ok=True)


@overload
def open_new(path: Path, mode: Literal["w"] = "w") -> TextIO: ...
@overload
def open_new(path: Path, mode: Literal["wb"]) -> BinaryIO: ...
def open_new(path: Path, mode: Literal["w", "wb"] = "w") -> TextIO | BinaryIO:
    """Open an empty file for writing; a file that is there is emptied, and its owner's only from then on."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, FILE_MODE)
    if stat.S_ISREG(os.fstat(descriptor).st_mode):  # else a terminal or a pipe that the user named
        os.fchmod(descriptor, FILE_MODE)
        os.ftruncate(descriptor, 0)
    file = os.fdopen(descriptor, mode, encoding=None if mode == "wb" else "utf-8")
    return cast("TextIO | BinaryIO", file)


def write(path: Path, content: bytes | str | Iterable[bytes]) -> None:
    """Write a file. One that was there is replaced when all is written, so that no reader gets a half.

    ``content`` may come in pieces.
    """
    data = content.encode() if isinstance(content, str) else content
    pieces = [data] if isinstance(data, bytes) else data
    if path.exists() and not path.is_file():
        with path.open("wb") as named:  # a terminal or a pipe that the user named
            named.writelines(pieces)
        return
    place = path.resolve()
    part = place.with_name(f".{place.name}.{secrets.token_hex(4)}")
    try:
        with os.fdopen(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, FILE_MODE), "wb") as file:
            os.fchmod(file.fileno(), FILE_MODE)
            file.writelines(pieces)
        part.replace(place)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def create(path: Path) -> None:
    """Create an empty file where there is none, so that a library that opens it next does not make a public one."""
    with contextlib.suppress(FileExistsError):
        os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, FILE_MODE))


def mend(paths: Iterable[Path]) -> dict[Path, str]:
    """Remove other users' rights on our files; returns those that were open, with their mode."""
    mended = {}
    for path in paths:
        try:
            found = path.stat()
            if not stat.S_ISREG(found.st_mode) or not found.st_mode & OTHERS:
                continue
            path.chmod(stat.S_IMODE(found.st_mode) & ~OTHERS)
        except OSError:
            continue  # gone, or another user's
        mended[path] = f"{stat.S_IMODE(found.st_mode):o}"
    return mended


def still_open(paths: Iterable[Path]) -> list[Path]:
    """Return the files that others may read or write, and which are not ours to close."""
    return [path for path in paths if path.is_file() and path.stat().st_mode & OTHERS]


def is_public(folder: Path) -> bool:
    """Tell whether every user may put files into a folder."""
    return folder.is_dir() and bool(folder.stat().st_mode & stat.S_IWOTH)


def family(database: Path) -> list[Path]:
    """Return the files of an SQLite database: itself, its journals, the locks of processes, what was moved aside."""
    folder, name = database.parent, database.name
    marks = ("-wal", "-shm", "-journal", "-process-", ".before-", ".before", ".part")
    beside = [path for path in folder.glob(f"{_literal(name)}*") if path.name[len(name) :].startswith(marks)]
    return [database, *sorted(beside)]


def _literal(name: str) -> str:
    return "".join(f"[{letter}]" if letter in "*?[" else letter for letter in name)
