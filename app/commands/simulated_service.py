"""A whole service with simulated vehicles, in a simulated time of its own: as fast as the machine allows."""

import asyncio
import tempfile
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from app.missions.service import MissionService
    from app.missions.settings import SimulationSettings

Came = TypeVar("Came")

START_S = 1.7e9
"""Unix time at which it begins."""

MAP_PAUSE_S = 20.0
"""How long no map is begun after one, of the vehicles' time: as slowly do maps of a leg's soundings change."""


def served(sea: "SimulationSettings", time_scale: float, work: "Callable[[MissionService], Awaitable[Came]]") -> Came:
    """Return what comes of work with a service whose time goes on only when nobody has anything left to do.

    ``time_scale``: how many seconds its vehicles live in one of its own, both simulated.
    """
    from app.missions import clock
    from simulator.event_loop import BEGIN_S, SimulatedTimeLoop

    with asyncio.Runner(loop_factory=SimulatedTimeLoop) as runner:
        loop = runner.get_loop()
        with clock.told_by(lambda: START_S + loop.time() - BEGIN_S):
            return runner.run(_served(sea, time_scale, work))


async def _served(
    sea: "SimulationSettings", time_scale: float, work: "Callable[[MissionService], Awaitable[Came]]"
) -> Came:
    from app.compute.settings import ComputeSettings
    from app.missions.service import MissionService
    from app.missions.settings import ImcSettings, ServiceSettings
    from app.storage.database import Database
    from app.storage.upkeep.prepare import prepare_database

    with tempfile.TemporaryDirectory() as folder:
        url = f"sqlite+aiosqlite:///{Path(folder) / 'mission.db'}"
        await prepare_database(url, may_upgrade=True)
        database = Database(url)
        settings = ServiceSettings(
            database_url=url,
            imc=ImcSettings(enabled=False),
            time_scale=time_scale,
            simulation=sea,
            compute=ComputeSettings(map_pause_s=MAP_PAUSE_S / time_scale),
        )
        service = MissionService(settings, database)
        await service.startup()
        try:
            return await work(service)
        finally:
            await service.shutdown()
            await database.close()
