"""Commands about alarms: what there is, and whether whoever is to be told can be reached."""

import asyncio
from typing import TYPE_CHECKING, Annotated

import typer

from app.commands.command import CommandError, command_settings, this_user

if TYPE_CHECKING:
    from app.missions.alarm_settings import AlarmSettings

alarms_app = typer.Typer(help="See what raises alarms, and try who is told.", no_args_is_help=True)


@alarms_app.command()
def kinds() -> None:
    """Print the table of alarms: how grave each is, when it is raised, and what to do."""
    from app.missions.alarm_kinds import alarms_text

    typer.echo(alarms_text(), nl=False)


@alarms_app.command("test")
def try_out(
    to: Annotated[
        list[str] | None, typer.Argument(metavar="[RECIPIENT]...", help="Names in the settings; none: everybody.")
    ] = None,
) -> None:
    """Send a test to recipients of the settings from this machine, once, and say what came of it.

    No service is needed, and nothing is stored.
    """
    settings = command_settings().alarms
    known = list(settings.recipients)
    unknown = [name for name in to or () if name not in known]
    if unknown:
        raise CommandError(f"there is no recipient {unknown[0]!r}", f"there are: {', '.join(known) or 'none'}")
    if not known:
        raise CommandError("nobody is told of alarms", "describe recipients in the settings: see docs/alarms.md")
    if not asyncio.run(_told(settings, to or known)):
        raise typer.Exit(1)


async def _told(settings: "AlarmSettings", names: list[str]) -> bool:
    """Send a test to each; tell whether all arrived."""
    from app.missions.alarm_kinds import AlarmKind
    from app.missions.alarms.channels import Channels, DeliveryError
    from app.missions.alarms.message import Message
    from app.missions.alarms.raised import alarm_view, make_alarm
    from app.missions.alarms.routes import delivery_id
    from app.missions.clock import now
    from app.missions.views.alarms import Notice

    alarm = alarm_view(make_alarm(AlarmKind.TEST, None, f"this is a test, asked for by {this_user()}", now()))
    channels, arrived = Channels(settings), True
    try:
        for name in names:
            message = Message(delivery_id(alarm.id, name, Notice.RAISED), Notice.RAISED, alarm, "")
            try:
                await channels.send(name, message, now())
            except DeliveryError as error:
                arrived = False
                typer.echo(f"{name}: failed: {error}")
            else:
                typer.echo(f"{name}: delivered")
    finally:
        await channels.close()
    return arrived
