"""Batches that vehicles post at the same time, when the disk fails half way."""

import asyncio

import pytest

from app.missions.operations.measurements import measure
from app.missions.views.measurements.soundings import BatchVerdict, Verdict
from app.storage.database import Database
from app.storage.queries.soundings import counts
from tests.support.missions.harbour import Harbour
from tests.support.missions.measured import measured
from tests.support.missions.specs import make_spec


async def test_batches_that_were_stored_are_not_stored_again_when_what_follows_fails(
    harbour: Harbour, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    service = harbour.service
    live = await service.get((await service.create(make_spec())).id)
    items = measured(9)

    failures = iter([OSError("the disk is full")])

    async def flush() -> None:
        for failure in failures:
            raise failure

    monkeypatch.setattr(live.journal, "flush", flush)
    answers = await asyncio.gather(
        *(measure(live, items[first : first + 3]) for first in (0, 3, 6)), return_exceptions=True
    )
    for answer in answers:
        # Who is told that they were not taken sends them again; who is told that they were must not hear "duplicate".
        assert isinstance(answer, OSError) or {item.verdict for item in answer.items} == {Verdict.ACCEPTED}
    assert any(isinstance(answer, OSError) for answer in answers)
    async with database.reading() as session:
        assert (await counts(session, live.id))[Verdict.ACCEPTED] == 9
    again = await measure(live, items)
    assert isinstance(again, BatchVerdict)
    assert again.accepted == 0
