"""The command that brings a database's tables up to date, or back."""

import asyncio
from typing import Annotated

import typer

from app.commands.command import CommandError, Database, command_settings, noted, this_user


def migrate(
    database: Database = None,
    down_to: Annotated[
        str | None, typer.Option(help="Go back to this revision ('base': empty). What its tables held is lost.")
    ] = None,
) -> None:
    """Bring the database's tables up to date."""
    settings = command_settings(database_url=database)
    from alembic.util import CommandError as AlembicError
    from sqlalchemy.exc import SQLAlchemyError

    from app.storage.queries import audit
    from app.storage.upkeep import migrate as migrations
    from app.storage.upkeep.prepare import check_that_empty, of_another_version

    async def run() -> tuple[str | None, str | None]:
        url = settings.database_url
        before = await migrations.current(url)
        if before is None:
            await check_that_empty(url)
        elif not migrations.is_known(before):
            raise of_another_version(url, before, migrations.head())
        if down_to is None:
            await migrations.upgrade(url)
        elif await migrations.is_in_use(url):
            raise CommandError("a service has the database, and would lose its tables", "Stop the service first")
        else:
            target = f"{before or 'empty'} down to {down_to}"
            noted_before = audit.Command(this_user(), "", "command line", "migrate", target, "done")
            await migrations.downgrade(url, down_to, noted_before if before != down_to else None)
        return before, await migrations.current(url)

    try:
        before, after = asyncio.run(run())
    except (AlembicError, SQLAlchemyError, OSError) as error:
        reason = str(getattr(error, "orig", None) or error).partition("\n")[0]
        raise CommandError(f"the database cannot be migrated: {reason}") from None
    if before != after and down_to is None:
        asyncio.run(noted(settings, "migrate", f"{before or 'empty'} to {after}"))
    if before == after:
        typer.echo(f"the database is at revision {after or 'empty'} already")
    else:
        typer.echo(f"the database went from revision {before or 'empty'} to {after or 'empty'}")
