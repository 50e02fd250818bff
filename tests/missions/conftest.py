import shutil
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import pytest

from app.missions.service import MissionService
from app.missions.settings import ImcSettings, ServiceSettings
from app.storage import migrate
from app.storage.database import Database
from tests.imc_bridge.conftest import captures
from tests.missions.fleet import Harbour

__all__ = ["captures"]


@pytest.fixture(scope="session")
def empty_database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An SQLite file with every table and no row."""
    path = tmp_path_factory.mktemp("database") / "empty.db"
    migrate.upgrade_now(f"sqlite+aiosqlite:///{path}")
    return path


@pytest.fixture
def database_path(tmp_path: Path, empty_database: Path) -> Path:
    path = tmp_path / "fleet.db"
    shutil.copy(empty_database, path)
    return path


@pytest.fixture
def make_settings(database_path: Path) -> Callable[..., ServiceSettings]:
    def make(**changes: object) -> ServiceSettings:
        values = {
            "database_url": f"sqlite+aiosqlite:///{database_path}",
            "imc": ImcSettings(enabled=False),
            "time_scale": 50.0,
        }
        return ServiceSettings.model_validate(values | changes)

    return make


@pytest.fixture
async def harbour(make_settings: Callable[..., ServiceSettings]) -> AsyncIterator[Harbour]:
    """A service that can be ended and started again on the same file."""
    harbour = Harbour(make_settings)
    await harbour.open()
    yield harbour
    await harbour.close()


@pytest.fixture
async def service(harbour: Harbour) -> MissionService:
    return harbour.service


@pytest.fixture
async def database(database_path: Path) -> AsyncIterator[Database]:
    """The file beside the service."""
    database = Database(f"sqlite+aiosqlite:///{database_path}")
    yield database
    await database.close()
