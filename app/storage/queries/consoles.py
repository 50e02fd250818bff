"""Queries on the IMC ids that processes on this database have led vehicles by."""

from sqlalchemy import select
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.ext.asyncio import AsyncSession

from app.storage.models import ConsoleRow


async def note(session: AsyncSession, imc_id: int) -> None:
    """Keep an id; nothing happens where it is kept already, by whichever process."""
    insert = sqlite.insert if session.get_bind().dialect.name == "sqlite" else postgresql.insert
    await session.execute(insert(ConsoleRow).values(imc_id=imc_id).on_conflict_do_nothing())


async def ids(session: AsyncSession) -> frozenset[int]:
    """Return all of them."""
    return frozenset((await session.scalars(select(ConsoleRow.imc_id))).all())
