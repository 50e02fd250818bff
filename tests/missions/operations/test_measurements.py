"""Batches that vehicles post at the same time, when the disk fails half way."""

import asyncio
import math
from collections.abc import AsyncIterator

import numpy as np
import pytest

from app.missions import clock
from app.missions.fleet.interface import Position
from app.missions.live.mission import LiveMission
from app.missions.operations.measurements import measure
from app.missions.preflight.survey import preflight
from app.missions.soundings.measurement import Measurement
from app.missions.views.measurements.soundings import BatchVerdict, Verdict
from app.storage.database import Database
from app.storage.queries.soundings import counts
from tests.support.missions.harbour import CLOCK_S, Harbour, Rover, sim_spec
from tests.support.missions.measured import measured
from tests.support.missions.specs import make_spec


async def test_batches_that_were_stored_are_not_stored_again_when_what_follows_fails(
    harbour: Harbour, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    service = harbour.service
    live = await service.get((await service.create(make_spec())).id)
    items = measured(9)

    failures = iter([OSError("the disk is full")])

    async def flush() -> None:
        for failure in failures:
            raise failure

    monkeypatch.setattr(live.journal, "flush", flush)
    answers = await asyncio.gather(
        *(measure(live, items[first : first + 3]) for first in (0, 3, 6)), return_exceptions=True
    )
    for answer in answers:
        # Who is told that they were not taken sends them again; who is told that they were must not hear "duplicate".
        assert isinstance(answer, OSError) or {item.verdict for item in answer.items} == {Verdict.ACCEPTED}
    assert any(isinstance(answer, OSError) for answer in answers)
    async with database.reading() as session:
        assert (await counts(session, live.id))[Verdict.ACCEPTED] == 9
    again = await measure(live, items)
    assert isinstance(again, BatchVerdict)
    assert again.accepted == 0


async def test_altitude_is_how_far_the_bottom_is_below_a_vehicle_however_its_beams_point(harbour: Harbour) -> None:
    service = harbour.service
    live = await service.get((await service.create(sim_spec(vehicles=[{"name": "a", "kind": "rest"}]))).id)
    rover = Rover(service, live.id, "a")
    time_s, tilted = 1_795_225_200.0, {"heading_deg": 0.0, "beam_azimuth_deg": 90.0}
    slant = [
        rover.item(time_s=time_s, range_m=4.0, beam=0, beam_off_nadir_deg=70.0, **tilted),
        rover.item(time_s=time_s, range_m=3.0, beam=1, beam_off_nadir_deg=0.0, **tilted),
    ]
    for items in (slant, slant[::-1]):
        await measure(live, items)
        report = live.hub.info(live.team.named("a").key).report
        assert report is not None
        assert report.altitude_m == pytest.approx(4.0 * math.cos(math.radians(70.0)), abs=1e-3)
    older = rover.item(time_s=time_s - 60.0, depth_m=9.0)
    await measure(live, [rover.item(time_s=time_s + 1.0, depth_m=3.0), older])
    report = live.hub.info(live.team.named("a").key).report
    assert report is not None
    assert (report.time_s, report.position.depth_m) == (time_s + 1.0, 3.0)


@pytest.fixture
async def mission(harbour: Harbour) -> AsyncIterator[LiveMission]:
    """One polling vehicle, whose clock is the wall's."""
    service = await harbour.reopen(time_scale=1.0)
    with clock.told_by(lambda: CLOCK_S + 60.0):
        yield await service.get((await service.create(sim_spec(vehicles=[{"name": "a", "kind": "rest"}]))).id)


async def place_after(live: LiveMission, *items: Measurement) -> tuple[Position, list[tuple[Verdict, str]]]:
    """Where the vehicle is taken to be after a batch, and what was said of each item."""
    answer = await measure(live, items)
    report = live.hub.info(live.team.named("a").key).report
    assert report is not None
    return report.position, [(item.verdict, item.reason.partition(":")[0]) for item in answer.items]


@pytest.mark.parametrize("range_m", [9.0, 20_000.0, None])
@pytest.mark.parametrize("wrong", [{"depth_m": 5000.0}, {"depth_m": 1e9}, {"depth_m": -500.0}, {"lat_deg": 41.9}])
async def test_where_no_vehicle_can_be_none_is_taken_to_be(
    harbour: Harbour, mission: LiveMission, wrong: dict[str, float], range_m: float | None
) -> None:
    rover = Rover(harbour.service, mission.id, "a")
    here, _ = await place_after(mission, rover.item())
    place, [(verdict, field)] = await place_after(mission, rover.item(range_m=range_m, **wrong))
    assert place == here
    assert verdict is Verdict.REJECTED
    if range_m is None:
        assert set(wrong) <= set(field.split(", ")), "what is wrong is named"


async def test_a_sounding_that_is_wrong_tells_where_its_vehicle_is_all_the_same(
    harbour: Harbour, mission: LiveMission
) -> None:
    rover = Rover(harbour.service, mission.id, "a")
    await measure(mission, [rover.item()])
    for wrong in (-3.0, 20_000.0):
        depth_m = 2.0 + wrong / 1e5
        place, [(verdict, _)] = await place_after(mission, rover.item(range_m=wrong, depth_m=depth_m))
        assert (verdict, place.depth_m) == (Verdict.REJECTED, depth_m)


async def test_a_vehicle_that_comes_up_far_away_is_believed_when_it_goes_on_saying_so(
    harbour: Harbour, mission: LiveMission
) -> None:
    rover = Rover(harbour.service, mission.id, "a")
    here, _ = await place_after(mission, rover.item())
    there = {"lat_deg": here.lat_deg + 0.01, "range_m": None}
    items = [rover.item(**there) for _ in range(6)]
    place, said = await place_after(mission, *items)
    assert place.lat_deg == there["lat_deg"]
    assert [verdict for verdict, _ in said] == 3 * [Verdict.REJECTED] + 3 * [Verdict.ACCEPTED]
    back = rover.item(range_m=None, lat_deg=here.lat_deg - 0.01)
    for _ in range(2):
        place, said = await place_after(mission, back)
        assert place.lat_deg == there["lat_deg"], "one from where it was does not move it back"


@pytest.mark.parametrize("east_m", [80.0, 45.0])
async def test_who_tells_only_where_it_comes_to_is_where_it_works_or_was_sent(
    harbour: Harbour, mission: LiveMission, east_m: float
) -> None:
    """As a client does that posts once at each waypoint, without the way there."""
    rover = Rover(harbour.service, mission.id, "a")
    far = Rover(harbour.service, mission.id, "a", east_m, 20.0)
    await place_after(mission, rover.item())
    member = mission.team.named("a")
    if east_m > 60.0:
        member.target_m = np.array([east_m, 20.0])
    item = far.item(time_s=rover.item().time_s)
    place, said = await place_after(mission, item)
    assert place.lon_deg == item.lon_deg
    deep = far.item(time_s=item.time_s + 1.0, depth_m=300.0)
    place, _ = await place_after(mission, deep)
    assert place.depth_m == item.depth_m
    assert said[0][0] is Verdict.REJECTED, "its sounding may be anywhere on that way"


async def test_ranges_to_targets_from_where_no_vehicle_can_be_are_refused(harbour: Harbour) -> None:
    service = await harbour.reopen(time_scale=1.0)
    spec = sim_spec(
        vehicles=[{"name": "a", "kind": "rest"}],
        targets=[{"name": "t"}],
    )
    live = await service.get((await service.create(spec)).id)
    item = Rover(service, live.id, "a").item(range_m=None, depth_m=1e9, target="t", target_range_m=20.0)
    answer = await measure(live, [item])
    assert [verdict.reason for verdict in answer.items] == ["depth_m: 1e+09 is not between -2 and 11100"]


async def test_the_checklist_calls_what_a_vehicle_posted_no_import(harbour: Harbour) -> None:
    service = harbour.service
    live = await service.get((await service.create(sim_spec(vehicles=[{"name": "a", "kind": "rest"}]))).id)
    await measure(live, [Rover(service, live.id, "a").item()])
    messages = [check.message for check in preflight(live).checks if check.id == "bottom"]
    assert messages == ["there are soundings; their map is being made"]
