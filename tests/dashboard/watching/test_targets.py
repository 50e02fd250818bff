"""Moving targets in Chromium, against the real service with its own simulation."""

import re

import pytest
from playwright.sync_api import expect

from tests.support.dashboard.browser import Watched
from tests.support.dashboard.service import Service
from tests.support.missions.specs import AREA

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]


def test_an_operator_sees_where_a_target_is_thought_to_be(watched: Watched, service: Service) -> None:
    lon, lat = AREA["coordinates"][0][0]
    target = {"name": "tag-1", "simulated": {"start": [lon + 3e-4, lat + 2e-4], "depth_m": 3, "speed_mps": 0.1}}
    mission = service.create(
        vehicles=[{"name": f"t-{k}", "kind": "sim"} for k in range(3)],
        targets=[target],
        surface_policy={"max_position_sd_m": 3.0},
    )
    page = watched.page
    page.goto(f"/#/missions/{mission}")
    card = page.get_by_test_id("target-tag-1")
    expect(card).to_have_attribute("data-state", "unheard")
    expect(card).to_contain_text("Not heard yet")
    service.act(mission, "start")
    try:
        expect(card).to_have_attribute("data-state", re.compile("uncertain|accurate"))
        expect(page.get_by_test_id("target-sd-tag-1")).to_have_text(re.compile(r"±\s\d"))
        expect(page.get_by_test_id("card-t-0")).to_contain_text(re.compile(r"nav\s±\s\d+\.\d\sm,\s(good|fading)"))
        expect(page.get_by_test_id("show-targets")).to_have_attribute("aria-pressed", "true")
        page.get_by_test_id("show-targets").click()
        expect(page.get_by_test_id("show-targets")).to_have_attribute("aria-pressed", "false")
    finally:
        service.act(mission, "abort")
    assert watched.complaints == []
