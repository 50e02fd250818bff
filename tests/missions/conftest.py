import asyncio
from collections.abc import AsyncIterator, Callable
from typing import Any

import pytest

from app.missions import clock
from app.missions.clock import now
from app.missions.service import MissionService
from app.missions.settings import ImcSettings, ServiceSettings
from app.storage.database import Database
from simulator.event_loop import BEGIN_S, SimulatedTimeLoop
from tests.support.missions.harbour import Harbour
from tests.support.neptus.gateway import COLS, ROWS, Gateway
from tests.support.ports import free_ports


def pytest_asyncio_loop_factories(item: pytest.Item) -> dict[str, Callable[[], asyncio.AbstractEventLoop]]:
    """Run tests that use ``simulated_time`` on a loop of that kind, all others on the usual one."""
    simulated = "simulated_time" in getattr(item, "fixturenames", ())
    return {"simulated": SimulatedTimeLoop} if simulated else {"real": asyncio.SelectorEventLoop}


@pytest.fixture
async def simulated_time() -> AsyncIterator[None]:
    """A time that goes on as soon as nobody has anything left to do: missions come out the same on busy machines.

    While a thread works, a planner's as well, no time passes.
    """
    loop, began = asyncio.get_running_loop(), now().timestamp()
    with clock.told_by(lambda: began + loop.time() - BEGIN_S):
        yield


@pytest.fixture
def make_settings(database_url: str) -> Callable[..., ServiceSettings]:
    def make(**changes: Any) -> ServiceSettings:
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
async def harbour_closed(make_settings: Callable[..., ServiceSettings]) -> AsyncIterator[Harbour]:
    """A service that was not started yet."""
    harbour = Harbour(make_settings)
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


@pytest.fixture
def make_gateway(make_settings: Callable[..., ServiceSettings]) -> Callable[..., Gateway]:
    """A service with the gateway for Neptus' panel, not open yet."""

    def make(**changes: Any) -> Gateway:
        ports = free_ports(2)
        values = {
            "enabled": True,
            "ftp_port": ports[0],
            "http_port": ports[1],
            "centre_lat_deg": 41.1855,
            "centre_lon_deg": -8.7045,
            "rows": ROWS,
            "cols": COLS,
            "planner": "random",
            "max_step_m": 8.0,
        }
        return Gateway(make_settings(neptus=values | changes, time_scale=1.0), ports)

    return make


@pytest.fixture
async def gateway(make_gateway: Callable[..., Gateway]) -> AsyncIterator[Gateway]:
    gateway = make_gateway()
    await gateway.open()
    yield gateway
    await gateway.close()
