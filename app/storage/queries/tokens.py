"""Queries on access tokens."""

from collections.abc import Sequence
from datetime import datetime

from sqlalchemy import Row, bindparam, or_, select, update
from sqlalchemy.ext.asyncio import AsyncSession

from app.storage.models import TokenRow

FIRST_START = "first-start"
"""Id of the token that the service makes by itself. Nobody decided that requests need one from now on."""

ANY = select(select(TokenRow.id).where(TokenRow.revoked_at.is_(None), TokenRow.id != FIRST_START).exists())
"""Whether there is a token that was made on purpose and not revoked."""


VALID = select(TokenRow.name, TokenRow.role, TokenRow.vehicle).where(
    TokenRow.token_hash == bindparam("hash"),
    TokenRow.revoked_at.is_(None),
    or_(TokenRow.expires_at.is_(None), TokenRow.expires_at > bindparam("now")),
)
"""Name, role and vehicle of the token with a ``hash``, unless it was revoked or has run out ``now``."""


async def all_valid(session: AsyncSession, now: datetime) -> Sequence[Row[str, str, str, str | None]]:
    """Return hash, name, role and vehicle of every token that was not revoked and has not run out."""
    query = select(TokenRow.token_hash, TokenRow.name, TokenRow.role, TokenRow.vehicle).where(
        TokenRow.revoked_at.is_(None), or_(TokenRow.expires_at.is_(None), TokenRow.expires_at > now)
    )
    return (await session.execute(query)).all()


async def any_token(session: AsyncSession) -> bool:
    """Tell whether a token exists that was not revoked, made on purpose; then requests must carry one."""
    return bool(await session.scalar(ANY))


async def all_tokens(session: AsyncSession) -> Sequence[TokenRow]:
    """Return every token, newest first."""
    return (await session.scalars(select(TokenRow).order_by(TokenRow.created_at.desc()))).all()


async def revoke(session: AsyncSession, token_id: str, now: datetime) -> bool:
    """Revoke a token; False when there is none to revoke."""
    found = await session.scalars(
        update(TokenRow)
        .where(TokenRow.id == token_id, TokenRow.revoked_at.is_(None))
        .values(revoked_at=now)
        .returning(TokenRow.id)
    )
    return found.first() is not None
