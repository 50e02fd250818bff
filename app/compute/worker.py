"""What the cluster's workers run. Loading this module loads nothing else of the service."""

import platform
from collections.abc import Sequence
from functools import cache
from importlib.metadata import PackageNotFoundError, version

from app import __version__
from app.arrays import ByteArray
from app.compute.packing import Packed, outcome, pack, unpack

PACKAGES = ("numpy", "scipy", "numba")
"""What results depend on beside this program."""

Facts = dict[str, str]


class OtherVersions(Exception):  # noqa: N818 - it is an answer
    """A worker has other versions than whoever asked: its facts."""

    def __init__(self, facts: Facts) -> None:
        super().__init__(facts)
        self.facts = facts


@cache
def facts() -> Facts:
    """Return what has to be the same everywhere, so that it does not matter where something is computed."""
    found = {"bathyfleet": __version__, "Python": ".".join(platform.python_version_tuple()[:2])}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "missing"
    return found


def differences(ours: Facts, theirs: Facts) -> str:
    """Return in words what differs; empty for nothing."""
    return ", ".join(
        f"{name} {theirs.get(name, 'missing')} where this service has {value}"
        for name, value in ours.items()
        if theirs.get(name) != value
    )


def work_there(asked_with: Facts, head: bytes, buffers: Sequence[ByteArray]) -> Packed:
    """Do what is packed and return what came of it. Raises OtherVersions."""
    ours = facts()
    if ours != asked_with:
        raise OtherVersions(ours)
    work, arguments, named = unpack(Packed(head, list(buffers)))
    return pack(outcome(work, arguments, named))
