"""Waiting for a condition instead of for a time."""

import asyncio
from collections.abc import Awaitable, Callable

import pytest

PATIENCE_S = 240.0
"""A condition is waited for this long; only on a machine that is very busy it comes near that."""


async def until(condition: Callable[[], object], what: str, patience_s: float = PATIENCE_S) -> None:
    """Wait for a condition, a function or a coroutine function; fail by its name when it does not come."""
    try:
        async with asyncio.timeout(patience_s):
            while True:
                holds = condition()
                if await holds if isinstance(holds, Awaitable) else holds:
                    return
                await asyncio.sleep(0.01)
    except TimeoutError:
        pytest.fail(f"waited {patience_s:g} s in vain until {what}")
