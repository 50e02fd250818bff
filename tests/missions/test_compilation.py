"""What is compiled ahead, and what waits for it."""

import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest
from sqlalchemy import select

from app.missions import compilation
from app.missions.running import supervisor
from app.missions.service import MissionService
from app.storage.models import EventRow
from tests.support.missions.harbour import Harbour, act, sim_spec, until_step
from tests.support.waiting import until

COMPILED = """
import pkgutil
from importlib import import_module

import numpy as np
from numba.core.dispatcher import Dispatcher

import app.exploration
from app.estimation import SingleBeam
from app.exploration.planners import create_planner, warm_up_planner
from app.missions.flight.decisions.decision import Knowledge, decide
from app.missions.flight.decisions.leg import Place
from app.missions.task.constraints import make_constraints
from app.missions.live.mission import builder_of
from tests.support.missions.harbour import sim_spec

names = [found.name for found in pkgutil.walk_packages(app.exploration.__path__, "app.exploration.")]
compiled = {id(f): f for name in names for f in vars(import_module(name)).values() if isinstance(f, Dispatcher)}
warm_up_planner("cao", SingleBeam())
before = {key: len(f.signatures) for key, f in compiled.items()}
spec = sim_spec(steps=20)
builder = builder_of(spec)
planner = create_planner("cao", spec.planner.options)
places = [Place("one", np.array([5.0, 5.0]), 0.0, 2.0), Place("two", np.array([15.0, 5.0]), float("nan"), 2.0)]
for step in (1, 2):
    known = Knowledge(builder.belief(), builder.sounded_at_m()[0])
    decide(step, spec, make_constraints(spec), planner, places, known)
    east = np.linspace(1.0, 20.0, 60)
    builder.add(np.column_stack([east, np.full(60, 5.0), 10.0 + np.sin(east), np.full(60, 0.1)]))
    builder.build()
print([f.__name__ for key, f in compiled.items() if len(f.signatures) > before[key]])
"""
"""Prints which compiled functions the default planner's warm-up forgot."""


@pytest.mark.slow
def test_the_default_planner_leaves_nothing_to_compile() -> None:
    # A process of its own: other tests have compiled everything in this one.
    found = subprocess.run([sys.executable, "-c", COMPILED], capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stderr
    assert found.stdout.strip() == "[]"


async def started_anew(harbour: Harbour) -> tuple[MissionService, str]:
    """A service that compiles as it is told to now, and the id of a mission that was started there."""
    await harbour.close()
    service = await harbour.open()
    mission = await service.create(sim_spec(steps=3))
    await act(service, mission.id, "start", actor="Ana")
    return service, mission.id


async def test_the_first_waypoint_does_not_wait_for_what_maps_need(
    harbour: Harbour, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiled = threading.Event()
    monkeypatch.setattr(compilation, "warm_up_maps", compiled.wait)
    try:
        service, mission_id = await started_anew(harbour)
        await until_step(service, mission_id, 1)
        assert not compiled.is_set()
    finally:
        compiled.set()


async def test_an_operator_is_told_that_the_first_legs_wait_for_a_planner_that_is_compiled(
    harbour: Harbour, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiled = threading.Event()
    monkeypatch.setattr(compilation, "warm_up_planner", lambda *_: compiled.wait())
    monkeypatch.setattr(supervisor, "COMPILED_SOON_S", 0.0)
    try:
        service, mission_id = await started_anew(harbour)

        async def told() -> list[str]:
            async with harbour.database.reading() as session:
                query = select(EventRow.message).where(EventRow.message.contains("compiled"))
                return list(await session.scalars(query))

        await until(told, "the operator is told")
        assert await told() == [
            "planner 'random' is being compiled, once on this machine: vehicles get their first legs when that is done"
        ]
        compiled.set()
        await until_step(service, mission_id, 1)
        assert len(await told()) == 1
    finally:
        compiled.set()


@pytest.mark.parametrize("waiting", ["planner", "maps"])
def test_an_executor_that_ends_cancels_what_waits_to_be_compiled(waiting: str, monkeypatch: pytest.MonkeyPatch) -> None:
    executor, busy, let_go = ThreadPoolExecutor(max_workers=1), threading.Event(), threading.Event()

    def block() -> None:
        busy.set()
        let_go.wait()

    def compile_planner(*_: object) -> None:
        executor.submit(block)  # ahead of the maps, which are submitted when this has ended

    monkeypatch.setattr(compilation.Compilation, "_warm_up", compile_planner)
    if waiting == "planner":
        executor.submit(block)
        busy.wait()
    compiling = compilation.Compilation(executor)
    compiling.begin()
    busy.wait()
    # A deadlock would keep the interpreter from ending, but for a daemon.
    end = threading.Thread(target=executor.shutdown, kwargs={"wait": False, "cancel_futures": True}, daemon=True)
    end.start()
    end.join(timeout=10.0)
    let_go.set()
    assert not end.is_alive()
    assert compiling.done
    assert compiling._search.cancelled()
