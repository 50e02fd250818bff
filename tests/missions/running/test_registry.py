"""Missions are taken up as they are stored; one that makes no sense is refused in words, and can be deleted."""

from typing import Any

import pytest

from app.missions.clock import now
from app.missions.errors import (
    ConflictError,
    InvalidRequestError,
    MissionNotFoundError,
    MissionUnreadableError,
)
from app.missions.running import registry
from app.missions.service import MissionService
from app.missions.spec.base import PolygonGeometry
from app.storage.database import Database
from app.storage.models import MissionRow, StepRow
from app.storage.upkeep.retention import remove
from tests.support.missions.harbour import Harbour, act, sim_spec

FAR = PolygonGeometry.model_validate({"coordinates": [[[8, 41], [8, 42], [9, 42], [8, 41]]]})
"""A zone that no description is allowed to have."""


STEP: dict[str, Any] = {"soundings": 0, "map_digest": "", "memory": b""}


async def stored_otherwise(database: Database, mission_id: str, state: str = "ready", **changes: Any) -> None:
    async with database.writing() as session:
        row = await session.get_one(MissionRow, mission_id)
        row.spec, row.state = row.spec | changes, state


@pytest.mark.parametrize("state", ["ready", "running"])
async def test_a_mission_that_cannot_be_opened_says_why_and_can_be_deleted(
    harbour: Harbour, database: Database, state: str
) -> None:
    mission_id = (await harbour.service.create(sim_spec("a"))).id
    await stored_otherwise(database, mission_id, state, of_a_newer_version=True)
    service = await harbour.reopen()
    with pytest.raises(MissionUnreadableError, match="of_a_newer_version: Extra inputs are not permitted"):
        await service.get(mission_id)
    await service.delete_stored(mission_id)
    with pytest.raises(MissionNotFoundError):
        await service.check_exists(mission_id)
    assert await service.rows() == []


async def test_what_was_measured_in_one_that_cannot_be_opened_is_kept(harbour: Harbour, database: Database) -> None:
    mission_id = (await harbour.service.create(sim_spec("a"))).id
    await stored_otherwise(database, mission_id, of_a_newer_version=True)
    async with database.writing() as session:
        session.add(StepRow(mission_id=mission_id, number=3, committed_at=now(), objective=None, terms={}, **STEP))
    service = await harbour.reopen()
    with pytest.raises(ConflictError, match="took 3 steps and has 0 soundings: what was measured is kept"):
        await service.delete_stored(mission_id)
    assert len(await service.rows()) == 1


async def test_nobody_finds_a_mission_that_was_deleted(service: MissionService) -> None:
    mission_id = (await service.create(sim_spec("a"))).id
    await service.check_exists(mission_id)
    await service.delete_stored(mission_id)
    with pytest.raises(MissionNotFoundError):
        await service.check_exists(mission_id)


async def test_a_mission_that_was_pruned_beside_the_service_is_gone_from_memory_too(
    harbour: Harbour, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(registry, "LOOKED_AT_EVERY_S", 0.0)
    service = harbour.service
    pruned, kept = [(await service.create(sim_spec(name))).id for name in ("a", "b")]
    for mission_id in (pruned, kept):
        await act(service, mission_id, "abort")
    assert await remove(database, pruned, -1.0)
    with pytest.raises(MissionNotFoundError):
        await service.get(pruned)
    with pytest.raises(MissionNotFoundError):
        await service.check_exists(pruned)
    assert (await service.get(kept)).id == kept


async def test_what_cannot_be_opened_is_not_stored(service: MissionService) -> None:
    unsound = sim_spec("a").model_copy(update={"keep_out": [FAR]})
    with pytest.raises(InvalidRequestError, match=r"no mission can be made of it: .*keep_out\.0"):
        await service.create(unsound)
    assert await service.rows() == []
    live = await service.get((await service.create(sim_spec("a"))).id)
    with pytest.raises(InvalidRequestError, match="no mission can be made of it"):
        await service.describe_anew(live, unsound)
    assert (await service.get(live.id)).spec.keep_out == []


@pytest.mark.parametrize(("stored", "shown"), [("   ", None), ("Quay\nSubject: x", "Quay Subject: x")])
async def test_a_mission_whose_name_would_be_refused_today_opens(
    harbour: Harbour, database: Database, stored: str, shown: str | None
) -> None:
    mission_id = (await harbour.service.create(sim_spec("a"))).id
    await stored_otherwise(database, mission_id, name=stored)
    service = await harbour.reopen()
    assert [summary.name for summary in await service.missions()] == [shown or mission_id]
