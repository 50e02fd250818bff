"""The command ``bathyfleet``. What a command needs is imported when it runs, so that ``--help`` answers at once."""

import sys
from typing import Annotated

import typer

from app import __version__
from app.commands.alarms import alarms_app
from app.commands.command import FAILURE, INTERRUPTED, USAGE, CommandError
from app.commands.data import adjust, export, import_file, report, tide
from app.commands.demo import demo
from app.commands.failsafes import failsafes
from app.commands.home import home
from app.commands.logs import import_logs
from app.commands.missions import missions_app
from app.commands.patch_test import patch_test
from app.commands.service.audit import audit
from app.commands.service.backup import backup, prune, restore
from app.commands.service.doctor import doctor
from app.commands.service.health import health
from app.commands.service.migrate import migrate
from app.commands.service.serve import serve
from app.commands.service.tokens import token_app
from app.commands.sites import sites_app
from app.commands.train import train

app = typer.Typer(
    name="bathyfleet",
    help="Maps an unknown sea floor with a fleet of AUVs.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.add_typer(token_app, name="token")
app.add_typer(sites_app, name="sites")
app.add_typer(missions_app, name="missions")
app.command()(export)
app.command()(report)
app.command("import")(import_file)
app.command("import-log")(import_logs)
app.command()(tide)
app.command()(adjust)
app.command("patch-test")(patch_test)
app.command()(train)
app.command()(failsafes)
app.add_typer(alarms_app, name="alarms")
app.command()(audit)
app.command()(backup)
app.command()(restore)
app.command()(prune)
app.command()(serve)
app.command()(migrate)
app.command()(doctor)
app.command()(health)
app.command()(demo)


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Show the version and exit.")] = False,
) -> None:
    # What is still kept back is written before typer ends the command: it says nothing where nobody reads any more.
    context.call_on_close(sys.stdout.flush)
    if version:
        typer.echo(f"bathyfleet {__version__}")
        raise typer.Exit


def evaluations() -> typer.Typer:
    """Return what ``evaluate`` offers: planners against each other, and missions of the whole service."""
    from app.evaluation.cli import evaluate_app

    if all(command.callback is not home for command in evaluate_app.registered_commands):
        evaluate_app.command()(home)
    return evaluate_app


@app.command(
    "evaluate",
    context_settings={"allow_extra_args": True, "ignore_unknown_options": True, "allow_interspersed_args": False},
    add_help_option=False,
)
def evaluate(context: typer.Context) -> None:
    """Compare planners in closed loop, without a network. See bathyfleet evaluate --help."""
    # Mounted by hand: its options are made from the planners, which take a second to load.
    evaluations()(args=context.args, prog_name="bathyfleet evaluate")


def main() -> None:
    """Run the command line; expected errors are one line and an exit code: 2 for wrong usage, 1 for failure.

    It is 130 after an interrupt, and 1 without a word when whoever reads the output has gone.
    """
    from app.compiled.cache import VARIABLE, keep_compiled
    from app.storage.private import for_owner_only

    try:
        if keep_compiled() is not None:
            typer.echo(
                "warning: no folder for compiled functions can be written, so each start compiles for about a minute. "
                f"Set {VARIABLE} to a folder that this user may write to",
                err=True,
            )
        # What a command writes is its user's: maps, logs, copies, also of the programs that it starts.
        with for_owner_only():
            app()
    except Exception as error:
        if _is_interrupt(error):
            sys.exit(INTERRUPTED)
        code = _exit_code(error)
        if code is None:
            raise
        field = getattr(error, "field", "")
        lines = getattr(error, "problems", None) or [f"{field}: {error}" if field else str(error)]
        remedy = getattr(error, "remedy", "")
        from imc_bridge.printable import printable

        for line in lines:
            said = f"error: {line}" + (f". {remedy}" if remedy else "")
            typer.echo(printable(said, keep="\n"), err=True)
        sys.exit(code)


def _is_interrupt(error: BaseException | None) -> bool:
    """Tell whether an error came of an interrupt, which compiled code turns into others."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _exit_code(error: Exception) -> int | None:
    """Return the exit code of an error that is expected; None for a fault of the program."""
    from app.missions.errors import MissionError
    from app.settings import SettingsError, StartupError
    from app.storage.ping_files import PingFileError
    from app.storage.upkeep.prepare import DatabaseNotReadyError

    if isinstance(error, SettingsError):
        return USAGE
    expected = isinstance(error, CommandError | StartupError | DatabaseNotReadyError | MissionError | PingFileError)
    return FAILURE if expected else None
