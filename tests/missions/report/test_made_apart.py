"""Files and reports of large maps are made by a process of their own, and are what they would be here."""

import asyncio
from collections.abc import Callable
from typing import Any

import psutil
import pytest

from app.missions.errors import MapNotReadyError, ProductUnavailableError
from app.missions.live.mission import LiveMission
from app.missions.maps import snapshot
from app.missions.maps.products import Product, ProductOptions
from app.missions.operations.maps.mission_maps import export
from app.missions.operations.measurements import measure
from app.missions.operations.reports import ReportOptions
from app.missions.operations.work_processes import WorkProcess
from app.missions.report.kinds import REPORTS
from app.missions.report.texts import Language
from app.missions.soundings.measurement import Measurement
from tests.support.children import new_children
from tests.support.mapping.tracks import flown, lawnmower, pinged
from tests.support.missions.harbour import Harbour
from tests.support.missions.specs import make_spec
from tests.support.waiting import until

FILES = ("tif", "s102", "geojson", "crossovers.csv")


@pytest.fixture
async def live(harbour: Harbour, monkeypatch: pytest.MonkeyPatch) -> LiveMission:
    """Swaths with a crossline; every map counts as large."""
    monkeypatch.setattr(snapshot, "LARGE_CELLS", 1)
    vehicles = [{"name": "a", "kind": "rest", "sensor": "multibeam", "sonar": {"beams": 11}}]
    tide = {"level_m": 0.5, "sd_m": 0.05, "source": "gauge", "datum_epsg": 5861}
    mission = await harbour.service.create(make_spec(vehicles=vehicles, tide=tide))
    live = await harbour.service.get(mission.id)
    lines = [(east + 3, north + 3) for east, north in lawnmower(24, 24, 4)]
    for way, start_s in ((lines, 1_795_225_140.0), ([(1, 12.3), (28, 12.6)], 1_795_275_140.0)):
        items = pinged("a", flown(way, start_s=start_s, spacing_m=0.5))
        await measure(live, [Measurement.model_validate(item) for item in items])
    return live


def reported(harbour: Harbour, live: LiveMission, kind: str = "html") -> Any:
    return harbour.service.reports.report(live, ReportOptions(REPORTS[kind], Language.PT))


def exported(harbour: Harbour, live: LiveMission, name: str) -> Any:
    service = harbour.service
    return export(live, service.maps, service.settings.provider, service.compute, name, ProductOptions())


def whole(made: Any) -> Any:
    return (made.filename, made.media_type, made.content.whole()) if isinstance(made, Product) else made


@pytest.mark.slow
async def test_they_are_what_they_would_be_here(
    harbour: Harbour, live: LiveMission, monkeypatch: pytest.MonkeyPatch
) -> None:
    make = WorkProcess.make
    same: list[bool] = []

    async def twice(process: WorkProcess, work: Callable[..., Any], *arguments: Any) -> Any:
        there = await make(process, work, *arguments)
        same.append(whole(there) == whole(await asyncio.to_thread(work, *arguments)))
        return there

    monkeypatch.setattr(WorkProcess, "make", twice)
    for name in FILES:
        product: Product = await exported(harbour, live, name)
        assert product.content.size_bytes
        assert same.pop(), name
    for kind in REPORTS:
        assert (await reported(harbour, live, kind)).content.size_bytes > 10_000
        assert same.pop(), kind


@pytest.mark.slow
async def test_one_that_everybody_left_makes_room_for_the_next(harbour: Harbour, live: LiveMission) -> None:
    children = new_children()
    first, second = (asyncio.create_task(reported(harbour, live)) for _ in range(2))
    await until(children, "a process makes the report")
    (process,) = children()
    first.cancel()
    await asyncio.wait([first])
    assert process.is_running(), "somebody waits for it"
    second.cancel()
    await until(lambda: not process.is_running() or process.status() == psutil.STATUS_ZOMBIE, "it has ended")
    assert (await reported(harbour, live)).content.size_bytes


async def test_one_whose_process_is_killed_is_told_so_and_can_be_asked_for_again(
    harbour: Harbour, live: LiveMission
) -> None:
    children = new_children()
    asked = asyncio.create_task(exported(harbour, live, "tif"))
    await until(children, "a process makes the file")
    children()[0].kill()
    with pytest.raises(ProductUnavailableError, match="memory may be short"):
        await asked
    assert (await exported(harbour, live, "tif")).content.whole()[:2] in (b"II", b"MM")


async def test_without_a_map_there_is_no_process(harbour: Harbour, live: LiveMission) -> None:
    empty = await harbour.service.get((await harbour.service.create(make_spec(name="empty"))).id)
    children = new_children()
    with pytest.raises(MapNotReadyError):
        await exported(harbour, empty, "tif")
    assert not children()
