"""Vehicles with a probe fly missions: what they measured of the water on their way is offered as a cast, and kept."""

from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.arrays import FloatArray
from app.missions.operations.corrections.casts import add_casts
from app.missions.operations.corrections.measured_casts import vehicles_casts
from app.missions.settings import ImcSettings, ServiceSettings
from app.missions.spec.mission import MissionSpec
from app.missions.spec.water import Cast, NewCasts
from app.missions.states import MissionState
from simulator.dune import DuneFleet, DuneOptions, default_specs
from simulator.floors.seafloors import generate
from simulator.water_column import SeaWater, WaterColumn
from tests.support.missions.harbour import Harbour, act, until_state
from tests.support.missions.specs import LAT, LON, make_spec, spec_json
from tests.support.ports import free_ports
from tests.support.waiting import until

SPEED = 10.0
WARM = WaterColumn(((0.0, 1545.0), (2.0, 1540.0)))
FLOOR_M = generate("flat", 3).max_depth_m
"""Everywhere."""


@pytest.mark.slow
async def test_what_a_vehicle_measures_on_its_way_is_offered_as_a_cast(harbour_closed: Harbour) -> None:
    *announce_ports, port, base_port = free_ports(5)
    imc = ImcSettings(port=port, announce_ports=tuple(announce_ports), loopback_only=True)
    floor = generate("slope", 0, width_m=150.0, height_m=150.0, origin=(LAT, LON))
    specs = default_specs(1, floor, base_port=base_port)
    options = DuneOptions(announce_ports=tuple(announce_ports))
    water = SeaWater(column=WaterColumn(((0.0, 1512.0), (50.0, 1412.0))))
    async with DuneFleet(floor, specs, speed=SPEED, options=options, water=water) as fleet:
        service = await harbour_closed.open(imc=imc, time_scale=SPEED)
        (node,) = fleet.nodes
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
        np.testing.assert_allclose(speeds, 1512.0 - 2.0 * depths, atol=1.0)
        assert live.spec.sound_speed is None, "none counts by itself"
        await act(service, mission_id, "abort")


@pytest.fixture
async def under_warm_water(make_settings: Callable[..., ServiceSettings], tmp_path: Path) -> AsyncIterator[Harbour]:
    simulation = {"family": "flat", "seed": 3, "sound_speed": WARM.entries}
    harbour = Harbour(lambda **changes: make_settings(**({"simulation": simulation, "time_scale": 30.0} | changes)))
    await harbour.open()
    yield harbour
    await harbour.close()


def one_multibeam(**changes: Any) -> MissionSpec:
    sonar = {"beams": 96, "rate_hz": 3.0}
    vehicle = {"name": "a", "kind": "sim", "sensor": "multibeam", "sonar": sonar, "depth_m": 3.5}
    values = {"vehicles": [vehicle], "budget": {"minutes": 60}, "cell_m": 1.0, "planner": {"name": "swath"}}
    limits = {"max_step_m": 25.0, "min_depth_m": 1.0}
    return MissionSpec.model_validate(spec_json(50.0, **(values | {"limits": limits, "sounding_noise": 0.0} | changes)))


@pytest.mark.usefixtures("simulated_time")
@pytest.mark.slow
async def test_depths_are_right_by_the_cast_that_a_vehicle_measured(under_warm_water: Harbour) -> None:
    service = under_warm_water.service
    live = await service.get((await service.create(one_multibeam())).id)
    await act(service, live.id, "start")
    await until_state(service, live.id, MissionState.FINISHED)

    async def off_m() -> FloatArray:
        built = await live.map.build()
        assert built is not None
        return np.asarray(built.map.depth_m[built.map.count > 0] - FLOOR_M)

    by_1500_mps = await off_m()
    (cast,) = await vehicles_casts(live)
    new = NewCasts(casts=[Cast(name="its own", profile=cast.profile, time=cast.time, position=cast.position)])
    await add_casts(live, new, "Ana")
    by_its_own = await off_m()
    altitude_m = FLOOR_M - 3.5
    assert np.median(by_1500_mps) == pytest.approx(altitude_m * (1500.0 / 1540.0 - 1.0), rel=0.05)
    assert np.abs(by_its_own).max() < 0.03
