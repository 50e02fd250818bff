"""Upgrading and the way back, with the data of a mission, as the administrator's guide says."""

from collections.abc import Callable

from app.settings import Settings
from app.storage.upkeep import migrate
from bathyfleet.client import AsyncClient
from tests.support.api.rest import mission_spec, running, soundings
from tests.support.storage.databases import query

FIRST = "0001"
KEPT = (
    "select s.vehicle, s.range_m from soundings s join missions m on s.mission_id = m.id "
    "where m.name = 'Old' order by s.id"
)


async def test_a_mission_goes_back_to_the_first_version_and_comes_up_again(
    make_settings: Callable[..., Settings],
) -> None:
    settings = make_settings()
    async with running(settings) as server, AsyncClient(server.url) as client:
        mission = await client.create_mission(mission_spec(name="Old"))
        assert (await client.send_measurements(mission.id, soundings(12))).accepted == 12
        await client.abort_mission(mission.id)
        before = await client.list_soundings(mission.id)
    rows = query(settings.database_url, KEPT)
    assert len(rows) == 12
    await migrate.downgrade(settings.database_url, FIRST)
    assert await migrate.current(settings.database_url) == FIRST
    assert query(settings.database_url, KEPT) == rows
    async with running(settings) as server, AsyncClient(server.url) as client:
        assert await migrate.current(settings.database_url) == migrate.head()
        again = await client.get_mission(mission.id)
        assert (again.state, again.progress.soundings) == ("aborted", 12)
        after = await client.list_soundings(mission.id)
        assert [s.range_m for s in after.items] == [s.range_m for s in before.items]
        assert (await client.get_map(mission.id)).sounded is not None
