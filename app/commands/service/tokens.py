"""Commands about access tokens: they are made, listed and revoked."""

import asyncio
import json
from typing import Annotated, Any

import typer

from app.api.accounts.roles import Role
from app.commands.command import Database, command_settings, missing_database, noted

token_app = typer.Typer(help="Make, list and revoke access tokens.", no_args_is_help=True)


@token_app.command("create")
def create_token(
    name: Annotated[str, typer.Argument(help="Who will hold it, shown in logs.")],
    role: Annotated[Role, typer.Option(help="What the holder may do.")] = Role.OPERATOR,
    vehicle: Annotated[str | None, typer.Option(help="The one vehicle that a token of role vehicle is for.")] = None,
    days: Annotated[
        float | None, typer.Option(min=0, max=36_500, help="Days it is valid; default: until revoked.")
    ] = None,
    database: Database = None,
) -> None:
    """Make an access token. It is printed once and cannot be seen again; from now on every request needs one."""
    if vehicle is not None and role is not Role.VEHICLE:
        raise typer.BadParameter("only a token of role vehicle is for one vehicle", param_hint="--vehicle")
    if not name.strip() or len(name) > 120:
        raise typer.BadParameter("the name has 1 to 120 characters", param_hint="NAME")
    from datetime import UTC, datetime, timedelta

    from pydantic import TypeAdapter, ValidationError

    from app.api.accounts.tokens import TokenStore
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
        return await store.create(name, role, vehicle=vehicle, expires_at=expires_at)

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


def _with_tokens(database: str | None, run: Any, changing: str = "", target: str = "") -> Any:
    settings = command_settings(database_url=database)
    new = missing_database(settings)
    from app.api.accounts.tokens import TokenStore
    from app.storage.database import Database as Store
    from app.storage.upkeep.prepare import prepare_database

    async def use() -> Any:
        writes = bool(changing) or new is not None
        await prepare_database(settings.database_url, may_upgrade=settings.migrates_itself and writes)
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
