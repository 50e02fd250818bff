"""Legs of a mission that becomes shorter while it is flown."""

from app.exploration.planner.ordered import OrderedPlanner
from app.missions.flight.legs.commit import LegCommit
from app.missions.flight.legs.dispatch import Dispatch
from app.missions.flight.legs.length_change import LengthChange
from app.missions.service import MissionService
from app.missions.spec.budget import Budget
from app.missions.task.constraints import make_constraints
from app.missions.task.planner import make_planner
from tests.support.missions.harbour import sim_spec
from tests.support.missions.on_legs import put_on_legs

LINE = [(10.0, 20.0), (10.0, 30.0), (10.0, 40.0), (10.0, 50.0)]


async def test_legs_beyond_the_new_end_are_taken_back_once(service: MissionService) -> None:
    spec = sim_spec("a", budget={"km_per_vehicle": 0.2}, side_m=60.0, planner={"name": "lawnmower"})
    live = await service.get((await service.create(spec)).id)
    leg_commit = LegCommit(live, make_constraints(spec), leads=False)
    dispatch = Dispatch(live, service.hub, leg_commit, 1.0, persistent=True)
    change = LengthChange(live, OrderedPlanner(make_planner(spec)), leg_commit, dispatch)
    member = put_on_legs(live, "a", (10.0, 10.0), LINE)
    assert not change.is_due
    live.relength(Budget(km_per_vehicle=0.022), {})
    assert change.is_due
    await change.fit()
    assert not change.is_due
    assert [leg.number for leg in member.ahead] == [2]
    assert (member.committed.way_m, member.committed.spared) == (20.0, 2)
