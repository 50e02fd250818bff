"""``bathyfleet missions``: what an operator needs of a running service where there is no browser."""

import json
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.commands.command import FAILURE, CommandError, command_settings
from app.commands.running_service import RunningService, own_token, own_url

if TYPE_CHECKING:
    from app.missions.views.mission import MissionSummary

missions_app = typer.Typer(
    help="List the missions of a running service, pause them, change their length and end them.", no_args_is_help=True
)

Url = Annotated[str | None, typer.Option(help="A running service.", show_default="the one of this machine's settings")]
Token = Annotated[
    str | None,
    typer.Option(
        envvar="BATHYFLEET_TOKEN",
        help="Access token.",
        show_default="that of its first start, where this user may read it",
    ),
]
Mission = Annotated[
    str, typer.Argument(metavar="MISSION", help="Its id, or the begin of it.", show_default="the only one under way")
]
Note = Annotated[str, typer.Option(help="Kept in the mission's log beside the action.")]
Home = Annotated[
    bool | None,
    typer.Option(
        "--return/--stop",
        help="Send the vehicles home first, or stop them where they are.",
        show_default="abort stops them, finish does as the mission says",
    ),
]


@missions_app.command("list")
def list_missions(
    states: Annotated[
        list[str] | None, typer.Option("--state", help="Only missions in this state, as often as needed.")
    ] = None,
    limit: Annotated[int | None, typer.Option(min=1, help="Most missions.", show_default="all")] = None,
    before: Annotated[str, typer.Option(help="Only missions older than this: its id, or the beginning of it.")] = "",
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, as GET /api/v1/missions answers.")] = False,
    url: Url = None,
    token: Token = None,
) -> None:
    """List the missions, newest first, with their state and what is left of them."""
    from app.missions.states import MissionState
    from app.missions.views.mission import MissionSummary
    from imc_bridge.printable import printable

    wanted = states or list(MissionState)
    for state in wanted:
        if state not in list(MissionState):
            raise typer.BadParameter(f"{state!r} is not one of {', '.join(MissionState)}", param_hint="--state")
    with _service(url, token) as service:
        found = [one for one in service.missions(before) if one["state"] in wanted][:limit]
    if as_json:
        typer.echo(json.dumps(found, indent=2))
        return
    if not found:
        where = f" that are {' or '.join(states)}" if states else "; POST /api/v1/missions describes one"
        typer.echo(f"there are no missions{where}")
    for one in map(MissionSummary.model_validate, found):
        told = f"{one.state}, {one.reason}" if one.reason else str(one.state)
        typer.echo(f"{one.id}  {printable(one.name)}: {printable(told)}{_left(one)}")


@missions_app.command()
def pause(mission: Mission = "", note: Note = "", url: Url = None, token: Token = None) -> None:
    """Stop a mission's vehicles until it is resumed."""
    _act("pause", mission, {"note": note}, url, token, lambda one: one.state == "running")


@missions_app.command()
def resume(mission: Mission = "", note: Note = "", url: Url = None, token: Token = None) -> None:
    """Go on with a paused mission."""
    _act("resume", mission, {"note": note}, url, token, lambda one: one.state == "paused")


@missions_app.command()
def finish(mission: Mission = "", home: Home = None, note: Note = "", url: Url = None, token: Token = None) -> None:
    """End a mission early; its vehicles go home where it says so."""
    _act("finish", mission, {"note": note, "return": home}, url, token, _is_under_way)


@missions_app.command()
def abort(mission: Mission = "", home: Home = None, note: Note = "", url: Url = None, token: Token = None) -> None:
    """Stop every vehicle of a mission now and end it.

    Exit code 1 when a vehicle has not acknowledged the stop.
    """
    _act("abort", mission, {"note": note, "return": home}, url, token, _is_under_way)


@missions_app.command()
def budget(
    mission: Mission = "",
    minutes: Annotated[float | None, typer.Option(help="Minutes in which each vehicle surveys.")] = None,
    km_per_vehicle: Annotated[float | None, typer.Option(help="Kilometres that each vehicle flies.")] = None,
    steps: Annotated[int | None, typer.Option(help="Legs that each vehicle flies.")] = None,
    url: Url = None,
    token: Token = None,
) -> None:
    """Make a mission longer or shorter; the length counts from its beginning, and what is flown is part of it."""
    from app.missions.views.mission import MissionView
    from imc_bridge.printable import printable

    given = {"minutes": minutes, "km_per_vehicle": km_per_vehicle, "steps": steps}
    asked = {name: value for name, value in given.items() if value is not None}
    if len(asked) != 1:
        raise CommandError(
            f"{len(asked)} lengths are given", "Give exactly one of --minutes, --km-per-vehicle and --steps"
        )
    with _service(url, token) as service:
        meant = mission or _only_one(service, "budget", _is_under_way)
        done = MissionView.model_validate(service.ask(meant, "PUT", "budget", json=asked))
    typer.echo(f"{done.id}  {printable(done.name)}: {done.progress.budget.words}{_left(done)}")


def _service(url: str | None, token: str | None) -> RunningService:
    settings = command_settings()
    if url is not None:
        return RunningService(url, token)
    return RunningService(
        own_url(settings), token or own_token(settings), settings.tls_certificate, on_this_machine=True
    )


def _left(mission: "MissionSummary") -> str:
    if not _is_under_way(mission) or mission.progress.minutes_left is None:
        return ""
    return f", {mission.progress.minutes_left:.0f} min left"


def _is_under_way(mission: "MissionSummary") -> bool:
    return mission.state in ("running", "paused")


def _only_one(service: RunningService, action: str, meant: "Callable[[MissionSummary], bool]") -> str:
    """Return the id of the only mission that an action can be meant for. Raises CommandError."""
    from app.missions.views.mission import MissionSummary

    every = map(MissionSummary.model_validate, service.missions())
    fitting = [one for one in every if meant(one)]
    if len(fitting) != 1:
        there = "; ".join(f"{one.id} {one.name} ({one.state})" for one in fitting)
        raise CommandError(f"{len(fitting)} missions can be meant by {action}", f"Name one of {there}" if there else "")
    return fitting[0].id


def _act(
    action: str,
    begin: str,
    asked: dict[str, Any],
    url: str | None,
    token: str | None,
    meant: "Callable[[MissionSummary], bool]",
) -> None:
    """Ask for an action and tell which vehicles acknowledged what it stopped; ``meant`` are missions it can be for."""
    from app.missions.views.mission import ActionView
    from imc_bridge.printable import printable

    with _service(url, token) as service:
        begin = begin or _only_one(service, action, meant)
        done: ActionView = ActionView.model_validate(service.ask(begin, "POST", action, json=asked))
    typer.echo(f"{done.mission.id}  {printable(done.mission.name)}: {done.mission.state}")
    for stop in done.stops:
        words = "acknowledged the stop" if stop.acknowledged else "has NOT acknowledged the stop"
        typer.echo(printable(f"{stop.vehicle} {words}{f': {stop.detail}' if stop.detail else ''}"))
    if not all(stop.acknowledged for stop in done.stops):
        raise typer.Exit(FAILURE)
