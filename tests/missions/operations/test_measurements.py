"""Batches that vehicles post at the same time, when the disk fails half way."""

import asyncio
import math

import pytest

from app.missions.operations.measurements import measure
from app.missions.views.measurements.soundings import BatchVerdict, Verdict
from app.storage.database import Database
from app.storage.queries.soundings import counts
from tests.support.missions.harbour import Harbour, Rover, sim_spec
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
