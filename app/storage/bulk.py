"""Reading very many rows as numbers: in small pieces, beside the event loop, which others need meanwhile."""

import asyncio
import sqlite3
import threading
from collections.abc import Callable, Sequence
from contextlib import closing
from typing import Any

from sqlalchemy import Select, make_url
from sqlalchemy.dialects import sqlite

from app.storage.database import BUSY_TIMEOUT_MS, Database

PIECE = 1000
"""Rows that are fetched at once: turning them into Python's values holds the interpreter for about a millisecond."""

Take = Callable[[Sequence[Any]], None]


async def read_in_pieces(database: Database, query: Select[*tuple[Any, ...]], take: Take) -> None:
    """Hand all rows of a query to ``take``, piece by piece; of SQLite's files in a thread, where ``take`` runs, too.

    The query's columns must be numbers and texts, which need no conversion.
    Reading stops when the caller is cancelled.
    """
    url = make_url(database.url)
    if url.get_backend_name() != "sqlite" or not url.database or url.database == ":memory:":
        async with database.reading() as session:
            found = await session.stream(query.execution_options(yield_per=PIECE))
            async for rows in found.partitions():
                take(rows)
        return
    compiled = query.compile(dialect=sqlite.dialect())
    values = [compiled.params[name] for name in compiled.positiontup or ()]
    stop = threading.Event()
    try:
        await asyncio.to_thread(_read, url.database, str(compiled), values, take, stop)
    finally:
        stop.set()


def _read(file: str, query: str, values: Sequence[Any], take: Take, stop: threading.Event) -> None:
    # A connection of its own: the library's would hand every piece to the event loop.
    with closing(sqlite3.connect(file, timeout=BUSY_TIMEOUT_MS / 1000)) as connection:
        connection.execute("PRAGMA query_only=ON")
        cursor = connection.execute(query, values)
        while not stop.is_set() and (rows := cursor.fetchmany(PIECE)):
            take(rows)
