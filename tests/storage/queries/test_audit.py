"""The audit log only grows, whoever writes to the database."""

from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import delete, text, update
from sqlalchemy.exc import DBAPIError

from app.storage.database import Database
from app.storage.models import AuditRow
from app.storage.queries import audit
from app.storage.queries.audit import Command

COMMAND = Command("Ana", "operator", "192.0.2.7", "startMission", "/api/v1/missions/m1/start", "done", status=200)


async def _rows(database: Database) -> list[AuditRow]:
    async with database.reading() as session:
        return list(await audit.newest(session, limit=100))


async def _age(database: Database, days: float) -> None:
    """Write a row that is older than it can become in a test."""
    values = {name: getattr(COMMAND, name) for name in ("actor", "role", "origin", "action", "target", "result")}
    async with database.writing() as session:
        session.add(AuditRow(time=datetime.now(UTC) - timedelta(days=days), detail="", request_id="", **values))


async def test_what_was_written_down_can_neither_be_changed_nor_removed(database: Database) -> None:
    async with database.writing() as session:
        audit.add(session, COMMAND)
    for statement in (
        update(AuditRow).values(actor="somebody else"),
        delete(AuditRow),
        text("UPDATE audit SET result = 'refused'"),
        text("DELETE FROM audit WHERE id > 0"),
    ):
        with pytest.raises(DBAPIError, match=r"can only grow|is kept for 30 days"):
            async with database.writing() as session:
                await session.execute(statement)
    (row,) = await _rows(database)
    assert (row.actor, row.result) == ("Ana", "done")


async def test_what_is_older_than_its_days_goes_but_never_what_is_younger_than_thirty(database: Database) -> None:
    for days in (400, 100, 31, 29, 0):
        await _age(database, days)
    async with database.writing() as session:
        assert await audit.forget(session, 90) == 2
    async with database.writing() as session:
        assert await audit.forget(session, 1) == 1
    assert len(await _rows(database)) == 2


async def test_any_text_that_a_stranger_sends_can_be_kept(database: Database) -> None:
    odd = "\0'; DROP TABLE audit; --\u202e" + "x" * 5000
    async with database.writing() as session:
        audit.add(session, Command(odd, "", odd, odd, odd, "refused", odd, odd, 401, odd))
    (row,) = await _rows(database)
    assert row.target.startswith("\ufffd'; DROP TABLE audit")
    assert len(row.target) == 300


async def test_pages_follow_each_other_and_choices_are_kept(database: Database) -> None:
    async with database.writing() as session:
        for number in range(25):
            audit.add(
                session, Command(f"user {number % 2}", "", "", "a", str(number), "done", mission_id=f"m{number % 5}")
            )
            await session.flush()
    async with database.reading() as session:
        seen, before = [], None
        while page := await audit.newest(session, limit=10, before=before):
            seen += [row.target for row in page]
            before = page[-1].id
        assert seen == [str(number) for number in reversed(range(25))]
        chosen = await audit.newest(session, limit=100, actor="user 1", mission_id="m3", days=1)
        assert [row.target for row in chosen] == ["23", "13", "3"]
