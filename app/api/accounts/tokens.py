"""Access tokens: made once, shown once, kept as a hash."""

import asyncio
import hashlib
import secrets
import uuid
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from app.api.accounts.roles import Role
from app.storage import private
from app.storage.concurrency.single_flight import Shared
from app.storage.database import Database
from app.storage.fast_read import AtOnce
from app.storage.models import TokenRow
from app.storage.queries import tokens
from app.storage.upkeep.prepare import FIRST_TOKEN_FILE

TOKEN_PREFIX = "bf_"  # noqa: S105 - makes leaked tokens easy to search for
DIGESTS_READ_AGAIN_S = 0.1
"""However many guesses come, the tokens are not read again sooner."""


@dataclass(frozen=True)
class Principal:
    """Who asks. ``vehicle`` binds a token of role vehicle to one vehicle."""

    name: str
    role: Role
    vehicle: str | None = None

    @property
    def identity(self) -> str:
        """The same for every token of this name, role and vehicle, and for no other."""
        return "\0".join((self.role, self.name, self.vehicle or ""))


LOCAL_OPERATOR = Principal("local operator", Role.ADMIN)
"""The user of this machine who runs the service, while nobody has made a token."""


def token_hash(token: str) -> str:
    """Return what is stored of a token. Its 256 random bits need no slow hash."""
    return hashlib.sha256(token.encode(errors="surrogateescape")).hexdigest()


class TokenStore:
    """The tokens in the database."""

    def __init__(self, database: Database) -> None:
        self._database = database
        # Asked with every request: pages that ask for a new map at the same moment are answered by one query.
        self._any = Shared(self._any_stored)
        self._at_once = AtOnce(database)
        self._digests: dict[str, Principal] = {}
        self._digests_read_s = -DIGESTS_READ_AGAIN_S
        self._read_again = Shared(self._read_in_turn)

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
        digest = token_hash(token)
        found = await self._at_once(tokens.VALID, {"hash": digest, "now": datetime.now(UTC)})
        if not found:
            self._digests.pop(digest, None)
            return None
        return _principal(*found[0])

    async def exists(self, token: str) -> bool:
        """Tell whether a token may be valid, at a cost that has a bound however many are asked for.

        For those who would else be refused unseen. What is revoked meanwhile may still be said to exist;
        :meth:`principal` has the last word. A token that is not known yet waits for the tokens to be read again.
        """
        digest = token_hash(token)
        if digest not in self._digests:
            self._digests = await self._read_again()
        return digest in self._digests

    def known(self, token: str) -> Principal | None:
        """Return who holds a token as far as that is known without asking the database, for counting only."""
        return self._digests.get(token_hash(token))

    async def _read_in_turn(self) -> dict[str, Principal]:
        loop = asyncio.get_running_loop()
        await asyncio.sleep(max(self._digests_read_s + DIGESTS_READ_AGAIN_S - loop.time(), 0.0))
        self._digests_read_s = loop.time()
        return await self._read_digests()

    async def _read_digests(self) -> dict[str, Principal]:
        async with self._database.reading() as session:
            valid = await tokens.all_valid(session, datetime.now(UTC))
        return {digest: _principal(name, role, vehicle) for digest, name, role, vehicle in valid}

    def close(self) -> None:
        """Let go of the database."""
        self._at_once.close()


def _principal(name: str, role: str, vehicle: str | None) -> Principal:
    return Principal(name, Role(role), vehicle)


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
