from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack, asynccontextmanager

import pytest

from app.missions.alarm_settings import AlarmSettings
from app.storage.database import Database
from tests.support.missions.alarms import Clock, Watch, end_of_process, open_watch, with_mission


@pytest.fixture
def clock() -> Clock:
    return Clock()


@asynccontextmanager
async def _watches(url: str, clock: Clock) -> AsyncIterator[Callable[[AlarmSettings], Awaitable[Watch]]]:
    async with AsyncExitStack() as stack:
        database = Database(url)
        stack.push_async_callback(database.close)
        await with_mission(database)

        async def keep(settings: AlarmSettings) -> Watch:
            watch = await open_watch(database, settings, clock)
            stack.push_async_callback(end_of_process, watch)
            return watch

        yield keep


@pytest.fixture
async def keep_watch(database_url: str, clock: Clock) -> AsyncIterator[Callable[[AlarmSettings], Awaitable[Watch]]]:
    """Opens desks of further processes on one database."""
    async with _watches(database_url, clock) as keep:
        yield keep


@pytest.fixture
async def keep_watch_on_either(
    either_url: str, clock: Clock
) -> AsyncIterator[Callable[[AlarmSettings], Awaitable[Watch]]]:
    """The same on SQLite's and on PostgreSQL's."""
    async with _watches(either_url, clock) as keep:
        yield keep
