"""Queries on the sessions of browsers that signed in."""

from datetime import datetime

from sqlalchemy import bindparam, delete, or_, select
from sqlalchemy.ext.asyncio import AsyncSession

from app.storage.models import SessionRow, TokenRow

VALID = (
    select(TokenRow.name, TokenRow.role, TokenRow.vehicle)
    .join(SessionRow, SessionRow.token_hash == TokenRow.token_hash)
    .where(
        SessionRow.secret_hash == bindparam("hash"),
        SessionRow.expires_at > bindparam("now"),
        TokenRow.revoked_at.is_(None),
        or_(TokenRow.expires_at.is_(None), TokenRow.expires_at > bindparam("now")),
    )
)
"""Name, role and vehicle of the token behind the session with a ``hash``, unless either is over ``now``."""


async def end(session: AsyncSession, secret_hash: str) -> None:
    """End one session."""
    await session.execute(delete(SessionRow).where(SessionRow.secret_hash == secret_hash))


async def forget(session: AsyncSession, now: datetime) -> None:
    """Remove those that have run out."""
    await session.execute(delete(SessionRow).where(SessionRow.expires_at <= now))
