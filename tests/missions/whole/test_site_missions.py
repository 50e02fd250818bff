"""Missions of a site: they begin with its depths, and it keeps what they found; its floor is dredged between two."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.missions.operations.imports.imports import imports_of
from app.missions.operations.measurements import measure
from app.missions.settings import ServiceSettings
from app.missions.spec.mission import MissionSpec
from app.missions.spec.site import SiteSpec
from app.missions.states import MissionState
from app.storage.database import Database
from app.storage.upkeep.retention import remove
from tests.support.missions.harbour import Harbour, act, sim_spec, until_state
from tests.support.missions.measured import measured
from tests.support.missions.specs import LAT, LON, make_spec, rectangle, spec_json

SIDE_M = 50.0
PIT_M = (18.0, 32.0)
DUG_M = 1.0
SITE: dict[str, Any] = {"name": "Quay", "area": rectangle(0, 0, SIDE_M, SIDE_M), "cell_m": 1.0}


def write_floor(path: Path, dug_m: float) -> None:
    """A slope with ripples, and a square pit in it."""
    north, east = np.meshgrid(np.arange(0.25, 80, 0.5) - 15, np.arange(0.25, 80, 0.5) - 15, indexing="ij")
    depth = 8.0 + 0.02 * east + 0.1 * np.sin(north / 5.0)
    pit = (np.minimum(east, north) >= PIT_M[0]) & (np.maximum(east, north) < PIT_M[1])
    lat, lon = LAT - 15 / 111_060.0, LON - 15 / 83_880.0
    np.savez(path, z=depth + dug_m * pit, cell_m=0.5, origin_lat=lat, origin_lon=lon)


async def survey(harbour: Harbour, site: str) -> str:
    sonar = {"beams": 96, "rate_hz": 3.0}
    vehicle = {"name": "a", "kind": "sim", "sensor": "multibeam", "sonar": sonar, "depth_m": 2.0}
    changes: dict[str, Any] = {
        "vehicles": [vehicle],
        "budget": {"minutes": 60},
        "cell_m": 1.0,
        "limits": {"max_step_m": 25.0, "min_depth_m": 1.0},
        "planner": {"name": "swath"},
        "site": site,
    }
    spec = MissionSpec.model_validate(spec_json(SIDE_M, **changes))
    mission = (await harbour.service.create(spec)).id
    await act(harbour.service, mission, "start")
    await until_state(harbour.service, mission, MissionState.FINISHED)
    return mission


@pytest.mark.slow
async def test_the_second_survey_begins_with_the_first_and_finds_what_was_dredged(
    make_settings: Callable[..., ServiceSettings], tmp_path: Path
) -> None:
    floors = [tmp_path / "before.npz", tmp_path / "after.npz"]
    for path, dug_m in zip(floors, (0.0, DUG_M), strict=True):
        write_floor(path, dug_m)
    harbour = Harbour(lambda **changes: make_settings(**({"time_scale": 30.0} | changes)))
    try:
        service = await harbour.open(simulation={"terrain": floors[0], "seed": 1})
        site = (await service.sites.create(SiteSpec.model_validate(SITE))).id
        first = await survey(harbour, site)
        known = (await service.site_models.map(site)).model
        service = await harbour.reopen(simulation={"terrain": floors[1], "seed": 2})
        second = await survey(harbour, site)

        (begun,) = await imports_of(await service.get(second))
        assert begun.site == site
        assert begun.found >= known.known.sum() > 0.97 * SIDE_M**2
        assert begun.max_depth_m < 10.0, "the pit was not there yet"
        listed = await service.site_models.surveys(site)
        assert [(one.mission_id, one.state) for one in listed] == [(first, "finished"), (second, "finished")]
        assert listed[0].beams > 1000

        found = await service.site_models.changes(site)
        change, grid = found.change, found.change.grid
        north, east = np.meshgrid(grid.north_m, grid.east_m, indexing="ij")
        inside = (np.minimum(east, north) > PIT_M[0] + 1) & (np.maximum(east, north) < PIT_M[1] - 1)
        outside = (np.minimum(east, north) < PIT_M[0] - 1) | (np.maximum(east, north) > PIT_M[1] + 1)
        assert change.significant[inside].mean() > 0.99
        assert (change.difference_m[inside] > 0.0).all(), "deeper is positive"
        assert change.significant[outside & change.compared].mean() < 0.1
        dug_m3 = DUG_M * (PIT_M[1] - PIT_M[0]) ** 2
        assert abs(change.lost.m3 - dug_m3) < 2.0 * change.lost.sd_m3 < dug_m3
        model = (await service.site_models.map(site)).model
        assert (model.surveys[inside] == 1).mean() > 0.99
        assert np.median(model.depth_m[inside] - known.depth_m[inside]) > 0.9 * DUG_M
    finally:
        await harbour.close()


async def test_a_mission_takes_the_depths_of_its_site_as_they_are_when_it_starts(harbour: Harbour) -> None:
    service = harbour.service
    site = (await service.sites.create(SiteSpec.model_validate(SITE))).id
    waiting = (await service.create(sim_spec(steps=2, site=site))).id
    assert await imports_of(await service.get(waiting)) == []

    first = (await service.create(make_spec(site=site))).id
    await measure(await service.get(first), measured(80, wrong=None)[:80])
    await act(service, first, "abort")
    assert [one.surveyed for one in await service.site_models.surveys(site)] == [True, False]

    await act(service, waiting, "start")
    (begun,) = await imports_of(await service.get(waiting))
    assert (begun.site, begun.taken > 50) == (site, True)
    await service.imports.delete(await service.get(waiting), begun.id, "Ana")
    assert await imports_of(await service.get(waiting)) == [], "once under way an operator may leave them out"
    await act(service, waiting, "abort")


async def test_a_site_keeps_what_a_mission_found_that_was_removed_to_make_room(harbour: Harbour) -> None:
    service = harbour.service
    site = (await service.sites.create(SiteSpec.model_validate(SITE))).id
    mission = (await service.create(make_spec(site=site))).id
    await measure(await service.get(mission), measured(80, wrong=None)[:80])
    await act(service, mission, "abort")
    before = await service.site_models.map(site)
    url = harbour.database.url
    await harbour.close()
    database = Database(url)
    assert await remove(database, mission, -1.0)
    await database.close()
    service = await harbour.open()
    after = await service.site_models.map(site)
    np.testing.assert_array_equal(after.model.depth_m, before.model.depth_m)
    (kept,) = await service.site_models.surveys(site)
    assert (kept.mission_id, kept.state, kept.surveyed) == (mission, None, True)
