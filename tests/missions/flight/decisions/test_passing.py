"""Whether somebody passes above a vehicle that is about to come up."""

import numpy as np
import pytest

from app.missions.fleet.interface import LinkState, Position, VehicleReport
from app.missions.flight.decisions.separation import passes_above
from app.missions.flight.legs.commit import LegCommit
from app.missions.service import MissionService
from app.missions.spec.failsafes import Response
from app.missions.task.constraints import make_constraints
from app.missions.team import Member, Withdrawal
from tests.support.missions.harbour import sim_spec


@pytest.mark.parametrize(
    ("at_m", "to_m", "depth_m", "over", "passes"),
    [
        ((15.0, 25.0), (15.0, 5.0), 2.0, False, True),
        ((35.0, 25.0), (55.0, 25.0), 2.0, False, False),
        ((15.0, 25.0), (15.0, 5.0), 3.5, False, False),
        ((15.0, 16.0), (15.0, 16.0), 0.0, True, False),
        ((15.0, 16.0), (15.0, 16.0), 2.0, False, True),
    ],
    ids=["comes over it", "goes elsewhere", "is no shallower", "is home", "circles above it"],
)
async def test_who_passes_above_is_waited_for(
    service: MissionService,
    at_m: tuple[float, float],
    to_m: tuple[float, float],
    depth_m: float,
    over: bool,
    passes: bool,
) -> None:
    live = await service.get((await service.create(sim_spec("a", "b", side_m=60.0))).id)
    below, above = (live.team.join(vehicle, slot) for slot, vehicle in enumerate(live.spec.vehicles))

    def put(member: Member, east_m: float, north_m: float, down_m: float) -> None:
        lat, lon = live.frame.to_geographic(np.array(east_m), np.array(north_m))
        member.report = VehicleReport(member.name, 0.0, Position(float(lat), float(lon), down_m))

    put(below, 15.0, 10.0, 4.0)
    put(above, *at_m, depth_m)
    above.engaged, above.link = True, LinkState.ENGAGED
    committing = LegCommit(live, make_constraints(live.spec), leads=False)
    committing.lead_home(above, [(np.array(to_m), depth_m)])
    if over:
        above.withdrawal = Withdrawal(Response.RETURN, "its energy", over=True)
    assert passes_above(below, live, live.spec) == ("b" if passes else "")
