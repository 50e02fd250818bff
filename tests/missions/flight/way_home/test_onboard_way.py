"""Ways home are kept on board soon, by the vehicles' clock, however fast that goes."""

import asyncio
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from app.missions.fleet.interface import LinkState, Position, VehicleReport
from app.missions.flight.way_home.onboard_way import PERIOD_S, OnboardWays
from app.missions.service import MissionService
from app.missions.team import WayHome
from imc_bridge.control.depth_layers import ALONE
from simulator.event_loop import SimulatedTimeLoop
from tests.support.missions.harbour import sim_spec


class Kept:
    """Notes when ways are stored."""

    def __init__(self) -> None:
        self.at_s: list[float] = []

    async def keep_way_home(self, *_: Any) -> None:
        self.at_s.append(asyncio.get_running_loop().time())


@pytest.mark.parametrize("time_scale", [1.0, 20.0])
async def test_a_way_is_on_board_within_a_period_and_anew_when_it_has_changed(
    service: MissionService, time_scale: float
) -> None:
    live = await service.get((await service.create(sim_spec("a"))).id)
    member = cast("Any", live.team.members["a"])
    member.capabilities = SimpleNamespace(keeps_way_home=True)
    member.engaged, member.link = True, LinkState.ENGAGED
    member.report = VehicleReport("a", 0.0, Position(41.185, -8.705, 2.0))
    ranging = SimpleNamespace(depths_m=lambda *_: [2.0], layer=lambda _: ALONE)
    kept = Kept()

    async def fly() -> list[float]:
        ways = OnboardWays(live, cast("Any", kept), cast("Any", ranging), time_scale)
        keeping, known_s = asyncio.create_task(ways.keep()), []
        for way in ([[10.0, 10.0]], [[30.0, 10.0]]):
            await asyncio.sleep(0.3 * PERIOD_S / time_scale)
            member.way_home = WayHome(left_alone_m=np.array(way))
            known_s.append(asyncio.get_running_loop().time())
            await asyncio.sleep(2.0 * PERIOD_S / time_scale)
        keeping.cancel()
        return known_s

    def run() -> list[float]:
        with asyncio.Runner(loop_factory=SimulatedTimeLoop) as runner:
            return runner.run(fly())

    known_s = await asyncio.to_thread(run)
    assert len(kept.at_s) == 2, "the same way is not stored again"
    for at_s, since_s in zip(kept.at_s, known_s, strict=True):
        assert 0.0 <= (at_s - since_s) * time_scale <= PERIOD_S + 1e-6
