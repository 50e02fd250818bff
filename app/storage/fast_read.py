"""Small answers that every request waits for, read from SQLite on the spot.

The library hands each query to a thread and back, which costs several times what the query does.
"""

import sqlite3
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from sqlalchemy import Select, make_url
from sqlalchemy.dialects import sqlite

from app.storage.database import Database

_DIALECT = sqlite.dialect()


class AtOnce:
    """Reads what is committed now, by any process; for queries on indexes of small tables only."""

    def __init__(self, database: Database) -> None:
        self._database = database
        url = make_url(database.url)
        is_file = url.get_backend_name() == "sqlite" and url.database and url.database != ":memory:"
        self._file = url.database if is_file else None
        self._connection: sqlite3.Connection | None = None
        self._known: dict[int, tuple[Select[*tuple[Any, ...]], _Known]] = {}

    async def __call__(
        self, query: Select[*tuple[Any, ...]], values: Mapping[str, Any] = MappingProxyType({})
    ) -> list[tuple[Any, ...]]:
        """Return all rows as the driver has them, read on the spot or where that is not possible the usual way."""
        found = self.rows(query, values)
        if found is not None:
            return found
        async with self._database.reading() as session:
            return [tuple(row) for row in await session.execute(query, values)]

    def rows(
        self, query: Select[*tuple[Any, ...]], values: Mapping[str, Any] = MappingProxyType({})
    ) -> list[tuple[Any, ...]] | None:
        """Return all rows as the driver has them; None where the query has to go the usual way.

        The query is one that is made once, with a ``bindparam`` for each of the ``values``.
        """
        if self._file is None:
            return None
        known = self._known.get(id(query))
        if known is None:
            # The query is kept with it: another one must not get its place in memory.
            known = self._known[id(query)] = query, _Known(query)
        try:
            if self._connection is None:
                # Waiting for a lock would hold up everyone: the usual way waits in a thread.
                self._connection = sqlite3.connect(self._file, timeout=0, isolation_level=None)
                self._connection.execute("PRAGMA query_only=ON")
            return self._connection.execute(known[1].text, known[1].bound(values)).fetchall()
        except sqlite3.Error:
            self.close()
            return None

    def close(self) -> None:
        """Let go of the file; the next query opens it again."""
        if self._connection is not None:
            self._connection.close()
            self._connection = None


class _Known:
    """A query as SQLite's text: to make that takes longer than to run it."""

    def __init__(self, query: Select[*tuple[Any, ...]]) -> None:
        compiled = query.compile(dialect=_DIALECT)
        self.text = str(compiled)
        self._fixed = compiled.params
        # Times are stored in a form of their own.
        self._places = [
            (name, compiled.binds[name].type.bind_processor(_DIALECT)) for name in compiled.positiontup or ()
        ]

    def bound(self, values: Mapping[str, Any]) -> list[Any]:
        """Return the values as the driver takes them."""
        given = [(values.get(name, self._fixed[name]), process) for name, process in self._places]
        return [value if process is None else process(value) for value, process in given]
