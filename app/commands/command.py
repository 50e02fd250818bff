"""What commands share. Heavy imports stay inside functions, so that ``--help`` answers at once."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

M = TypeVar("M", bound="BaseModel")

if TYPE_CHECKING:
    from pathlib import Path

    from pydantic import BaseModel

    from app.settings import Settings

FAILURE = 1
USAGE = 2
INTERRUPTED = 130
"""Exit codes: something failed, the command cannot be understood, or it was interrupted."""

SHORTEST_PREFIX = 4
"""Characters of an id's beginning, so that a slip of the finger means nobody else."""
MOST_SHOWN = 5
"""Of those that can be meant."""

Database = Annotated[
    str | None,
    typer.Option(help="Database URL: sqlite+aiosqlite:///FILE or postgresql+asyncpg://USER:PASSWORD@HOST/NAME"),
]


class CommandError(Exception):
    """A command failed for a reason that the user can do something about."""

    def __init__(self, message: str, remedy: str = "") -> None:
        super().__init__(message)
        self.remedy = remedy


def id_with_prefix(prefix: str, named: Mapping[str, str], what: str, where: str) -> str:
    """Return the one id that begins so, of those that are ``named``, newest first. Raises CommandError.

    ``what`` they are of, and ``where`` they are, is told to who has to choose.
    """
    from imc_bridge.printable import printable

    if prefix in named:
        return prefix
    if len(prefix) < SHORTEST_PREFIX:
        raise CommandError(
            f"{prefix!r} is too short for the beginning of an id", f"Give at least {SHORTEST_PREFIX} characters"
        )
    meant = [id_ for id_ in named if id_.startswith(prefix)]
    if len(meant) == 1:
        return meant[0]
    shown = [f"{id_} {printable(named[id_])}" for id_ in meant or named]
    more = f"; and {len(shown) - MOST_SHOWN} more" if len(shown) > MOST_SHOWN else ""
    candidates = "; ".join(shown[:MOST_SHOWN]) or "none"
    raise CommandError(
        f"{len(meant)} {what} have ids that begin with {prefix!r}", f"There are: {candidates}{more}, {where}"
    )


def command_settings(**overrides: Any) -> "Settings":
    """Read the settings, with the command line's options; only warnings are logged."""
    from app.api import logs
    from app.settings import load_settings

    settings = load_settings(**overrides)
    logs.configure("warning", settings.log_format)
    return settings


def missing_database(settings: "Settings") -> "Path | None":
    """Return the file of an SQLite database where there is none yet."""
    from app.storage.upkeep.prepare import file_of

    file = file_of(settings.database_url)
    return file.resolve() if file is not None and not file.exists() else None


def check_database(settings: "Settings") -> None:
    """Raise CommandError where there is no database: who only looks into one would be shown a new, empty one."""
    missing = missing_database(settings)
    if missing is not None:
        raise CommandError(f"there is no database {missing}", "Name it with --database")


def this_user() -> str:
    """Return the user who gives a command on this machine."""
    import getpass
    import os

    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return f"user {os.getuid()}"


@contextmanager
def audit_failure_told(result: str = "done") -> Iterator[None]:
    """Say in a line that a command is not in the audit log, where that cannot be written, and go on: it was given."""
    import sqlite3

    from sqlalchemy.exc import SQLAlchemyError

    from app.storage.upkeep.prepare import DatabaseNotReadyError
    from imc_bridge.printable import printable

    try:
        yield
    except (DatabaseNotReadyError, SQLAlchemyError, sqlite3.Error, OSError) as error:
        reason = str(getattr(error, "orig", None) or error).partition("\n")[0]
        typer.echo(printable(f"it is {result}, but not in the audit log: {reason}"), err=True)


async def noted(
    settings: "Settings", action: str, target: str, mission_id: str | None = None, *, refused: str | None = None
) -> None:
    """Write a command that was given on this machine into the audit log; ``refused`` is why it was not carried out.

    Where that fails it is said: the command's own result is told all the same.
    """
    with audit_failure_told("done" if refused is None else "refused"):
        await _note(settings, action, target, mission_id, refused)


async def _note(settings: "Settings", action: str, target: str, mission_id: str | None, refused: str | None) -> None:
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


def checked(model: "type[M]", values: dict[str, Any]) -> "M":
    """Return the values as a model; what is wrong is named by its option."""
    from pydantic import ValidationError

    try:
        return model.model_validate(values)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        field = ".".join(str(part) for part in first["loc"])
        raise CommandError(f"{field} is {first['input']!r}: {first['msg'].removeprefix('Value error, ')}") from None
