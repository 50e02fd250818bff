"""What is noted is written in its order, once, and counts only then; a database that fails loses nothing of it."""

import sqlite3
from collections.abc import Sequence

import pytest
from sqlalchemy.exc import OperationalError
from sqlalchemy.ext.asyncio import AsyncSession

from app.missions.errors import MissionElsewhereError
from app.missions.live.journals import db_retry
from app.missions.live.journals.db_retry import DatabaseRetry
from app.missions.live.journals.write_behind import Committed, WriteBehind
from app.storage.database import Database
from tests.support.waiting import until

CAUSE = sqlite3.OperationalError("database or disk is full")
CAUSE.sqlite_errorcode = sqlite3.SQLITE_FULL
FULL = OperationalError("insert", {}, CAUSE)


class Numbers(WriteBehind[int]):
    """Written is what was stored by a transaction that committed."""

    def __init__(self, database: Database, period_s: float = 60.0) -> None:
        self.begun: list[str] = []
        self.over: list[str] = []
        super().__init__(database, "m", DatabaseRetry("m", lambda: None, self.begun.append, self.over.append), period_s)
        self.written: list[int] = []
        self.transactions: list[list[int]] = []
        self.errors: list[Exception] = []

    def note(self, *numbers: int) -> None:
        self._note(*numbers)

    async def _store(self, noted: Sequence[int], session: AsyncSession) -> Committed:
        self.transactions.append(list(noted))
        if self.errors:
            # What comes while a transaction is under way belongs to the next one.
            self.note(9)
            raise self.errors.pop(0)
        return lambda: self.written.extend(noted)


@pytest.fixture
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(db_retry, "RETRY_S", 0.01)


async def test_what_is_noted_together_is_written_together_within_a_moment(database: Database) -> None:
    numbers = Numbers(database, 0.01)
    numbers.note(1)
    numbers.note(2, 3)
    await until(lambda: numbers.written == [1, 2, 3], "they are written")
    numbers.note(4)
    await until(lambda: numbers.written == [1, 2, 3, 4], "the next is written")
    assert numbers.transactions == [[1, 2, 3], [4]]
    await numbers.close()


async def test_what_could_not_be_written_stays_noted_before_what_came_since(database: Database) -> None:
    numbers = Numbers(database)
    numbers.errors = [FULL]
    numbers.note(1, 2)
    with pytest.raises(OperationalError):
        await numbers.flush()
    assert numbers.written == []
    await numbers.flush()
    assert (numbers.written, numbers.transactions) == ([1, 2, 9], [[1, 2], [1, 2, 9]])
    await numbers.close()
    assert len(numbers.transactions) == 2


async def test_a_full_disk_is_tried_again_until_it_has_room(soon: None, database: Database) -> None:
    numbers = Numbers(database, 0.01)
    numbers.errors = [FULL, FULL, FULL]
    numbers.note(1)
    await until(lambda: numbers.storage.trouble, "the trouble is known")
    await until(lambda: numbers.written == [1, 9, 9, 9], "all is written")
    await until(lambda: numbers.over, "its end is told")
    assert numbers.storage.trouble == ""
    await numbers.close()


async def test_the_end_writes_what_is_left_and_gives_up_what_cannot_be(database: Database) -> None:
    numbers, unlucky = Numbers(database), Numbers(database)
    numbers.note(1)
    await numbers.close()
    assert numbers.written == [1]
    unlucky.errors = [FULL]
    unlucky.note(1)
    await unlucky.close()
    assert unlucky.written == []


async def test_nothing_is_written_of_a_mission_that_another_process_has(database: Database) -> None:
    numbers = Numbers(database, 0.01)
    numbers.errors = [MissionElsewhereError("gone", "ask there")]
    numbers.note(1)
    await until(lambda: not numbers.errors and numbers._pump is not None and numbers._pump.done(), "it ends")
    numbers.abandon()
    await numbers.close()
    assert (numbers.written, len(numbers.transactions)) == ([], 1)
