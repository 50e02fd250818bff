"""Missions of a database that no service has to run for."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING, TypeVar

from app.commands.command import CommandError, check_database, id_with_prefix, noted

T = TypeVar("T")

if TYPE_CHECKING:
    from app.missions.live.mission import LiveMission
    from app.missions.service import MissionService
    from app.settings import Settings


def with_missions(
    settings: "Settings",
    run: "Callable[[MissionService], Awaitable[T]]",
    *,
    changing: str = "",
    mission: str = "",
) -> "T":
    """Run something with the missions of a database; nothing is started, the links stay closed.

    A command that is ``changing`` a mission is named by that for the audit log, which it goes into with its result.
    Raises CommandError where there is no database, DatabaseNotReadyError also where one that only reads would have to
    bring it up to date.
    """
    check_database(settings)
    from app.missions.errors import MissionError
    from app.missions.service import MissionService
    from app.storage.database import Database as Store
    from app.storage.upkeep.prepare import prepare_database

    async def use() -> "T":
        await prepare_database(settings.database_url, may_upgrade=settings.migrates_itself and bool(changing))
        store = Store(settings.database_url)
        closed = settings.model_copy(update={"imc": settings.imc.model_copy(update={"enabled": False})})
        service = MissionService(closed, store)
        try:
            done = await run(service)
        except (CommandError, MissionError) as error:
            if changing:
                await noted(settings, changing, mission, refused=str(error))
            raise
        finally:
            await service.shutdown()
            await store.close()
        if changing:
            await noted(settings, changing, mission)
        return done

    return asyncio.run(use())


async def resting_mission(service: "MissionService", begin: str) -> "LiveMission":
    """Return a mission that no service has. Raises CommandError."""
    from app.storage.processes import processes
    from app.storage.processes.membership import alive_beside

    mission = await meant_mission(service, begin)
    state = mission.header.state
    async with mission.database.reading() as session:
        owner = await processes.owner(session, mission.id)
        owned = owner is not None and await alive_beside(session, service.settings.database_url, [owner])
    if owned or state in ("running", "paused"):
        raise CommandError(f"the mission is {state} in a service that would not notice", "Name that service with --url")
    return mission


async def meant_mission(service: "MissionService", begin: str) -> "LiveMission":
    """Return the one mission whose id begins so. Raises CommandError."""
    from app.storage.upkeep.prepare import name_of

    named = {summary.id: summary.name for summary in await service.missions()}
    database = name_of(service.settings.database_url)
    return await service.get(id_with_prefix(begin, named, "missions", f"in database {database}"))
