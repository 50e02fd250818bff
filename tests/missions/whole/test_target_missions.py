"""Missions that keep track of moving targets: real services, simulated vehicles, UDP."""

import math
from dataclasses import replace
from typing import Any

import pytest

from app.missions.errors import TargetNotFoundError
from app.missions.operations.history import events_after, steps_after, target_ranges_page
from app.missions.operations.measurements import measure
from app.missions.service import MissionService
from app.missions.settings import ImcSettings
from app.missions.soundings.measurement import Measurement
from app.missions.states import MissionState
from app.missions.views.measurements.soundings import Verdict
from app.storage.database import Database
from simulator.dune import DuneFleet, DuneOptions, default_specs
from simulator.dune.fleet import EQUIPMENT
from simulator.floors.seafloors import generate
from simulator.targets import RangingNoise, TargetSpec
from tests.support.missions.harbour import Harbour, Rover, act, until_state, view_of
from tests.support.missions.specs import LAT, LON, lon_lat, make_spec, rectangle
from tests.support.ports import free_ports
from tests.support.waiting import until

TAG = (20.0, 18.0, 5.0)


def measured(east: float, north: float, time_s: float, **changes: Any) -> Measurement:
    lon, lat = lon_lat(east, north)
    away = math.dist((east, north, 2.0), TAG)
    values = {"vehicle": "a", "time_s": time_s, "lat_deg": lat, "lon_deg": lon, "depth_m": 2.0}
    return Measurement.model_validate(values | {"target": "tag-1", "target_range_m": away} | changes)


def round_trip(count: int, begin_s: float) -> list[Measurement]:
    return [
        measured(15 + 12 * math.cos(0.5 * k), 15 + 12 * math.sin(0.5 * k), begin_s + k, vehicle="ab"[k % 2])
        for k in range(count)
    ]


@pytest.mark.slow
async def test_posted_ranges_find_a_target_and_a_restart_does_not_forget_it(
    harbour: Harbour, service: MissionService
) -> None:
    mission = await service.create(make_spec(targets=[{"name": "tag-1"}], steps=50))
    for name in "ab":
        await Rover(service, mission.id, name).post()
    await act(service, mission.id, "start", actor="Ana")
    first = await measure(await service.get(mission.id), round_trip(30, 1000.0), idempotency_key="one")
    assert (first.accepted, first.rejected) == (30, 0)
    # A step keeps the filters; what comes after it is found again among the stored ranges.
    second = await measure(await service.get(mission.id), round_trip(31, 1030.0))
    assert second.accepted == 31
    # Before the pause: that waits for vehicles to stop, while the target's place grows old.
    (before,) = (await service.get(mission.id)).target_views()
    await act(service, mission.id, "pause", actor="Ana")
    assert before.accurate
    assert before.east_m is not None
    assert before.north_m is not None
    assert math.hypot(before.east_m - TAG[0], before.north_m - TAG[1]) < 3.0
    assert (await view_of(service, mission.id)).targets[0].name == "tag-1"

    service = await harbour.reopen()
    (after,) = (await service.get(mission.id)).target_views()
    assert (after.ranges, after.rejected) == (before.ranges, before.rejected)
    assert after.sd_east_m is not None
    assert after.east_m == pytest.approx(before.east_m, abs=max(0.5, 3 * after.sd_east_m))
    again = await measure(await service.get(mission.id), round_trip(30, 1000.0), idempotency_key="one")
    assert again.replayed
    twice = await measure(await service.get(mission.id), round_trip(31, 1030.0))
    assert twice.duplicate == 31
    assert ((await service.get(mission.id)).target_views())[0].ranges == 61


async def test_each_item_has_its_own_verdict_with_the_name_of_what_is_wrong(service: MissionService) -> None:
    mission = await service.create(make_spec(targets=[{"name": "tag-1"}]))
    items = [
        measured(5, 5, 1.0),
        measured(5, 5, 2.0, target="tag-9"),
        measured(5, 5, 3.0, target_range_m=-4.0),
        measured(5, 5, 4.0, vehicle="stranger"),
        measured(5, 5, 1.0),
    ]
    answer = await measure(await service.get(mission.id), items)
    assert [item.verdict for item in answer.items] == [
        Verdict.ACCEPTED, Verdict.REJECTED, Verdict.REJECTED, Verdict.REJECTED, Verdict.DUPLICATE,
    ]  # fmt: skip
    assert "'tag-9' is not among the targets of this mission (tag-1)" in answer.items[1].reason
    assert "target_range_m: -4 is not positive" in answer.items[2].reason
    assert "takes no part" in answer.items[3].reason
    page = await target_ranges_page(await service.get(mission.id), target="tag-1", limit=1)
    assert [item.used for item in page.items] == [True]
    assert page.next_after is None
    with pytest.raises(TargetNotFoundError, match="not a target of this mission"):
        await target_ranges_page(await service.get(mission.id), target="tag-9")


async def test_a_range_needs_its_target_and_no_sounding_beside_it() -> None:
    for changes in ({"target": None}, {"target_range_m": None}, {"range_m": 4.0}):
        with pytest.raises(ValueError, match="target"):
            measured(5, 5, 1.0, **changes)


@pytest.mark.slow
async def test_simulated_vehicles_map_and_keep_track_of_a_simulated_target(harbour: Harbour) -> None:
    """In the service's own simulation: one of three leaves the mapping for the target, says so, and comes back."""
    service = harbour.service
    lon, lat = lon_lat(50, 52)
    target = {"name": "tag-1", "simulated": {"start": [lon, lat], "depth_m": 4, "course_deg": 200, "speed_mps": 0.2}}
    spec = make_spec(
        60.0,
        vehicles=[{"name": name, "kind": "sim"} for name in "abc"],
        targets=[target],
        tracking={"accuracy_m": 2.5},
        planner={"name": "cao"},
        steps=5,
    )
    mission = await service.create(spec)
    await act(service, mission.id, "start", actor="Ana")
    pursued: set[str] = set()

    async def over() -> bool:
        view = await view_of(service, mission.id)
        pursued.update(v.pursuing for v in view.vehicles if v.pursuing)
        return view.state is MissionState.FINISHED

    await until(over, "the mission is finished")
    (seen,) = (await service.get(mission.id)).target_views()
    assert seen.ranges > 20
    said = [event.message for event in await events_after(await service.get(mission.id)) if event.kind == "target"]
    assert any("goes for tag-1" in message for message in said)
    assert pursued == {"tag-1"}
    assert seen.state != "unheard"


async def test_vehicles_over_udp_find_what_swims_about_and_every_waypoint_was_checked(
    harbour: Harbour, database: Database
) -> None:
    """Fake DUNE nodes tell of ranges as DUNE does by radio; a transponder that nobody asked about is named once."""
    ports = free_ports(5)
    floor = generate("harbour", 3, width_m=60.0, height_m=60.0, origin=(LAT, LON))
    targets = [
        TargetSpec("tag-1", (45.0, 20.0, 4.0), math.radians(300), 0.2),
        TargetSpec("buoy", (10.0, 50.0, 1.0), 0.0, 0.0),
    ]
    fleet = DuneFleet(
        floor,
        default_specs(2, floor, base_port=ports[0]),
        replace(EQUIPMENT, drift_m2ps=0.02),
        speed=20.0,
        options=DuneOptions(announce_ports=tuple(ports[3:])),
        targets=targets,
        ranging=RangingNoise(period_s=1.0, outliers=0.2),
    )
    async with fleet:
        imc = ImcSettings(port=ports[2], announce_ports=tuple(ports[3:]), loopback_only=True)
        service = await harbour.reopen(imc=imc, time_scale=20.0)
        spec = make_spec(
            60.0,
            area=rectangle(2, 2, 58, 58),
            vehicles=[{"name": f"lauv-sim-{k + 1}"} for k in range(2)],
            targets=[{"name": "tag-1"}],
            tracking={"accuracy_m": 4.0},
            surface_policy={"max_position_sd_m": 2.0},
            planner={"name": "cao"},
            steps=40,
        )
        mission = await service.create(spec)

        async def known() -> bool:
            (target,) = (await service.get(mission.id)).target_views()
            return target.state in ("uncertain", "accurate") and target.ranges > 30 and target.rejected > 0

        await until(lambda: _ready(service), "the vehicles are ready")
        await act(service, mission.id, "start", actor="Ana")
        # How well and how soon it is known is a matter of the filters' own tests: a busy machine is late by minutes.
        await until(known, "the target is known")
        await act(service, mission.id, "finish", actor="Ana")
        assert await until_state(service, mission.id, MissionState.FINISHED)
        (seen,) = (await service.get(mission.id)).target_views()
        assert "were expected" in seen.last_refusal
        view = await view_of(service, mission.id)
        assert {v.localization for v in view.vehicles} <= {"good", "fading", "poor"}
        strangers = [e for e in await events_after(await service.get(mission.id)) if "'buoy'" in e.message]
        assert len(strangers) == 1
        ranges = await target_ranges_page(await service.get(mission.id), limit=1000)
        assert {item.source for item in ranges.items} == {"AcousticOperation"}
        waypoints = [w for step in await steps_after(await service.get(mission.id)) for w in step.waypoints]
        assert all(2 - 1e-3 <= w.east_m <= 58 + 1e-3 for w in waypoints if w.status != "refused")


async def _ready(service: MissionService) -> bool:
    return sum(vehicle.link == "ready" for vehicle in await service.vehicles()) == 2
