"""A vehicle that stands aside for another one does not keep that one where it is."""

import numpy as np
import pytest

from app.missions.fleet.interface import LinkState, Position, VehicleReport, WaypointOrder, WaypointStatus
from app.missions.flight.decisions.decision import Decision
from app.missions.flight.decisions.leg import Leg
from app.missions.flight.decisions.separation import too_close
from app.missions.service import MissionService
from app.missions.team import Member
from tests.support.missions.harbour import sim_spec


@pytest.mark.parametrize(
    ("waits_m", "waits"),
    [(None, True), ((60.0, 30.0), False), ((35.0, 30.0), True)],
    ids=["flies its leg", "stands aside", "stands aside where the leg leads"],
)
async def test_who_another_vehicle_stands_aside_for_gets_its_leg(
    service: MissionService, waits_m: tuple[float, float] | None, waits: bool
) -> None:
    limits = {"max_step_m": 60.0, "min_separation_m": 5.0}
    live = await service.get((await service.create(sim_spec("a", "b", side_m=90.0, limits=limits))).id)

    def place(east_m: float, north_m: float) -> Position:
        lat, lon = live.frame.to_geographic(np.array(east_m), np.array(north_m))
        return Position(float(lat), float(lon), 2.0)

    def put(slot: int, east_m: float, north_m: float) -> Member:
        member = live.team.join(live.spec.vehicles[slot], slot)
        member.report = VehicleReport(member.name, 0.0, place(east_m, north_m), heading_rad=np.pi / 2)
        member.engaged, member.link = True, LinkState.ENGAGED
        return member

    put(0, 10.0, 30.0)
    second = put(1, 60.0, 30.0)
    order = WaypointOrder(live.id, 1, "b", place(10.0, 30.0), 1.0, 3.0, 1.0)
    second.set_order(order, np.array([10.0, 30.0]))
    second.status = WaypointStatus.ACKNOWLEDGED
    if waits_m is not None:
        second.waits_m, second.lets_pass = np.array(waits_m), True
    legs = [Leg("a", np.array([40.0, 30.0, 2.0]))]
    decision = Decision(legs, None, {}, b"", origin_m={"a": np.array([10.0, 30.0])})
    assert ("a" in too_close(decision, live, live.spec)) is waits
