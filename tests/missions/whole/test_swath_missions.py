"""Missions that cover their area with swath sonars: seen to the last corner, ended by themselves, taken up again."""

import io
from collections.abc import AsyncIterator, Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from sqlalchemy import select

from app.mapping.s44 import Order
from app.missions.errors import InvalidRequestError
from app.missions.flight.decisions import deciding
from app.missions.flight.decisions.decision import Decision, decide
from app.missions.flight.decisions.leg import Place
from app.missions.flight.orders import orders_of
from app.missions.live.mission import LiveMission
from app.missions.operations.corrections.crossovers import survey_check
from app.missions.operations.corrections.patch_test import estimate_mounting
from app.missions.operations.corrections.recorrection import set_mounting
from app.missions.operations.maps.mission_maps import export, map_at_step, newest_map
from app.missions.preflight.survey import preflight
from app.missions.running import vehicle_orders
from app.missions.settings import ServiceSettings
from app.missions.spec.mission import MissionSpec
from app.missions.spec.mounting import MountingSpec
from app.missions.spec.orders import GoOrder, OrderState
from app.missions.spec.water import Tide
from app.missions.states import ENDED, MissionState
from app.missions.views.measurements.mounting_estimate import MountingEstimateRequest
from app.missions.views.mission import CheckStatus
from app.storage.models import TelemetryRow
from tests.support.missions.harbour import Harbour, act, until_state, view_of
from tests.support.missions.pings import ping
from tests.support.missions.specs import lon_lat, spec_json
from tests.support.waiting import until

SIDE_M = 50.0
SONAR = {"beams": 96, "rate_hz": 3.0}


def swath_spec(**changes: Any) -> MissionSpec:
    values: dict[str, Any] = {
        "vehicles": [
            {"name": name, "kind": "sim", "sensor": "multibeam", "sonar": SONAR, "depth_m": depth_m}
            for name, depth_m in (("a", 1.0), ("b", 2.0))
        ],
        "budget": {"minutes": 60},
        "cell_m": 1.0,
        "limits": {"max_step_m": 25.0, "min_depth_m": 1.0},
        "planner": {"name": "swath"},
    }
    return MissionSpec.model_validate(spec_json(SIDE_M, **(values | changes)))


@pytest.fixture
async def harbour(make_settings: Callable[..., ServiceSettings], tmp_path: Path) -> AsyncIterator[Harbour]:
    simulation = {"family": "flat", "seed": 3}
    harbour = Harbour(lambda **changes: make_settings(**({"simulation": simulation, "time_scale": 30.0} | changes)))
    await harbour.open()
    yield harbour
    await harbour.close()


async def started(harbour: Harbour, **changes: Any) -> LiveMission:
    mission = await harbour.service.create(swath_spec(**changes))
    await act(harbour.service, mission.id, "start")
    return await harbour.service.get(mission.id)


async def ensonified(live: LiveMission, share_pct: float) -> None:
    async def reached() -> bool:
        assert live.header.state not in ENDED, live.header.reason
        return (live.progress().ensonified_pct or 0.0) >= share_pct

    await until(reached, f"{share_pct} % are ensonified")


@pytest.mark.slow
async def test_a_mission_sees_all_of_its_area_and_ends_by_itself(harbour: Harbour) -> None:
    live = await started(harbour)
    await until_state(harbour.service, live.id, MissionState.FINISHED)
    built = await live.map.build()
    progress = live.progress()
    assert built is not None
    assert progress.ensonified_pct is not None
    assert progress.ensonified_pct > 99.0
    assert progress.holidays == 0
    assert progress.coverage_pct == progress.ensonified_pct
    assert progress.minutes_left is not None
    assert progress.minutes_left > 30.0, "it did not wait for its time to be up"
    assert progress.beams > 10_000


@pytest.mark.usefixtures("simulated_time")
@pytest.mark.slow
async def test_a_vehicle_that_was_sent_elsewhere_leaves_nothing_out(harbour: Harbour) -> None:
    live = await started(harbour)
    await ensonified(live, 15.0)
    await vehicle_orders.go(live, "a", GoOrder(position=lon_lat(45.0, 45.0)), "Ana")
    await until_state(harbour.service, live.id, MissionState.FINISHED)
    assert [order.state for order in await orders_of(live)] == [OrderState.DONE]
    await live.map.build()  # what was seen on the last legs is in no map yet
    progress = live.progress()
    assert progress.holidays == 0
    assert (progress.ensonified_pct or 0.0) > 99.0


@pytest.mark.slow
async def test_cells_and_what_was_left_are_the_same_after_the_service_started_again(harbour: Harbour) -> None:
    live = await started(harbour, cell_m=0.5, coverage={"cell_of_depth": 0.1})
    await until_state(harbour.service, live.id, MissionState.FINISHED)

    async def refined() -> Any:
        mission = await harbour.service.get(live.id)
        settings = harbour.service.settings
        product = await export(mission, harbour.service.maps, settings.provider, harbour.service.compute, "vr.bag")
        with h5py.File(io.BytesIO(product.content.whole())) as file:
            return [file[f"BAG_root/varres_{name}"][:] for name in ("metadata", "refinements", "nodes")]

    places, nodes, samples = await refined()
    built, progress = live.builder.newest, live.progress()
    assert built is not None
    assert samples["n_samples"].sum() == built.map.count.sum()
    deepest = float(np.nanmax(built.map.depth_m))
    assert places["resolution_x"].max() > 0.5, f"it is {deepest:.1f} m deep"
    assert progress.ensonified_pct is not None
    assert progress.dense_pct is not None
    assert progress.ensonified_pct > 99.0
    single = [100.0 * float((built.map.count >= least).mean()) for least in (1, 5)]
    assert progress.ensonified_pct >= single[0]
    assert progress.dense_pct > single[1], "larger cells hold more soundings"
    await harbour.reopen()
    for before, after in zip((places, nodes, samples), await refined(), strict=True):
        np.testing.assert_array_equal(before, after)
    again = (await harbour.service.get(live.id)).progress()
    assert progress.minutes_left is not None
    assert again.minutes_left is not None
    assert again.minutes_left == pytest.approx(progress.minutes_left, abs=0.02)
    assert again.minutes_left < 60.0


@pytest.mark.slow
async def test_a_map_of_swaths_is_shown_as_it_was_at_any_step(harbour: Harbour) -> None:
    live = await started(harbour)
    await until_state(harbour.service, live.id, MissionState.FINISHED)
    newest = (await newest_map(live, harbour.service.maps)).built.map
    for _ in ("pings in blocks or files", "pings in files"):
        last = (await map_at_step(live, live.header.step)).built.map
        np.testing.assert_allclose(last.depth_m, newest.depth_m, atol=1e-9)
        np.testing.assert_array_equal(last.count, newest.count)
        early = (await map_at_step(live, 4)).built.map
        assert 0 < early.count.sum() < 0.7 * last.count.sum()
        assert (early.count <= last.count).all()
        await harbour.reopen()
        live = await harbour.service.get(live.id)


@pytest.mark.slow
@pytest.mark.usefixtures("simulated_time")
async def test_a_service_that_starts_again_knows_what_was_seen(harbour: Harbour) -> None:
    live = await started(harbour)
    await ensonified(live, 25.0)
    await harbour.reopen()
    again = await harbour.service.get(live.id)
    await again.swath.complete()
    seen = again.builder.swath.beams
    assert seen >= 0.95 * again.progress().beams, "all but spikes"
    await until_state(harbour.service, live.id, MissionState.FINISHED)
    await again.map.build()
    progress = again.progress()
    assert progress.ensonified_pct is not None
    assert progress.ensonified_pct > 99.0
    assert progress.beams > seen


@pytest.mark.slow
async def test_nothing_is_left_only_where_nothing_is_expected_of_legs_that_were_flown(
    harbour_closed: Harbour, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As when a vehicle came to the end of its leg from elsewhere, and saw other ground than it was sent to see."""
    expecting: list[int] = []

    def expects(number: int, spec: Any, limits: Any, planner: Any, places: list[Place], *more: Any) -> Decision:
        memory = planner.snapshot()
        decision = decide(number, spec, limits, planner, places, *more)
        if (number > 3 and not expecting) or (expecting and not any(place.at_rest for place in places)):
            planner.restore(memory)
            expecting.append(number)
            return replace(decision, legs=[], done=frozenset(place.vehicle for place in places))
        return decision

    monkeypatch.setattr(deciding, "decide", expects)
    await harbour_closed.open(simulation={"family": "flat", "seed": 3}, time_scale=30.0)
    vehicle = {"name": "a", "kind": "sim", "sensor": "multibeam", "sonar": SONAR, "depth_m": 1.0}
    live = await started(harbour_closed, vehicles=[vehicle])
    await until_state(harbour_closed.service, live.id, MissionState.FINISHED)
    await live.map.build()
    assert expecting
    assert live.header.reason == "nothing is left to ensonify"
    assert (live.progress().ensonified_pct or 0.0) > 99.0
    assert live.progress().eta_s == 0.0


async def test_a_mission_that_did_not_see_all_says_so_when_it_ends(
    harbour: Harbour, monkeypatch: pytest.MonkeyPatch
) -> None:
    def gives_up(*arguments: Any, **more: Any) -> Decision:
        decision = decide(*arguments, **more)
        return replace(decision, legs=[], terms={"left_pct": 3.21}, done=frozenset({"a", "b"}))

    monkeypatch.setattr(deciding, "decide", gives_up)
    live = await started(harbour)
    await until_state(harbour.service, live.id, MissionState.FINISHED)
    assert live.header.reason == "nothing is left to ensonify but 3.2 % of the area, which lines do not see"
    assert live.progress().eta_s == 0.0


@pytest.mark.slow
async def test_a_finished_survey_is_shown_without_reading_its_pings(harbour: Harbour) -> None:
    live = await started(harbour)
    await until_state(harbour.service, live.id, MissionState.FINISHED)

    await harbour.service.maps.last(live.id)
    before = live.progress()
    await harbour.reopen()
    again = await harbour.service.get(live.id)
    assert again.swath.unread
    assert (again.progress().ensonified_pct, again.progress().holidays) == (before.ensonified_pct, before.holidays)


async def test_pings_are_placed_anew_when_the_tide_is_known(harbour: Harbour) -> None:
    vehicles = [{"name": "a", "kind": "rest", "sensor": "multibeam"}]
    live = await harbour.service.get((await harbour.service.create(swath_spec(vehicles=vehicles))).id)
    for number in range(20):
        live.receive(ping(number, heading_rad=0.0))
    await live.journal.flush()
    built = await live.map.build()
    assert built is not None
    before = built.map.depth_m.copy()
    spec = live.spec.model_copy(update={"tide": Tide(level_m=1.5, source="gauge")})
    corrections = type(live.gate.corrections)(live.frame, spec.tide)
    live.recorrect(spec, corrections, live.journal.counts)
    after = await live.map.build()
    assert after is not None
    seen = np.isfinite(before)
    assert seen.any()
    assert np.array_equal(seen, np.isfinite(after.map.depth_m))
    assert np.allclose((before - after.map.depth_m)[seen], 1.5)


@pytest.mark.slow
async def test_vehicles_keep_a_height_above_a_bottom_that_falls_away(harbour_closed: Harbour) -> None:
    harbour = harbour_closed
    await harbour.open(simulation={"family": "slope", "seed": 2}, time_scale=20.0)
    vehicle = {"name": "a", "kind": "sim", "sensor": "multibeam", "sonar": SONAR, "depth_m": 1.0, "altitude_m": 4.0}
    live = await started(harbour, vehicles=[vehicle])
    await until_state(harbour.service, live.id, MissionState.FINISHED)
    built, progress = await live.map.build(), live.progress()
    assert built is not None
    assert progress.ensonified_pct is not None
    assert progress.ensonified_pct > 99.0
    assert (live.header.terms or {}).get("left_pct") == 0.0
    async with harbour.database.reading() as session:
        samples = (await session.scalars(select(TelemetryRow).where(TelemetryRow.mission_id == live.id))).all()
    heights = np.array([sample.altitude_m for sample in samples if sample.altitude_m is not None])
    depths = np.array([sample.depth_m for sample in samples if sample.depth_m is not None])
    assert heights.min() >= 4.0 - 0.3, "it keeps its height, in turns and circles too"
    assert depths.max() > 2.0, "it goes down with the bottom, beyond its depth"


async def test_it_is_said_what_the_planner_needs(harbour: Harbour) -> None:
    with pytest.raises(InvalidRequestError, match="has no swath"):
        await harbour.service.create(swath_spec(vehicles=[{"name": "a", "kind": "sim"}]))
    with pytest.raises(InvalidRequestError, match="lines of their own"):
        await harbour.service.create(swath_spec(limits={"max_step_m": 25.0, "com_range_m": 100.0}))
    assert (await view_of(harbour.service, (await harbour.service.create(swath_spec())).id)).state is MissionState.READY


async def test_the_checklist_warns_of_vehicles_that_are_too_fast(harbour: Harbour) -> None:
    mission = await harbour.service.create(swath_spec(cell_m=0.5, speed_mps=1.5))
    checks = {check.id: check for check in preflight(await harbour.service.get(mission.id)).checks}
    assert checks["density.a"].status is CheckStatus.WARNING
    assert "0.75 m/s" in checks["density.a"].remedy
    slow = await harbour.service.create(swath_spec(cell_m=2.0, name="slow"))
    checks = {check.id: check for check in preflight(await harbour.service.get(slow.id)).checks}
    assert checks["density.b"].status is CheckStatus.OK


@pytest.mark.usefixtures("simulated_time")
async def test_a_sonar_that_is_simulated_askew_is_put_right_after_the_mission(harbour: Harbour) -> None:
    askew = {"roll_deg": 3.0, "pitch_deg": -2.0, "offset_m": [0.5, 0.0, 0.3]}
    vehicle = {"name": "a", "kind": "sim", "sensor": "multibeam", "sonar": SONAR, "depth_m": 1.0}
    live = await started(harbour, vehicles=[vehicle | {"simulated_mounting": askew}], sounding_noise=0.0)
    await ensonified(live, 40.0)
    await act(harbour.service, live.id, "finish")
    await until_state(harbour.service, live.id, MissionState.FINISHED)

    async def spread_m() -> float:
        """How far the cells of a floor that is flat lie apart."""
        built = await live.map.build()
        assert built is not None
        return float(np.nanstd(built.map.depth_m[built.map.sounded]))

    off_m = await spread_m()
    await set_mounting(live, "a", MountingSpec.model_validate(askew), "Ana")
    right_m = await spread_m()
    assert off_m > 0.1
    assert right_m < 0.02
    await set_mounting(live, "a", None, "Ana")
    assert await spread_m() == pytest.approx(off_m, rel=1e-12), "beams are summed up in another order than as they came"


@pytest.mark.slow
@pytest.mark.usefixtures("simulated_time")
async def test_what_overlapping_lines_of_a_mission_say_of_its_sonar_puts_the_depths_right(
    harbour_closed: Harbour,
) -> None:
    harbour = harbour_closed
    await harbour.open(simulation={"family": "rugged", "seed": 2}, time_scale=30.0)
    askew = {"roll_deg": 2.0, "pitch_deg": -2.5, "heading_deg": 2.0}
    vehicle = {"name": "a", "kind": "sim", "sensor": "multibeam", "sonar": SONAR, "depth_m": 1.0}
    live = await started(
        harbour,
        vehicles=[vehicle | {"simulated_mounting": askew}],
        sounding_noise=0.0,
        coverage={"overlap_pct": 50, "crosslines_pct": 20},
    )
    await until_state(harbour.service, live.id, MissionState.FINISHED)
    before = live.gate.corrections
    found = await estimate_mounting(live, "a", MountingEstimateRequest())
    assert live.gate.corrections is before, "nothing is changed"
    told = {one.name.value: one for one in found.parameters}
    for name, real in askew.items():
        one = told[name]
        assert one.value is not None, (name, one.why)
        assert one.sd is not None
        assert abs(one.value - real) < 4.0 * one.sd, one
    assert found.proposal is not None

    async def apart_m() -> float:
        """How far beams of crosslines lie from the depths of all other lines."""
        beams = (await survey_check(live)).beams
        assert beams is not None
        overall = beams.overall(Order.ORDER_1A)
        assert overall is not None
        assert overall.sd_m is not None
        return overall.sd_m

    spoiled_m = await apart_m()
    await set_mounting(live, "a", found.proposal, "Ana")
    right_m = await apart_m()
    assert right_m < 0.5 * spoiled_m
    assert (await estimate_mounting(live, "a", MountingEstimateRequest())).proposal is None
