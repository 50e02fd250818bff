"""Alembic's entry: runs on the connection that app.storage.upkeep.migrate hands over, or on BATHYFLEET_DATABASE_URL."""

import asyncio
import os

from alembic import context
from sqlalchemy import Connection

from app.storage.database import make_engine
from app.storage.models import Base


def run(connection: Connection) -> None:
    context.configure(
        connection=connection,
        target_metadata=Base.metadata,
        render_as_batch=connection.dialect.name == "sqlite",
        compare_type=True,
    )
    with context.begin_transaction():
        context.run_migrations()


async def run_on_configured_database() -> None:
    engine = make_engine(os.environ.get("BATHYFLEET_DATABASE_URL", "sqlite+aiosqlite:///bathyfleet.db"))
    async with engine.connect() as connection:
        await connection.execution_options(bathyfleet_writes=True)
        async with connection.begin():
            await connection.run_sync(run)
    await engine.dispose()


handed_over = context.config.attributes.get("connection")
if handed_over is not None:
    run(handed_over)
else:
    asyncio.run(run_on_configured_database())
