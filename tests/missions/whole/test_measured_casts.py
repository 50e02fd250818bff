"""A vehicle with a probe flies a mission: what it measured of the water on its way is offered as a cast, and kept."""

from collections.abc import Callable

import imcpy
import numpy as np
import pytest

from app.missions.operations.corrections.measured_casts import vehicles_casts
from app.missions.settings import ImcSettings
from simulator.dune import DuneFleet, DuneOptions, default_specs
from simulator.dune.entities import SIMULATION
from simulator.dune.node import FakeDune
from simulator.floors.seafloors import generate
from tests.support.missions.harbour import Harbour, act
from tests.support.missions.specs import LAT, LON, make_spec
from tests.support.ports import free_ports
from tests.support.waiting import until

SPEED = 10.0
PERIOD_S = 0.5


def water_mps(depth_m: float) -> float:
    return 1512.0 - 2.0 * depth_m


def probing(node: FakeDune) -> Callable[[float], None]:
    """Let a probe on board tell the speed of sound twice a second, and every fourth time nonsense."""
    step, told = node.step, [0.0, 0.0]

    def stepping(now_s: float) -> None:
        step(now_s)
        if now_s - told[0] >= PERIOD_S:
            told[0], told[1] = now_s, told[1] + 1.0
            message = imcpy.SoundSpeed()
            message.value = -1.0 if told[1] % 4 == 0 else water_mps(node.vehicle.true_position.depth_m)
            node.send(message, SIMULATION["CTD"])

    return stepping


@pytest.mark.slow
async def test_what_a_vehicle_measures_on_its_way_is_offered_as_a_cast(
    harbour_closed: Harbour, monkeypatch: pytest.MonkeyPatch
) -> None:
    *announce_ports, port, base_port = free_ports(5)
    imc = ImcSettings(port=port, announce_ports=tuple(announce_ports), loopback_only=True)
    floor = generate("slope", 0, width_m=150.0, height_m=150.0, origin=(LAT, LON))
    specs = default_specs(1, floor, base_port=base_port)
    options = DuneOptions(announce_ports=tuple(announce_ports))
    async with DuneFleet(floor, specs, speed=SPEED, options=options) as fleet:
        service = await harbour_closed.open(imc=imc, time_scale=SPEED)
        (node,) = fleet.nodes
        monkeypatch.setattr(node, "step", probing(node))
        await until(lambda: any(info.state.value == "ready" for info, _ in service.hub.vehicles()), "it is ready")
        spec = make_spec(150.0, vehicles=[{"name": node.name, "kind": "imc", "depth_m": 4.0}], steps=1000)
        mission_id = (await service.create(spec)).id
        await act(service, mission_id, "start")
        live = await service.get(mission_id)
        await until(lambda: node.vehicle.true_position.depth_m > 3.5, "it has gone down")

        async def offered() -> bool:
            return bool(await vehicles_casts(live))

        await until(offered, "a cast is offered")
        (cast,) = await vehicles_casts(live)
        assert (cast.vehicle, cast.probe, cast.file) == (node.name, "CTD", None)
        depths, speeds = np.array(cast.profile).T
        assert depths[-1] - depths[0] > 1.5
        # A dive of 4 m takes seconds here: half a metre of depth while a sample is under way counts for 1 m/s.
        np.testing.assert_allclose(speeds, water_mps(depths), atol=1.0)
        assert live.spec.sound_speed is None, "none counts by itself"
        await act(service, mission_id, "abort")
