"""How sonars are mounted while other things of a mission change."""

from sqlalchemy.ext.asyncio import AsyncSession

from app.missions.operations.corrections.recorrection import recorrect
from app.missions.service import MissionService
from app.missions.spec.mounting import MountingSpec
from tests.support.missions.specs import make_spec


async def test_who_joins_while_soundings_are_corrected_keeps_its_mounting(service: MissionService) -> None:
    live = await service.get((await service.create(make_spec())).id)

    async def joining(_: AsyncSession) -> None:
        live.state_mounting("late", MountingSpec(offset_m=(0.0, 0.0, 1.0)))

    async with live.correcting:
        await recorrect(live, live.spec, None, None, joining)
    assert live.gate.corrections.mounted_vehicles == {"late"}
