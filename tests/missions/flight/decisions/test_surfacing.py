"""Vehicles that come up for a fix because they no longer know well enough where they are."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from sqlalchemy import select

from app.missions.flight.decisions.decision import Decision
from app.missions.flight.decisions.leg import Place
from app.missions.states import MissionState
from app.missions.task.constraints import make_constraints
from app.storage.database import Database
from app.storage.models import EventRow, WaypointRow
from tests.support.missions.decisions import decide_for, place
from tests.support.missions.harbour import Harbour, act, sim_spec, until_state
from tests.support.missions.specs import make_spec

POLICY: dict[str, Any] = {"surface_policy": {"max_position_sd_m": 3.0, "good_position_sd_m": 0.5}}


def decided(places: list[Place], wishes: list[list[float]], **changes: Any) -> Decision:
    return decide_for(places, wishes, **(POLICY | changes))[0]


def test_who_does_not_know_where_it_is_comes_up_along_its_leg() -> None:
    lost = replace(place("a", 10, 10), position_sd_m=2.8)
    decision = decided([lost, replace(place("b", 40, 40), position_sd_m=2.0)], [[15.0, 12.0, 9.0], [42.0, 45.0, 9.0]])
    np.testing.assert_allclose([leg.target_m for leg in decision.legs], [[15, 12, 0.0], [42, 45, 2.0]])
    assert [leg.surfacing for leg in decision.legs] == [True, False]
    assert list(decision.fixes) == ["a"]
    assert "knows its position to 2.8 m, 3 m are allowed" in decision.fixes["a"]


def test_it_stays_up_until_its_position_is_good_and_then_goes_down() -> None:
    for sd, depth, said in ((1.0, 0.0, ""), (math.nan, 0.0, ""), (0.4, 2.0, "goes down again")):
        up = replace(place("a", 10, 10), position_sd_m=sd, surfacing_depth_m=0.1)
        decision = decided([up], [[15.0, 12.0, 9.0]])
        assert decision.legs[0].target_m[2] == pytest.approx(depth)
        assert said in decision.fixes.get("a", "")
        assert bool(said) == bool(decision.fixes)


def test_a_deep_vehicle_comes_up_in_several_steps() -> None:
    depth, steps = 18.0, 0
    here = replace(place("a", 10, 10, depth), position_sd_m=3.5)
    limits = {"max_step_m": 5.0, "max_depth_m": 30.0}
    while depth > 0.0:
        decision = decided([here], [[14.0, 10.0, 9.0]], limits=limits, belief=None)
        rise = depth - decision.legs[0].target_m[2]
        assert decision.legs[0].refusal == ""
        assert steps == 0 or 0.0 < rise <= 5.0
        depth = float(decision.legs[0].target_m[2])
        here = replace(here, surfacing_depth_m=depth)
        steps += 1
    assert steps <= 5


def test_without_a_policy_or_a_deviation_nobody_comes_up() -> None:
    assert (
        decided([replace(place("a", 10, 10), position_sd_m=9.0)], [[15.0, 12.0, 9.0]], surface_policy=None).fixes == {}
    )
    assert decided([place("a", 10, 10)], [[15.0, 12.0, 9.0]]).legs[0].target_m[2] == 2.0


@given(
    st.lists(st.tuples(st.floats(0, 60), st.floats(0, 60), st.floats(0, 6), st.booleans()), min_size=1, max_size=4),
    st.integers(0, 99),
)
@settings(max_examples=40, deadline=None)
def test_coming_up_breaks_no_limit(rows: list[tuple[float, float, float, bool]], seed: int) -> None:
    """Whatever is sent keeps area, separation and step, also when several come up at once."""
    rng = np.random.default_rng(seed)
    places = [
        replace(place(f"v{k}", e, n, 2.0 + k), position_sd_m=sd, surfacing_depth_m=0.0 if up else math.nan)
        for k, (e, n, sd, up) in enumerate(rows)
    ]
    wishes = [[*(np.array([e, n]) + rng.uniform(-9, 9, 2)), 5.0] for e, n, _, _ in rows]
    decision, planner, spec = decide_for(places, wishes, **POLICY)
    if not planner.asked:
        return
    constraints = make_constraints(spec)
    origin = planner.asked[0].positions
    sent = [k for k, leg in enumerate(decision.legs) if not leg.refusal]
    if len(sent) == len(places):
        targets = np.array([leg.target_m for leg in decision.legs])
        assert constraints.violations(tuple(p.vehicle for p in places), origin, targets) == ()


def test_a_policy_that_cannot_be_kept_is_refused_with_what_would_be_right() -> None:
    with pytest.raises(ValidationError, match="must be known better than the limit"):
        make_spec(surface_policy={"max_position_sd_m": 1.0, "good_position_sd_m": 2.0})


@pytest.mark.slow
async def test_a_running_mission_brings_its_vehicles_up_and_down_again(harbour: Harbour, database: Database) -> None:
    """Simulated vehicles whose dead reckoning drifts: fixes come at the surface, the log tells of each."""
    service = await harbour.reopen(simulation={"drift_m2ps": 0.05})
    spec = sim_spec("a", steps=12, surface_policy={"max_position_sd_m": 1.0, "good_position_sd_m": 0.4})
    mission = await service.create(spec)
    await act(service, mission.id, "start", actor="Ana")
    await until_state(service, mission.id, MissionState.FINISHED)
    async with database.reading() as session:
        rows = (
            await session.execute(select(EventRow).where(EventRow.kind == "surface").order_by(EventRow.id))
        ).scalars()
        said = [row.message for row in rows]
        steps = (await session.execute(select(WaypointRow).order_by(WaypointRow.step))).scalars()
        depths = [row.depth_m for row in steps]
    assert "comes up for a fix" in said[0]
    assert "goes down again" in said[1]
    assert 0.0 in depths
    assert max(depths) == pytest.approx(2.0)


CLOCK: dict[str, Any] = {"surface_policy": {"every_min": 20, "stay_s": 60}}


def test_by_the_clock_a_vehicle_comes_up_and_goes_down_again_whatever_it_says() -> None:
    for sd in (math.nan, 50.0):
        late = replace(place("a", 10, 10), position_sd_m=sd, submerged_s=1201.0)
        decision = decided([late], [[15.0, 12.0, 9.0]], **CLOCK)
        assert [leg.surfacing for leg in decision.legs] == [True]
        assert "it was under water for 20 min" in decision.fixes["a"]
        up = replace(late, surfacing_depth_m=0.1)
        assert decided([up], [[15.0, 12.0, 9.0]], **CLOCK).legs[0].surfacing, "it has not been up for long enough"
        fixed = replace(up, submerged_s=0.0)
        decision = decided([fixed], [[15.0, 12.0, 9.0]], **CLOCK)
        assert [leg.surfacing for leg in decision.legs] == [False]
        assert "goes down again" in decision.fixes["a"]
        early = replace(late, submerged_s=1199.0)
        assert not decided([early], [[15.0, 12.0, 9.0]], **CLOCK).legs[0].surfacing


@pytest.mark.slow
async def test_a_mission_brings_its_vehicles_up_by_the_clock(harbour: Harbour, database: Database) -> None:
    service = harbour.service
    policy = {"every_min": 1.0, "stay_s": 5.0}
    mission = await service.create(sim_spec("a", steps=40, side_m=60.0, surface_policy=policy))
    await act(service, mission.id, "start")
    ended = await until_state(service, mission.id, MissionState.FINISHED)
    assert ended.vehicles[0].risings >= 2


@pytest.mark.parametrize("policy", [{}, {"every_min": 10, "good_position_sd_m": 1.0}, {"stay_s": 5.0}])
def test_a_policy_says_when(policy: dict[str, float]) -> None:
    with pytest.raises(ValidationError, match="max_position_sd_m"):
        make_spec(surface_policy=policy)
