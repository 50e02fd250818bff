"""Vehicles' logs into missions: once, whatever happens in between."""

import asyncio
import json
import signal
import subprocess
import time
from collections.abc import AsyncIterator, Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

from app.missions.errors import ConflictError, InvalidRequestError
from app.missions.operations.history import events_after
from app.missions.operations.imports import log_batches
from app.missions.operations.imports.log_import import LogImport, import_log
from app.missions.operations.maps.mission_maps import newest_map
from app.missions.service import MissionService
from app.missions.settings import ServiceSettings
from app.missions.views.measurements.soundings import LogImportView
from app.storage.database import Database
from app.storage.queries import missions as mission_queries
from tests.support.commands import COMMAND, environment
from tests.support.imc import log_writer as writer
from tests.support.missions.harbour import view_of
from tests.support.missions.specs import make_spec, rectangle
from tests.support.storage.databases import query

PINGS = 300
"""90 m of track, of which the area with its margin holds the first 46 m."""

Rows = Sequence[tuple[Any, ...]]


def stored(url: str, columns: str = "time_s, beam, verdict, depth_m") -> Rows:
    return query(url, f"select {columns} from soundings order by time_s, beam")  # noqa: S608


def points(url: str) -> Rows:
    return query(url, "select vehicle, time_s from positions order by id")


@pytest.fixture
async def service(make_settings: Callable[..., ServiceSettings], database: Database) -> AsyncIterator[MissionService]:
    """The service as the command line uses it: nothing is started."""
    service = MissionService(make_settings(), database)
    yield service
    await service.shutdown()


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return writer.write(tmp_path / "Data.lsf.gz", writer.survey(PINGS))


@pytest.fixture
def small_batches(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(log_batches, "BATCH", 50)


async def take(service: MissionService, mission_id: str, log: Path, **options: Any) -> LogImportView:
    return await import_log(await service.get(mission_id), service.settings, log, actor="tester", **options)


async def test_a_log_becomes_soundings_a_track_a_map_and_a_line_in_the_log(
    service: MissionService, log: Path, database_url: str
) -> None:
    mission = await service.create(make_spec(vehicles=[]))
    seen: list[tuple[int, int]] = []
    view = await take(service, mission.id, log, progress=lambda done, total: seen.append((done, total)))
    rows = stored(database_url)
    assert (view.vehicle, view.soundings + view.rejected) == (writer.NAME, PINGS)
    assert len(rows) == PINGS
    assert view.soundings == sum(row[2] == "accepted" for row in rows) > 100
    assert sum(view.reasons.values()) == view.rejected > 0
    assert all("outside the area" in reason for reason in view.reasons)
    assert seen[-1][0] == seen[-1][1] > 0
    for time_s, _, verdict, depth in rows:
        if verdict == "accepted":
            assert depth == pytest.approx(writer.bottom_m(writer.SPEED_MPS * (time_s - writer.START_S)), abs=1e-3)
    assert (await newest_map(await service.get(mission.id), service.maps)).built.soundings == view.soundings
    track = (await (await service.get(mission.id)).trails.newest())[writer.NAME]
    latitudes = [lat for _, lat, _ in track]
    assert latitudes == sorted(latitudes)
    assert (latitudes[-1] - latitudes[0]) * 111_000 > 20
    events = await events_after(await service.get(mission.id))
    assert events[-1].kind == "import"
    assert events[-1].data["soundings"] == view.soundings


async def test_a_log_imported_again_changes_nothing(
    service: MissionService, log: Path, database_url: str, tmp_path: Path
) -> None:
    mission = await service.create(make_spec())
    first = await take(service, mission.id, log)
    before = stored(database_url, "*"), points(database_url), await events_after(await service.get(mission.id))
    again = await take(service, mission.id, log)
    assert again == first.model_copy(update={"known": True})
    # What was packed is the same log unpacked.
    plain = writer.write(tmp_path / "Data.lsf", writer.survey(PINGS))
    assert await take(service, mission.id, plain) == again.model_copy(update={"file": "Data.lsf"})
    # The same records in another file: known one by one.
    longer = writer.write(tmp_path / "longer.lsf", [*writer.survey(PINGS), writer.announce(1.0)])
    assert (await take(service, mission.id, longer)).duplicate == PINGS
    assert stored(database_url, "*") == before[0]
    assert (await view_of(service, mission.id)).progress.soundings == first.soundings


async def test_a_log_that_another_process_begins_with_meanwhile_has_one_number(
    service: MissionService, log: Path, database_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    mission = await service.create(make_spec())
    first = await take(service, mission.id, log)
    track = points(database_url)

    async def nothing_there_yet(_: LogImport) -> None:
        pass

    monkeypatch.setattr(LogImport, "_look", nothing_there_yet)
    assert await take(service, mission.id, log) == first.model_copy(update={"known": True})
    assert points(database_url) == track
    assert len(query(database_url, "select id from logs")) == 1
    with pytest.raises(ConflictError, match=f"as the log of {writer.NAME}"):
        await take(service, mission.id, log, vehicle="other")
    assert points(database_url) == track


async def test_pings_of_a_log_count_once_and_are_on_the_map(
    service: MissionService, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(log_batches, "PING_BATCH", 3)
    times = [writer.START_S + 1.03 + 0.1 * k for k in range(10)]
    packets = [*writer.survey(20), *(writer.ping(at_s, 8.0) for at_s in times)]
    log = writer.write(tmp_path / "Data.lsf", packets)
    mission = await service.create(make_spec(vehicles=[]))
    view = await take(service, mission.id, log)
    assert (view.pings, view.pings_rejected, view.soundings, view.known) == (10, 0, 20, False)
    live = await service.get(mission.id)
    assert (live.progress().pings, live.progress().beams) == (10, 10 * writer.BEAMS)
    assert (await take(service, mission.id, log)).known
    await live.map.build()
    assert live.progress().ensonified_pct
    assert live.progress().pings == 10
    events = await events_after(live)
    assert "20 soundings and 10 pings" in events[-1].message


@pytest.mark.usefixtures("small_batches")
@pytest.mark.parametrize("fails_after", [0, 1, 5])
async def test_an_import_that_failed_anywhere_goes_on_where_it_was(
    service: MissionService,
    make_settings: Callable[..., ServiceSettings],
    database: Database,
    log: Path,
    database_url: str,
    monkeypatch: pytest.MonkeyPatch,
    fails_after: int,
) -> None:
    whole, broken = await service.create(make_spec()), await service.create(make_spec())
    calls = 0
    write_positions = mission_queries.add_positions

    async def fail(*arguments: Any) -> None:
        nonlocal calls
        calls += 1
        await write_positions(*arguments)
        if calls > fails_after:
            raise OSError("disk full")

    with monkeypatch.context() as patch:
        patch.setattr(mission_queries, "add_positions", fail)
        with pytest.raises(OSError, match="disk full"):
            await take(service, broken.id, log)
    later = MissionService(make_settings(), database)
    finished = await take(later, broken.id, log)
    straight = await take(later, whole.id, log)
    assert finished == straight
    for table, columns in (("soundings", "time_s, beam, verdict, reason, depth_m, lat_deg"), ("positions", "time_s")):
        rows = [
            query(database_url, f"select {columns} from {table} where mission_id = :id order by id", id=m.id)  # noqa: S608
            for m in (whole, broken)
        ]
        assert rows[0] == rows[1]
    assert (await view_of(later, broken.id)).progress.soundings == straight.soundings
    await later.shutdown()


async def test_a_running_service_notices_what_another_process_imported(
    service: MissionService, make_settings: Callable[..., ServiceSettings], log: Path
) -> None:
    mission = await service.create(make_spec())
    half = writer.write(log.with_name("half.lsf"), writer.survey(60))
    await take(service, mission.id, half)
    version = (await newest_map(await service.get(mission.id), service.maps)).built.version
    settings = make_settings()
    store = Database(settings.database_url)
    beside = MissionService(settings, store)
    view = await take(beside, mission.id, log)
    await beside.shutdown()
    await store.close()
    snapshot = await newest_map(await service.get(mission.id), service.maps)
    assert snapshot.built.soundings == view.soundings + 60
    assert snapshot.built.version > version
    assert (await view_of(service, mission.id)).progress.soundings == view.soundings + 60
    assert (await newest_map(await service.get(mission.id), service.maps)).built is snapshot.built, "noticed once"


async def test_live_telemetry_of_the_same_dive_is_not_stored_twice(
    service: MissionService, log: Path, database_url: str
) -> None:
    mission = await service.create(make_spec(area=rectangle(0, 0, 30, 120)))
    first = await take(service, mission.id, writer.write(log.with_name("part.lsf"), writer.survey(100)))
    rest = await take(service, mission.id, log)
    assert (first.soundings, rest.duplicate, rest.soundings) == (100, 100, PINGS - 100)
    assert len({row[:2] for row in stored(database_url)}) == PINGS == len(stored(database_url))


@pytest.mark.parametrize(
    ("content", "vehicle", "words"),
    [
        (b"no log", None, "holds no IMC packet"),
        (None, None, "cannot be read"),
        (b"".join(writer.survey(3)), "two words", "'two words' is no name of a vehicle"),
    ],
)
async def test_what_cannot_be_imported_is_refused_and_nothing_is_stored(
    service: MissionService, tmp_path: Path, database_url: str, content: bytes | None, vehicle: str | None, words: str
) -> None:
    mission = await service.create(make_spec())
    path = tmp_path / "Data.lsf"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InvalidRequestError, match=words) as refused:
        await take(service, mission.id, path, vehicle=vehicle)
    assert refused.value.remedy
    assert stored(database_url) == []


def kill_after_the_first_batch(command: list[str], database: str) -> None:
    with subprocess.Popen(command, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        while not stored(database) and process.poll() is None:
            time.sleep(0.005)
        process.send_signal(signal.SIGKILL)


@pytest.mark.slow
async def test_a_command_that_was_killed_and_run_again_has_imported_everything_once(
    service: MissionService, tmp_path: Path, database_url: str
) -> None:
    mission = await service.create(make_spec(area=rectangle(0, 0, 30, 1600)))
    log = writer.write(tmp_path / "Data.lsf.gz", writer.survey(5000))
    command = [*COMMAND, "import-log", mission.id[:8], str(log), "--json", "--database", database_url]
    await asyncio.to_thread(kill_after_the_first_batch, command, database_url)
    ended = await asyncio.to_thread(
        subprocess.run, command, env=environment(), cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (ended.returncode, ended.stderr) == (0, ""), "no progress bar where there is no terminal"
    (view,) = json.loads(ended.stdout)
    assert (view["soundings"], view["rejected"], view["duplicate"]) == (5000, 0, 0)
    rows = stored(database_url)
    assert len(rows) == len({row[:2] for row in rows}) == 5000
    times = [time_s for _, time_s in points(database_url)]
    assert times == sorted(set(times)), "no part of the track twice"


async def test_a_real_log_of_dune_maps_the_relief_it_flew_over(
    service: MissionService, captures: Path, database_url: str
) -> None:
    west, south = -8.7075, 41.1835
    east, north = -8.7035, 41.1865
    ring = [[west, south], [east, south], [east, north], [west, north], [west, south]]
    spec = make_spec(area={"type": "Polygon", "coordinates": [ring]}, cell_m=5.0)
    mission = await service.create(spec)
    view = await take(service, mission.id, captures / "lauv-xplore-1.lsf.gz")
    assert (view.vehicle, view.soundings, view.rejected) == ("lauv-xplore-1", 958, 0)
    assert view.refused == {}
    assert {row[2] for row in stored(database_url)} == {"accepted"}
