"""What commands share. Heavy imports stay inside functions, so that ``--help`` answers at once."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

T = TypeVar("T")
M = TypeVar("M", bound="BaseModel")

if TYPE_CHECKING:
    from pydantic import BaseModel

    from app.missions.live.mission import LiveMission
    from app.missions.service import MissionService
    from app.settings import Settings

Database = Annotated[
    str | None,
    typer.Option(help="Database URL: sqlite+aiosqlite:///FILE or postgresql+asyncpg://USER:PASSWORD@HOST/NAME"),
]


class CommandError(Exception):
    """A command failed for a reason that the user can do something about."""

    def __init__(self, message: str, remedy: str = "") -> None:
        super().__init__(message)
        self.remedy = remedy


def command_settings(**overrides: Any) -> "Settings":
    """Read the settings, with the command line's options; only warnings are logged."""
    from app.api import logs
    from app.settings import load_settings

    settings = load_settings(**overrides)
    logs.configure("warning", settings.log_format)
    return settings


def this_user() -> str:
    """Return the user who gives a command on this machine."""
    import getpass
    import os

    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return f"user {os.getuid()}"


async def noted(
    settings: "Settings", action: str, target: str, mission_id: str | None = None, *, refused: str | None = None
) -> None:
    """Write a command that was given on this machine into the audit log; ``refused`` is why it was not carried out."""
    from app.storage.database import Database as Store
    from app.storage.queries import audit
    from app.storage.upkeep.prepare import prepare_database

    await prepare_database(settings.database_url, may_upgrade=settings.migrates_itself)
    store = Store(settings.database_url)
    result = "done" if refused is None else "refused"
    try:
        async with store.writing() as session:
            audit.add(
                session,
                audit.Command(this_user(), "", "command line", action, target, result, refused or "", mission_id),
            )
    finally:
        await store.close()


def with_missions(
    settings: "Settings",
    run: "Callable[[MissionService], Awaitable[T]]",
    *,
    changing: str = "",
    mission: str = "",
) -> "T":
    """Run something with the missions of a database; nothing is started, the links stay closed.

    A command that is ``changing`` a mission is named by that for the audit log, which it goes into with its result.
    """
    from app.missions.errors import MissionError
    from app.missions.service import MissionService
    from app.storage.database import Database as Store
    from app.storage.upkeep.prepare import prepare_database

    async def use() -> "T":
        await prepare_database(settings.database_url, may_upgrade=settings.migrates_itself)
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
    """Return a mission that no service is running. Raises CommandError."""
    mission = await meant_mission(service, begin)
    state = mission.header.state
    if state in ("running", "paused"):
        raise CommandError(f"the mission is {state} in a service that would not notice", "Name that service with --url")
    return mission


def checked(model: "type[M]", values: dict[str, Any]) -> "M":
    """Return the values as a model; what is wrong is named by its option."""
    from pydantic import ValidationError

    try:
        return model.model_validate(values)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        field = ".".join(str(part) for part in first["loc"])
        raise CommandError(f"{field} is {first['input']!r}: {first['msg'].removeprefix('Value error, ')}") from None


def ask_service(url: str, token: str | None, begin: str, method: str, path: str, **content: Any) -> Any:
    """Send something for the one mission whose id begins so to a running service; returns its answer."""
    import httpx

    headers = {} if token is None else {"Authorization": f"Bearer {token}"}
    try:
        with httpx.Client(base_url=url.rstrip("/") + "/api/v1", headers=headers, timeout=300.0) as client:
            listed = client.get("/missions")
            meant = [m["id"] for m in _answer(listed) if m["id"].startswith(begin)]
            if len(meant) != 1:
                raise CommandError(f"{len(meant)} missions have ids that begin with {begin!r}")
            return _answer(client.request(method, f"/missions/{meant[0]}/{path}", **content))
    except (httpx.HTTPError, httpx.InvalidURL) as error:
        raise CommandError(f"{url} does not answer: {error}", "Is the service running there?") from None


def _answer(response: Any) -> Any:
    """Return a service's answer. Raises CommandError with what it refused."""
    try:
        said = response.json()
    except ValueError:
        raise CommandError(f"{response.url} answers, but not as bathyfleet does") from None
    if response.is_success:
        return said
    faults = "; ".join(f"{fault['field']}: {fault['message']}" for fault in said.get("errors", []))
    raise CommandError(faults or said.get("detail", "the service refused it"), said.get("remedy", ""))


async def meant_mission(service: "MissionService", begin: str) -> "LiveMission":
    """Return the one mission whose id begins so. Raises CommandError."""
    every = await service.missions()
    meant = [summary.id for summary in every if summary.id.startswith(begin)]
    if len(meant) != 1:
        ids = "; ".join(f"{summary.id} {summary.name}" for summary in every[:5]) or "none"
        raise CommandError(f"{len(meant)} missions have ids that begin with {begin!r}", f"There are: {ids}")
    return await service.get(meant[0])
