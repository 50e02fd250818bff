"""Two areas flown one after the other by vehicles led over IMC: how they get from the one into the other."""

from collections.abc import Callable
from itertools import combinations, pairwise

import numpy as np
import pytest
from shapely.geometry import LineString, Polygon

from app.missions.flight.legs.next_moment import VERTICAL_SHARE
from app.missions.operations.history import events_after
from app.missions.settings import ImcSettings, ServiceSettings
from app.missions.spec.mission import MissionSpec
from app.missions.states import MissionState
from app.storage.queries import missions as mission_queries
from tests.support.imc.sea import Sea, open_sea
from tests.support.missions.harbour import Harbour, act, until_state, view_of
from tests.support.waiting import until

SPEED = 3.0
WEST, EAST = ((5, 5), (30, 5), (30, 95), (5, 95)), ((70, 5), (95, 5), (95, 95), (70, 95))
ZONE = ((45, 40), (55, 40), (55, 60), (45, 60))
APART_M = 8.0
HEARD_WITHIN_S = 1.0
"""By the vehicles' clocks: on a busy machine seconds of a track may be missing."""


def block(sea: Sea, names: list[str], area: tuple[tuple[int, int], ...], **changes: object) -> MissionSpec:
    def polygon(corners: tuple[tuple[int, int], ...]) -> dict[str, object]:
        places = [sea.floor.frame.to_geodetic(*place) for place in (*corners, corners[0])]
        return {"type": "Polygon", "coordinates": [[[lon, lat] for lat, lon in places]]}

    return MissionSpec.model_validate(
        {
            "name": "Block",
            "area": polygon(area),
            "keep_out": [polygon(ZONE)],
            "vehicles": [{"name": name, "kind": "imc"} for name in names],
            "steps": 4,
            "cell_m": 5.0,
            "limits": {
                "max_step_m": 20.0,
                "min_depth_m": 1.0,
                "max_depth_m": 4.0,
                "keep_out_margin_m": 3.0,
                "min_separation_m": APART_M,
            },
            "planner": {"name": "lawnmower"},
            **changes,
        }
    )


@pytest.mark.slow
async def test_vehicles_go_over_into_the_next_block_clear_of_zones_and_of_each_other(
    make_settings: Callable[..., ServiceSettings],
) -> None:
    async with open_sea(vehicles=2, connected=False, speed=SPEED) as sea:
        imc = ImcSettings(port=sea.settings.port, announce_ports=sea.settings.announce_ports, loopback_only=True)
        harbour = Harbour(make_settings)
        service = await harbour.open(imc=imc, time_scale=SPEED)
        await sea.launch()
        try:
            names = [node.name for node in sea.fleet.nodes]

            async def ready() -> bool:
                return sum(v.link == "ready" for v in await service.vehicles()) == len(names)

            await until(ready, "the vehicles are ready")
            first = await service.create(block(sea, names, WEST))
            # Who goes aside to let the other one pass spends steps before it is there.
            second = await service.create(block(sea, names, EAST, after=first.id, steps=9))
            await act(service, first.id, "start")
            await until_state(service, first.id, MissionState.FINISHED)
            view = await until_state(service, second.id, MissionState.FINISHED)
            assert {str(waypoint.status) for waypoint in view.waypoints} == {"reached"}
            said = [event.message for event in await events_after(await service.get(second.id))]
            assert any("m outside the area: it is sent to the border" in words for words in said), said
            assert (await view_of(service, second.id)).after == first.id

            async with harbour.database.reading() as session:
                tracks = await mission_queries.track_points(session, second.id)
            zone, ways = Polygon(ZONE), {}
            for name, points in tracks.items():
                lon, lat, depth, time = np.array(points).T
                east_north = np.array([sea.floor.frame.to_local(*place) for place in zip(lat, lon, strict=True)])
                ways[name] = (time, east_north, depth)
                assert not any(LineString(leg).intersects(zone) for leg in pairwise(east_north)), name
                assert east_north[0, 0] < 40.0, "it came from the first block"
                assert east_north[-1, 0] > 60.0, "it goes to the second one, past the zone between them"
            for one, other in combinations(ways.values(), 2):
                apart_m = distances(one, other)
                # At the end of the first block they may lie beside each other, one above the other.
                set_out = int(np.argmax(apart_m >= APART_M))
                assert apart_m[set_out:].min() > APART_M / 2, "which is flown, not planned"
        finally:
            await harbour.close()


def distances(one: tuple[np.ndarray, ...], other: tuple[np.ndarray, ...]) -> np.ndarray:
    """How far two vehicles are apart sideways when both were heard, while they are at the same depth."""
    heard = np.abs(one[0][:, None] - other[0]).min(axis=1) < HEARD_WITHIN_S
    time, place, depth = (column[heard] for column in one)
    at = np.column_stack([np.interp(time, other[0], other[1][:, k]) for k in (0, 1)])
    # Vehicles a metre apart in depth pass above each other, and none keeps its depth exactly.
    similar = np.abs(depth - np.interp(time, other[0], other[2])) < VERTICAL_SHARE
    return np.hypot(*(place - at)[similar].T)
