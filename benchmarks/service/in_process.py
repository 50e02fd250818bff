"""The service's missions in this process, without HTTP and without vehicles."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

from app.missions.service import MissionService
from app.missions.settings import ImcSettings, ServiceSettings
from app.storage.database import Database
from app.storage.upkeep.prepare import prepare_database


@asynccontextmanager
async def missions_in(folder: Path) -> AsyncIterator[MissionService]:
    """Open the missions of a database of their own in a folder."""
    settings = ServiceSettings(
        database_url=f"sqlite+aiosqlite:///{folder / 'fleet.db'}", imc=ImcSettings(enabled=False)
    )
    await prepare_database(settings.database_url, may_upgrade=True)
    database = Database(settings.database_url)
    service = MissionService(settings, database)
    await service.startup()
    try:
        yield service
    finally:
        await service.shutdown()
        await database.close()
