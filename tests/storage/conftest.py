from collections.abc import AsyncIterator

import pytest

from app.storage.database import Database
from tests.support.storage.databases import KINDS, Databases


@pytest.fixture(params=KINDS)
def empty_url(request: pytest.FixtureRequest, databases: Databases) -> str:
    """An empty database of either kind."""
    return databases.empty(request.param)


@pytest.fixture
def url(either_url: str) -> str:
    """A database of either kind with every table and no row."""
    return either_url


@pytest.fixture
async def database(url: str) -> AsyncIterator[Database]:
    database = Database(url)
    yield database
    await database.close()


@pytest.fixture
async def sqlite(databases: Databases) -> AsyncIterator[Database]:
    """A migrated SQLite file, where a statement is about SQLite only."""
    database = Database(databases.fresh("sqlite"))
    yield database
    await database.close()
