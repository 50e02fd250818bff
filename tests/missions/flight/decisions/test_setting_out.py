"""Vehicles that set out at once from beside each other."""

import math

import numpy as np
import pytest

from app.missions.fleet.interface import LinkState, Position, VehicleReport
from app.missions.flight.decisions.decision import Decision
from app.missions.flight.decisions.leg import Leg
from app.missions.flight.decisions.separation import too_close
from app.missions.service import MissionService
from tests.support.missions.harbour import sim_spec

WEST = -math.pi / 2


@pytest.mark.parametrize(
    ("heading_rad", "second_moves", "waits"),
    [(WEST, True, True), (math.pi / 4, True, False), (WEST, False, False)],
    ids=["turns before the other's way", "heads along its leg", "turns beside one that stays"],
)
async def test_who_would_turn_into_anothers_way_waits(
    service: MissionService, heading_rad: float, second_moves: bool, waits: bool
) -> None:
    limits = {"max_step_m": 60.0, "min_separation_m": 5.0}
    live = await service.get((await service.create(sim_spec("a", "b", side_m=90.0, limits=limits))).id)

    def put(slot: int, east_m: float, north_m: float, heading_rad: float) -> np.ndarray:
        member = live.team.join(live.spec.vehicles[slot], slot)
        lat, lon = live.frame.to_geographic(np.array(east_m), np.array(north_m))
        member.report = VehicleReport(member.name, 0.0, Position(float(lat), float(lon), 0.0), heading_rad=heading_rad)
        member.engaged, member.link = True, LinkState.ENGAGED
        return np.array([east_m, north_m])

    # Straight from where they are the first is well past where their ways cross when the second comes there.
    first, second = put(0, 20.0, 30.0, heading_rad), put(1, 10.0, 43.0, 2.36)
    legs = [Leg("a", np.array([55.0, 65.0, 0.0])), *([Leg("b", np.array([50.0, 3.0, 0.0]))] if second_moves else [])]
    decision = Decision(legs, None, {}, b"", origin_m={"a": first, "b": second})
    assert bool(too_close(decision, live, live.spec)) is waits
