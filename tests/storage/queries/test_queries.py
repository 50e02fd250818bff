"""What the queries answer."""

import random

import numpy as np
import pytest
from sqlalchemy import select

from app.storage.bulk import read_in_pieces, read_numbers
from app.storage.database import Database
from app.storage.models import EventRow, ImportRow, MissionRow, ReferenceRow, SoundingRow
from app.storage.queries import events as event_queries
from app.storage.queries import missions as mission_queries
from app.storage.queries import soundings as sounding_queries
from app.storage.queries import telemetry as telemetry_queries
from tests.support.storage.rows import TIME, mission, one_of_each, position, sounding, step, vehicle, waypoint


async def _two_missions(database: Database) -> None:
    async with database.writing() as session:
        session.add_all([mission(), mission("m2")])


async def test_a_sounding_is_known_by_vehicle_time_and_beam(database: Database) -> None:
    await _two_missions(database)
    first = [sounding(time_s=1.0), sounding(time_s=1.0, beam=1), sounding(time_s=2.0)]
    async with database.writing() as session:
        assert await sounding_queries.insert_new(session, first) == {("a", 1.0, 0), ("a", 1.0, 1), ("a", 2.0, 0)}
    again = [
        sounding(time_s=1.0, depth_m=99.0),
        sounding(time_s=2.0, beam=1),
        sounding(name="b", time_s=1.0),
        sounding(name="b", time_s=1.0, depth_m=98.0),
    ]
    async with database.writing() as session:
        assert await sounding_queries.insert_new(session, again) == {("a", 2.0, 1), ("b", 1.0, 0)}
        assert await sounding_queries.insert_new(session, [sounding("m2")]) == {("a", 1.0, 0)}
        assert await sounding_queries.insert_new(session, []) == set()
    async with database.reading() as session:
        rows = await sounding_queries.soundings_after(session, "m1", 0, 100)
    assert [(r.vehicle, r.time_s, r.beam) for r in rows] == [
        ("a", 1.0, 0),
        ("a", 1.0, 1),
        ("a", 2.0, 0),
        ("a", 2.0, 1),
        ("b", 1.0, 0),
    ]
    assert {row.depth_m for row in rows} == {10.0}  # what was there first stays


async def test_the_extent_of_soundings_is_that_of_one_verdict(database: Database) -> None:
    await _two_missions(database)
    rows = [sounding(time_s=float(t)) | {"position_sd_m": 0.5 * t} for t in (3, 1, 2)]
    rejected = sounding(time_s=9.0) | {"verdict": "rejected", "position_sd_m": 40.0}
    async with database.writing() as session:
        await sounding_queries.insert_new(session, [*rows, rejected])
    async with database.reading() as session:
        assert await sounding_queries.extent(session, "m1", "accepted") == sounding_queries.Extent(1.0, 3.0, 1.5)
        assert await sounding_queries.extent(session, "m2", "accepted") is None
    async with database.writing() as session:
        await sounding_queries.insert_new(session, [sounding(time_s=4.0)])
    async with database.reading() as session:
        found = await sounding_queries.extent(session, "m1", "accepted")
    assert found == sounding_queries.Extent(1.0, 4.0, None), "one states no deviation of its position"


async def test_unix_times_with_all_their_digits_are_told_apart_and_recognised(database: Database) -> None:
    await _two_missions(database)
    rng = random.Random(5)  # noqa: S311
    times = sorted({1.795e9 + rng.random() * 1e5 for _ in range(500)})
    times.append(float(np.nextafter(times[-1], np.inf)))
    rows = [sounding(time_s=t) for t in times]
    async with database.writing() as session:
        assert len(await sounding_queries.insert_new(session, rows)) == len(times)
    async with database.writing() as session:
        assert await sounding_queries.insert_new(session, rows) == set()


async def test_a_large_batch_is_stored_whole(database: Database) -> None:
    await _two_missions(database)
    rows = [
        sounding(time_s=float(i), depth_m=float(i), verdict="rejected" if i % 3 else "accepted") for i in range(5000)
    ]
    async with database.writing() as session:
        assert len(await sounding_queries.insert_new(session, rows)) == 5000
    async with database.reading() as session:
        assert await sounding_queries.counts(session, "m1") == {"accepted": 1667, "rejected": 3333}
        assert await sounding_queries.counts(session, "m2") == {}
    found: list[list[float]] = []
    await read_in_pieces(database, sounding_queries.accepted_query("m1"), lambda part: found.extend(map(list, part)))
    assert [row[2] for row in found] == [float(i) for i in range(0, 5000, 3)]
    assert not any(row[4] for row in found)
    await read_in_pieces(database, sounding_queries.accepted_query("m2"), lambda part: pytest.fail(f"{part}"))


async def test_numbers_are_read_as_arrays_in_their_order(database: Database) -> None:
    await _two_missions(database)
    rows = [sounding(time_s=float(i), depth_m=i / 3.0, ruling="restored" if i % 2 else None) for i in range(2500)]
    async with database.writing() as session:
        await sounding_queries.insert_new(session, rows)
    pieces: list[np.ndarray] = []
    await read_numbers(database, sounding_queries.accepted_query("m1"), pieces.append)
    table = np.concatenate(pieces)
    assert table.shape == (2500, 5)
    assert table.dtype == np.float64
    np.testing.assert_array_equal(table[:, 2], np.arange(2500) / 3.0)
    np.testing.assert_array_equal(table[:, 4], np.arange(2500) % 2)
    await read_numbers(database, sounding_queries.accepted_query("m2"), lambda part: pytest.fail(f"{part}"))


async def test_numbers_that_are_missing_are_not_read_as_others(database: Database) -> None:
    await _two_missions(database)
    async with database.writing() as session:
        await sounding_queries.insert_new(session, [sounding(position_sd_m=None)])
    query = select(SoundingRow.position_sd_m, SoundingRow.depth_m).where(SoundingRow.mission_id == "m1")
    with pytest.raises(ValueError, match="is missing there"):
        await read_numbers(database, query, lambda part: pytest.fail(f"{part}"))


async def test_newest_waypoints_are_one_for_each_vehicle(database: Database) -> None:
    await _two_missions(database)
    async with database.writing() as session:
        session.add_all([vehicle(), vehicle(name="b", slot=1), step(), step(number=2), step("m2")])
        await session.flush()
        session.add_all([waypoint(), waypoint(number=2), waypoint(name="b"), waypoint("m2", name="c")])
    async with database.writing() as session:
        await mission_queries.set_waypoint_status(session, "m1", 2, "a", "reached", "there", TIME)
    async with database.reading() as session:
        newest = await mission_queries.newest_waypoints(session, "m1")
        assert [(w.vehicle, w.step, w.status, w.reason) for w in newest] == [
            ("a", 2, "reached", "there"),
            ("b", 1, "planned", ""),
        ]
        last = await mission_queries.last_step(session, "m1")
        assert last is not None
        assert (last.number, last.memory) == (2, b"\x00memory")
        assert [w.vehicle for w in await mission_queries.waypoints_between(session, "m1", 1, 1)] == ["a", "b"]


async def test_missions_come_newest_first_in_the_state_they_are_in(database: Database) -> None:
    async with database.writing() as session:
        session.add_all(
            [mission("old", state="running"), mission("new", state="paused", created_at=TIME.replace(year=2027))]
        )
    async with database.writing() as session:
        await mission_queries.set_state(session, "old", "failed", "no power", TIME.replace(year=2028))
        await mission_queries.add_elapsed(session, "old", 2.5, TIME)
    async with database.reading() as session:
        newest, oldest = await session.scalars(mission_queries.ALL)
        failed = await session.get_one(MissionRow, oldest)
    assert newest == "new"
    assert (failed.id, failed.reason, failed.elapsed_s) == ("old", "no power", 4.0)


async def test_tracks_keep_the_order_in_which_they_were_heard(database: Database) -> None:
    await _two_missions(database)
    async with database.writing() as session:
        await mission_queries.add_positions(
            session, [position(lat_deg=41.3), position(lat_deg=41.1), position(name="b"), position("m2", lat_deg=1.0)]
        )
        await mission_queries.add_positions(session, [])
    async with database.reading() as session:
        last = await mission_queries.last_positions(session, "m1")
    tracks: list[tuple[str, float]] = []
    for after in (0, 1):
        take = lambda part: tracks.extend((row[1], row[5]) for row in part)  # noqa: E731
        await read_in_pieces(database, mission_queries.positions_after("m1", after), take)
    assert tracks == [("a", 41.3), ("a", 41.1), ("b", 41.18), ("a", 41.1), ("b", 41.18)]
    assert {name: row.lat_deg for name, row in last.items()} == {"a": 41.1, "b": 41.18}


async def test_events_resume_after_any_of_them(database: Database) -> None:
    await _two_missions(database)
    async with database.writing() as session:
        for i in range(6):
            mission_id = "m1" if i % 2 else "m2"
            session.add(EventRow(mission_id=mission_id, time=TIME, level="info", kind="k", message=str(i), data={}))
            await session.flush()
    async with database.reading() as session:
        every = await event_queries.events_after(session, "m1", 0, 10)
        assert [e.message for e in every] == ["1", "3", "5"]
        rest = await event_queries.events_after(session, "m1", every[0].id, 1)
        assert [e.message for e in rest] == ["3"]
        assert await event_queries.last_event_id(session, "m1") == every[-1].id
        assert await event_queries.last_event_id(session, "m3") == 0


async def test_imports_and_the_reference_grid_come_back_as_they_were(database: Database) -> None:
    await _two_missions(database)
    async with database.writing() as session:
        for rows in one_of_each():
            session.add_all(row for row in rows if isinstance(row, ImportRow | ReferenceRow))
    async with database.reading() as session:
        np.testing.assert_array_equal(await sounding_queries.imported_arrays(session, "m1"), [[1.0, 2.0, 3.0, 0.5]])
        assert (await sounding_queries.imported_arrays(session, "m2")).shape == (0, 4)
        np.testing.assert_array_equal(await sounding_queries.reference_grid(session, "m1"), [[3.0, np.nan]])
        assert await sounding_queries.reference_grid(session, "m2") is None


async def test_telemetry_is_thinned_evenly_for_all_vehicles_alike_and_keeps_the_newest(database: Database) -> None:
    await _two_missions(database)
    empty = {"depth_m": None, "altitude_m": None, "battery_pct": None, "age_s": None}
    rows = [
        {"mission_id": "m1", "vehicle": name, "at_s": 5.0 * i} | empty | {"depth_m": float(i)}
        for i in range(101)
        for name in ("b", "a")
        if name == "a" or i >= 60  # joined later
    ]
    async with database.writing() as session:
        await telemetry_queries.add(session, rows)
        await telemetry_queries.add(session, [rows[0] | {"mission_id": "m2", "at_s": 1e6}])
        await telemetry_queries.add(session, [])
    async with database.reading() as session:
        every = await telemetry_queries.samples(session, "m1", 200)
        thin = await telemetry_queries.samples(session, "m1", 25)
        assert await telemetry_queries.samples(session, "m3", 25) == []
    assert [(row.at_s, row.vehicle, row.depth_m) for row in every] == sorted(
        (row["at_s"], row["vehicle"], row["depth_m"]) for row in rows
    )
    of = {name: [row.at_s for row in thin if row.vehicle == name] for name in "ab"}
    assert of["a"] == [5.0 * i for i in range(0, 101, 5)]
    assert of["b"] == [at for at in of["a"] if at >= 300.0]
