"""Answers that take long, made as long as a client waits for them."""

import asyncio
from collections.abc import Coroutine
from typing import Any, TypeVar

from fastapi import Request, Response

LOOK_S = 0.2
"""How often it is looked whether a client still waits."""

CLIENT_LEFT = 499
"""Only the log sees it."""

T = TypeVar("T")


async def while_connected(request: Request, work: Coroutine[Any, Any, T]) -> T | Response:
    """Return what ``work`` does, and end it when the client leaves: nobody would read the answer."""
    task = asyncio.ensure_future(work)
    try:
        while not task.done():
            if await request.is_disconnected():
                return Response(status_code=CLIENT_LEFT)
            await asyncio.wait([task], timeout=LOOK_S)
        return task.result()
    finally:
        task.cancel()
