from collections.abc import Iterator

import pytest

from app.main import Server
from app.missions.settings import ImcSettings
from app.settings import Settings
from bathyfleet.client import Client
from tests.support.api.rest import running_in_thread
from tests.support.storage.databases import Databases


@pytest.fixture(scope="session")
def server(databases: Databases) -> Iterator[Server]:
    """A service whose simulated vehicles are quick."""
    settings = Settings(port=0, database_url=databases.fresh(), imc=ImcSettings(enabled=False), time_scale=200.0)
    with running_in_thread(settings) as server:
        yield server


@pytest.fixture
def client(server: Server) -> Iterator[Client]:
    with Client(server.url) as client:
        yield client
