"""Files of a vehicle's own multibeam: pings of a mission, once, and all of a file or nothing."""

from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.mapping.coordinates.georeference import LocalFrame
from app.missions.errors import InvalidRequestError
from app.missions.operations.corrections.casts import set_cast
from app.missions.operations.corrections.recorrection import corrections_view, set_sound_speed
from app.missions.operations.history import events_after
from app.missions.operations.imports import log_batches
from app.missions.operations.imports.log_import import import_log
from app.missions.operations.maps.mission_maps import newest_map
from app.missions.service import MissionService
from app.missions.settings import ServiceSettings
from app.missions.spec.water import CastDescription, SoundSpeed
from app.missions.views.measurements.soundings import LogImportView
from app.storage.database import Database
from tests.support.mapping.multibeam import floor, line, write_gsf, write_kmall
from tests.support.missions.specs import FRAME, make_spec

MIDDLE = LocalFrame(*(float(value) for value in FRAME.to_geographic(15.0, 15.0)))
"""Of a mission's area, 30 m wide."""


@pytest.fixture
async def service(make_settings: Callable[..., ServiceSettings], database: Database) -> AsyncIterator[MissionService]:
    """The service as the command line uses it: nothing is started."""
    service = MissionService(make_settings(), database)
    yield service
    await service.shutdown()


async def take(service: MissionService, mission_id: str, file: Path, vehicle: str | None = "wam-v") -> LogImportView:
    return await import_log(await service.get(mission_id), service.settings, file, vehicle=vehicle, actor="tester")


def write(kind: str, path: Path, **more: Any) -> Path:
    """A line over the plane of :func:`floor` about the middle of the area, whose water stood 0.4 m too high for GSF."""
    file = path / f"line.{kind}"
    if kind == "kmall":
        write_kmall(file, line(MIDDLE, **more))
        return file
    pings = line(MIDDLE, more={"TideCorrector_m": -0.4, "DepthCorrector_m": 1.5}, **more)
    for ping in pings:
        ping.depth_m = ping.depth_m - 0.4
    write_gsf(file, pings, {"TIDE_COMPENSATED": "YES"})
    return file


@pytest.mark.parametrize("kind", ["gsf", "kmall"])
async def test_pings_are_below_the_surface_and_on_the_map_once(
    service: MissionService, tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(log_batches, "PING_BATCH", 5)
    file = write(kind, tmp_path)
    mission = await service.create(make_spec(vehicles=[], cell_m=1.0))
    view = await take(service, mission.id, file)
    assert (view.vehicle, view.pings, view.pings_rejected, view.soundings, view.known) == ("wam-v", 12, 0, 0, False)
    live = await service.get(mission.id)
    assert (live.progress().pings, live.progress().beams) == (12, 12 * 21)
    async for vehicle, pings in live.pings.all_accepted():
        assert vehicle == "wam-v"
        np.testing.assert_allclose(pings.depth_m, 1.5, atol=1e-6)
        found = live.gate.corrections.beams(vehicle, pings)
        assert found is not None
        beams = found.footprints
        east, north = (np.array(axis) - shift for axis, shift in ((beams.east_m, 15.0), (beams.north_m, 15.0)))
        np.testing.assert_allclose(beams.depth_m, floor(east, north), atol=0.02)
    built = (await newest_map(live, service.maps)).built
    known = np.isfinite(built.map.depth_m) & built.map.sounded
    assert known.sum() > 100
    east, north = np.meshgrid(built.map.grid.east_m - 15.0, built.map.grid.north_m - 15.0)
    assert np.abs(built.map.depth_m - floor(east, north))[known].max() < 0.2
    track = (await live.trails.newest())["wam-v"]
    assert len(track) >= 2
    again = await take(service, mission.id, file)
    assert again == view.model_copy(update={"known": True})
    assert "12 pings from line" in (await events_after(live))[-1].message
    of_the_same_line = write({"gsf": "kmall", "kmall": "gsf"}[kind], tmp_path)
    more = await take(service, mission.id, of_the_same_line)
    assert (more.pings, more.pings_duplicate) == (0, 12)
    said = "taken out of depths" if kind == "gsf" else "not reduced for the tide"
    assert any(said in note for note in view.notes)


async def test_pings_elsewhere_are_counted_and_not_stored(service: MissionService, tmp_path: Path) -> None:
    pings = line(MIDDLE, pings=3) + line(LocalFrame(41.3, -8.7), pings=4) + line(LocalFrame(-41.3, 8.7), pings=5)
    pings[1].flags = np.ones(21)
    write_gsf(tmp_path / "a.gsf", pings)
    mission = await service.create(make_spec(vehicles=[]))
    view = await take(service, mission.id, tmp_path / "a.gsf")
    assert (view.pings, view.pings_rejected) == (2, 0)
    assert sorted(view.refused.values()) == [1, 9]


async def test_pings_of_one_time_are_all_kept(service: MissionService, tmp_path: Path) -> None:
    """Two swaths of one transmission, or two receivers, have the time of the transmission."""
    pings = line(MIDDLE, pings=6)
    for number, ping in enumerate(pings):
        ping.time_s = 1.7e9 + number // 3
    write_kmall(tmp_path / "a.kmall", pings)
    mission = await service.create(make_spec(vehicles=[]))
    assert (await take(service, mission.id, tmp_path / "a.kmall")).pings == 6


@pytest.mark.parametrize("kind", ["gsf", "kmall"])
async def test_of_a_damaged_file_nothing_is_taken(
    service: MissionService, tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(log_batches, "PING_BATCH", 2)
    file = write(kind, tmp_path)
    file.write_bytes(file.read_bytes()[:-1])
    mission = await service.create(make_spec(vehicles=[]))
    with pytest.raises(InvalidRequestError, match="ends within it"):
        await take(service, mission.id, file)
    live = await service.get(mission.id)
    assert live.progress().pings == 0
    assert not [event for event in await events_after(live) if event.kind == "import"]


@pytest.mark.parametrize(
    ("change", "parameters", "said"),
    [
        ({}, {"TIDE_COMPENSATED": "YES"}, "does not say by how much"),
        ({"TideCorrector_m": 0.5, "GPSTideCorrector_m": 0.7}, None, "does not say by how much"),
    ],
)
async def test_depths_that_cannot_be_taken_back_to_the_surface_are_refused(
    service: MissionService, tmp_path: Path, change: dict[str, float], parameters: dict[str, str] | None, said: str
) -> None:
    write_gsf(tmp_path / "a.gsf", line(MIDDLE, more=change), parameters)
    mission = await service.create(make_spec(vehicles=[]))
    with pytest.raises(InvalidRequestError, match=said) as refused:
        await take(service, mission.id, tmp_path / "a.gsf")
    assert "bathyfleet import" in str(refused.value.remedy)


async def test_a_name_is_needed_and_no_profile_may_be_applied_again(service: MissionService, tmp_path: Path) -> None:
    file = write("kmall", tmp_path)
    mission = await service.create(make_spec(vehicles=[]))
    with pytest.raises(InvalidRequestError, match=r"line\.kmall does not tell its vehicle's name"):
        await take(service, mission.id, file, vehicle=None)
    profile = SoundSpeed(profile=[(0.0, 1500.0), (20.0, 1510.0)])
    other = await service.create(make_spec(vehicles=[], sound_speed=profile.model_dump()))
    with pytest.raises(InvalidRequestError, match="profile would be applied again"):
        await take(service, other.id, file)
    await take(service, mission.id, file)
    live = await service.get(mission.id)
    before = corrections_view(live)
    with pytest.raises(InvalidRequestError, match=r"line\.kmall have the sound speed applied"):
        await set_sound_speed(live, profile, "Ana")
    with pytest.raises(InvalidRequestError, match=r"line\.kmall have the sound speed applied"):
        await set_cast(live, "noon", CastDescription(profile=profile.profile), "Ana")
    assert corrections_view(live) == before
    await set_sound_speed(live, None, "Ana")
