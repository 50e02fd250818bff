"""The threads in which missions compute."""

from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass

WORKERS = 2
"""How many there are of each kind."""


@dataclass(frozen=True)
class Threads:
    """Two kinds, so that no vehicle waits for what people asked for.

    Attributes
    ----------
    planning
        Decisions, and the maps that vehicles are led by.
    making
        Thorough maps, corrections of all soundings, files: what takes seconds, and minutes for large missions.
    """

    planning: Executor
    making: Executor

    def close(self) -> None:
        """End both, without what was not begun."""
        for executor in (self.planning, self.making):
            executor.shutdown(wait=True, cancel_futures=True)


def make_threads() -> Threads:
    """Return threads of both kinds, which are started as they are needed."""
    return Threads(
        ThreadPoolExecutor(WORKERS, thread_name_prefix="planning"),
        ThreadPoolExecutor(WORKERS, thread_name_prefix="making"),
    )
