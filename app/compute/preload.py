"""For the cluster's workers: ``dask worker --preload app.compute.preload`` makes ready what heavy work takes.

Functions that are compiled when they are first used would make the first pieces of work late, and forecasts short.
"""

import asyncio
from importlib import import_module
from typing import Any

from app.compiled.cache import PARTS, compile_beside, keep_compiled, wait_for_compiling


async def dask_setup(_worker: Any) -> None:
    """Compile what is not compiled yet, or load it; the worker takes work when that is done."""
    keep_compiled()
    await asyncio.to_thread(_warm_up)


def _warm_up() -> None:
    compile_beside()
    wait_for_compiling()
    for part in PARTS.values():
        for name in part.modules:
            import_module(name).warm_up()
