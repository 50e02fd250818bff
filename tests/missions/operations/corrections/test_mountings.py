"""How sonars are mounted while other things of a mission change, and what watchers learn of corrections."""

import asyncio
from collections.abc import AsyncIterator
from typing import Any

from sqlalchemy.ext.asyncio import AsyncSession

from app.missions.operations.corrections.recorrection import recorrect, set_tide
from app.missions.running.mission_views import watched
from app.missions.service import MissionService
from app.missions.spec.mounting import MountingSpec
from app.missions.views.measurements.corrections import TideCorrection
from app.missions.views.messages import MapMessage, SnapshotMessage
from tests.support.missions.specs import make_spec


async def test_who_joins_while_soundings_are_corrected_keeps_its_mounting(service: MissionService) -> None:
    live = await service.get((await service.create(make_spec())).id)

    async def joining(_: AsyncSession) -> None:
        live.state_mounting("late", MountingSpec(offset_m=(0.0, 0.0, 1.0)))

    async with live.correcting:
        await recorrect(live, live.spec, None, None, joining)
    assert live.gate.corrections.mounted_vehicles == {"late"}


async def test_who_watches_learns_that_there_is_another_map_when_soundings_are_corrected(
    service: MissionService,
) -> None:
    live = await service.get((await service.create(make_spec())).id)
    async with watched(live) as messages, asyncio.timeout(30):
        assert isinstance(await anext(messages), SnapshotMessage)
        await set_tide(live, TideCorrection(level_m=1.0), "Ana")
        told = [message.live async for message in until_map(messages)]
    assert told[-1] > 0


async def until_map(messages: AsyncIterator[Any]) -> AsyncIterator[MapMessage]:
    async for message in messages:
        if isinstance(message, MapMessage):
            yield message
            return
