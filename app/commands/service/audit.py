"""``bathyfleet audit``: who commanded what."""

import asyncio
import csv
import json
import sys
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.commands.command import Database, check_database, command_settings

if TYPE_CHECKING:
    from app.storage.models import AuditRow

FIELDS = ("id", "time", "actor", "role", "origin", "action", "target", "mission_id", "result", "status", "detail")
PAGE = 1000


def audit(
    days: Annotated[
        float | None, typer.Option(min=0, max=36_500, help="Only the last so many days.", show_default="all")
    ] = None,
    actor: Annotated[str | None, typer.Option(help="Only commands of the token of this name.")] = None,
    mission: Annotated[str | None, typer.Option(help="Only commands to the mission of this id.")] = None,
    limit: Annotated[
        int | None, typer.Option(min=1, help="Most entries.", show_default="50; all with --format")
    ] = None,
    form: Annotated[
        str, typer.Option("--format", "-f", help="table, csv, or json: an object per line, to keep or to search.")
    ] = "table",
    database: Database = None,
) -> None:
    """List or export who commanded what, from where, and what came of it; newest first."""
    if form not in ("table", "csv", "json"):
        raise typer.BadParameter(f"{form!r} is not one of table, csv, json", param_hint="--format")
    settings = command_settings(database_url=database)
    check_database(settings)
    from app.storage.database import Database as Store
    from app.storage.queries import audit as stored
    from app.storage.upkeep.prepare import prepare_database

    most = limit or (50 if form == "table" else sys.maxsize)

    async def run() -> list["AuditRow"]:
        await prepare_database(settings.database_url, may_upgrade=False)
        store = Store(settings.database_url)
        rows: list[AuditRow] = []
        try:
            async with store.reading() as session:
                while len(rows) < most:
                    page = await stored.newest(
                        session,
                        limit=min(PAGE, most - len(rows)),
                        before=rows[-1].id if rows else None,
                        days=days,
                        actor=actor,
                        mission_id=mission,
                    )
                    rows += page
                    if len(page) < PAGE:
                        break
        finally:
            await store.close()
        return rows

    entries = [_plain(row) for row in asyncio.run(run())]
    if form == "json":
        for entry in entries:
            typer.echo(json.dumps(entry))
    elif form == "csv":
        from app.csv_cells import text_cell

        writer = csv.DictWriter(sys.stdout, FIELDS)
        writer.writeheader()
        writer.writerows({name: text_cell(value) for name, value in entry.items()} for entry in entries)
    else:
        _show(entries)


def _plain(row: "AuditRow") -> dict[str, Any]:
    return {
        name: value.isoformat(timespec="milliseconds") if name == "time" else value
        for name in FIELDS
        for value in [getattr(row, name)]
    }


def _show(entries: list[dict[str, Any]]) -> None:
    from rich.console import Console
    from rich.table import Column, Table
    from rich.text import Text

    from imc_bridge.printable import printable

    # A narrow terminal gets more lines: nothing of who did what is cut off, and no time.
    others = [Column(name, overflow="fold") for name in ("who", "from", "what", "result", "why")]
    table = Table(Column("time", no_wrap=True), *others)
    for entry in entries:
        who = f"{entry['actor'] or 'nobody known'} ({entry['role'] or '–'})"
        what = f"{entry['action']} {entry['target']}"
        result = entry["result"] if entry["status"] is None else f"{entry['result']} ({entry['status']})"
        shown = (entry["time"][:19] + "Z", who, entry["origin"], what, result, entry["detail"])
        table.add_row(*(Text(printable(text)) for text in shown))
    Console().print(table)
