"""The command that says what it hears of vehicles and ships, and what is missing."""

import asyncio
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.commands.command import FAILURE, CommandError, command_settings

if TYPE_CHECKING:
    from app.missions.views.traffic import TrafficFinding
    from imc_bridge.doctor.doctor import Diagnosis


def doctor(
    seconds: Annotated[float, typer.Option(min=0.1, max=3600, help="How long to listen.")] = 15.0,
    replay: Annotated[
        Path | None,
        typer.Option(
            exists=True, dir_okay=False, readable=True, help="Judge a recorded session (.jsonl or .jsonl.gz) instead."
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Listen for IMC vehicles, and ships by AIS, and say what is missing. Nothing is commanded.

    Exit code 1 when something is wrong.
    """
    settings = command_settings()
    from app.missions.fleet.links.imc import bridge_settings
    from app.missions.traffic.watch import Traffic
    from app.missions.views.doctor import doctor_view
    from app.missions.views.traffic import traffic_findings
    from imc_bridge.doctor.doctor import Diagnosis, diagnose, diagnose_recording
    from imc_bridge.doctor.replay import RecordingError

    bridge = bridge_settings(settings.imc, settings.time_scale)
    ships: list[TrafficFinding] = []

    async def run() -> Diagnosis:
        traffic = Traffic(settings.ais)
        await traffic.start()
        try:
            diagnosis = await diagnose(bridge, seconds)
            ships.extend(traffic_findings(traffic))
            return diagnosis
        finally:
            await traffic.close()

    try:
        if replay is not None:
            diagnosis = diagnose_recording(str(replay), bridge)
        elif as_json:
            diagnosis = asyncio.run(run())
        else:
            from rich.console import Console

            with Console(stderr=True).status(f"Listening for {seconds:g} s …"):
                diagnosis = asyncio.run(run())
    except RecordingError as error:
        raise CommandError(str(error)) from None
    except ValueError as error:
        raise CommandError(str(error), "See docs/settings.md") from None
    except OSError as error:
        raise CommandError(
            f"cannot listen on UDP port {settings.imc.port}: {error.strerror or error}",
            "Stop the service first, or ask it: GET /api/v1/doctor",
        ) from None
    if as_json:
        typer.echo(doctor_view(diagnosis, ships).model_dump_json(indent=2))
    else:
        show_diagnosis(diagnosis, ships)
    raise typer.Exit(0 if diagnosis.healthy else FAILURE)


def show_diagnosis(diagnosis: "Diagnosis", ships: Sequence["TrafficFinding"] = ()) -> None:
    """Print what was found, for people: a table, and how each vehicle's link went."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from imc_bridge.doctor.doctor import Severity
    from imc_bridge.printable import printable

    def plain(words: str) -> Text:
        """Return words that strangers on the network may have sent, as they can do no harm."""
        return Text(printable(words))

    marks = {Severity.OK: ("ok", "green"), Severity.NOTE: ("note", "yellow"), Severity.PROBLEM: ("problem", "bold red")}
    table = Table(
        "", "", "finding", "what to do", title=f"IMC, listened for {diagnosis.seconds:g} s", title_style="bold"
    )
    groups = [("this service", diagnosis.own), *((f"{n.name} ({n.imc_id:#06x})", n.findings) for n in diagnosis.nodes)]
    for name, findings in groups:
        for index, finding in enumerate(findings):
            words, style = marks[finding.severity]
            table.add_row("" if index else plain(name), Text(words, style), plain(finding.text), plain(finding.remedy))
        table.add_section()
    for index, ship in enumerate(ships):
        words, style = marks[ship.severity]
        table.add_row("" if index else "ships", Text(words, style), plain(ship.text), plain(ship.remedy))
    Console().print(table)
    for node in diagnosis.nodes:
        if len(node.history) > 1:
            Console().print(Text(f"\n{printable(node.name)}'s link:", style="bold"))
        for change in node.history if len(node.history) > 1 else ():
            at = datetime.fromtimestamp(change.at_s, UTC)
            words = f"{change.state.value}: {change.reason}" if change.reason else change.state.value
            Console().print(plain(f"  {at:%H:%M:%S}Z {words}"))
