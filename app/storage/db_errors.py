"""Troubles of the database that pass: its disk is full, another program holds it locked, its server is away or busy."""

import sqlite3

from sqlalchemy.exc import DBAPIError, InterfaceError
from sqlalchemy.exc import TimeoutError as NoFreeConnectionError

_SQLITE = {
    sqlite3.SQLITE_FULL: "the disk with the database is full: free some space on it",
    sqlite3.SQLITE_IOERR: "the disk with the database reports an error: see whether it is full, unplugged or broken",
    sqlite3.SQLITE_BUSY: "another program holds the database locked: end it",
    sqlite3.SQLITE_LOCKED: "another program holds the database locked: end it",
    sqlite3.SQLITE_READONLY: "the database's file cannot be written: see its rights and whether its disk is read-only",
    sqlite3.SQLITE_CANTOPEN: "the database's file cannot be opened: see whether its disk is there",
}
_PRIMARY = 0xFF
"""SQLite's codes carry details in their higher bits."""

_SERVER = {
    "25006": "the database's server takes no writes: see whether it is a standby, as after a change of servers",
    "40": "the database's server ended a transaction because of others: it is tried again",
    "55P03": "another program holds the database locked: end it",
    "08": "the connection to the database's server broke: see whether it runs and can be reached",
    "53300": "the database's server takes no more connections: raise its max_connections, or share it among fewer",
    "53": "the database's server lacks room or memory: free some space on its disk",
    "57": "the database's server is stopping or starting: wait for it, or start it",
    "58": "the disk of the database's server reports an error: see whether it is full or broken",
}
"""By SQLSTATE, or its class."""

_ALL_IN_USE = (
    "every connection of this process to the database is in use: ask again in a moment; where it stays so see what "
    "holds its tables locked, and who asks that often"
)


def trouble_of(error: BaseException) -> str:
    """Return in words what keeps the database from being used and what to do about it.

    Empty when waiting will not help: the error is in what was asked of the database.
    """
    if isinstance(error, NoFreeConnectionError):
        return _ALL_IN_USE
    cause = error.orig if isinstance(error, DBAPIError) and error.orig is not None else error
    code = getattr(cause, "sqlite_errorcode", None)
    if code is not None:
        return _SQLITE.get(code & _PRIMARY, "")
    state = getattr(cause, "sqlstate", None) or getattr(cause, "pgcode", None)
    if state:
        return _SERVER.get(str(state), _SERVER.get(str(state)[:2], ""))
    lost = isinstance(error, InterfaceError) or (isinstance(error, DBAPIError) and error.connection_invalidated)
    return _SERVER["08"] if lost or isinstance(cause, ConnectionError | TimeoutError) else ""
