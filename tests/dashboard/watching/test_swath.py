"""Swath surveys in Chromium, against the real service with its own simulation."""

import re
from typing import Any

import pytest
from playwright.sync_api import expect

from tests.support.dashboard.browser import Watched
from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, colours_in_the_middle, expect_state, picture, show, start
from tests.support.missions.specs import lon_lat, rectangle

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]

SIDE_M, CELL_M = 60, 2


@pytest.fixture
def with_a_hole(service: Service) -> str:
    """A mission whose pings left out four by three cells."""
    vehicles = [{"name": "rover", "kind": "rest", "sensor": "multibeam"}]
    area = rectangle(0, 0, SIDE_M, SIDE_M)
    mission = service.create(name="Hole", area=area, cell_m=CELL_M, vehicles=vehicles)
    items: list[dict[str, Any]] = []
    for north in range(1, SIDE_M, CELL_M):
        for east in range(1, SIDE_M, CELL_M):
            if 10 < east < 18 and 20 < north < 26:
                continue
            lon, lat = lon_lat(east, north)
            beams = {"angles_deg": [-5.0, 0.0, 5.0], "ranges_m": [8.0 + 0.05 * east] * 3}
            items.append({"vehicle": "rover", "time_s": 1.79e9 + 0.2 * len(items), "lat_deg": lat, "lon_deg": lon})
            items[-1] |= {"depth_m": 2.0, "heading_deg": 90.0, "beams": beams}
    service.post(f"/missions/{mission}/measurements", {"items": items})
    return mission


def test_holidays_are_listed_drawn_and_gone_to(watched: Watched, service: Service, with_a_hole: str) -> None:
    page = watched.page
    show(page, with_a_hole)
    expect(by_id(page, "coverage")).to_have_text("98.7 %")
    expect(by_id(page, "dense")).to_have_text("0.0 %")
    expect(by_id(page, "holidays")).to_have_text("1")
    expect(by_id(page, "beams")).to_have_text("2 664")
    expect(by_id(page, "holiday-count")).to_have_text("1")
    expect(by_id(page, "holiday-1")).to_have_text("Holiday 1 48 m²")
    expect(by_id(page, "card-rover")).to_contain_text(re.compile(r"multibeam.120° · 256.beams"))
    by_id(page, "layer").select_option(label="Density")
    expect(by_id(page, "density")).to_contain_text("no sounding 1 %")
    expect(by_id(page, "density")).to_contain_text("1 to 4 soundings 99 %")
    picture(page, "holiday-wide")
    by_id(page, "holiday-1").click()
    assert any(colours_in_the_middle(page) > 2 for _ in range(50)), "its stripes are in the middle"
    picture(page, "holiday-shown")
    by_id(page, "show-holidays").click()
    expect(by_id(page, "show-holidays")).to_have_attribute("aria-pressed", "false")
    by_id(page, "show-holidays").click()
    by_id(page, "toggle-files").click()
    with page.expect_download() as download:
        by_id(page, "file-holidays.geojson").click()
    assert '"number":1' in download.value.path().read_text()
    page.set_viewport_size({"width": 390, "height": 844})
    by_id(page, "toggle-missions").click()
    by_id(page, "toggle-files").click()
    picture(page, "holiday-phone")
    assert watched.complaints == []


def test_a_swath_survey_is_described_started_and_followed(watched: Watched, service: Service) -> None:
    page = watched.page
    page.goto("/")
    by_id(page, "new-mission").click()
    by_id(page, "field-name").fill("Full coverage")
    by_id(page, "field-east_m").fill("80")
    by_id(page, "field-north_m").fill("60")
    by_id(page, "field-simulated").fill("1")
    expect(by_id(page, "planner-swath")).to_have_count(0)
    by_id(page, "field-sensor").select_option("multibeam")
    by_id(page, "planner-swath").check()
    expect(by_id(page, "field-overlap_pct")).to_have_value("6")
    page.get_by_text("Single vehicles").click()
    expect(by_id(page, "beams-sim-1")).to_have_attribute("placeholder", "256")
    by_id(page, "aperture_deg-sim-1").fill("100")
    by_id(page, "beams-sim-1").fill("128")
    picture(page, "form")
    # Its plan and its forecast tell of the whole area, whatever the length is.
    by_id(page, "field-length").select_option("minutes")
    by_id(page, "field-minutes").fill("2")
    expect(by_id(page, "planned").get_by_test_id("whole-survey")).to_contain_text("sim-1")
    by_id(page, "ask-forecast").click()
    forecast = by_id(page, "forecast")
    expect(forecast).to_contain_text("Ensonified", timeout=120_000)
    expect(by_id(page, "forecast-duration")).to_have_text(re.compile(r"\d"))
    share = re.match(r"(\d+)", by_id(page, "forecast-coverage").inner_text())
    assert share is not None
    assert 0 < int(share.group(1)) < 100, "two minutes are not enough"
    expect(forecast.get_by_test_id("whole-survey")).to_have_class("reason")
    picture(page, "forecast")
    by_id(page, "field-minutes").fill("60")
    expect(forecast).not_to_contain_text("Ensonified")
    expect(by_id(page, "planned").get_by_test_id("whole-survey")).to_have_class("hint")
    by_id(page, "create-mission").click()
    expect(by_id(page, "mission-name")).to_have_text("Full coverage")
    (made,) = [m for m in service.get("/missions") if m["name"] == "Full coverage"]
    spec = service.get(f"/missions/{made['id']}")["spec"]
    assert (spec["planner"]["name"], spec["coverage"]["overlap_pct"]) == ("swath", 6.0)
    sonar = spec["vehicles"][0]["sonar"]
    assert (sonar["aperture_deg"], sonar["beams"], sonar["rate_hz"]) == (100.0, 128, 5.0)

    start(page)
    expect(by_id(page, "coverage")).to_have_text(re.compile(r"^[1-9]\d*\.\d %"))
    expect(by_id(page, "beams")).to_have_text(re.compile(r"^[1-9]"))
    expect(by_id(page, "card-sim-1")).to_contain_text(re.compile(r"multibeam.100° · 128.beams"))
    port_m, starboard_m = service.get(f"/missions/{made['id']}")["vehicles"][0]["swath_m"]
    # At the border of the simulated floor one side meets nothing.
    assert port_m + starboard_m > 2.0
    picture(page, "swath-wide")
    by_id(page, "layer").select_option(label="Density")
    expect(by_id(page, "density")).to_contain_text("5 and more")
    picture(page, "swath-density")
    page.set_viewport_size({"width": 390, "height": 844})
    expect(by_id(page, "swath-card")).to_be_attached()
    by_id(page, "toggle-missions").click()
    picture(page, "swath-phone")
    service.act(made["id"], "abort")
    expect_state(page, "aborted")
    assert watched.complaints == []
