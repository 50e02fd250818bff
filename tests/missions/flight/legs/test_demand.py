"""Who needs legs, and how many at once."""

from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from app.exploration.motion.leg_rules import AHEAD
from app.missions.flight.legs.demand import MOST_AHEAD, LegDemand
from app.missions.live.mission import LiveMission
from app.missions.service import MissionService
from tests.support.missions.harbour import sim_spec
from tests.support.missions.on_legs import put_on_legs

LIMITS = {"max_step_m": 10.0, "min_separation_m": 0.0}
LINE = [(10.0, 20.0), (10.0, 30.0), (10.0, 40.0), (10.0, 50.0)]
QUICK_S, SLOW_S = 0.01, 60.0

Made = Callable[..., Awaitable[LiveMission]]


@pytest.fixture
def mission(service: MissionService) -> Made:
    async def made(**changes: Any) -> LiveMission:
        values = {"steps": 12, "side_m": 60.0, "limits": LIMITS, "planner": {"name": "lawnmower"}} | changes
        return await service.get((await service.create(sim_spec(**values))).id)

    return made


def names(demand: LegDemand) -> list[str]:
    return [member.name for member in demand.members()]


async def test_who_has_legs_enough_ahead_needs_none_while_decisions_are_quick(mission: Made) -> None:
    live = await mission()
    demand = LegDemand(live, lambda: QUICK_S, 1.0)
    put_on_legs(live, "a", (10.0, 10.0), LINE[: 1 + AHEAD])
    put_on_legs(live, "b", (40.0, 10.0), LINE)
    assert names(demand) == []
    put_on_legs(live, "a", (10.0, 10.0), LINE[:AHEAD])
    assert names(demand) == ["a"]
    assert names(LegDemand(live, lambda: SLOW_S, 1.0)) == ["a", "b"]


async def test_who_has_flown_its_way_or_is_out_of_reach_needs_none(mission: Made) -> None:
    live = await mission(steps=4)
    demand = LegDemand(live, lambda: QUICK_S, 1.0)
    flown = put_on_legs(live, "a", LINE[-1], LINE)
    flown.ahead.clear()
    away = put_on_legs(live, "b", (40.0, 10.0))
    away.engaged = False
    assert names(demand) == []
    assert [demand.wants_legs(flown), demand.wants_legs(away)] == [False, True]


async def test_who_got_none_is_left_out_until_something_changes(mission: Made) -> None:
    live = await mission()
    demand = LegDemand(live, lambda: QUICK_S, 1.0)
    put_on_legs(live, "a", (10.0, 10.0))
    demand.look_later(["a"])
    assert names(demand) == []
    demand.look_now()
    assert names(demand) == ["a"]


async def test_who_joins_goes_on_with_the_number_that_the_others_have_come_to(mission: Made) -> None:
    live = await mission()
    ahead = put_on_legs(live, "a", (10.0, 10.0), LINE)
    live.header.step = 4
    demand = LegDemand(live, lambda: QUICK_S, 1.0)
    joins = put_on_legs(live, "b", (40.0, 10.0))
    assert demand.next_number(ahead) == 5
    assert demand.next_number(joins) == 2, "the other one flies its first leg"
    demand.note_decided({"b"})
    assert demand.next_number(joins) == 1, "it counts for itself from then on"


async def test_slow_decisions_give_more_legs_at_once_and_one_where_positions_are_watched(mission: Made) -> None:
    live = await mission()
    vehicle = put_on_legs(live, "a", (10.0, 10.0))
    assert LegDemand(live, lambda: QUICK_S, 1.0).legs_at_once([vehicle]) == 1 + AHEAD
    assert LegDemand(live, lambda: SLOW_S, 1.0).legs_at_once([vehicle]) == MOST_AHEAD
    followed = await mission(surface_policy={"max_position_sd_m": 3.0})
    vehicle = put_on_legs(followed, "a", (10.0, 10.0))
    assert LegDemand(followed, lambda: SLOW_S, 1.0).legs_at_once([vehicle]) == 1
