"""What is foretold of a mission, beside what comes of it."""

import asyncio
import threading

import numpy as np
import pytest

from app.missions import forecasts
from app.missions.errors import ConflictError, InvalidRequestError
from app.missions.forecast_floor import floor_of
from app.missions.forecasting import Forecast, forecast
from app.missions.service import MissionService
from app.missions.spec import MissionSpec
from app.missions.states import MissionState
from tests.missions.builders import make_spec
from tests.missions.fleet import sim_spec, until, until_state

NONE = np.zeros((0, 4))


def lines(**changes: object) -> MissionSpec:
    return sim_spec(steps=8, planner={"name": "lawnmower"}, **changes)


async def test_a_forecast_is_near_what_comes_and_says_what_it_assumes(
    service: MissionService, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(forecasts, "BUDGET_S", 600.0)  # on a slow machine, too, all steps are simulated
    spec = lines()
    before = await service.forecast(spec)
    assert before.steps == before.steps_simulated == 8
    mission = (await service.create(spec)).id
    assert (await service.forecast_of(mission)).duration_s == pytest.approx(before.duration_s, rel=0.05)
    await service.act(mission, "start", actor="Ana")
    await until_state(service, mission, MissionState.FINISHED)
    # Between its waypoints: on a slow machine vehicles of this speed circle for long until they get the next one.
    ways: dict[str, list[tuple[float, float, float]]] = {}
    for step in await service.steps(mission):
        for w in step.waypoints:
            ways.setdefault(w.vehicle, []).append((w.east_m, w.north_m, w.depth_m))
    legs = sum(float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum()) for way in ways.values())
    foretold = sum(vehicle.distance_m for vehicle in before.vehicles)
    # The same plan is flown otherwise by vehicles that turn in circles, in so small an area above all.
    assert legs / 2 < foretold < 2 * legs
    assert {vehicle.vehicle for vehicle in before.vehicles} == {"a", "b"}
    assert 0 < before.coverage_pct <= 100
    assert any("guess" in words for words in before.assumptions)
    with pytest.raises(ConflictError, match="nothing before it"):
        await service.forecast_of(mission)


async def test_what_cannot_be_foretold_is_refused_and_nothing_is_stored(service: MissionService) -> None:
    with pytest.raises(InvalidRequestError, match="no vehicle"):
        await service.forecast(make_spec(vehicles=[]))
    with pytest.raises(InvalidRequestError, match="no planner"):
        await service.forecast(make_spec(planner={"name": "oracle"}))
    assert await service.missions() == []


async def test_one_who_leaves_ends_the_simulation(service: MissionService, monkeypatch: pytest.MonkeyPatch) -> None:
    begun, ended = threading.Event(), threading.Event()

    def endless(*_: object, stop: object, **__: object) -> Forecast:
        begun.set()
        while not stop():  # type: ignore[operator]
            pass
        ended.set()
        raise RuntimeError("nobody waits")

    monkeypatch.setattr(forecasts, "forecast", endless)
    asked = asyncio.create_task(service.forecast(lines()))
    await until(begun.is_set, "it is begun")
    asked.cancel()
    await until(ended.is_set, "it ends")
    with pytest.raises(asyncio.CancelledError):
        await asked


def test_time_that_is_up_leaves_a_forecast_that_says_so() -> None:
    spec = lines()
    team = forecasts.Team()
    members = [team.join(vehicle, slot) for slot, vehicle in enumerate(spec.vehicles)]
    starts, _ = forecasts.starts_of(spec, members)
    found = forecast(spec, members, starts, NONE, budget_s=0.0)
    assert found.steps_flown == 1
    # Drawn out: as if every step were as long as the first.
    assert found.duration_s == pytest.approx(8 * min(8.0 / spec.speed_mps + 2.0, 60.0), rel=0.2)
    view = forecasts._view(spec, found, "", 8)
    assert any("1 of 8 steps" in words for words in view.assumptions)


def test_the_floor_is_what_was_imported_and_a_guess_beside_it() -> None:
    spec = make_spec(40.0)
    guessed = floor_of(spec, NONE, 4.0, None)
    assert guessed.known == 0.0
    assert np.median(guessed.terrain.z_m) == pytest.approx(10.0, rel=0.2)
    assert np.ptp(guessed.terrain.z_m) > 1.0
    assert np.median(floor_of(spec, NONE, 4.0, 55.0).terrain.z_m) == pytest.approx(55.0, rel=0.2)
    east, north = np.meshgrid(np.arange(1.0, 20.0, 2.0), np.arange(1.0, 40.0, 2.0))
    prior = np.column_stack([east.ravel(), north.ravel(), 20.0 + 0.1 * east.ravel(), np.full(east.size, 0.1)])
    half = floor_of(spec, prior, 4.0, None)
    assert 0.1 < half.known < 0.6
    assert half.terrain.depth_at_point(9.0, 21.0) == pytest.approx(20.9, abs=0.3)
    assert "imported" in half.words
    again = floor_of(spec, NONE, 4.0, None)
    np.testing.assert_array_equal(guessed.terrain.z_m, again.terrain.z_m)
