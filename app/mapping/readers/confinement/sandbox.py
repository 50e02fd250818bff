"""The layers in their order."""

import contextlib
import errno
import os
import resource
import signal
import tempfile
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

from app.mapping.readers.confinement import landlock, system_calls
from app.mapping.readers.confinement.kernel import (
    PR_SET_DUMPABLE,
    PR_SET_NO_NEW_PRIVS,
    PR_SET_PDEATHSIG,
    prctl,
    unshare,
)

LAYERS = ("namespaces", "landlock", "seccomp")
"""What a kernel may lack. Limits and lost privileges are had everywhere."""

LOCKING_CALLS = ("landlock_create_ruleset", "landlock_add_rule", "landlock_restrict_self", "seccomp")
"""System calls by which the process locks itself in: a filter that it is started under has to allow them."""
FORBIDDEN = "a filter of system calls forbids it"
"""Why a layer does not hold that the kernel may well have."""

_NEW_USER, _NEW_NETWORK, _NEW_IPC = 0x10000000, 0x40000000, 0x08000000
MAX_DESCRIPTORS = 64
NICENESS = 10


@dataclass(frozen=True)
class ResourceLimits:
    """What the process may use up at most."""

    memory_bytes: int
    cpu_s: int
    file_bytes: int


def limit(limits: ResourceLimits) -> None:
    """Bound this process, put others before it, and let it end with the process that started it."""
    parent = os.getppid()
    prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        raise SystemExit("the service has ended")
    for what, most in (
        (resource.RLIMIT_AS, limits.memory_bytes),
        (resource.RLIMIT_CPU, limits.cpu_s),
        (resource.RLIMIT_FSIZE, limits.file_bytes),
        (resource.RLIMIT_CORE, 0),
    ):
        hard = resource.getrlimit(what)[1]
        most = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(what, (most, most))
    os.nice(NICENESS)


def confine(descriptors: Collection[int], readable: Sequence[Path], layers: Collection[str] = LAYERS) -> dict[str, str]:
    """Leave this process nothing but what it has open; there is no way back.

    Call it with everything imported and with one thread: threads that run already stay free.

    Parameters
    ----------
    descriptors
        What stays open besides standard input, output and error, and files in ``readable``.
    readable
        Folders whose files may be read later on, where the kernel can tell folders apart; nothing secret lies there.
    layers
        Which of :data:`LAYERS` to put on.

    Returns
    -------
    By layer "" where it holds, or why it does not.
    """
    if len(os.listdir("/proc/self/task")) != 1:  # noqa: PTH208 - numbers, no paths
        raise RuntimeError("only a process with one thread can be confined")
    _close_others({0, 1, 2, *descriptors}, readable)
    _leave_for_nowhere()
    resource.setrlimit(resource.RLIMIT_NOFILE, (MAX_DESCRIPTORS, MAX_DESCRIPTORS))
    resource.setrlimit(resource.RLIMIT_NPROC, (0, 0))
    prctl(PR_SET_NO_NEW_PRIVS, 1)
    # Nobody looks into its memory, and it is nobody's to trace.
    prctl(PR_SET_DUMPABLE, 0)
    found = dict.fromkeys(LAYERS, "switched off")
    for layer in LAYERS:
        if layer in layers:
            found[layer] = _put_on(layer, readable, told_apart=found["landlock"] == "")
    return found


def _put_on(layer: str, readable: Sequence[Path], *, told_apart: bool) -> str:
    try:
        if layer == "namespaces":
            unshare(_NEW_USER | _NEW_NETWORK | _NEW_IPC)
        elif layer == "landlock":
            landlock.restrict(readable)
        else:
            # Without Landlock no file can be told from another: then none is opened at all.
            system_calls.restrict(opening=told_apart)
    except OSError as error:
        # What the kernel lacks is ENOSYS, or EOPNOTSUPP where it is switched off.
        filtered = error.errno == errno.EPERM and layer != "namespaces"
        return FORBIDDEN if filtered else error.strerror or type(error).__name__
    return ""


def _close_others(kept: Collection[int], readable: Sequence[Path]) -> None:
    folders = [folder.resolve() for folder in readable]
    for name in os.listdir("/proc/self/fd"):  # noqa: PTH208 - numbers, no paths
        descriptor = int(name)
        if descriptor in kept:
            continue
        with contextlib.suppress(OSError):  # the one by which the folder was listed is closed already
            file = Path(os.readlink(f"/proc/self/fd/{name}"))  # noqa: PTH115 - may be no path
            if not any(file.is_relative_to(folder) for folder in folders):
                os.close(descriptor)


def _leave_for_nowhere() -> None:
    """Make a folder the working directory that is gone: nothing is in it, and nothing can be put there."""
    folder = tempfile.mkdtemp(prefix="bathyfleet-nowhere-")
    os.chdir(folder)
    Path(folder).rmdir()
