"""A search in Chromium, against the real service with its own simulation."""

import re

import pytest
from playwright.sync_api import Page, expect

from app.missions.search.examples import example
from tests.support.dashboard.browser import Watched
from tests.support.dashboard.service import Service

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]


def test_an_operator_sees_what_a_search_has_looked_at(watched: Watched, service: Service) -> None:
    mission = service.post("/missions", example("harbour", vehicles=2))["id"]
    page = watched.page
    page.goto(f"/#/missions/{mission}")
    expect(page.get_by_test_id("search-state")).to_contain_text("Not begun")
    service.act(mission, "start")
    try:
        expect(page.get_by_test_id("search-state")).to_contain_text("In time")
        expect(page.get_by_test_id("site-seen")).to_have_text(re.compile(r"^[1-9]\d* %"))
        expect(page.get_by_test_id("time-left")).to_contain_text("min")
        page.get_by_test_id("toggle-legend").click()
        expect(page.get_by_test_id("site-legend")).to_contain_text("obstacle found")
        page.get_by_test_id("show-site").click()
        expect(page.get_by_test_id("site-legend")).to_have_count(0)
        page.get_by_test_id("show-site").click()
        page.get_by_test_id("toggle-files").click()
        with page.expect_download() as download:
            page.get_by_test_id("file-obstacles.geojson").click()
        assert '"found":false' in download.value.path().read_text()
    finally:
        service.act(mission, "abort")
    expect(page.get_by_test_id("search-card")).to_contain_text("scans")
    assert watched.complaints == []


def test_a_search_is_described_by_pointing_at_the_map(page: Page, service: Service) -> None:
    page.goto("/")
    page.get_by_test_id("new-mission").click()
    page.get_by_test_id("field-name").fill("Lost buoy")
    page.get_by_test_id("kind-search").check()
    page.get_by_test_id("create-mission").click()
    expect(page.get_by_test_id("fault-goal")).to_contain_text("Pick the goal on the map")
    for field, (dx, dy) in (("goal", (30, -40)), ("entry", (-30, 40))):
        page.get_by_test_id(f"pick-{field}").click()
        expect(page.get_by_test_id(f"pick-{field}")).to_have_text("Click on the map…")
        box = page.get_by_test_id("map").bounding_box()
        assert box is not None
        page.mouse.click(box["x"] + box["width"] / 2 + dx, box["y"] + box["height"] / 2 + dy)
        expect(page.get_by_test_id(f"field-{field}")).to_have_value(re.compile(r"^41\.\d+, -8\.\d+$"))
    page.get_by_test_id("field-window_min").fill("12")
    page.get_by_test_id("create-mission").click()
    expect(page.get_by_test_id("search-card")).to_be_visible()
    (made,) = [m for m in service.get("/missions") if m["name"] == "Lost buoy"]
    spec = service.get(f"/missions/{made['id']}")["spec"]
    assert (spec["kind"], spec["search"]["window_s"], spec["planner"]["name"]) == ("search", 720.0, "rollout")
