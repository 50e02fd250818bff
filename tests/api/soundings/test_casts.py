"""Several sound speed casts: each sounding and ping is corrected by its own, also when casts come late."""

import asyncio
import csv
import io
import math
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any

import httpx
import pytest
from sqlalchemy import update

from app.settings import Settings
from app.storage.database import Database
from app.storage.models import MissionRow
from tests.support.api.rest import make_client, mission_spec, running, soundings
from tests.support.missions.pings import CLOCK_S, posted_ping

VEHICLES = [{"name": "rover", "kind": "rest", "sensor": "multibeam"}, {"name": "plain", "kind": "rest"}]
NEAR, FAR = [-8.7049, 41.1851], [-8.6, 41.1851]


def utc(time_s: float) -> str:
    return datetime.fromtimestamp(time_s, UTC).isoformat()


def cast(speed_mps: float, hours: float, position: list[float] | None = None) -> dict[str, Any]:
    """One of a water with one speed, taken some hours after the first sounding."""
    return {"profile": [[0, speed_mps]], "time": utc(CLOCK_S + 3600 * hours), "position": position}


def hourly(count: int = 10) -> list[dict[str, Any]]:
    """Soundings of 10 m range from 2 m depth, one an hour."""
    items = soundings(count, "plain")
    return [item | {"range_m": 10.0, "time_s": CLOCK_S + 3600 * hour} for hour, item in enumerate(items)]


def pings(numbers: range) -> list[dict[str, Any]]:
    """Pings over a floor some 10 m below 2 m, five a second and 2 m apart, in the area."""
    return [posted_ping(number, lat_deg=41.18515 + 2e-5 * number, lon_deg=-8.7045) for number in numbers]


@pytest.fixture
async def path(client: httpx.AsyncClient) -> str:
    answer = await client.post("/missions", json=mission_spec(vehicles=VEHICLES))
    assert answer.status_code == 201, answer.text
    return f"/missions/{answer.json()['id']}"


async def rows(client: httpx.AsyncClient, path: str) -> list[dict[str, str]]:
    text = (await client.get(f"{path}/soundings.csv")).text
    return list(csv.DictReader(io.StringIO(text.partition("\n")[2])))


async def speeds(client: httpx.AsyncClient, path: str) -> list[float]:
    """With which speed each of the hourly soundings was corrected, as its depth says."""
    return [round((float(row["depth_m"]) - 2.0) * 150.0, 3) for row in await rows(client, path)]


async def put(client: httpx.AsyncClient, address: str, body: dict[str, Any]) -> dict[str, Any]:
    answer = await client.put(address, json=body)
    assert answer.status_code == 200, answer.text
    return dict(answer.json())


async def post(client: httpx.AsyncClient, path: str, items: list[dict[str, Any]]) -> None:
    answer = await client.post(f"{path}/measurements", json={"items": items})
    assert answer.json()["rejected"] == 0, answer.text


async def test_each_sounding_is_corrected_by_the_cast_nearest_in_time(client: httpx.AsyncClient, path: str) -> None:
    await post(client, path, hourly()[:5])
    await put(client, f"{path}/sound-speed/casts/morning", cast(1510, 0))
    assert await speeds(client, path) == [1510.0] * 5
    shown = await put(client, f"{path}/sound-speed/casts/noon (north).asvp", cast(1530, 4))
    assert await speeds(client, path) == [1510.0] * 3 + [1530.0] * 2, "of two as near the earlier one"
    assert [one["name"] for one in (shown["sound_speed"], *shown["sound_speed"]["further"])] == [
        "morning",
        "noon (north).asvp",
    ]
    assert (
        "sound speed: 2 casts from 2026-11-21 01:39 to 2026-11-21 05:39 UTC, nearest in time"
        in (shown["vertical_datum"])
    )
    assert (await client.get(f"{path}/map")).json()["vertical_datum"] == shown["vertical_datum"]
    # Those that come later are corrected in the same way, and a cast may be replaced when all was flown.
    await post(client, path, hourly()[5:])
    assert await speeds(client, path) == [1510.0] * 3 + [1530.0] * 7
    await put(client, f"{path}/sound-speed/casts/noon (north).asvp", cast(1540, 8))
    assert await speeds(client, path) == [1510.0] * 5 + [1540.0] * 5
    listed = (await client.get(f"{path}/sound-speed/casts")).json()
    told = [(one["name"], one["soundings"], one["pings"], one["farthest_h"]) for one in listed["casts"]]
    assert told == [("morning", 5, 0, 4.0), ("noon (north).asvp", 5, 0, 3.0)]
    assert datetime.fromisoformat(listed["casts"][0]["last"]).timestamp() == pytest.approx(CLOCK_S + 4 * 3600)
    assert (listed["far_soundings"], listed["far_h"]) == (0, 4.0)


async def test_removing_a_cast_leaves_all_as_it_was_before_to_the_last_bit(
    client: httpx.AsyncClient, path: str
) -> None:
    await post(client, path, [*hourly(6), *pings(range(20))])
    profile = [[0, 1512.3], [5, 1509.8], [20, 1506.1]]
    await put(client, f"{path}/sound-speed", {"profile": profile, "source": "pier", "time": utc(CLOCK_S)})

    async def everything() -> tuple[Any, ...]:
        told = (await client.get(f"{path}/corrections")).json()
        found = (await client.get(f"{path}/map", params={"layer": "count"})).json()
        return await rows(client, path), told, found["depth_m"], found["sd_m"], found["layers"]

    before = await everything()
    alike = {"profile": profile, "time": utc(CLOCK_S + 7200)}
    await put(client, f"{path}/sound-speed/casts/alike", alike)
    same = await everything()
    assert (same[0], *same[2:]) == (before[0], *before[2:]), "a cast that equals the present one changes nothing"
    await put(client, f"{path}/sound-speed/casts/alike", alike | {"profile": [[0, 1480]]})
    other = await everything()
    assert other[0] != before[0]
    answer = await client.delete(f"{path}/sound-speed/casts/alike")
    assert answer.status_code == 200, answer.text
    assert await everything() == before
    await client.delete(f"{path}/sound-speed/casts/pier")
    assert (await client.get(f"{path}/corrections")).json()["sound_speed"] is None


async def test_pings_have_the_cast_of_their_own_time(client: httpx.AsyncClient, path: str) -> None:
    await post(client, path, pings(range(10)))
    await put(client, f"{path}/sound-speed/casts/a", cast(1500, 0))
    plain = (await client.get(f"{path}/map")).json()["depth_m"]
    # As far from the one cast as from the other: between the tenth ping and the eleventh.
    await put(client, f"{path}/sound-speed/casts/b", cast(1575, 2 * 1.9 / 3600))
    assert (await client.get(f"{path}/map")).json()["depth_m"] == plain
    await post(client, path, pings(range(10, 15)))
    told = (await client.get(f"{path}/sound-speed/casts")).json()
    assert [(one["name"], one["soundings"], one["pings"]) for one in told["casts"]] == [("a", 0, 10), ("b", 0, 5)]
    found = (await client.get(f"{path}/map")).json()
    assert found["min_depth_m"] == pytest.approx(12.0, abs=0.1)
    assert found["max_depth_m"] == pytest.approx(2.0 + 10.0 * 1.05, abs=0.1)


async def test_the_nearest_in_distance_corrects_within_a_time(client: httpx.AsyncClient, path: str) -> None:
    await post(client, path, hourly(10))
    await put(client, f"{path}/sound-speed/casts/far", cast(1510, 0, FAR))
    await put(client, f"{path}/sound-speed/casts/near", cast(1530, 5, NEAR))
    shown = await put(client, f"{path}/sound-speed/rule", {"rule": "nearest_in_distance_within_time", "within_h": 3})
    assert await speeds(client, path) == [1510.0] * 2 + [1530.0] * 8
    assert "nearest in distance within time 3 h" in shown["vertical_datum"]
    told = (await client.get(f"{path}/sound-speed/casts")).json()
    assert [(one["name"], one["soundings"]) for one in told["casts"]] == [("far", 2), ("near", 8)]
    await put(client, f"{path}/sound-speed/rule", {"rule": "nearest_in_time"})
    assert await speeds(client, path) == [1510.0] * 3 + [1530.0] * 7


async def test_casts_that_come_at_the_same_time_are_all_kept(client: httpx.AsyncClient, path: str) -> None:
    await post(client, path, hourly(10))
    casts = f"{path}/sound-speed/casts"
    await asyncio.gather(*(put(client, f"{casts}/{n}", cast(1500 + 5 * n, 2 * n)) for n in range(5)))
    told = (await client.get(casts)).json()["casts"]
    assert [one["name"] for one in told] == ["0", "1", "2", "3", "4"]
    assert sum(one["soundings"] for one in told) == 10
    assert await speeds(client, path) == [1500.0 + 5 * (hour // 2) for hour in range(10)]


async def test_files_of_several_casts_that_two_operators_add_at_the_same_time_are_all_kept(
    client: httpx.AsyncClient, path: str
) -> None:
    await post(client, path, hourly(10))
    casts = f"{path}/sound-speed/casts"

    def section(name: str, number: int) -> dict[str, Any]:
        hours = 2 * number + (1 if name == "b" else 0)
        return cast(1500 + 5 * hours, hours) | {"name": f"{name} {number}", "source": f"{name}.svp"}

    async def add(name: str) -> dict[str, Any]:
        answer = await client.post(casts, json={"casts": [section(name, n) for n in range(5)], "assumed_mps": 1490})
        assert answer.status_code == 200, answer.text
        return dict(answer.json())

    await asyncio.gather(add("a"), add("b"))
    told = (await client.get(casts)).json()
    assert [one["name"] for one in told["casts"]] == [f"{name} {n}" for n in range(5) for name in "ab"]
    assert told["assumed_mps"] == 1490.0, "the speed set in the sonars comes with the first of all casts"
    # Read once more, a file replaces its own casts only.
    again = await client.post(casts, json={"casts": [section("b", 0) | {"profile": [[0, 1600]]}]})
    speed = again.json()["sound_speed"]
    assert len([speed, *speed["further"]]) == 10
    told = (await client.get(casts)).json()
    assert [(one["name"], one["profile"]) for one in told["casts"]][:2] == [
        ("a 0", [[0.0, 1500.0]]),
        ("b 0", [[0.0, 1600.0]]),
    ]
    events = (await client.get(f"{path}/events", headers={"Accept": "application/json"})).json()
    words = [one["message"] for one in events if one["kind"] == "corrections"]
    assert any(line.startswith("sound speed casts 'a 0', 'a 1', 'a 2', 'a 3', 'a 4' added by ") for line in words)
    assert words[-1].startswith("sound speed cast 'b 0' replaced by ")


async def test_of_several_casts_all_are_added_or_none(client: httpx.AsyncClient, path: str) -> None:
    await post(client, path, hourly(3))
    casts = f"{path}/sound-speed/casts"
    named = [cast(1510, 0) | {"name": "one"}, cast(1520, 1, NEAR) | {"name": "two"}]
    timeless = cast(1530, 2) | {"name": "three", "time": None}
    far = cast(1530, 2, [100.0, 0.0]) | {"name": "three"}
    for listed, field, words in (
        ([*named, timeless], "casts.2.time", "cast 'three' has no time"),
        ([*named, far], "casts.2.position", "nowhere near the area"),
        ([*named, cast(1530, 2) | {"name": "two"}], "casts.2.name", "two casts are called 'two'"),
        ([*named, cast(1530, 2) | {"name": "..."}], "casts.2.name", "is no name of a cast"),
        ([*named, cast(99, 2) | {"name": "three"}], "casts.2.profile.0.1", ""),
        ([], "casts", ""),
    ):
        answer = await client.post(casts, json={"casts": listed})
        assert answer.status_code == 422, (listed, answer.text)
        [error] = answer.json()["errors"]
        assert error["field"] == field, error
        assert words in error["message"], error
    assert (await client.get(casts)).json()["casts"] == []
    await put(client, f"{casts}/pier", cast(1510, 0) | {"time": None})
    answer = await client.post(casts, json={"casts": named})
    assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, "casts")
    assert "cast 'pier' has no time" in answer.text
    other = await client.post(casts, json={"casts": named, "assumed_mps": 1490})
    assert (other.status_code, other.json()["type"]) == (409, "urn:bathyfleet:problem:conflict")
    assert "1500 m/s is set in the sonars" in other.json()["detail"]
    assert [one["name"] for one in (await client.get(casts)).json()["casts"]] == ["pier"]
    await put(client, f"{casts}/pier", cast(1510, 0))
    answer = await client.put(f"{casts}/second", json=cast(1520, 1, [100.0, 0.0]))
    assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, "position")


async def test_soundings_far_from_their_cast_and_casts_far_apart_are_told(client: httpx.AsyncClient, path: str) -> None:
    await post(client, path, [*hourly(10), *pings(range(20))])
    told = (await client.get(f"{path}/sound-speed/casts")).json()
    assert (told["casts"], told["changes"], told["far_soundings"]) == ([], [], 0)
    await put(client, f"{path}/sound-speed/casts/a", cast(1500, -4.5))
    await put(client, f"{path}/sound-speed/casts/b", cast(1503, 2))
    await put(client, f"{path}/sound-speed/casts/c", cast(1600, 3))
    depth = (await client.get(f"{path}/map")).json()["max_depth_m"]
    told = (await client.get(f"{path}/sound-speed/casts", params={"order": "special"})).json()
    assert (told["far_soundings"], told["far_pings"]) == (2, 0)
    assert told["depth_m"] == pytest.approx(depth, abs=0.01)
    limit = 0.5 * math.hypot(0.25, 0.0075 * told["depth_m"])
    assert told["limit_m"] == pytest.approx(limit)
    assert told["angle_deg"] == 60.0
    down = told["depth_m"] - told["sonar_m"]
    assert [(one["before"], one["after"], one["is_large"]) for one in told["changes"]] == [
        ("a", "b", False),
        ("b", "c", True),
    ]
    assert [one["difference_m"] for one in told["changes"]] == pytest.approx([down * 3 / 1500, down * 97 / 1500])
    report = (await client.get(f"{path}/report.html", params={"order": "special"})).text
    assert "2 soundings and pings are more than 4 h from their cast" in report
    assert "1 times two neighbouring casts give the outer beam depths up to" in report
    assert "more than half the TVU of Special Order" in report
    assert "Sound speed casts, what each corrected" in report
    assert "Next cast" in report


async def test_casts_far_apart_are_told_also_by_a_service_that_has_just_begun(
    make_settings: Callable[..., Settings],
) -> None:
    settings = make_settings()
    async with running(settings) as server, make_client(server) as client:
        answer = await client.post("/missions", json=mission_spec(vehicles=VEHICLES))
        path = f"/missions/{answer.json()['id']}"
        await post(client, path, hourly(4))
        await put(client, f"{path}/sound-speed/casts/a", cast(1500, 0))
        await put(client, f"{path}/sound-speed/casts/b", cast(1600, 3))
    async with running(settings) as server, make_client(server) as client:
        told = (await client.get(f"{path}/sound-speed/casts")).json()
        assert [(one["before"], one["after"], one["is_large"]) for one in told["changes"]] == [("a", "b", True)]


async def test_what_cannot_be_changes_nothing_and_says_which_field(client: httpx.AsyncClient, path: str) -> None:
    absent = await client.delete(f"{path}/sound-speed/casts/none")
    assert (absent.status_code, absent.json()["type"]) == (404, "urn:bathyfleet:problem:cast-not-found")
    early = await client.put(f"{path}/sound-speed/rule", json={})
    assert (early.status_code, early.json()["type"]) == (409, "urn:bathyfleet:problem:conflict")
    await post(client, path, hourly(3))
    await put(client, f"{path}/sound-speed", {"profile": [[0, 1510]], "source": "pier"})
    before = await rows(client, path), (await client.get(f"{path}/corrections")).json()
    casts = f"{path}/sound-speed/casts"
    for address, body, field, words in (
        (f"{casts}/b", cast(1520, 1), "time", "cast 'pier' has no time"),
        (f"{casts}/pier", cast(1520, 1) | {"profile": [[5, 1500], [0, 1500]]}, "profile", "not below the 5 m"),
        (f"{casts}/pier", cast(99, 1), "profile.0.1", ""),
        (f"{casts}/pier", cast(1520, 1, [100.0, 0.0]), "position", "nowhere near the area"),
        (f"{casts}/pier", cast(1520, 1, NEAR[::-1]), "position", "nowhere near the area"),
        (f"{casts}/pier", cast(1520, 1) | {"time": "0001-01-01T00:00:00+05:00"}, "time", "no time of a cast"),
        (f"{casts}/...", cast(1520, 1), "name", "is no name of a cast"),
        (f"{path}/sound-speed/rule", {"rule": "nearest"}, "rule", ""),
        (f"{path}/sound-speed/rule", {"within_h": 0}, "within_h", ""),
    ):
        answer = await client.put(address, json=body)
        assert answer.status_code == 422, (address, body, answer.text)
        [error] = answer.json()["errors"]
        assert error["field"] == field, (address, error)
        assert words in error["message"], error
        assert error["expected"]
    named = cast(1510, 0) | {"name": "one"}
    twice = named | {"further": [cast(1520, 1) | {"name": "one"}]}
    answer = await client.put(f"{path}/sound-speed", json=twice)
    assert answer.status_code == 422
    assert (answer.json()["errors"][0]["field"]) == "further.0.name"
    placeless = named | {"rule": "nearest_in_distance_within_time", "further": [cast(1520, 1, NEAR) | {"name": "two"}]}
    answer = await client.put(f"{path}/sound-speed", json=placeless)
    assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, "position")
    long = {"profile": [[d, 1500] for d in range(2000)]}
    many = named | {"further": [cast(1500, n) | long | {"name": f"n{n}"} for n in range(26)]}
    answer = await client.put(f"{path}/sound-speed", json=many)
    assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, "further")
    assert (await rows(client, path), (await client.get(f"{path}/corrections")).json()) == before


async def test_a_mission_may_be_described_with_casts_and_a_single_profile_replaces_all(
    client: httpx.AsyncClient,
) -> None:
    far = cast(1530, 5, [100.0, 0.0]) | {"name": "two"}
    speed = cast(1510, 0) | {"source": "first", "further": [far]}
    answer = await client.post("/missions", json=mission_spec(vehicles=VEHICLES, sound_speed=speed))
    assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, "sound_speed.further.0.position")
    far["position"] = NEAR
    answer = await client.post("/missions", json=mission_spec(vehicles=VEHICLES, sound_speed=speed))
    assert answer.status_code == 201, answer.text
    path = f"/missions/{answer.json()['id']}"
    await post(client, path, hourly(10))
    assert await speeds(client, path) == [1510.0] * 3 + [1530.0] * 7
    await put(client, f"{path}/sound-speed", {"profile": [[0, 1520]], "source": "only"})
    assert await speeds(client, path) == [1520.0] * 10
    assert (await client.get(f"{path}/corrections")).json()["vertical_datum"].endswith("; sound speed: only)")


async def test_a_profile_that_an_older_version_stored_is_one_cast(make_settings: Callable[..., Settings]) -> None:
    settings = make_settings()
    async with running(settings) as server, make_client(server) as client:
        answer = await client.post("/missions", json=mission_spec(vehicles=VEHICLES))
        mission = answer.json()["id"]
        await post(client, f"/missions/{mission}", hourly(4))
    database = Database(settings.database_url)
    old = {"assumed_mps": 1490.0, "profile": [[0.0, 1512.3], [5.0, 1509.8]], "source": "cast at the pier/1"}
    async with database.writing() as session:
        row = await session.get_one(MissionRow, mission)
        spec = row.spec | {"sound_speed": old}
        await session.execute(update(MissionRow).where(MissionRow.id == mission).values(spec=spec))
    await database.close()
    async with running(settings) as server, make_client(server) as client:
        path = f"/missions/{mission}"
        speed = (await client.get(f"{path}/corrections")).json()["sound_speed"]
        assert {name: speed[name] for name in old} == old
        [told] = (await client.get(f"{path}/sound-speed/casts")).json()["casts"]
        assert (told["name"], told["soundings"], told["time"]) == ("cast at the pier 1", 4, None)
        assert (told["farthest_h"], told["profile"]) == (None, old["profile"])
        await put(client, f"{path}/sound-speed/casts/cast at the pier 1", cast(1510, 0))
        await put(client, f"{path}/sound-speed/casts/second", cast(1530, 3))
        kept = await rows(client, path)
    async with running(settings) as server, make_client(server) as client:
        assert await rows(client, path) == kept
        listed = (await client.get(f"{path}/sound-speed/casts")).json()
        assert [one["soundings"] for one in listed["casts"]] == [2, 2]
        assert listed["assumed_mps"] == 1490.0
