"""A patch test over REST: what overlapping lines say of a mounting, which is taken over and makes them agree."""

import asyncio
from typing import Any

import httpx
import pytest
from typer.testing import CliRunner

from app.cli import app
from app.settings import Settings
from tests.support.api.rest import make_client, running
from tests.support.api.surveys import START_S, new_mission, post
from tests.support.mapping.calibration import REAL, calibration
from tests.support.mapping.tracks import flown, measured


async def estimated(client: httpx.AsyncClient, path: str, **asked: float) -> dict[str, Any]:
    answer = await client.post(f"{path}/mountings/rover/estimate", json=asked)
    assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()
    return found


def at_the_command_line(path: str, *options: str, pings_url: str = "") -> str:
    words = ["patch-test", path.rpartition("/")[2], "rover", *options]
    ended = CliRunner().invoke(app, words, env={"BATHYFLEET_PINGS_URL": pings_url})
    assert ended.exit_code == 0, ended.output
    return ended.output


@pytest.mark.slow
async def test_overlapping_lines_tell_a_mounting_that_makes_them_agree(settings: Settings) -> None:
    async with running(settings) as server, make_client(server) as client:
        path = await new_mission(client, "rover", sensor="multibeam", mounting={"offset_m": REAL["offset_m"]})
        items = calibration("rover", START_S)
        for start in range(0, len(items), 200):
            await post(client, path, items[start : start + 200])
        before = (await client.get(f"{path}/corrections")).json()
        found = await estimated(client, path)
        assert (await client.get(f"{path}/corrections")).json() == before, "nothing is changed"
        told = {one["name"]: one for one in found["parameters"]}
        assert told["latency_s"]["known"] == "undetermined"
        assert told["latency_s"]["value"] is None
        assert "slowly and fast" in told["latency_s"]["why"]
        for name in ("roll_deg", "pitch_deg", "heading_deg"):
            one = told[name]
            assert one["proposed"], one
            assert abs(one["value"] - REAL[name]) < 4.0 * one["sd"], one
        assert len(found["lines"]) == 6
        assert {round(one["heading_deg"]) % 360 for one in found["lines"]} == {0, 180}
        assert found["after_m"] < 0.5 * found["before_m"]
        assert found["proposal"]["offset_m"] == REAL["offset_m"], "the lever arm stays"
        told_there = await asyncio.to_thread(at_the_command_line, path, "--url", server.url, "--apply")
        assert f"roll     {told['roll_deg']['value']:+.3f} ±" in told_there
        assert "latency  undetermined: these lines do not tell it; it takes a line flown twice" in told_there
        assert "the mounting of rover is corrected: roll +1.2" in told_there
        (kept,) = (await client.get(f"{path}/corrections")).json()["mountings"]
        assert kept["corrected"] == found["proposal"]
        again = await estimated(client, path)
        assert again["proposal"] is None, "lines agree already"
        assert again["before_m"] == pytest.approx(found["after_m"], rel=0.1)
    told_here = await asyncio.to_thread(
        at_the_command_line, path, "--database", settings.database_url, pings_url=settings.pings_url
    )
    assert "nothing is proposed" in told_here


async def test_what_does_not_overlap_or_is_no_swath_is_refused_with_advice(client: httpx.AsyncClient) -> None:
    path = await new_mission(client, "rover", "other")
    await post(client, path, measured("rover", flown([(5, 5), (50, 50)], start_s=START_S)))
    refused = await client.post(f"{path}/mountings/rover/estimate")
    assert refused.status_code == 409, refused.text
    assert "no pings" in refused.text
    stranger = await client.post(f"{path}/mountings/stranger/estimate")
    assert stranger.status_code == 404, stranger.text
    assert (await client.post(f"{path}/mountings/rover/estimate", json={"level_sd_m": 0})).status_code == 422
    path = await new_mission(client, "rover", sensor="multibeam")
    await post(client, path, [item for item in calibration("rover", START_S) if item["time_s"] < START_S + 50.0])
    refused = await client.post(f"{path}/mountings/rover/estimate")
    assert refused.status_code == 409, refused.text
    assert "fly a line there and back" in refused.text
