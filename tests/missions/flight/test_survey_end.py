"""When all is surveyed, and who goes home then."""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any

import pytest

from app.exploration.planner.ordered import OrderedPlanner
from app.missions.fleet.interface import LinkState
from app.missions.flight.decisions.decision import Decision
from app.missions.flight.legs.commit import LegCommit
from app.missions.flight.legs.demand import LegDemand
from app.missions.flight.legs.energy_range import EnergyRange
from app.missions.flight.survey_end import NOT_WAITED_FOR, SurveyEnd
from app.missions.live.mission import LiveMission
from app.missions.service import MissionService
from app.missions.spec.failsafes import Response
from app.missions.task.constraints import make_constraints
from app.missions.task.planner import make_planner
from app.missions.team import Member, Withdrawal
from tests.support.missions.harbour import sim_spec
from tests.support.missions.on_legs import put_on_legs
from tests.support.missions.specs import lon_lat

HOME = (10.0, 10.0)
LINE = [(10.0, 20.0), (10.0, 30.0), (10.0, 40.0), (10.0, 50.0)]
NOTHING_FOR_A = [Decision([], None, {}, b"", done=frozenset({"a"}))]


@dataclass
class Ended:
    live: LiveMission
    end: SurveyEnd
    a: Member
    b: Member

    def has_flown_all(self, member: Member) -> None:
        member.committed.legs = self.live.spec.steps
        member.ahead.clear()
        member.drop_order()


@pytest.fixture
def survey(service: MissionService) -> Callable[..., Awaitable[Ended]]:
    async def made(**changes: Any) -> Ended:
        limits = {"max_step_m": 10.0, "min_separation_m": 0.0}
        spec = sim_spec(**({"steps": 4, "side_m": 60.0, "limits": limits, "planner": {"name": "lawnmower"}} | changes))
        live = await service.get((await service.create(spec)).id)
        constraints = make_constraints(spec)
        energy_range = EnergyRange(live, constraints, LegCommit(live, constraints, leads=False))
        planner = OrderedPlanner(make_planner(spec))
        end = SurveyEnd(live, planner, LegDemand(live, lambda: 0.01, 1.0), energy_range, 1.0)
        return Ended(live, end, put_on_legs(live, "a", HOME, LINE[:1]), put_on_legs(live, "b", (40.0, 10.0), LINE[:1]))

    return made


Made = Callable[..., Awaitable[Ended]]


async def test_it_is_reached_when_everybody_has_flown_its_way(survey: Made) -> None:
    ended = await survey()
    assert not ended.end.is_reached()
    ended.has_flown_all(ended.a)
    assert not ended.end.is_reached()
    ended.has_flown_all(ended.b)
    assert ended.end.is_reached()
    assert ended.end.reason() == "every step is done"


async def test_who_misses_leg_after_leg_keeps_nobody_who_is_done(survey: Made) -> None:
    ended = await survey()
    ended.b.misses = NOT_WAITED_FOR
    assert not ended.end.is_reached(), "somebody else surveys"
    ended.has_flown_all(ended.a)
    assert ended.end.is_reached()
    assert ended.end.reason() == "every step is done but b"


async def test_who_is_held_with_some_of_its_way_left_is_waited_for(survey: Made) -> None:
    ended = await survey()
    ended.has_flown_all(ended.a)
    ended.b.withdrawal = Withdrawal(Response.HOLD, "Ana wants it")
    assert not ended.end.is_reached()
    ended.has_flown_all(ended.b)
    assert ended.end.is_reached()


async def test_nobody_is_led_where_all_that_want_legs_are_out_of_reach(survey: Made) -> None:
    ended = await survey()
    ended.has_flown_all(ended.a)
    ended.a.link = LinkState.LOST
    assert not ended.end.nobody_to_lead
    ended.b.link = LinkState.LOST
    assert ended.end.nobody_to_lead


async def test_who_gets_no_leg_is_done_only_once_all_that_was_being_measured_was_looked_at(survey: Made) -> None:
    ended = await survey()
    end, a = ended.end, ended.a
    ended.has_flown_all(ended.b)
    a.drop_order()
    end.note_decided([a], NOTHING_FOR_A, set(), all_flown=False)
    assert not end.is_reached(), "others still measured"
    assert end.at_rest([a]) == {"a"}
    end.note_decided([a], NOTHING_FOR_A, {"a"}, all_flown=True)
    assert end.is_reached()
    end.look_again()
    assert not end.is_reached(), "there may be more to do"


async def test_who_has_flown_its_way_goes_home_and_who_gets_no_further_line_with_it(survey: Made) -> None:
    ended = await survey(recovery={"point": lon_lat(10.0, 10.0)})
    assert ended.end.flown_out() == []
    ended.has_flown_all(ended.b)
    assert ended.end.flown_out() == [ended.b]
    ended.end.call_home(["a"])
    assert ended.a.withdrawal is None, "it flies"
    ended.a.drop_order()
    ended.end.call_home(["a"])
    assert ended.a.withdrawal is not None
    assert (ended.a.withdrawal.response, ended.a.withdrawal.done) == (Response.RETURN, True)
