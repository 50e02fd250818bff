"""Queries on the IMC ids that processes on this database have led vehicles by."""

from sqlalchemy import select
from sqlalchemy.ext.asyncio import AsyncSession

from app.storage.models import ConsoleRow


async def note(session: AsyncSession, imc_id: int) -> None:
    """Keep an id; harmless to repeat."""
    if await session.get(ConsoleRow, imc_id) is None:
        session.add(ConsoleRow(imc_id=imc_id))


async def ids(session: AsyncSession) -> frozenset[int]:
    """Return all of them."""
    return frozenset((await session.scalars(select(ConsoleRow.imc_id))).all())
