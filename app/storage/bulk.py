"""Reading very many rows as numbers: in small pieces, beside the event loop, which others need meanwhile."""

import asyncio
import sqlite3
import threading
from collections.abc import Callable, Sequence
from contextlib import closing
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import Boolean, ColumnElement, Double, Integer, Select, cast, make_url
from sqlalchemy.dialects import sqlite

from app.storage.database import BUSY_TIMEOUT_MS, Database

PIECE = 1000
"""Rows that are fetched at once: turning them into Python's values holds the interpreter for about a millisecond."""

Take = Callable[[Sequence[Any]], None]
TakeNumbers = Callable[[NDArray[np.float64]], None]

MISSING = "a number that was read from the database is missing there (NULL)"

COPY_HEAD = 19
"""Bytes before the first row of PostgreSQL's binary copies: a signature, flags, and no extension."""


async def read_in_pieces(database: Database, query: Select[*tuple[Any, ...]], take: Take) -> None:
    """Hand all rows of a query to ``take``, piece by piece; of SQLite's files in a thread, where ``take`` runs, too.

    The query's columns must be numbers and texts, which need no conversion.
    Reading stops when the caller is cancelled.
    """
    url = make_url(database.url)
    if url.get_backend_name() != "sqlite" or not url.database or url.database == ":memory:":
        await _stream(database, query, take)
        return
    compiled = query.compile(dialect=sqlite.dialect())
    values = [compiled.params[name] for name in compiled.positiontup or ()]
    stop = threading.Event()
    try:
        await asyncio.to_thread(_read, url.database, str(compiled), values, take, stop)
    finally:
        stop.set()


async def read_numbers(database: Database, query: Select[*tuple[Any, ...]], take: TakeNumbers) -> None:
    """Hand all rows of a query to ``take`` as arrays (k, columns), piece by piece, in the order of the query.

    The query's columns must be numbers that are never NULL; what is true counts as 1.
    Of PostgreSQL the rows come as they are in its memory, and no value of them becomes one of Python's.
    """
    width = len(query.selected_columns)
    if make_url(database.url).get_backend_name() == "postgresql":
        await _copy(database, query, width, take)
        return

    def take_rows(rows: Sequence[Any]) -> None:
        piece = np.fromiter(chain.from_iterable(rows), float, width * len(rows)).reshape(-1, width)
        if np.isnan(piece).any():
            raise ValueError(MISSING)
        take(piece)

    await read_in_pieces(database, query, take_rows)


async def _stream(database: Database, query: Select[*tuple[Any, ...]], take: Take) -> None:
    async with database.reading() as session:
        found = await session.stream(query.execution_options(yield_per=PIECE))
        async for rows in found.partitions():
            take(rows)


async def _copy(database: Database, query: Select[*tuple[Any, ...]], width: int, take: TakeNumbers) -> None:
    wanted = query.with_only_columns(*map(_as_double, query.selected_columns))
    copied = _Copied(width, take)
    async with database.reading() as session:
        compiled = wanted.compile(dialect=session.get_bind().dialect)
        values = [compiled.params[name] for name in compiled.positiontup or ()]
        pooled = await (await session.connection()).get_raw_connection()
        connection: Any = pooled.driver_connection
        await connection.copy_from_query(str(compiled), *values, output=copied.receive, format="binary")
    copied.end()


def _as_double(column: ColumnElement[Any]) -> ColumnElement[float]:
    return cast(cast(column, Integer) if isinstance(column.type, Boolean) else column, Double)


class _Copied:
    """Takes rows of ``width`` double numbers out of the bytes of a binary copy: all of one length."""

    def __init__(self, width: int, take: TakeNumbers) -> None:
        value = [("length", ">i4"), ("value", ">f8")]
        self._row = np.dtype([("fields", ">i2"), ("values", value, (width,))])
        self._take = take
        self._bytes = bytearray()
        self._to_skip = COPY_HEAD

    async def receive(self, part: bytes) -> None:
        self._bytes += part
        if len(self._bytes) >= self._to_skip + PIECE * self._row.itemsize:
            self._pass_on()

    def end(self) -> None:
        """Pass on what is left; two bytes without a row end the copy. A row with a NULL is shorter than the others."""
        self._pass_on()
        if len(self._bytes) != 2:
            raise ValueError(MISSING)

    def _pass_on(self) -> None:
        first, self._to_skip = self._to_skip, 0
        number = (len(self._bytes) - first) // self._row.itemsize
        rows = np.frombuffer(bytes(self._bytes[first : first + number * self._row.itemsize]), self._row)
        del self._bytes[: first + number * self._row.itemsize]
        if (rows["values"]["length"] != 8).any():
            raise ValueError(MISSING)
        if number:
            self._take(rows["values"]["value"].astype(np.float64))


def _read(file: str, query: str, values: Sequence[Any], take: Take, stop: threading.Event) -> None:
    # A connection of its own: the library's would hand every piece to the event loop.
    with closing(sqlite3.connect(file, timeout=BUSY_TIMEOUT_MS / 1000)) as connection:
        connection.execute("PRAGMA query_only=ON")
        cursor = connection.execute(query, values)
        while not stop.is_set() and (rows := cursor.fetchmany(PIECE)):
            take(rows)
