"""``bathyfleet backup``, ``restore`` and ``prune``: copies of the database, and room in it."""

import asyncio
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.commands.command import CommandError, Database, audit_failure_told, check_database, command_settings, noted

if TYPE_CHECKING:
    from app.storage.upkeep.backup import Contents


def backup(
    file: Annotated[
        Path | None,
        typer.Argument(help="File to write, or a folder to write one with date and time into.", show_default="backups"),
    ] = None,
    verify: Annotated[
        Path | None,
        typer.Option(exists=True, dir_okay=False, readable=True, help="Only check this backup; nothing is written."),
    ] = None,
    database: Database = None,
) -> None:
    """Copy the database to a file while the service goes on writing, and check the copy."""
    from app.storage.ping_files import PingFiles
    from app.storage.upkeep.backup import BackupError, back_up, contents_of, files_beside
    from app.storage.upkeep.prepare import is_up_to_date

    if verify is not None and file is not None:
        raise typer.BadParameter("check a backup or write one, not both", param_hint="--verify")
    settings = command_settings(database_url=database)
    files = PingFiles.beside(settings.database_url, settings.pings_url)
    try:
        if verify is not None:
            contents = contents_of(verify, files)
            _tell(verify, contents, "is sound")
            if contents.ping_files_elsewhere:
                typer.echo(
                    f"{contents.ping_files_elsewhere} of its files of pings are in {files.where('')} only: "
                    f"copy them to {files_beside(verify).where('')}, or it cannot be restored once they are lost",
                    err=True,
                )
            return
        path, contents = back_up(settings.database_url, file or Path("backups"), files)
    except BackupError as error:
        raise CommandError(str(error), error.remedy) from None
    _tell(path, contents, "is written and checked")
    # In the database, not in the copy: a copy of everything is worth an audit entry, though not an upgrade.
    with audit_failure_told():
        if asyncio.run(is_up_to_date(settings.database_url)):
            asyncio.run(noted(settings, "backup", str(path)))
        else:
            typer.echo("the database is another version's: it stays as it is, the copy is in no audit log", err=True)


def restore(
    file: Annotated[Path, typer.Argument(exists=True, dir_okay=False, readable=True, help="The backup.")],
    replace: Annotated[
        bool, typer.Option("--replace", help="Where there is a database: move it aside, beside the restored one.")
    ] = False,
    database: Database = None,
) -> None:
    """Put a backup in the database's place, after checking it. Stop the service first."""
    from app.storage.ping_files import PingFiles
    from app.storage.upkeep.backup import BackupError, restore_to
    from app.storage.upkeep.prepare import is_up_to_date

    settings = command_settings(database_url=database)
    try:
        files = PingFiles.beside(settings.database_url, settings.pings_url)
        contents, aside = restore_to(settings.database_url, file, replace=replace, pings=files)
    except BackupError as error:
        raise CommandError(str(error), error.remedy) from None
    if aside is not None:
        typer.echo(f"what was there before is now {aside}")
    _tell(file, contents, "is restored")
    with audit_failure_told():
        if settings.migrates_itself or asyncio.run(is_up_to_date(settings.database_url)):
            asyncio.run(noted(settings, "restore", str(file)))
        else:
            typer.echo("it is of an older version: before the service starts, run 'bathyfleet migrate'", err=True)


def prune(
    days: Annotated[int, typer.Option(min=1, max=36_500, help="Missions that ended longer ago than this go.")],
    apply: Annotated[bool, typer.Option("--apply", help="Remove them; without it they are only listed.")] = False,
    database: Database = None,
) -> None:
    """Remove missions that ended long ago, with everything measured in them, and give the space back."""
    settings = command_settings(database_url=database)
    check_database(settings)
    from app.storage.database import Database as Store
    from app.storage.ping_files import PingFiles, PingPlaceError
    from app.storage.upkeep import retention
    from app.storage.upkeep.prepare import prepare_database

    files = PingFiles.beside(settings.database_url, settings.pings_url)

    async def run() -> tuple[list[retention.Ended], int, str]:
        await prepare_database(settings.database_url, may_upgrade=settings.migrates_itself and apply)
        store = Store(settings.database_url)
        try:
            await retention.finish_removing(store, files)
            found = await retention.ended_before(store, days)
            if not apply:
                return found, len(await retention.unlisted_files(store, files)), ""
            removed = []
            for mission in found:
                try:
                    gone = await retention.remove(store, mission.id, days, files)
                except PingPlaceError:  # it is gone, its files are not
                    await noted(settings, "prune", f"{mission.name}, but its files of pings stay", mission.id)
                    raise
                if gone:
                    removed.append(mission)
                    await noted(settings, "prune", f"{mission.name}, ended {mission.ended:%Y-%m-%d}", mission.id)
            unlisted = len(await retention.unlisted_files(store, files))
            return removed, unlisted, await retention.give_space_back(settings.database_url)
        finally:
            await store.close()

    from imc_bridge.printable import printable

    try:
        missions, unlisted, note = asyncio.run(run())
    except PingPlaceError as error:
        raise CommandError(
            str(error), "Is pings_url right? Run it again when that place answers: it says which files no mission has"
        ) from None
    for mission in missions:
        typer.echo(
            f"{mission.id}  ended {mission.ended:%Y-%m-%d}  {mission.soundings} soundings  {printable(mission.name)}"
        )
    number = f"{len(missions)} mission{'' if len(missions) == 1 else 's'}"
    if not apply:
        hint = "; --apply removes them: bathyfleet export and bathyfleet backup keep them" if missions else ""
        typer.echo(f"{number} ended more than {days} days ago{hint}")
    else:
        typer.echo(f"{number} removed{f'; {note}' if note else ''}")
    if unlisted:
        typer.echo(
            f"{unlisted} files of pings in {files.where('')} are of no mission of this database and stay: "
            "another database's, or left by a kill"
        )


def _tell(file: Path, contents: "Contents", what: str) -> None:
    counts = ", ".join(f"{count} {table}" for table, count in contents.rows.items() if count)
    known = f": revision {contents.revision}, {counts or 'no rows'}" if contents.revision else ""
    pings = f", and {contents.ping_files} files of pings" if contents.ping_files else ""
    typer.echo(f"{file} {what} ({contents.size_bytes} bytes){known}{pings}")
