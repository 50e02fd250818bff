"""Processes that this one has started since: others of the same worker's tests may live beside them."""

from collections.abc import Callable

import psutil


def new_children() -> Callable[[], list[psutil.Process]]:
    """Return what tells which of this process's children were started after this call, and live."""
    here = psutil.Process()
    before = set(here.children())

    def now() -> list[psutil.Process]:
        return [one for one in here.children() if one not in before and one.status() != psutil.STATUS_ZOMBIE]

    return now
