"""Measurements are sent however many they are, and in whatever numbers a program has them."""

from typing import Any

import numpy as np
import pytest

from app.main import Server
from bathyfleet.client import AsyncClient, Client, models
from bathyfleet.client.connection import BATCH_BYTES, batches
from tests.support.api.rest import mission_spec, soundings
from tests.support.missions.pings import posted_ping

SWATH = mission_spec(vehicles=[{"name": "rover", "kind": "rest", "sensor": "multibeam"}])


def swath_pings(count: int, beams: int) -> list[dict[str, Any]]:
    """Pings as a program has them: arrays, nothing rounded."""
    angles = np.linspace(-60, 60, beams)
    ranges = (10.0 / np.cos(np.radians(angles))).astype(np.float32)
    return [posted_ping(number) | {"beams": {"angles_deg": angles, "ranges_m": ranges}} for number in range(count)]


def test_a_thousand_pings_of_many_beams_are_stored(client: Client) -> None:
    mission = client.create_mission(SWATH)
    verdict = client.send_measurements(mission.id, swath_pings(1000, 512))
    assert (verdict.accepted, len(verdict.items)) == (1000, 1000)
    assert client.get_mission(mission.id).progress.pings == 1000
    client.abort_mission(mission.id)


async def test_they_are_with_asyncio(server: Server) -> None:
    async with AsyncClient(server.url) as client:
        mission = await client.create_mission(SWATH)
        verdict = await client.send_measurements(mission.id, swath_pings(400, 512), batch=400)
        assert (verdict.accepted, (await client.get_mission(mission.id)).progress.pings) == (400, 400)
        await client.abort_mission(mission.id)


def test_numbers_of_numpy_are_stored_as_their_values(client: Client) -> None:
    mission = client.create_mission(mission_spec())
    items = soundings(3)
    items[0]["range_m"] = np.float32(9.0)
    items[1]["range_m"] = np.int64(9)
    items[2]["range_m"] = np.array(9.0)
    assert client.send_measurements(mission.id, items).accepted == 3
    points = client.list_sounding_points(mission.id)
    assert points.depth_m == [11.0, 11.0, 11.0]
    client.abort_mission(mission.id)


def test_what_cannot_be_sent_is_named_by_its_place(client: Client) -> None:
    odd = object()
    with pytest.raises(TypeError, match=r"^items\.1\.beams\.ranges_m\.2: <object object at .*> cannot be sent"):
        client.send_measurements("m", [*soundings(1), posted_ping() | {"beams": {"ranges_m": [1.0, 2.0, odd]}}])
    with pytest.raises(TypeError, match=r"^items\.0\.reach: "):
        client.send_measurements("m", [models.Measurement(**soundings(1)[0], reach=odd)])


def test_a_batch_is_as_large_as_it_may_be_and_never_empty() -> None:
    long = {"text": "x" * BATCH_BYTES}
    sizes = [len(batch) for batch in batches([*soundings(5), long, *soundings(2)], 4)]
    assert sizes == [4, 1, 1, 2]
    assert list(batches([], 4)) == []
