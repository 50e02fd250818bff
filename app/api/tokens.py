"""Access tokens: made once, shown once, kept as a hash."""

import hashlib
import secrets
import uuid
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path

from app.storage import private, tokens
from app.storage.at_once import AtOnce
from app.storage.database import Database
from app.storage.models import TokenRow
from app.storage.prepare import FIRST_TOKEN_FILE
from app.storage.sharing import Shared

TOKEN_PREFIX = "bf_"  # noqa: S105 - makes leaked tokens easy to search for


class Role(StrEnum):
    """What the holder of a token may do."""

    VIEWER = "viewer"
    """Look at everything."""
    VEHICLE = "vehicle"
    """Look, post measurements and fetch waypoints."""
    OPERATOR = "operator"
    """Everything that concerns missions."""
    ADMIN = "admin"
    """Everything."""


@dataclass(frozen=True)
class Principal:
    """Who asks. ``vehicle`` binds a token of role vehicle to one vehicle."""

    name: str
    role: Role
    vehicle: str | None = None


def token_hash(token: str) -> str:
    """Return what is stored of a token. Its 256 random bits need no slow hash."""
    return hashlib.sha256(token.encode()).hexdigest()


class TokenStore:
    """The tokens in the database."""

    def __init__(self, database: Database) -> None:
        self._database = database
        # Asked with every request: pages that ask for a new map at the same moment are answered by one query.
        self._any = Shared(self._any_stored)
        self._at_once = AtOnce(database)

    async def create(
        self, name: str, role: Role, *, vehicle: str | None = None, expires_at: datetime | None = None
    ) -> tuple[str, str]:
        """Store a new token; return its id and the token itself, which cannot be seen again."""
        token, row = _made(str(uuid.uuid4()), name, role, vehicle, expires_at)
        async with self._database.writing() as session:
            session.add(row)
        return row.id, token

    async def first_start(self, folder: Path) -> Path | None:
        """Make an operator's token where there never was a token; returns the file that it is in.

        For other users of this machine, and for programs that want one. The file is for its owner only.
        """
        token, row = _made(tokens.FIRST_START, "first start", Role.OPERATOR, None, None)
        async with self._database.writing() as session:
            if await tokens.all_tokens(session):
                return None
            file = folder / FIRST_TOKEN_FILE
            private.write(file, token + "\n")
            session.add(row)
        return file

    async def all(self) -> list[TokenRow]:
        """Return every token that was ever made, newest first."""
        async with self._database.reading() as session:
            return list(await tokens.all_tokens(session))

    async def any(self) -> bool:
        """Tell whether a token exists that was not revoked; then every request must carry one."""
        found = self._at_once.rows(tokens.ANY)
        return bool(found[0][0]) if found is not None else await self._any()

    async def _any_stored(self) -> bool:
        async with self._database.reading() as session:
            return await tokens.any_token(session)

    async def revoke(self, token_id: str) -> bool:
        """Revoke a token for good; False when no valid token has this id."""
        async with self._database.writing() as session:
            return await tokens.revoke(session, token_id, datetime.now(UTC))

    async def principal(self, token: str) -> Principal | None:
        """Return who holds ``token``; None when it is unknown, revoked or has run out."""
        values = {"hash": token_hash(token), "now": datetime.now(UTC)}
        found = await self._at_once(tokens.VALID, values)
        if not found:
            return None
        name, role, vehicle = found[0]
        return Principal(name, Role(role), vehicle)

    def close(self) -> None:
        """Let go of the database."""
        self._at_once.close()


def _made(
    token_id: str, name: str, role: Role, vehicle: str | None, expires_at: datetime | None
) -> tuple[str, TokenRow]:
    token = TOKEN_PREFIX + secrets.token_urlsafe(32)
    row = TokenRow(
        id=token_id,
        name=name,
        role=role.value,
        vehicle=vehicle,
        token_hash=token_hash(token),
        created_at=datetime.now(UTC),
        expires_at=expires_at,
        revoked_at=None,
    )
    return token, row
