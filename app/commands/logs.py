"""``bathyfleet import-log``: what vehicles wrote down themselves."""

import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.commands.command import CommandError, Database, checked, command_settings
from app.commands.data import Token, Url
from app.commands.running_service import RunningService
from app.commands.stored_missions import meant_mission, with_missions

if TYPE_CHECKING:
    from app.missions.service import MissionService
    from app.missions.views.measurements.soundings import LogImportView

ASK_EVERY_S = 0.5
"""How often a service is asked how far reading a log is."""

Show = Callable[[int, int], None]
"""Told how many bytes of a file are done, and how many it has."""


def import_logs(
    mission: Annotated[str, typer.Argument(metavar="MISSION", help="Its id, or the begin of it.")],
    logs: Annotated[
        list[Path],
        typer.Argument(
            metavar="LOG...", help="DUNE logs: Data.lsf or Data.lsf.gz; a multibeam's own files: .gsf or .kmall."
        ),
    ],
    vehicle: Annotated[
        str | None, typer.Option(help="Name of the vehicle.", show_default="the one that the log announces")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    database: Database = None,
    url: Url = None,
    token: Token = None,
) -> None:
    """Take the soundings of vehicles' own logs into a mission. Begun again after a crash, nothing is stored twice."""
    from rich.console import Console
    from rich.progress import BarColumn, DownloadColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

    from app.missions.views.measurements.soundings import LogImportView

    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), DownloadColumn(), TimeRemainingColumn())
    views: list[LogImportView] = []

    def shown(path: Path) -> Show:
        task = bar.add_task(path.name, total=None)

        def show(done: int, total: int, task: TaskID = task) -> None:
            bar.update(task, completed=done, total=total)

        return show

    try:
        with Progress(*columns, console=console, disable=not console.is_terminal) as bar:
            if url is not None:
                with RunningService(url, token) as service:
                    for path in logs:
                        views.append(_sent(service, mission, path, vehicle, shown(path)))  # noqa: PERF401 - one by one
            else:
                _stored(mission, logs, vehicle, database, views, shown)
    finally:
        # The result of one log is shown even when the next one cannot be read.
        if as_json:
            typer.echo(json.dumps([view.model_dump() for view in views], indent=2))
        else:
            from imc_bridge.printable import printable

            typer.echo("\n".join(printable(line) for view in views for line in _import_lines(view)), nl=bool(views))


def _stored(
    mission: str,
    logs: list[Path],
    vehicle: str | None,
    database: Database,
    views: "list[LogImportView]",
    shown: Callable[[Path], Show],
) -> None:
    """Import logs into a mission of a database; ``views`` is filled with what came of each."""
    import getpass

    from app.missions.operations.imports.log_import import import_log

    async def run(service: "MissionService") -> None:
        live = await meant_mission(service, mission)
        actor = f"{getpass.getuser()} at the console"
        for path in logs:
            progress = shown(path)
            views.append(
                await import_log(live, service.settings, path, vehicle=vehicle, actor=actor, progress=progress)
            )

    with_missions(command_settings(database_url=database), run, changing="import-log", mission=mission)


def _sent(service: RunningService, mission: str, path: Path, vehicle: str | None, show: Show) -> "LogImportView":
    """Send a log to a running service and wait until it is read. Raises CommandError."""
    from app.missions.views.measurements.imports import LogOptions, LogState, LogView

    options = checked(LogOptions, {"filename": path.name, "vehicle": vehicle})
    try:
        with path.open("rb") as content:
            asked = options.model_dump(exclude_none=True)
            log = LogView.model_validate(service.ask(mission, "POST", "logs", content=content, params=asked))
    except OSError as error:
        raise CommandError(f"log: {path} cannot be read: {error.strerror}", "give a file that can be") from None
    while log.state in (LogState.WAITING, LogState.READING):
        show(log.read_bytes or 0, log.size_bytes or 0)
        time.sleep(ASK_EVERY_S)
        log = LogView.model_validate(service.ask(mission, "GET", f"logs/{log.id}"))
    if log.state is LogState.TAKEN_BACK:
        raise CommandError(f"{log.file} was taken back by {log.taken_back_by}", "send it again to have it after all")
    if log.result is None:
        raise CommandError(f"{log.file}: {log.problem}", log.remedy)
    show(log.size_bytes or 0, log.size_bytes or 0)
    return log.result


def _import_lines(view: "LogImportView") -> Iterator[str]:
    yield (
        f"{view.file}: {view.vehicle}, {view.soundings} soundings accepted, {view.rejected} rejected, "
        f"{view.duplicate} there before"
        + (
            f", {view.pings} pings accepted, {view.pings_rejected} rejected, {view.pings_duplicate} there before"
            if view.pings or view.pings_rejected or view.pings_duplicate
            else ""
        )
        + (" (imported before, nothing new)" if view.known else "")
    )
    for reason, count in sorted(view.reasons.items(), key=lambda item: -item[1]):
        yield f"  {count} rejected: {reason}"
    for reason, count in sorted(view.refused.items(), key=lambda item: -item[1]):
        yield f"  {count} refused: {reason}"
    for note in view.notes:
        yield f"  {note}"
    for reason, count in view.unreadable.items():
        yield f"  {count} packets unreadable: {reason}"
    if view.skipped_bytes:
        yield f"  {view.skipped_bytes} bytes skipped that are no packet"
    if view.cut_off:
        yield "  the file ends in the middle; what came before is used"
