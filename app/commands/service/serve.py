"""The command that runs the service."""

import asyncio
import gc
from typing import TYPE_CHECKING, Annotated

import structlog
import typer

from app.commands.command import Database, command_settings
from app.log_choices import LogFormat, LogLevel

if TYPE_CHECKING:
    from app.settings import Settings

log = structlog.get_logger(__name__)


def serve(
    host: Annotated[str | None, typer.Option(help="Address to listen on.", show_default="127.0.0.1")] = None,
    port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="TCP port; 0: any free one.", show_default="8080")
    ] = None,
    database: Database = None,
    insecure: Annotated[
        bool, typer.Option("--insecure", help="Serve other machines without access tokens: anyone may command.")
    ] = False,
    time_scale: Annotated[
        float | None, typer.Option(help="How much faster than wall time simulated vehicles live.", show_default="1")
    ] = None,
    log_level: Annotated[LogLevel | None, typer.Option(help="How much is logged.", show_default="info")] = None,
    log_format: Annotated[LogFormat | None, typer.Option(help="How it is written.", show_default="console")] = None,
    check: Annotated[
        bool,
        typer.Option("--check", help="Only read the settings and files that they name, and say what is wrong."),
    ] = False,
) -> None:
    """Run the service. Further settings: environment BATHYFLEET_* or bathyfleet.toml."""
    settings = command_settings(
        host=host,
        port=port,
        database_url=database,
        insecure=insecure or None,
        time_scale=time_scale,
        log_level=log_level,
        log_format=log_format,
    )
    if check:
        _check_files(settings)
        typer.echo("the settings can be used")
        return
    from app.api import logs
    from app.compiled.cache import compile_beside
    from app.settings import overridden
    from app.storage.upkeep.prepare import prepare_database

    compile_beside()
    logs.configure(settings.log_level, settings.log_format)
    for setting, variable in overridden().items():
        log.warning("an environment variable overrules the settings file", setting=setting, variable=variable)
    for line in _open_passwords(settings):
        log.warning(line)
    # Before the rest is loaded, which takes seconds: most starts that fail do so here.
    asyncio.run(prepare_database(settings.database_url, may_upgrade=settings.migrates_itself))
    # What is imported stays: looking for garbage in it takes a fifth of a start, and later keeps requests waiting.
    gc.disable()
    from app.main import Server, serve

    gc.freeze()
    gc.enable()

    def started(server: Server) -> None:
        token = f" An operator token for others is in {server.first_token}." if server.first_token is not None else ""
        typer.echo(
            f"bathyfleet answers at {server.url} (API: {server.url}/api/docs).{token} Ctrl-C stops it.", err=True
        )

    asyncio.run(serve(settings, started=started, with_first_token=True))


def _check_files(settings: "Settings") -> None:
    """Warn of certificates that are not valid now. Raises SettingsError where a file cannot be used."""
    from app.named_files import certificates_out_of_time, unusable_files
    from app.settings import SettingsError

    problems = list(unusable_files(settings))
    if problems:
        raise SettingsError(problems)
    for line in (*certificates_out_of_time(settings), *_open_passwords(settings)):
        typer.echo(f"warning: {line}", err=True)


def _open_passwords(settings: "Settings") -> list[str]:
    """Return a line for each password that is sent unprotected."""
    broker = settings.alarms.mqtt
    if not broker.sends_password_openly:
        return []
    return [
        f"alarms.mqtt.password is sent to {broker.host} unprotected, for everyone on that network to read: "
        "set alarms.mqtt.tls to true, with the broker's port for TLS, often 8883"
    ]
