"""Sound speeds that a mission keeps: what tells of the water, never without bound, and nothing that cannot be."""

import math
from dataclasses import replace

import pytest

from app.missions.clock import now
from app.missions.fleet.interface import Position, SoundSpeedReport
from app.missions.live.journals import sound_speed_journal
from app.missions.live.journals.db_retry import DatabaseRetry
from app.missions.live.journals.sound_speed_journal import SoundSpeedJournal
from app.storage.database import Database
from app.storage.queries import sound_speeds as queries
from tests.support.storage.rows import mission


def report(
    depth_m: float = 5.0, after_s: float = 0.0, speed_mps: float = 1507.5, source: str = "CTD"
) -> SoundSpeedReport:
    return SoundSpeedReport("a", now().timestamp() + after_s, Position(41.18, -8.7, depth_m), speed_mps, source)


@pytest.fixture
async def journal(database: Database) -> SoundSpeedJournal:
    async with database.writing() as session:
        session.add(mission())
    return again(database)


def again(database: Database) -> SoundSpeedJournal:
    """As another run of the service has it."""
    storage = DatabaseRetry("m1", lambda: None, lambda trouble: None, lambda words: None)
    return SoundSpeedJournal(database, "m1", storage, 1.0)


async def depths(database: Database) -> list[float]:
    async with database.reading() as session:
        return [row.depth_m for row in await queries.samples(session, "m1")]


async def test_a_vehicle_that_changes_its_depth_is_heard_more_often(
    journal: SoundSpeedJournal, database: Database
) -> None:
    for tenth in range(600):
        journal.note(report(5.0, 0.1 * tenth))
    await journal.flush()
    assert len(await depths(database)) == 6, "one each 10 s"
    for tenth in range(100):
        journal.note(report(5.0 + 0.1 * tenth, 60.0 + 0.1 * tenth))
    await journal.close()
    assert len(await depths(database)) == pytest.approx(6 + 50, abs=2), "a step of depth each, at most five a second"


async def test_what_cannot_be_is_not_kept(journal: SoundSpeedJournal, database: Database) -> None:
    day = 86400.0
    for wrong in (math.nan, math.inf, -1.0, 343.0, 1e30):
        journal.note(report(speed_mps=wrong))
    for depth_m in (math.nan, -3.0, 0.0, 1e9):
        journal.note(report(depth_m))
    for after_s in (-2.0 * day, 2.0 * day, -now().timestamp(), 1e12, math.nan):
        journal.note(report(after_s=after_s))
    journal.note(report(after_s=2.0 * day), posted=True)
    await journal.flush()
    assert await depths(database) == []
    journal.note(report(after_s=-2.0 * day), posted=True)
    await journal.flush()
    assert len(await depths(database)) == 1, "a vehicle that posts may have gathered it for long"
    for number in range(1000):
        journal.note(replace(report(), vehicle="b", source=f"probe {number}"))
    await journal.flush()
    assert len(await depths(database)) == 1 + sound_speed_journal.MOST_SOURCES


async def test_a_flood_is_thinned_evenly_and_goes_on_after_a_restart(
    journal: SoundSpeedJournal, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sound_speed_journal, "MOST_SAMPLES", 100)
    other = replace(report(), vehicle="b")
    for number in range(5000):
        journal.note(report(1.0 + 0.2 * (number % 50), 0.2 * number))
        if number % 10 == 0:
            journal.note(replace(other, time_s=other.time_s + number))
        if number % 100 == 0:
            await journal.flush()
    await journal.close()
    async with database.reading() as session:
        counts = await queries.counts(session, "m1")
        times = [row.time_s for row in await queries.samples(session, "m1", vehicle="a")]
    assert 40 <= counts["a"] <= 100
    assert counts["b"] <= 100
    assert max(times) - min(times) > 900.0, "of all its time"
    later = again(database)
    later.note(report(3.0, 2000.0))
    await later.close()
    async with database.reading() as session:
        assert (await queries.counts(session, "m1"))["a"] == counts["a"] + 1
