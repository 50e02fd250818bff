"""Tide and sound speed can be set when they are known; raw values stay."""

import csv
import io
import math
from datetime import UTC, datetime, timedelta
from typing import Any

import httpx
import pytest

from app.mapping.coordinates.georeference import LocalFrame
from tests.support.api.rest import mission_spec, soundings

START_S = 1_795_225_140.0


def tide_table(begin_s: float, hours: float = 12.0) -> str:
    """Low water of 1 m at ``begin_s``, high water of 3 m at the end."""
    begin = datetime.fromtimestamp(begin_s, UTC)
    lines = [f"{begin:%Y/%m/%d %H:%M:%S}.000 1.0", f"{begin + timedelta(hours=hours):%Y/%m/%d %H:%M:%S}.000 3.0"]
    return "# Harbor: Test\n" + "\n".join(lines)


async def rows(client: httpx.AsyncClient, path: str) -> list[dict[str, str]]:
    text = (await client.get(f"{path}/soundings.csv")).text
    return list(csv.DictReader(io.StringIO(text.partition("\n")[2])))


@pytest.fixture
async def path(client: httpx.AsyncClient, mission: dict[str, Any]) -> str:
    return f"/missions/{mission['id']}"


async def test_a_tide_set_afterwards_corrects_what_was_measured_before(client: httpx.AsyncClient, path: str) -> None:
    await client.post(f"{path}/measurements", json={"items": soundings(5, start_s=START_S)})
    before = await rows(client, path)
    first_map = (await client.get(f"{path}/map")).json()
    assert first_map["vertical_datum"] == "instantaneous water level (tide: none applied)"

    answer = await client.put(f"{path}/tide", json={"table": tide_table(START_S), "source": "port authority"})
    assert answer.status_code == 200, answer.text
    shown = answer.json()
    assert (shown["accepted"], shown["rejected"], shown["tide_table"]["entries"]) == (5, 0, 2)
    assert shown["vertical_datum"].startswith("EPSG:5861 LAT depth, by tide table Test (sha256 ")
    after = await rows(client, path)
    for old, new in zip(before, after, strict=True):
        assert new["raw_depth_m"] == old["raw_depth_m"] == old["depth_m"]
        assert float(new["depth_m"]) == pytest.approx(float(old["depth_m"]) - 1.0, abs=1e-4)
        assert float(new["level_m"]) == pytest.approx(1.0, abs=1e-4)
    later = (await client.get(f"{path}/map")).json()
    assert later["max_depth_m"] == pytest.approx(first_map["max_depth_m"] - 1.0, abs=0.01)
    assert later["version"] > first_map["version"]

    constant = {"level_m": 0.5, "datum_epsg": 5715, "datum_offset_m": 2.0, "sd_m": 0.1}
    await client.put(f"{path}/tide", json=constant)
    (one, *_) = await rows(client, path)
    assert float(one["depth_m"]) == pytest.approx(float(one["raw_depth_m"]) - 0.5 + 2.0)
    assert (await client.get(f"{path}/quality")).json()["common_sd_m"] == 0.1
    said = (await client.get(f"{path}/map")).json()["vertical_datum"]
    assert said == "EPSG:5715 MSL depth, by level +0.50 m (tide: source not stated; datum offset +2.000 m)"
    report = (await client.get(f"{path}/report.html")).text
    assert "none applied</" not in report.partition("Sound speed")[0]


async def test_that_a_gauges_times_are_taken_for_utc_is_answered_and_logged(
    client: httpx.AsyncClient, path: str
) -> None:
    begin = datetime.fromtimestamp(START_S, UTC)
    lines = [f"{begin + timedelta(minutes=6 * k):%Y-%m-%d %H:%M};1.{k}" for k in range(3)]
    answer = await client.put(f"{path}/tide", json={"table": "\n".join(lines), "source": "gauge"})
    assert answer.status_code == 200, answer.text
    assert answer.json()["tide_table"]["utc_assumed"]
    logged = [
        event["message"]
        for event in (await client.get(f"{path}/events", headers={"Accept": "application/json"})).json()
    ]
    assert any("whose times state no zone and are taken for UTC" in text for text in logged), logged
    stated = "\n".join(line.replace(";", "Z;") for line in lines)
    assert not (await client.put(f"{path}/tide", json={"table": stated})).json()["tide_table"]["utc_assumed"]


async def test_soundings_are_corrected_and_written_piece_by_piece(
    client: httpx.AsyncClient, path: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.missions.operations.corrections.recorrection.AT_ONCE", 3)
    await client.post(f"{path}/measurements", json={"items": soundings(7, start_s=START_S)})
    await client.put(f"{path}/tide", json={"table": tide_table(START_S + 2.5)})
    partly = await rows(client, path)
    assert {row["verdict"] for row in partly} == {"accepted", "rejected"}
    assert all((row["level_m"] == "") == (row["verdict"] == "rejected") for row in partly)
    shown = (await client.put(f"{path}/tide", json={"level_m": 0.5, "datum_epsg": 5861})).json()
    assert (shown["accepted"], shown["rejected"]) == (7, 0)
    whole = await rows(client, path)
    assert [row["id"] for row in whole] == [row["id"] for row in partly]
    assert all(float(row["depth_m"]) == pytest.approx(float(row["raw_depth_m"]) - 0.5) for row in whole)


async def test_beyond_the_table_soundings_are_refused_until_a_table_covers_them(
    client: httpx.AsyncClient, path: str
) -> None:
    await client.put(f"{path}/tide", json={"table": tide_table(START_S - 1e6)})
    answer = (await client.post(f"{path}/measurements", json={"items": soundings(3, start_s=START_S)})).json()
    assert (answer["accepted"], answer["rejected"]) == (0, 3)
    assert answer["items"][0]["reason"].startswith("tide: 2026-11-21 01:39 UTC is not within the tide table 'Test'")
    events = (await client.get(f"{path}/events", headers={"Accept": "application/json"})).json()
    alarms = [event["message"] for event in events if event["level"] == "alarm"]
    assert len(alarms) == 1
    assert "Send a tide table that covers them" in alarms[0]

    shown = (await client.put(f"{path}/tide", json={"table": tide_table(START_S - 3600)})).json()
    assert (shown["accepted"], shown["rejected"]) == (3, 0)
    assert [row["reason"] for row in await rows(client, path)] == [""] * 3
    # And back: what was accepted under a level has none any more.
    shown = (await client.put(f"{path}/tide", json={"table": tide_table(START_S - 1e6)})).json()
    assert (shown["accepted"], shown["rejected"]) == (0, 3)
    assert (await client.get(f"{path}/map")).status_code == 404


async def test_a_mission_does_not_start_with_a_table_that_has_run_out(client: httpx.AsyncClient, path: str) -> None:
    await client.put(f"{path}/tide", json={"table": tide_table(1_500_000_000.0)})
    answer = await client.post(f"{path}/start")
    assert (answer.status_code, answer.json()["type"]) == (409, "urn:bathyfleet:problem:conflict")
    assert "is not within the tide table 'Test', 2017-07-14 02:40 UTC" in answer.json()["detail"]


@pytest.mark.parametrize(
    ("body", "field"),
    [
        ({"table": "2019/01/01 05:20 1.1\n2019/01/01 09:20 much"}, "table"),
        ({"datum_epsg": 5780}, "datum_epsg"),
        ({"datum_epsg": 4326}, "datum_epsg"),
        ({"datum_epsg": 999_999}, "datum_epsg"),
        ({"level_m": 900}, "level_m"),
        ({"levels": 1}, "levels"),
    ],
)
async def test_a_tide_that_cannot_be_changes_nothing(
    client: httpx.AsyncClient, path: str, body: dict[str, Any], field: str
) -> None:
    await client.put(f"{path}/tide", json={"level_m": 1.5})
    answer = await client.put(f"{path}/tide", json=body)
    assert answer.status_code == 422
    assert field in answer.json()["errors"][0]["field"]
    assert (await client.get(f"{path}/corrections")).json()["tide"]["level_m"] == 1.5


async def test_sound_speed_stretches_ranges_and_can_be_taken_back(client: httpx.AsyncClient, path: str) -> None:
    slanted = {"beam_off_nadir_deg": 30.0, "beam_azimuth_deg": 90.0, "heading_deg": 0.0}
    items = [soundings(1)[0] | {"range_m": 10.0}, soundings(1)[0] | {"range_m": 10.0, "beam": 1} | slanted]
    assert (await client.post(f"{path}/measurements", json={"items": items})).json()["accepted"] == 2
    plain = await rows(client, path)
    answer = await client.put(f"{path}/sound-speed", json={"profile": [[0, 1530.0]], "source": "cast 1"})
    assert "sound speed: cast 1" in answer.json()["vertical_datum"]
    down, side = await rows(client, path)
    assert float(down["depth_m"]) == pytest.approx(2.0 + 10.2)
    assert float(side["depth_m"]) == pytest.approx(2.0 + 10.2 * math.cos(math.radians(30)), abs=1e-3)
    assert float(side["east_m"]) - float(down["east_m"]) == pytest.approx(5.1, abs=2e-3)
    assert float(down["raw_depth_m"]) == 12.0
    await client.delete(f"{path}/sound-speed")
    assert await rows(client, path) == plain
    bad = await client.put(f"{path}/sound-speed", json={"profile": [[5, 1500], [0, 1500]]})
    assert (bad.status_code, bad.json()["errors"][0]["field"]) == (422, "profile")


async def test_slanted_beams_meet_the_bottom_where_attitude_and_angle_say(client: httpx.AsyncClient, path: str) -> None:
    place = soundings(1)[0]
    attitude = {"heading_deg": 90.0, "roll_deg": 10.0, "pitch_deg": 0.0}
    beam = {"beam_off_nadir_deg": 20.0, "beam_azimuth_deg": 90.0}
    # Starboard down by 10 degrees turns a starboard beam from 20 back to 10 degrees off the vertical.
    await client.post(f"{path}/measurements", json={"items": [place | {"range_m": 20.0} | attitude | beam]})
    (row,) = await rows(client, path)
    spec = mission_spec()["area"]["coordinates"][0]
    frame = LocalFrame(min(lat for _, lat in spec), min(lon for lon, _ in spec))
    east, north = (float(v) for v in frame.to_local(place["lat_deg"], place["lon_deg"]))
    assert float(row["raw_depth_m"]) == pytest.approx(2.0 + 20.0 * math.cos(math.radians(10.0)), abs=1e-6)
    assert float(row["north_m"]) == pytest.approx(north - 20.0 * math.sin(math.radians(10.0)), abs=0.01)
    assert float(row["east_m"]) == pytest.approx(east, abs=0.01)
    assert [float(row[name]) for name in ("roll_deg", "heading_deg", "beam_off_nadir_deg")] == [10.0, 90.0, 20.0]

    missing = soundings(2)[1] | {"range_m": 20.0} | beam
    answer = (await client.post(f"{path}/measurements", json={"items": [missing]})).json()
    assert answer["rejected"] == 1
    assert "a slanted beam needs both" in answer["items"][0]["reason"]
