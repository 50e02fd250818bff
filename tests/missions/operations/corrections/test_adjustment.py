"""The adjustment of a mission's tracks outlives the service."""

import numpy as np
import pytest

from app.arrays import FloatArray
from app.missions.errors import ConflictError
from app.missions.operations.corrections.adjustment import adjust, adjustment_view, undo
from app.missions.operations.history import events_after
from app.missions.operations.measurements import measure
from app.missions.views.measurements.adjustment import AdjustmentRequest, FixRequest
from tests.support.missions.harbour import Harbour
from tests.support.missions.measured import measured
from tests.support.missions.specs import make_spec

OFF_DEG = 3e-5
"""About 3 m to the north."""


async def test_tracks_of_a_vehicle_whose_clock_was_set_back_are_not_adjusted(harbour: Harbour) -> None:
    live = await harbour.service.get((await harbour.service.create(make_spec())).id)
    items = measured(80, wrong=None)[:80]
    later = [item.model_copy(update={"time_s": item.time_s - 445.0}) for item in items[40:]]
    await measure(live, [*items[:40], *later])
    with pytest.raises(ConflictError, match="the clock of a was set back by 435 s"):
        await adjust(live, AdjustmentRequest(), "Ana")


async def test_a_restart_places_soundings_as_before_it_and_an_undo_as_they_came(harbour: Harbour) -> None:
    mission = (await harbour.service.create(make_spec())).id

    async def depths() -> FloatArray:
        built = await (await harbour.service.get(mission)).map.build()
        assert built is not None
        return built.map.depth_m

    live = await harbour.service.get(mission)
    items = measured(80, wrong=None)[:80]
    await measure(live, items)
    raw = await depths()
    first, last = items[0], items[-1]
    fixes = [
        FixRequest(vehicle="a", time_s=one.time_s, lat_deg=one.lat_deg + off, lon_deg=one.lon_deg, sd_m=0.2)
        for one, off in ((first, 0.0), (last, OFF_DEG))
    ]
    found = await adjust(live, AdjustmentRequest(fixes=fixes), "Ana")
    assert found.applied
    assert found.tracks[0].max_m > 2.5
    adjusted = await depths()
    assert not np.array_equal(adjusted, raw, equal_nan=True)

    await harbour.reopen()
    live = await harbour.service.get(mission)
    assert adjustment_view(live) == found
    np.testing.assert_array_equal(await depths(), adjusted)

    await undo(live, "Ana")
    assert not adjustment_view(live).applied
    np.testing.assert_allclose(await depths(), raw, atol=1e-6)


async def test_what_moves_nothing_is_not_said_to_be_applied(harbour: Harbour) -> None:
    mission = (await harbour.service.create(make_spec())).id
    live = await harbour.service.get(mission)
    items = measured(80, wrong=None)[:80]
    await measure(live, items)
    fix = FixRequest(
        vehicle="a", time_s=items[-1].time_s, lat_deg=items[-1].lat_deg + OFF_DEG, lon_deg=items[-1].lon_deg, sd_m=0.2
    )
    assert (await adjust(live, AdjustmentRequest(fixes=[fix]), "Ana")).applied

    found = await adjust(live, AdjustmentRequest(), "Ana")
    assert not found.applied
    assert found.made_at is None
    assert found.actor is None
    assert all(track.max_m == 0 for track in found.tracks)
    assert (await events_after(live))[-1].message.startswith("the tracks' adjustment, asked for by Ana, moved nothing")
    await harbour.reopen()
    assert not adjustment_view(await harbour.service.get(mission)).applied
