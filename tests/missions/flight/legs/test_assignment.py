"""Which legs of a decision vehicles get."""

from typing import Any

import numpy as np
import pytest

from app.exploration.core.constraints import Constraints
from app.missions.flight.decisions.decision import Decision
from app.missions.flight.decisions.leg import Leg
from app.missions.flight.legs.assignment import LegAssignment
from app.missions.flight.legs.commit import LegCommit
from app.missions.flight.legs.demand import LegDemand
from app.missions.flight.legs.energy_range import EnergyRange
from app.missions.flight.legs.spacing import LegSpacing
from app.missions.flight.legs.unflown import UnflownLegs
from app.missions.live.mission import LiveMission
from app.missions.service import MissionService
from app.missions.task.constraints import make_constraints
from tests.support.missions.harbour import sim_spec
from tests.support.missions.on_legs import put_on_legs

A_FROM, B_FROM = np.array([10.0, 20.0]), np.array([40.0, 20.0])
"""Where the vehicles' legs end, and those decided begin."""
LEGS = [Leg("a", np.array([10.0, 28.0, 2.0])), Leg("b", np.array([40.0, 28.0, 2.0]))]
DECISION = Decision(LEGS, None, {}, b"memory", origin_m={"a": A_FROM, "b": B_FROM})
STARTS = {"a": A_FROM, "b": B_FROM}


class Assigned:
    """Two vehicles, each on the leg before the ones that are decided."""

    def __init__(self, live: LiveMission, constraints: Constraints) -> None:
        self.live, self.unflown = live, UnflownLegs()
        self.a = put_on_legs(live, "a", (10.0, 10.0), [(10.0, 20.0)])
        self.b = put_on_legs(live, "b", (40.0, 10.0), [(40.0, 20.0)])
        leg_commit = LegCommit(live, constraints, leads=False)
        energy_range = EnergyRange(live, constraints, leg_commit)
        self.demand = LegDemand(live, lambda: 0.01, 1.0)
        spacing = LegSpacing(live, constraints)
        self.assignment = LegAssignment(live, self.demand, spacing, leg_commit, energy_range, self.unflown)

    async def assign(self, **numbers: int) -> tuple[dict[str, Any], list[str]]:
        """Return who got which end, and whose planned leg nobody got."""
        ends_m = await self.assignment.assign(DECISION, STARTS, numbers)
        not_assigned = self.assignment.not_assigned(DECISION, ends_m)
        return {name: end_m.tolist() for name, end_m in ends_m.items()}, [leg.vehicle for leg in not_assigned]


@pytest.fixture
async def assigned(service: MissionService) -> Assigned:
    limits = {"max_step_m": 10.0, "min_separation_m": 3.0}
    spec = sim_spec(steps=12, side_m=60.0, limits=limits, planner={"name": "lawnmower"})
    live = await service.get((await service.create(spec)).id)
    return Assigned(live, make_constraints(spec))


async def test_legs_that_begin_where_the_last_ones_end_are_committed(assigned: Assigned) -> None:
    assert await assigned.assign(a=2, b=2) == ({"a": [10.0, 28.0, 2.0], "b": [40.0, 28.0, 2.0]}, [])
    assert [leg.number for leg in assigned.a.ahead] == [2]
    assert assigned.assignment.has_leg("a", 2)


@pytest.mark.parametrize("why", ["elsewhere", "silent", "gone", "barred", "not asked", "it has that leg"])
async def test_who_cannot_begin_its_leg_where_it_was_to_begin_gets_none(assigned: Assigned, why: str) -> None:
    numbers = {"a": 2, "b": 2}
    if why == "elsewhere":
        assigned.b.target_m = np.array([44.0, 20.0])
    elif why == "silent":
        assigned.b.engaged = False
    elif why == "gone":
        assigned.live.team.members.pop("b")
    elif why == "barred":
        assigned.unflown.add_barred("b", [B_FROM])
    elif why == "not asked":
        del numbers["b"]
    else:
        assigned.b.committed.legs = 2
    ends_m, not_assigned = await assigned.assign(**numbers)
    assert list(ends_m) == ["a"]
    if why == "barred":
        assert not_assigned == []
        assert assigned.unflown.is_barred_end("b", np.array([40.0, 28.0])), "it goes on from what is barred"
    else:
        assert not_assigned == ["b"]
