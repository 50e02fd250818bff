"""Live messages of one mission to everyone who watches it."""

import asyncio
from collections import deque
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager

from app.missions.views.messages import AlarmMessage, EventMessage, LiveMessage, WaypointsMessage

MAX_BACKLOG = 5000
"""A watcher that is this far behind is cut off; it reconnects and gets a fresh snapshot."""


class WatchEndedError(Exception):
    """A watcher gets no more: it was too slow, or the mission went to another process. It may ask again."""


class Subscription:
    """What one watcher has yet to receive: every event, alarm and waypoint change, of all else only the newest."""

    def __init__(self) -> None:
        self._all: deque[LiveMessage] = deque()
        self._newest: dict[str, LiveMessage] = {}
        self._wake = asyncio.Event()
        self._end = ""

    def put(self, message: LiveMessage) -> None:
        """Queue a message."""
        if isinstance(message, AlarmMessage | EventMessage | WaypointsMessage):
            if len(self._all) >= MAX_BACKLOG:
                self.end(f"more than {MAX_BACKLOG} messages were not taken in time")
            else:
                self._all.append(message)
        else:
            self._newest[message.type] = message
        self._wake.set()

    def end(self, why: str) -> None:
        """Let nothing more come."""
        self._end = why
        self._wake.set()

    async def __aiter__(self) -> AsyncIterator[LiveMessage]:
        """Yield messages as they come. Raises WatchEndedError."""
        while True:
            await self._wake.wait()
            self._wake.clear()
            if self._end:
                raise WatchEndedError(self._end)
            while self._all:
                yield self._all.popleft()
            newest, self._newest = self._newest, {}
            for message in newest.values():
                yield message


class Broadcaster:
    """Hands every message to every subscription; never waits for any of them."""

    def __init__(self) -> None:
        self._subscriptions: set[Subscription] = set()

    @property
    def watched(self) -> bool:
        """Whether anyone listens."""
        return bool(self._subscriptions)

    @property
    def viewers(self) -> int:
        """How many listen."""
        return len(self._subscriptions)

    def publish(self, message: LiveMessage) -> None:
        """Hand out a message."""
        for subscription in self._subscriptions:
            subscription.put(message)

    def end(self, why: str) -> None:
        """End every subscription."""
        for subscription in self._subscriptions:
            subscription.end(why)

    @contextmanager
    def subscribe(self) -> Iterator[Subscription]:
        """Receive everything published from now on."""
        subscription = Subscription()
        self._subscriptions.add(subscription)
        try:
            yield subscription
        finally:
            self._subscriptions.discard(subscription)
