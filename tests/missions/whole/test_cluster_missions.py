"""A service with a cluster makes what one without makes, and goes on without it."""

import asyncio
import signal
from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from prometheus_client import REGISTRY

from app.compute import cluster as cluster_module
from app.compute import compute, packing
from app.compute.packing import Packed
from app.compute.settings import ComputeSettings
from app.missions.clock import now
from app.missions.forecast import floor, request
from app.missions.live import mission as live_mission
from app.missions.live.mission import LiveMission
from app.missions.maps import builder, snapshot
from app.missions.operations.corrections.adjustment import adjust
from app.missions.operations.maps import mission_maps
from app.missions.operations.maps.mission_maps import export, newest_map
from app.missions.operations.measurements import measure
from app.missions.service import MissionService
from app.missions.settings import ServiceSettings
from app.missions.soundings.measurement import Measurement
from app.missions.views.measurements.adjustment import AdjustmentRequest
from tests.support.compute.cluster import DaskCluster, dask_cluster
from tests.support.mapping.tracks import flown, lawnmower, measured
from tests.support.missions.harbour import Harbour, sim_spec
from tests.support.missions.specs import make_spec
from tests.support.waiting import until

pytestmark = pytest.mark.filterwarnings("ignore")  # what is killed leaves sockets behind


@pytest.fixture(autouse=True)
def all_is_heavy(monkeypatch: pytest.MonkeyPatch) -> None:
    for module, name, value in (
        (builder, "HEAVY", 1),
        (live_mission, "HEAVY", 1),
        (snapshot, "LARGE_CELLS", 1),
        (cluster_module, "CHECK_S", 0.1),
        (request, "BUDGET_S", 600.0),
        (request, "PATIENCE_S", 600.0),
    ):
        monkeypatch.setattr(module, name, value)


@pytest.fixture(scope="module")
def dask(tmp_path_factory: pytest.TempPathFactory) -> Iterator[DaskCluster]:
    with dask_cluster(tmp_path_factory.mktemp("dask"), workers=1) as cluster:
        yield cluster


@pytest.fixture
async def service(dask: DaskCluster, make_settings: Callable[..., ServiceSettings]) -> AsyncIterator[MissionService]:
    harbour = Harbour(make_settings)
    service = await harbour.open(compute=ComputeSettings(scheduler=dask.address))
    await until(lambda: service.compute.elsewhere, "the cluster is there")
    yield service
    await harbour.close()


@pytest.fixture
def sent(monkeypatch: pytest.MonkeyPatch) -> list[bytes]:
    """All that is given to the cluster."""
    found: list[bytes] = []

    def recorded(content: Any) -> Packed:
        packed = packing.pack(content)
        found.append(packed.head + b"".join(buffer.tobytes() for buffer in packed.buffers))
        return packed

    monkeypatch.setattr(compute, "pack", recorded)
    return found


async def surveyed(service: MissionService) -> LiveMission:
    """A mission with crossing lines of soundings over a flat floor, one of which is wrong."""
    created = await service.create(make_spec(vehicles=[{"name": "a", "kind": "rest"}]))
    live = await service.get(created.id)
    items = measured("a", flown(lawnmower(27, 27, 3), start_s=1_795_225_140.0))
    items += measured("a", flown([(1, 12.3), (28, 12.6)], start_s=1_795_229_140.0))
    items[70]["range_m"] += 3.0
    await measure(live, [Measurement.model_validate(item) for item in items])
    return live


def done(where: str) -> float:
    return REGISTRY.get_sample_value("bathyfleet_heavy_work_total", {"where": where}) or 0.0


def by_the_cluster() -> float:
    return done("cluster")


@pytest.mark.slow
async def test_a_forecast_waits_for_a_cluster_that_hangs_no_longer_than_for_this_machine(
    service: MissionService, dask: DaskCluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(floor, "KINDS", floor.KINDS[:2])
    spec = sim_spec(steps=3, planner={"name": "lawnmower"})
    floors = (await service.forecaster.of_description(spec)).floors
    by_threads = done("thread")
    for process, patience_s, answer_s, expected in (
        (dask.workers[0], 1.0, 60.0, 1),  # nothing comes of it: one floor is flown here all the same
        (dask.scheduler, 600.0, 1.0, floors),  # it is noticed to be gone: this machine has the rest of the time
    ):
        assert process is not None
        monkeypatch.setattr(request, "PATIENCE_S", patience_s)
        monkeypatch.setattr(cluster_module, "ANSWER_S", answer_s)
        await until(lambda: service.compute.elsewhere, "the cluster is there")
        process.send_signal(signal.SIGSTOP)
        try:
            async with asyncio.timeout(90.0):
                assert (await service.forecaster.of_description(spec)).floors == expected
        finally:
            process.send_signal(signal.SIGCONT)
    assert done("thread") == by_threads, "its floors are flown one after the other, by the forecasts' own thread"
    await until(lambda: service.compute.elsewhere, "the cluster is there again")


@pytest.mark.slow
async def test_maps_forecasts_files_and_adjusted_tracks_are_those_made_here(
    service: MissionService, dask: DaskCluster, sent: list[bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    moment = now()
    monkeypatch.setattr(mission_maps, "now", lambda: moment)
    monkeypatch.setattr(floor, "KINDS", floor.KINDS[:2])
    spec = sim_spec(steps=3, planner={"name": "lawnmower"})

    async def product() -> bytes:
        return (await export(live, service.maps, service.settings.provider, service.compute, "tif")).content.whole()

    async def adjusted(mission: LiveMission) -> dict[str, Any]:
        return (await adjust(mission, AdjustmentRequest(), "Ana")).model_dump(exclude={"made_at"})

    live, other, last = [await surveyed(service) for _ in range(3)]
    begun = by_the_cluster()
    there = await newest_map(live, service.maps)
    assert by_the_cluster() == begun + 1, "outliers were judged and cells predicted there"
    doubted = [(row.tolist(), reason) for row, reason in live.builder.doubted()]
    assert len(doubted) == 1
    file = await product()
    ties = await adjusted(other)
    foretold = await service.forecaster.of_description(spec)
    assert by_the_cluster() == begun + 3 + foretold.floors
    assert (await service.forecaster.of_mission(live)).floors == 2
    assert by_the_cluster() == begun + 3 + 2 * foretold.floors
    assert (await service.ready())[1]["compute"] == "ok"

    assert len(sent) == by_the_cluster() - begun
    database = Path(service.settings.database_url.rpartition("/")[2]).name.encode()
    assert not any(database in one for one in sent), "nobody elsewhere learns where the database is"

    dask.kill_workers()
    dask.kill_scheduler()
    await until(lambda: not service.compute.elsewhere, "it is gone")
    well, components = await service.ready()
    assert well
    assert dask.address in components["compute"]
    before = by_the_cluster()
    assert (await newest_map(last, service.maps)).built.digest == there.built.digest
    assert [(row.tolist(), reason) for row, reason in last.builder.doubted()] == doubted
    assert await service.forecaster.of_description(spec) == foretold
    assert await product() == file
    assert await adjusted(last) == ties
    assert by_the_cluster() == before
