"""Work in a thread that nothing waits for when the process ends."""

import asyncio
import contextvars
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

T = TypeVar("T")


async def on_own_thread(work: Callable[..., T], *arguments: Any) -> T:
    """Do what may hang, as calls to another machine do, and return what comes of it.

    As ``asyncio.to_thread``, but in a thread of its own: a cancelled caller leaves it behind, and neither the event
    loop nor the process waits for it to end. So it must be work that may be broken off at any moment, as by a kill.
    """
    done: Future[T] = Future()
    done.set_running_or_notify_cancel()  # nobody's cancellation ends a thread
    context = contextvars.copy_context()

    def do() -> None:
        try:
            result = context.run(work, *arguments)
        except BaseException as error:
            done.set_exception(error)
        else:
            done.set_result(result)

    threading.Thread(target=do, name=f"own {getattr(work, '__name__', 'work')}", daemon=True).start()
    return await asyncio.wrap_future(done)
