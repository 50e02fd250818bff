"""Heavy work on a real cluster: the same as here, whatever ends in the middle."""

import asyncio
import contextlib
import logging
import os
import shutil
import signal
import subprocess
import threading
from collections.abc import AsyncIterator, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from prometheus_client import REGISTRY

from app.compute import cluster as cluster_module
from app.compute.compute import Compute
from app.compute.settings import ComputeSettings
from app.compute.worker import facts
from app.missions.errors import InvalidRequestError, ProductUnavailableError
from app.missions.operations.work_processes import WorkProcesses
from tests.support.compute import heavy_work
from tests.support.compute.cluster import DaskCluster, dask_cluster
from tests.support.paths import PROJECT
from tests.support.waiting import until

pytestmark = pytest.mark.filterwarnings("ignore")  # what is killed leaves sockets behind


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_module, "CHECK_S", 0.1)
    monkeypatch.setattr(cluster_module, "CONNECT_S", 60.0)
    monkeypatch.setattr(cluster_module, "ANSWER_S", 60.0)


@pytest.fixture(scope="module")
def dask(tmp_path_factory: pytest.TempPathFactory) -> Iterator[DaskCluster]:
    with dask_cluster(tmp_path_factory.mktemp("dask"), workers=2) as cluster:
        yield cluster


@pytest.fixture
async def compute(dask: DaskCluster) -> AsyncIterator[Compute]:
    processes = WorkProcesses()
    compute = Compute(ComputeSettings(scheduler=dask.address), processes)
    compute.start()
    while len(dask.workers) < 2:
        dask.start_worker()
    await until(lambda: compute.elsewhere and workers() == 2, "both workers are there")
    yield compute
    await compute.close()
    await processes.close()


def workers() -> float:
    return REGISTRY.get_sample_value("bathyfleet_cluster_workers") or 0.0


def counted(name: str, **labels: str) -> float:
    return REGISTRY.get_sample_value(f"bathyfleet_heavy_work_{name}", labels) or 0.0


def forget_dead(dask: DaskCluster) -> None:
    for worker in [one for one in dask.workers if one.poll() is not None]:
        dask.workers.remove(worker)


def begun_by(folder: Path) -> list[int]:
    return [int(mark.name) for mark in folder.iterdir()]


async def begun(folder: Path, work: "asyncio.Task[int]") -> int:
    """The process that has begun it."""
    await until(lambda: work.done() or begun_by(folder), "it has begun")
    assert not work.done()
    return begun_by(folder)[0]


@pytest.mark.slow
async def test_workers_return_and_refuse_what_this_process_would(compute: Compute, dask: DaskCluster) -> None:
    table = np.arange(12.0).reshape(4, 3)
    made, writable = await compute.run(heavy_work.doubled, table)
    np.testing.assert_array_equal(made, 2.0 * np.arange(12.0).reshape(4, 3))
    np.testing.assert_array_equal(table, np.arange(12.0).reshape(4, 3))
    made *= 2.0
    assert writable
    with pytest.raises(InvalidRequestError, match="it cannot be") as refused:
        await compute.make(heavy_work.refuse)
    assert (refused.value.field, refused.value.remedy) == ("format", "ask for another")
    there = {worker.pid for worker in dask.workers}
    assert await compute.run(heavy_work.process) in there
    assert await asyncio.to_thread(compute.in_thread, heavy_work.process) in there
    async with compute.process("json") as process:
        assert await process.make(heavy_work.process) in there
    assert compute.state == "ok"


async def test_a_worker_that_is_killed_in_the_middle_costs_a_repetition(
    compute: Compute, dask: DaskCluster, tmp_path: Path
) -> None:
    repeated = counted("repeated_total", why="lost")
    work = asyncio.create_task(compute.run(heavy_work.begin_and_hang_first, tmp_path))
    first = await begun(tmp_path, work)
    os.kill(first, signal.SIGKILL)
    second = await work
    assert second != first
    assert second in {worker.pid for worker in dask.workers}
    assert counted("repeated_total", why="lost") == repeated
    assert compute.state == "ok"
    await until(lambda: any(worker.poll() is not None for worker in dask.workers), "it has ended")
    forget_dead(dask)


async def test_what_ends_workers_is_done_by_a_process_that_may_end(compute: Compute, dask: DaskCluster) -> None:
    repeated = counted("repeated_total", why="died")
    made = await compute.run(heavy_work.kill_workers)
    assert made != os.getpid()
    assert counted("repeated_total", why="died") == repeated + 1
    await until(lambda: all(worker.poll() is not None for worker in dask.workers), "both have ended")
    forget_dead(dask)


async def test_what_is_late_is_done_here_and_the_cluster_may_leave_it(
    compute: Compute, dask: DaskCluster, tmp_path: Path
) -> None:
    impatient = ComputeSettings.model_construct(scheduler=dask.address, timeout_s=0.5)
    processes = WorkProcesses()
    other = Compute(impatient, processes)
    other.start()
    await until(lambda: other.elsewhere, "the cluster is there")
    assert await other.run(heavy_work.hang_workers, tmp_path) == os.getpid()
    await other.close()
    await processes.close()
    for process in begun_by(tmp_path):
        os.kill(process, signal.SIGKILL)
        await until(lambda: any(worker.poll() is not None for worker in dask.workers), "it has ended")
    forget_dead(dask)


async def test_what_is_under_way_when_the_service_ends_is_not_begun_here(dask: DaskCluster, tmp_path: Path) -> None:
    processes = WorkProcesses()
    compute = Compute(ComputeSettings(scheduler=dask.address), processes)
    compute.start()
    await until(lambda: compute.elsewhere, "the cluster is there")
    work = asyncio.create_task(compute.run(heavy_work.begin_and_hang_first, tmp_path))
    waiting = asyncio.create_task(asyncio.to_thread(compute.in_thread, heavy_work.begin_and_hang_first, tmp_path))
    worker = await begun(tmp_path, work)
    await processes.close()
    compute.end()
    with pytest.raises(ProductUnavailableError, match="the service is ending"):
        await work
    with contextlib.suppress(ProductUnavailableError):  # the other worker may have done it
        assert await waiting != os.getpid()
    await compute.close()
    os.kill(worker, signal.SIGKILL)
    await until(lambda: any(one.poll() is not None for one in dask.workers), "it has ended")
    forget_dead(dask)


async def test_who_no_longer_waits_does_not_keep_others_waiting(compute: Compute, tmp_path: Path) -> None:
    works = [asyncio.create_task(compute.run(heavy_work.process)) for _ in range(20)]
    for work in works[:10]:
        work.cancel()
    made = await asyncio.gather(*works[10:])
    assert os.getpid() not in made


async def test_what_cannot_be_sent_is_done_here(compute: Compute) -> None:
    number = 7
    assert await compute.run(lambda: (number, os.getpid())) == (7, os.getpid())
    assert compute.state == "ok"


async def test_a_worker_with_other_versions_is_told_and_nothing_is_given_to_it(
    compute: Compute, dask: DaskCluster, tmp_path: Path
) -> None:
    (tmp_path / "sitecustomize.py").write_text("import app\napp.__version__ = '0.0.9'\n")
    other = dask.start_worker(PYTHONPATH=f"{tmp_path}{os.pathsep}{PROJECT}")
    await until(lambda: not compute.elsewhere, "it was noticed")
    words = f"bathyfleet 0.0.9 where this service has {facts()['bathyfleet']}"
    assert words in (compute.state or "")
    assert await compute.run(heavy_work.process) == os.getpid()
    other.kill()
    other.wait()
    forget_dead(dask)
    await until(lambda: compute.elsewhere, "it was noticed that it has gone")
    assert await compute.run(heavy_work.process) != os.getpid()


@pytest.mark.slow
async def test_a_cluster_that_is_gone_in_the_middle_costs_a_repetition_and_is_used_when_it_is_back(
    compute: Compute, dask: DaskCluster, tmp_path: Path
) -> None:
    repeated = counted("repeated_total", why="lost")
    in_turn = asyncio.create_task(compute.run(heavy_work.begin_and_hang_first, tmp_path))
    first = await begun(tmp_path, in_turn)
    waiting = asyncio.create_task(asyncio.to_thread(compute.in_thread, heavy_work.begin_and_hang_first, tmp_path))
    dask.kill_scheduler()
    os.kill(first, signal.SIGKILL)
    assert await in_turn == os.getpid()
    await waiting
    assert counted("repeated_total", why="lost") > repeated
    await until(lambda: dask.address in (compute.state or ""), "it is told to be gone")
    assert workers() == 0
    async with compute.process("json") as process:
        assert await process.make(heavy_work.process) not in {os.getpid(), *(one.pid for one in dask.workers)}
    dask.kill_workers()
    dask.start_scheduler()
    dask.start_worker()
    await until(lambda: compute.elsewhere, "it is back")
    assert await compute.run(heavy_work.process) == dask.workers[0].pid


async def test_without_a_cluster_that_answers_everything_is_done_here(
    unused_tcp_port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster_module, "CONNECT_S", 0.2)
    processes = WorkProcesses()
    compute = Compute(ComputeSettings(scheduler=f"tcp://127.0.0.1:{unused_tcp_port}"), processes)
    compute.start()
    assert await compute.run(heavy_work.process) == os.getpid()
    await until(lambda: "no Dask scheduler answers" in (compute.state or ""), "it was looked for")
    assert str(unused_tcp_port) in (compute.state or "")
    assert not logging.getLogger("distributed.client").isEnabledFor(logging.ERROR), "it is told here, not by tracebacks"
    assert await asyncio.to_thread(compute.in_thread, heavy_work.process) == os.getpid()
    await compute.close()
    await processes.close()


async def test_what_waits_to_be_repeated_here_holds_no_thread_of_the_service(unused_tcp_port: int) -> None:
    processes = WorkProcesses()
    compute = Compute(ComputeSettings(scheduler=f"tcp://127.0.0.1:{unused_tcp_port}"), processes)
    shared = ThreadPoolExecutor(2)
    asyncio.get_running_loop().set_default_executor(shared)
    begun, go_on = threading.Event(), threading.Event()

    def work() -> bool:
        begun.set()
        return go_on.wait(60.0)

    works = [asyncio.create_task(compute.run(work)) for _ in range(6)]
    try:
        await until(begun.is_set, "one is being repeated")
        async with asyncio.timeout(20.0):
            assert await asyncio.to_thread(os.getpid) == os.getpid()
        works[-1].cancel()
    finally:
        go_on.set()
    assert await asyncio.gather(*works[:-1]) == [True] * 5
    await compute.close()
    await processes.close()


def signed(folder: Path, name: str) -> tuple[str, str]:
    """Return the files of a certificate for 127.0.0.1 by an authority of this test, and of its key."""
    openssl = shutil.which("openssl")
    if openssl is None:
        pytest.skip("openssl is not installed: no certificate can be made")
    key, file = folder / f"{name}.key", folder / f"{name}.pem"
    new = [openssl, "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2"]
    named = ["-subj", f"/CN={name}", "-addext", "subjectAltName=IP:127.0.0.1", "-keyout", str(key), "-out", str(file)]
    by = ["-CA", str(folder / "ca.pem"), "-CAkey", str(folder / "ca.key")] if name != "ca" else []
    subprocess.run(new + named + by, check=True, capture_output=True)
    return str(file), str(key)


async def test_an_encrypted_cluster_takes_work_by_certificate_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    authority, _ = signed(tmp_path, "ca")
    certificate, key = signed(tmp_path, "cluster")
    stranger = tmp_path / "stranger"
    stranger.mkdir()
    signed(stranger, "ca")
    options = [f"--tls-ca-file={authority}", f"--tls-cert={certificate}", f"--tls-key={key}"]
    processes = WorkProcesses()
    with dask_cluster(tmp_path, 1, "tls", options) as dask:
        files = {"tls_ca_file": authority, "tls_certificate": certificate, "tls_key": key}
        compute = Compute(ComputeSettings.model_validate({"scheduler": dask.address} | files), processes)
        compute.start()
        await until(lambda: compute.elsewhere, "it lets us in")
        assert await compute.run(heavy_work.process) == dask.workers[0].pid
        await compute.close()
        monkeypatch.setattr(cluster_module, "CONNECT_S", 2.0)
        certificate, key = signed(stranger, "other")
        files |= {"tls_certificate": certificate, "tls_key": key}
        compute = Compute(ComputeSettings.model_validate({"scheduler": dask.address} | files), processes)
        compute.start()
        await until(lambda: "no Dask scheduler answers" in (compute.state or ""), "it does not let a stranger in")
        assert await compute.run(heavy_work.process) == os.getpid()
        await compute.close()
    await processes.close()
