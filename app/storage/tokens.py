"""Queries on access tokens."""

from collections.abc import Sequence
from datetime import datetime

from sqlalchemy import func, select, update
from sqlalchemy.ext.asyncio import AsyncSession

from app.storage.models import TokenRow

FIRST_START = "first-start"
"""Id of the token that the service makes by itself. Nobody decided that requests need one from now on."""


async def by_hash(session: AsyncSession, token_hash: str) -> TokenRow | None:
    """Return the token with this hash, revoked or not."""
    return (await session.scalars(select(TokenRow).where(TokenRow.token_hash == token_hash))).first()


async def any_token(session: AsyncSession) -> bool:
    """Tell whether a token exists that was not revoked, made on purpose; then requests must carry one."""
    chosen = (TokenRow.revoked_at.is_(None), TokenRow.id != FIRST_START)
    return bool(await session.scalar(select(func.count()).select_from(TokenRow).where(*chosen)))


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
