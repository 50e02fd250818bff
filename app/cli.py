"""The command ``bathyfleet``. What a command needs is imported when it runs, so that ``--help`` answers at once."""

import asyncio
import gc
import json
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app import __version__
from app.commands.alarms import alarms_app
from app.commands.audit import audit
from app.commands.backup import backup, prune, restore
from app.commands.command import CommandError, Database, command_settings, missing_database, noted
from app.commands.data import adjust, export, import_file, report, tide
from app.commands.failsafes import failsafes
from app.commands.home import home
from app.commands.logs import import_logs
from app.commands.sites import sites_app
from app.commands.train import train

if TYPE_CHECKING:
    from app.missions.views.traffic import TrafficFinding
    from imc_bridge.doctor.doctor import Diagnosis

app = typer.Typer(
    name="bathyfleet",
    help="Maps an unknown sea floor with a fleet of AUVs.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
token_app = typer.Typer(help="Make, list and revoke access tokens.", no_args_is_help=True)
app.add_typer(token_app, name="token")
app.add_typer(sites_app, name="sites")
app.command()(export)
app.command()(report)
app.command("import")(import_file)
app.command("import-log")(import_logs)
app.command()(tide)
app.command()(adjust)
app.command()(train)
app.command()(failsafes)
app.add_typer(alarms_app, name="alarms")
app.command()(audit)
app.command()(backup)
app.command()(restore)
app.command()(prune)


DEMO_FOLDER = Path("bathyfleet-demo")

FAILURE = 1
USAGE = 2


class LogLevel(StrEnum):
    """How much is logged."""

    DEBUG = "debug"
    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


class LogFormat(StrEnum):
    """How it is written."""

    CONSOLE = "console"
    JSON = "json"


class TokenRole(StrEnum):
    """What the holder of a token may do: the roles of ``app.api.accounts.tokens``."""

    VIEWER = "viewer"
    VEHICLE = "vehicle"
    OPERATOR = "operator"
    ADMIN = "admin"


@app.callback(invoke_without_command=True)
def _root(
    version: Annotated[bool, typer.Option("--version", help="Show the version and exit.")] = False,
) -> None:
    if version:
        typer.echo(f"bathyfleet {__version__}")
        raise typer.Exit


@app.command()
def serve(
    host: Annotated[str | None, typer.Option(help="Address to listen on [default: 127.0.0.1]")] = None,
    port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="TCP port; 0: any free one [default: 8080]")
    ] = None,
    database: Database = None,
    insecure: Annotated[
        bool, typer.Option("--insecure", help="Serve other machines without access tokens: anyone may command.")
    ] = False,
    time_scale: Annotated[
        float | None, typer.Option(help="How much faster than wall time simulated vehicles live [default: 1]")
    ] = None,
    log_level: Annotated[LogLevel | None, typer.Option(help="How much is logged [default: info]")] = None,
    log_format: Annotated[LogFormat | None, typer.Option(help="How it is written [default: console]")] = None,
) -> None:
    """Run the service. Further settings: environment BATHYFLEET_* or bathyfleet.toml."""
    settings = command_settings(
        host=host,
        port=port,
        database_url=database,
        insecure=insecure or None,
        time_scale=time_scale,
        log_level=log_level and log_level.value,
        log_format=log_format and log_format.value,
    )
    from app.api import logs
    from app.compiled.cache import compile_beside
    from app.storage.upkeep.prepare import prepare_database

    compile_beside()
    logs.configure(settings.log_level, settings.log_format)
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


@app.command()
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

    from app.storage.upkeep import migrate as migrations
    from app.storage.upkeep.prepare import of_another_version

    async def run() -> tuple[str | None, str | None]:
        url = settings.database_url
        before = await migrations.current(url)
        if before is not None and not migrations.is_known(before):
            raise of_another_version(url, before, migrations.head())
        if down_to is None:
            await migrations.upgrade(url)
        elif await migrations.is_in_use(url):
            raise CommandError("a service has the database, and would lose its tables", "Stop the service first")
        else:
            await migrations.downgrade(url, down_to)
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


@token_app.command("create")
def create_token(
    name: Annotated[str, typer.Argument(help="Who will hold it, shown in logs.")],
    role: Annotated[TokenRole, typer.Option(help="What the holder may do.")] = TokenRole.OPERATOR,
    vehicle: Annotated[str | None, typer.Option(help="The one vehicle that a token of role vehicle is for.")] = None,
    days: Annotated[
        float | None, typer.Option(min=0, max=36_500, help="Days it is valid; default: until revoked.")
    ] = None,
    database: Database = None,
) -> None:
    """Make an access token. It is printed once and cannot be seen again; from now on every request needs one."""
    if vehicle is not None and role is not TokenRole.VEHICLE:
        raise typer.BadParameter("only a token of role vehicle is for one vehicle", param_hint="--vehicle")
    if not name.strip() or len(name) > 120:
        raise typer.BadParameter("the name has 1 to 120 characters", param_hint="NAME")
    from datetime import UTC, datetime, timedelta

    from pydantic import TypeAdapter, ValidationError

    from app.api.accounts.tokens import Role, TokenStore
    from app.missions.spec.base import Name

    try:
        TypeAdapter(Name | None).validate_python(vehicle)
    except ValidationError:
        raise typer.BadParameter(
            f"{vehicle!r} is no name of a vehicle: letters, digits, '.', '_' and '-', at most 64",
            param_hint="--vehicle",
        ) from None
    expires_at = None if days is None else datetime.now(UTC) + timedelta(days=days)

    async def run(store: TokenStore) -> tuple[str, str]:
        return await store.create(name, Role(role.value), vehicle=vehicle, expires_at=expires_at)

    bound = f", vehicle {vehicle}" if vehicle else ""
    token_id, token = _with_tokens(database, run, "token create", f"{name}, {role.value}{bound}")
    typer.echo(f"token {token_id} of role {role} for {name}; it is shown only now:", err=True)
    typer.echo(token)


@token_app.command("list")
def list_tokens(
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False, database: Database = None
) -> None:
    """List the access tokens, newest first."""
    from app.api.accounts.tokens import TokenStore

    async def run(store: TokenStore) -> list[dict[str, Any]]:
        return [
            {
                "id": row.id,
                "name": row.name,
                "role": row.role,
                "vehicle": row.vehicle,
                "created_at": row.created_at.isoformat(timespec="seconds"),
                "expires_at": row.expires_at and row.expires_at.isoformat(timespec="seconds"),
                "revoked_at": row.revoked_at and row.revoked_at.isoformat(timespec="seconds"),
            }
            for row in await store.all()
        ]

    rows = _with_tokens(database, run)
    if as_json:
        typer.echo(json.dumps(rows, indent=2))
        return
    if not rows:
        typer.echo("there are no tokens: only this machine may use the service")
        return
    from rich.console import Console
    from rich.table import Column, Table
    from rich.text import Text

    from imc_bridge.printable import printable

    # A narrow terminal gets more lines; a time or a role that is cut off would say nothing.
    others = [Column(name, overflow="fold") for name in ("name", "role", "vehicle", "made", "valid until", "revoked")]
    table = Table(Column("id", no_wrap=True), *others)
    for row in rows:
        table.add_row(*(Text(printable(str(value))) if value is not None else "–" for value in row.values()))
    Console().print(table)


@token_app.command("revoke")
def revoke_token(
    token_id: Annotated[str, typer.Argument(metavar="ID", help="Its id, or the begin of it.")],
    database: Database = None,
) -> None:
    """Revoke an access token for good."""
    from app.api.accounts.tokens import TokenStore

    async def run(store: TokenStore) -> str:
        found = [row.id for row in await store.all() if row.revoked_at is None and row.id.startswith(token_id)]
        if len(found) != 1:
            meaning = "several tokens have ids that begin" if found else "no valid token has an id that begins"
            raise typer.BadParameter(f"{meaning} with {token_id!r}; see bathyfleet token list", param_hint="ID")
        await store.revoke(found[0])
        return found[0]

    typer.echo(f"token {_with_tokens(database, run, 'token revoke', token_id)} is revoked")


@app.command()
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
        _show_diagnosis(diagnosis, ships)
    raise typer.Exit(0 if diagnosis.healthy else FAILURE)


def _show_diagnosis(diagnosis: "Diagnosis", ships: Sequence["TrafficFinding"] = ()) -> None:
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


@app.command()
def demo(
    speed: Annotated[
        float | None,
        typer.Option(
            min=0.1,
            max=200,
            help="How much faster than real time [default: 5, less on a slow or busy machine]",
            show_default=False,
        ),
    ] = None,
    terrain: Annotated[
        Path | None,
        typer.Option(
            exists=True,
            dir_okay=False,
            readable=True,
            help="Sea floor: .npz, .asc, GeoTIFF, .xyz or .csv [default: generated]",
        ),
    ] = None,
    vehicles: Annotated[int, typer.Option(min=1, max=20, help="Number of simulated AUVs.")] = 2,
    steps: Annotated[
        int | None, typer.Option(min=1, max=100_000, help="Steps of the mission [default: 60]", show_default=False)
    ] = None,
    minutes: Annotated[
        float | None, typer.Option(min=0.1, max=10_080, help="Instead of steps: minutes under way, of vehicle time.")
    ] = None,
    km: Annotated[
        float | None, typer.Option(min=0.01, max=1000, help="Instead of steps: kilometres that each vehicle flies.")
    ] = None,
    search: Annotated[
        str | None,
        typer.Option(
            metavar="SITE",
            help="Search a partly known site instead: harbour, car-park-1, car-park-2 or car-park-3, with boats.",
        ),
    ] = None,
    window: Annotated[
        float, typer.Option(min=30, max=86_400, help="Time for a search, seconds of vehicle time.")
    ] = 1800,
    keep_serving: Annotated[bool, typer.Option("--keep-serving", help="Go on serving after the mission.")] = False,
    port: Annotated[int, typer.Option(min=0, max=65535, help="TCP port of the service; 0: any free one.")] = 8080,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the sea floor and every random decision.")] = 0,
    output: Annotated[Path, typer.Option(file_okay=False, help="Folder for the files.")] = DEMO_FOLDER,
) -> None:
    """Try it without a vehicle: a whole mission with simulated AUVs that speak IMC, from start to map."""
    from app.compiled.cache import compile_beside

    compile_beside()
    from app.demo.service import DemoError
    from app.demo.survey import DemoOptions, run_demo

    lengths = {"--steps": steps, "--minutes": minutes, "--km": km}
    given = [option for option, value in lengths.items() if value is not None]
    if len(given) > 1:
        raise CommandError(f"{' and '.join(given)} are given", "a mission has one length: leave out all but one")
    if search is not None and given:
        raise CommandError(f"{given[0]}: a search is as long as its time window", "give --window in seconds")
    if search is not None:
        raise typer.Exit(_search_demo(search, vehicles, window, speed, seed, port, output, keep_serving=keep_serving))
    options = DemoOptions(
        vehicles=vehicles,
        steps=steps if given else 60,
        minutes=minutes,
        km=km,
        speed=_demo_speed(speed),
        terrain=terrain,
        seed=seed,
        port=port,
        keep_serving=keep_serving,
        output=output,
    )
    try:
        code = run_demo(options)
    except DemoError as error:
        raise CommandError(str(error)) from None
    raise typer.Exit(code)


def _demo_speed(asked: float | None) -> float:
    """Return how much faster than real time a demonstration runs: as asked for, or as this machine can."""
    from app.demo.pace import FASTEST, kept_speed

    speed = kept_speed() if asked is None else asked
    if asked is None and speed < FASTEST:
        typer.echo(f"This machine is slow or busy: vehicles live {speed:g} times as fast as the clock (--speed).")
    return speed


def _search_demo(
    site: str,
    vehicles: int,
    window_s: float,
    speed: float | None,
    seed: int,
    port: int,
    output: Path,
    *,
    keep_serving: bool,
) -> int:
    from app.demo.search import SearchDemoOptions, run_search_demo
    from app.demo.service import DemoError
    from app.missions.search.examples import SITES

    if site not in SITES:
        raise CommandError(f"--search: there is no {site!r}", f"choose one of {', '.join(SITES)}")
    options = SearchDemoOptions(site, vehicles, window_s, _demo_speed(speed), seed, port, keep_serving, output)
    try:
        return run_search_demo(options)
    except DemoError as error:
        raise CommandError(str(error)) from None


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


def _with_tokens(database: str | None, run: Any, changing: str = "", target: str = "") -> Any:
    settings = command_settings(database_url=database)
    new = missing_database(settings)
    from app.api.accounts.tokens import TokenStore
    from app.storage.database import Database as Store
    from app.storage.upkeep.prepare import prepare_database

    async def use() -> Any:
        await prepare_database(settings.database_url, may_upgrade=settings.migrates_itself)
        store = Store(settings.database_url)
        try:
            done = await run(TokenStore(store))
        except typer.BadParameter as error:
            await noted(settings, changing, target, refused=error.message)
            raise
        finally:
            await store.close()
        if changing:
            await noted(settings, changing, target)
        if new is not None:
            typer.echo(f"there was no database {new}, so a new one was made; --database names another", err=True)
        return done

    return asyncio.run(use())


def main() -> None:
    """Run the command line; expected errors are one line and an exit code: 2 for wrong usage, 1 for failure."""
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


def _exit_code(error: Exception) -> int | None:
    """Return the exit code of an error that is expected; None for a fault of the program."""
    from app.missions.errors import MissionError
    from app.settings import SettingsError, StartupError
    from app.storage.upkeep.prepare import DatabaseNotReadyError

    if isinstance(error, SettingsError):
        return USAGE
    expected = isinstance(error, CommandError | StartupError | DatabaseNotReadyError | MissionError)
    return FAILURE if expected else None
