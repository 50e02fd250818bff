"""The lock by which one process shows those of other runs and programs that it lives: a file, open to its user only.

The operating system gives a lock up when its process ends, however it ends. Two things it does not see to: another user
of the machine may hold a lock on a file that he could open, and a file may stay when its process is gone. So the file
names its process, too.
"""

import fcntl
import json
import os
import secrets
import stat
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from app.storage.private import FILE_MODE

PROC = Path("/proc")


class LockHeldError(Exception):
    """The lock is another process'."""


@dataclass(frozen=True)
class Holder:
    """Which process has a lock.

    Attributes
    ----------
    number
        Its number among those that share the database.
    pid, began
        Its id, and when it began in the kernel's ticks since the start: ids are given out again.
    boot, world
        Where that holds: of one run of the system, in one namespace of process ids.
    """

    number: int
    pid: int
    began: str
    boot: str
    world: str


class ProcessLock:
    """A lock that is held until :meth:`release`, or until this process ends.

    Parameters
    ----------
    path
        The file.
    number
        The process' number.
    owner
        The user whom the database belongs to; where root runs a process, too, that user's processes can see it.

    Raises
    ------
    LockHeldError
        When another process has it, and lives.
    OSError
        When the file cannot be made.
    """

    def __init__(self, path: Path, number: int, owner: int | None = None) -> None:
        if is_held(path, owner):
            raise LockHeldError(f"{path} is locked by another process")
        # Made under another name, so that it is not found before it is locked and names its owner.
        part = path.with_name(f"{path.name}.{secrets.token_hex(4)}")
        self._descriptor = os.open(part, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, FILE_MODE)
        try:
            os.fchmod(self._descriptor, FILE_MODE)
            if owner is not None and os.geteuid() == 0:
                os.fchown(self._descriptor, owner, -1)
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            os.write(self._descriptor, json.dumps(asdict(_this_process(number))).encode())
            part.replace(path)
        except BaseException:
            part.unlink(missing_ok=True)
            os.close(self._descriptor)
            raise
        self._path = path

    @property
    def is_ours(self) -> bool:
        """Whether the file under the lock's name is still the one that this process has locked."""
        try:
            return os.path.samestat(os.fstat(self._descriptor), self._path.stat())
        except OSError:
            return False

    def release(self) -> None:
        """Give the lock up and remove the file."""
        if self.is_ours:
            self._path.unlink(missing_ok=True)
        os.close(self._descriptor)


def is_held(path: Path, owner: int | None = None) -> bool:
    """Tell whether a process that lives has a lock; what is left of one that ended is removed.

    ``owner`` is the user whom the database belongs to. What a third user put there is no lock.
    """
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK)
    except FileNotFoundError:
        return False
    except OSError:
        # Nobody can give a file away: one of root's or of the owner's, which this user may not open, is in earnest.
        return os.path.lexists(path) and path.lstat().st_uid in _trusted(owner)
    try:
        found = os.fstat(descriptor)
        if not stat.S_ISREG(found.st_mode) or found.st_uid not in _trusted(owner):
            return False
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return _holder_lives(_read(descriptor), found, owner)
        if os.path.samestat(found, path.stat()):
            path.unlink()
        return False
    except FileNotFoundError:
        return False  # removed by another process meanwhile
    finally:
        os.close(descriptor)


def _trusted(owner: int | None) -> set[int]:
    return {0, os.geteuid()} | ({owner} if owner is not None else set())


def _holder_lives(holder: Holder | None, found: os.stat_result, owner: int | None) -> bool:
    """Tell whether the process lives that a locked file names; without a name, whether one of ours has it locked."""
    if holder is None:
        # Of a version before, whose files every user of the machine could open and lock.
        return _is_locked_by_trusted(found, owner)
    here = _this_process(holder.number)
    if (holder.boot, holder.world) != (here.boot, here.world):
        # In another container on the same file nothing but the lock can be seen; after a restart nothing is locked.
        return holder.boot == here.boot
    began = _began(holder.pid)
    return began is None or began == holder.began


def _this_process(number: int) -> Holder:
    pid = os.getpid()
    try:
        boot = (PROC / "sys/kernel/random/boot_id").read_text().strip()
        world = str((PROC / "self/ns/pid").stat().st_ino)
    except OSError:
        boot = world = ""
    return Holder(number, pid, _began(pid) or "", boot, world)


def _began(pid: int) -> str | None:
    """Return when a process began, empty when there is none; None where the system does not show it."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return ""
    except OSError:
        pass  # another user's, which may be hidden below
    try:
        # The name stands in parentheses, which it may contain itself.
        return (PROC / str(pid) / "stat").read_text().rpartition(")")[2].split()[19]
    except OSError:
        return None


def _read(descriptor: int) -> Holder | None:
    try:
        said: Any = json.loads(os.pread(descriptor, 4096, 0))
        return Holder(**said)
    except (ValueError, TypeError):
        return None


def _is_locked_by_trusted(found: os.stat_result, owner: int | None) -> bool:
    """Tell by the kernel's list of locks whether a process of ours has a file locked; False where there is no list."""
    place = f"{os.major(found.st_dev):02x}:{os.minor(found.st_dev):02x}:{found.st_ino}"
    try:
        lines = (PROC / "locks").read_text().splitlines()
    except OSError:
        return False
    holders = [line.split()[4] for line in lines if place in line.split() and "->" not in line]
    return any((PROC / pid).exists() and (PROC / pid).stat().st_uid in _trusted(owner) for pid in holders)
