"""Copies of a PostgreSQL database, made and put back by PostgreSQL's own programs."""

import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any, NamedTuple

import structlog
from sqlalchemy import URL

from app.storage.models import Base, MissionOwnerRow, PingChunkRow, ProcessRow
from app.storage.processes.membership import HELD

log = structlog.get_logger(__name__)

VERSION_TABLE = "alembic_version"
_FUNCTION = "audit_only_grows()"
"""What the tables need beside them."""
_LEFT_OUT = tuple(row.__tablename__ for row in (MissionOwnerRow, ProcessRow))
"""The list of live processes, and what they lead, is of no use later, and their secrets are private."""

_REFERENCES = {
    str(key.name): key.column_keys[0]
    for table in Base.metadata.sorted_tables
    if table.name not in _LEFT_OUT
    for key in table.foreign_key_constraints
    if key.referred_table.name == ProcessRow.__tablename__
}
"""The columns of foreign keys to processes, of tables that are in archives."""


class BackupError(Exception):
    """A backup cannot be made, is damaged, or cannot be restored; ``remedy`` says what to do."""

    def __init__(self, message: str, remedy: str = "") -> None:
        super().__init__(message)
        self.remedy = remedy


def dump(url: URL, target: Path) -> None:
    """Write an archive of one consistent moment. Raises BackupError."""
    without = (f"--exclude-table-data={table}" for table in _LEFT_OUT)
    _run([*_on_server("pg_dump", url), "--format=custom", *without, f"--file={target}"], url)


def check(archive: Path) -> None:
    """Read an archive from end to end. Raises BackupError when it is damaged."""
    _run([_program("pg_restore"), "--file=/dev/null", str(archive)])


def revision(archive: Path) -> str:
    """Return the revision of an archive's tables; empty when it is none of ours. Raises BackupError."""
    read = [_program("pg_restore"), "--data-only", f"--table={VERSION_TABLE}", "--file=-"]
    found = re.search(rf"^COPY \S*{VERSION_TABLE} .*\n(\S+)\n", _run([*read, str(archive)]), re.MULTILINE)
    return found[1] if found else ""


def ping_files(archive: Path) -> list[str]:
    """Return the names of the files of pings that an archive refers to. Raises BackupError when it is damaged."""
    table = PingChunkRow.__tablename__
    command = [_program("pg_restore"), "--data-only", f"--table={table}", "--file=-", str(archive)]
    with (
        tempfile.TemporaryFile() as said,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=said) as reading,  # noqa: S603 - no shell
    ):
        assert reading.stdout is not None  # noqa: S101 - it is a pipe
        # Line by line: the rows hold the times of all pings.
        names = list(_names_in(reading.stdout, table))
        if reading.wait() != 0:
            said.seek(0)
            raise BackupError(f"pg_restore failed: {said.read().decode(errors='replace').strip()}")
    return names


def _names_in(lines: Iterable[bytes], table: str) -> Iterator[str]:
    """Yield the column ``name`` of a table's rows, as pg_restore writes them."""
    column: int | None = None
    for line in lines:
        if column is not None:
            if line == b"\\.\n":
                return
            yield line.split(b"\t", column + 1)[column].decode()
        elif begin := re.match(rf"COPY \S*{table} \((.*)\) FROM stdin;".encode(), line):
            column = begin[1].split(b", ").index(b"name")


def is_in_use(url: URL) -> bool:
    """Tell whether a process of the service has the database open. Raises BackupError where it cannot be reached."""
    return bool(_run([*_on_server("psql", url), "--no-psqlrc", "--tuples-only", f"--command={HELD}"], url).strip())


def put_back(url: URL, archive: Path, *, replace: bool) -> None:
    """Write what an archive holds into a database: all in one transaction, or nothing. Raises BackupError.

    Rows that name a process keep everything but that: the process is in no archive. The references are made again
    when the names are gone. ``replace``: the service's tables go before, also those that the archive does not know of.
    """
    read = [_program("pg_restore"), "--no-owner"]
    listed = _run([*read, "--list", str(archive)]).splitlines(keepends=True)
    references = [reference for line in listed if (reference := _Reference.to_a_process(line)) is not None]
    with tempfile.TemporaryDirectory() as folder:
        tables, later = Path(folder, "tables"), Path(folder, "later")
        tables.write_text("".join(line for line in listed if _Reference.to_a_process(line) is None))
        later.write_text("".join(reference.line for reference in references))
        with _transaction(url) as script:
            if replace:
                for table in _tables(listed):
                    _write(script, f"DROP TABLE IF EXISTS {table} CASCADE;\n")
                _write(script, f"DROP FUNCTION IF EXISTS {_FUNCTION} CASCADE;\n")
            clean = ["--clean", "--if-exists"] if replace else []
            _run([*read, *clean, f"--use-list={tables}", "--file=-", str(archive)], output=script)
            for reference in references:
                _write(script, reference.forgotten)
            if references:
                _run([*read, f"--use-list={later}", "--file=-", str(archive)], output=script)
    if replace and (strange := _strange_tables(url)):
        words = "tables stay that this version does not know: others', or a newer version's, whose migration they stop"
        log.warning(words, tables=strange)


class _Reference(NamedTuple):
    """A foreign key to the processes that some row of an archive may hold."""

    line: str
    """The archive's list names it so."""
    table: str
    column: str

    @classmethod
    def to_a_process(cls, line: str) -> "_Reference | None":
        found = re.match(r"\d+; \d+ \d+ FK CONSTRAINT (\S+) (\S+) (\S+) ", line)
        if found is None or found[3] not in _REFERENCES:
            return None
        return cls(line, f"{_quoted(found[1])}.{_quoted(found[2])}", _quoted(_REFERENCES[found[3]]))

    @property
    def forgotten(self) -> str:
        return f"UPDATE {self.table} SET {self.column} = NULL WHERE {self.column} IS NOT NULL;\n"  # noqa: S608 - quoted


def _tables(listed: Iterable[str]) -> list[str]:
    """Return the tables of this version, and those that an archive lists."""
    ours = [VERSION_TABLE, *(table.name for table in Base.metadata.sorted_tables)]
    found = (re.match(r"\d+; \d+ \d+ TABLE (\S+) (\S+) ", line) for line in listed)
    archived = [f"{_quoted(table[1])}.{_quoted(table[2])}" for table in found if table is not None]
    return [*map(_quoted, ours), *archived]


def _strange_tables(url: URL) -> list[str]:
    """Return the tables of a database that are not of this version."""
    query = "SELECT tablename FROM pg_tables WHERE schemaname = ANY(current_schemas(false)) ORDER BY 1"
    command = [*_on_server("psql", url), "--no-psqlrc", "--tuples-only", "--no-align", f"--command={query}"]
    return sorted(set(_run(command, url).split("\n")) - {"", VERSION_TABLE, *Base.metadata.tables})


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"'


@contextmanager
def _transaction(url: URL) -> Iterator[IO[bytes]]:
    """Run what is written to it in one transaction that ends well only when the caller does. Raises BackupError."""
    command = [*_on_server("psql", url), "--no-psqlrc", "--quiet", "--set=ON_ERROR_STOP=1"]
    with (
        tempfile.TemporaryFile() as said,
        subprocess.Popen(  # noqa: S603 - no shell
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=said, env=_environment(url)
        ) as psql,
    ):
        assert psql.stdin is not None  # noqa: S101 - it is a pipe
        failed: BackupError | None = None
        try:
            # The first line of what it says is to be the error.
            _write(psql.stdin, "SET client_min_messages = warning;\nBEGIN;\n")
            yield psql.stdin
            _write(psql.stdin, "COMMIT;\n")
        except BackupError as error:
            failed = error
        finally:
            # Without its last word the server takes everything back.
            with suppress(BrokenPipeError):
                psql.stdin.close()
            code = psql.wait()
            said.seek(0)
            reason = said.read().decode(errors="replace").strip()
        if code != 0:
            raise BackupError(f"psql failed: {(reason or f'exit code {code}').splitlines()[0]}") from failed
        if failed is not None:
            raise failed


def _write(script: IO[bytes], text: str) -> None:
    try:
        script.write(text.encode())
        script.flush()
    except BrokenPipeError:
        raise BackupError("psql ended early") from None


def _program(name: str) -> str:
    found = shutil.which(name)
    if found is None:
        raise BackupError(
            f"PostgreSQL's {name} is not installed here",
            f"Install PostgreSQL's client programs (postgresql-client), or run {name} where the database is: "
            "docker compose exec database pg_dump --username bathyfleet --format custom bathyfleet > FILE, "
            "and copy the folder of pings_url to FILE-pings after that",
        )
    return found


_SETTINGS = {
    "ssl": "PGSSLMODE",
    "target_session_attrs": "PGTARGETSESSIONATTRS",
    "passfile": "PGPASSFILE",
    "krbsrvname": "PGKRBSRVNAME",
    "gsslib": "PGGSSLIB",
    "password": "PGPASSWORD",
}
"""What the service's driver takes in a URL, and how PostgreSQL's programs are told the same."""
_PLACE = ("host", "port", "user", "database")
_OF_THE_DRIVER = ("async_fallback", "prepared_statement_cache_size", "prepared_statement_name_func")
"""What says nothing about the way to the server."""
_USUAL_HOSTS = "/run/postgresql,/var/run/postgresql,/tmp,localhost"
"""Where the service's driver looks for a server that is not named."""


def _given(url: URL) -> dict[str, Any]:
    """Return where a URL says that a database is, as the service's driver reads it. Raises BackupError."""
    given = dict(url.get_dialect()().create_connect_args(url)[1])
    strange = sorted(given.keys() - {*_SETTINGS, *_PLACE, *_OF_THE_DRIVER})
    if strange:
        raise BackupError(
            f"the database's URL has {', '.join(strange)}, which PostgreSQL's programs cannot be told",
            "Leave it out there: libpq's variables say the same to both, as PGSSLROOTCERT",
        )
    return given


def _on_server(name: str, url: URL) -> list[str]:
    given = _given(url)
    command = [_program(name), "--no-password"]
    if "host" in given:
        command += ["--host", _listed(given["host"])]
    elif "PGHOST" not in os.environ:
        command += ["--host", _USUAL_HOSTS]
    for option, value in (("--port", "port"), ("--username", "user"), ("--dbname", "database")):
        if value in given:
            command += [option, _listed(given[value])]
    return command


def _listed(value: object) -> str:
    """Return one value, or one for each of several servers."""
    return ",".join(map(str, value)) if isinstance(value, list | tuple) else str(value)


def _environment(url: URL) -> dict[str, str]:
    """Return an environment with what is no option; no other user sees a password there."""
    given = _given(url)
    return os.environ | {variable: str(given[name]) for name, variable in _SETTINGS.items() if name in given}


def _run(command: list[str], url: URL | None = None, output: IO[bytes] | None = None) -> str:
    """Run one of PostgreSQL's programs; returns what it prints, unless that goes elsewhere."""
    done = subprocess.run(  # noqa: S603 - no shell
        command,
        stdout=output or subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=None if url is None else _environment(url),
        check=False,
    )
    if done.returncode != 0:
        reason = (done.stderr.decode(errors="replace").strip() or f"exit code {done.returncode}").splitlines()[0]
        raise BackupError(f"{Path(command[0]).name} failed: {reason}")
    return "" if done.stdout is None else done.stdout.decode()
