from collections.abc import AsyncIterator, Callable

import pytest

from app.missions.service import MissionService
from app.missions.settings import ImcSettings, ServiceSettings
from app.storage.database import Database
from tests.imc_bridge.conftest import captures
from tests.missions.fleet import Harbour

__all__ = ["captures"]


@pytest.fixture
def make_settings(database_url: str) -> Callable[..., ServiceSettings]:
    def make(**changes: object) -> ServiceSettings:
        values = {
            "database_url": database_url,
            "imc": ImcSettings(enabled=False),
            "time_scale": 50.0,
        }
        return ServiceSettings.model_validate(values | changes)

    return make


@pytest.fixture
async def harbour(make_settings: Callable[..., ServiceSettings]) -> AsyncIterator[Harbour]:
    """A service that can be ended and started again on the same database."""
    harbour = Harbour(make_settings)
    await harbour.open()
    yield harbour
    await harbour.close()


@pytest.fixture
async def service(harbour: Harbour) -> MissionService:
    return harbour.service


@pytest.fixture
async def database(database_url: str) -> AsyncIterator[Database]:
    """The database beside the service."""
    database = Database(database_url)
    yield database
    await database.close()
