"""Fake DUNE vehicles in a thread of their own, for tests that have no event loop."""

import asyncio
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from simulator.dune import DuneFleet
from simulator.dune.node import FakeDune


class Afloat:
    """A fleet that lives in another thread: what is done to it is done there."""

    def __init__(self, fleet: DuneFleet, loop: asyncio.AbstractEventLoop) -> None:
        self._fleet = fleet
        self._loop = loop

    def do(self, vehicle: str, what: Callable[[FakeDune], object]) -> None:
        """Have something happen to a vehicle, and wait until it has."""
        node = next(node for node in self._fleet.nodes if node.name == vehicle)

        async def happen() -> None:
            what(node)

        asyncio.run_coroutine_threadsafe(happen(), self._loop).result(30)

    def vanish(self, vehicle: str) -> None:
        """Let a vehicle's DUNE be heard no more."""

        def stop(node: FakeDune) -> None:
            self._fleet.nodes.remove(node)
            node.stop()

        self.do(vehicle, stop)


@contextmanager
def afloat(make: Callable[[], DuneFleet]) -> Iterator[Afloat]:
    """Run a fleet; ``make`` is called in its thread."""
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever)
    thread.start()

    async def start() -> DuneFleet:
        fleet = make()
        await fleet.start()
        return fleet

    try:
        fleet = asyncio.run_coroutine_threadsafe(start(), loop).result(60)
        try:
            yield Afloat(fleet, loop)
        finally:
            asyncio.run_coroutine_threadsafe(fleet.stop(), loop).result(60)
    finally:
        loop.call_soon_threadsafe(loop.stop)
        thread.join(30)
        loop.close()
