"""Queries on the audit log."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime, timedelta

from sqlalchemy import delete, select
from sqlalchemy.ext.asyncio import AsyncSession
from sqlalchemy.orm import Session

from app.storage.models import AuditRow

LEAST_DAYS = 30
"""The database itself refuses to remove what is newer."""


@dataclass(frozen=True)
class Command:
    """Who did what from where, with the result; see :class:`AuditRow`."""

    actor: str
    role: str
    origin: str
    action: str
    target: str
    result: str
    detail: str = ""
    mission_id: str | None = None
    status: int | None = None
    request_id: str = ""


def add(session: AsyncSession | Session, command: Command) -> None:
    """Write a command down, now."""
    # A path may hold anything; not every database takes a NUL in a text.
    texts = {name: value.replace("\0", "\ufffd") for name, value in asdict(command).items() if isinstance(value, str)}
    cut = {name: text[: _SIZES.get(name)] for name, text in texts.items()}
    session.add(AuditRow(time=datetime.now(UTC), **(asdict(command) | cut)))


_SIZES = {"actor": 120, "origin": 64, "action": 64, "target": 300, "detail": 2000, "mission_id": 64, "request_id": 64}


async def newest(
    session: AsyncSession,
    *,
    limit: int,
    before: int | None = None,
    days: float | None = None,
    actor: str | None = None,
    mission_id: str | None = None,
) -> Sequence[AuditRow]:
    """Return commands, newest first: only with ids below ``before``, of the last days, of an actor, of a mission."""
    query = select(AuditRow).order_by(AuditRow.id.desc()).limit(limit)
    if before is not None:
        query = query.where(AuditRow.id < before)
    if days is not None:
        query = query.where(AuditRow.time >= datetime.now(UTC) - timedelta(days=days))
    if actor is not None:
        query = query.where(AuditRow.actor == actor)
    if mission_id is not None:
        query = query.where(AuditRow.mission_id == mission_id)
    return (await session.scalars(query)).all()


async def forget(session: AsyncSession, days: float) -> int:
    """Remove what is older than ``days``, at least :data:`LEAST_DAYS`; returns how many."""
    # A minute of grace: the database's clock decides.
    until = datetime.now(UTC) - timedelta(days=max(days, LEAST_DAYS), minutes=1)
    removed = await session.scalars(delete(AuditRow).where(AuditRow.time < until).returning(AuditRow.id))
    return len(removed.all())
