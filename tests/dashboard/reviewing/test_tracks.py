"""Tracks adjusted for drift on the page, in Chromium."""

import re

import numpy as np
import pytest
from playwright.sync_api import expect

from tests.support.dashboard.browser import Watched
from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, picture, show, violations
from tests.support.mapping.drifting import SIDE_M, drift_of, pinged_while_drifting, ways
from tests.support.missions.specs import rectangle

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]


@pytest.fixture
def drifted(service: Service) -> str:
    """Crossing lines of two swath sonars, of which one drifts."""
    kinds = [{"name": name, "kind": "rest", "sensor": "multibeam"} for name in ("rover", "scout")]
    mission = service.create(name="Drifted", area=rectangle(0, 0, SIDE_M, SIDE_M), cell_m=1, vehicles=kinds)
    first, second = ways()
    for items in (
        pinged_while_drifting("rover", first, np.zeros((len(first), 2))),
        pinged_while_drifting("scout", second, drift_of(second)),
    ):
        for begin in range(0, len(items), 100):
            service.post(f"/missions/{mission}/measurements", {"items": items[begin : begin + 100]})
    return mission


def test_tracks_are_adjusted_by_a_click_told_of_and_put_back_by_another(watched: Watched, drifted: str) -> None:
    page = watched.page
    show(page, drifted)
    by_id(page, "look-at-tracks").click()
    told = by_id(page, "adjustment")
    expect(told).to_contain_text("Positions are as the vehicles told them.")
    by_id(page, "adjust-tracks").click()
    expect(told).to_contain_text(re.compile(r"Adjusted by \d+ ties and 0 GPS fixes, .+, \d+"))
    card = by_id(page, "tracks-card")
    expect(card.get_by_role("row", name="scout")).to_contain_text(re.compile(r"\d\.\d"))
    expect(by_id(page, "ties-agree")).to_have_text(
        re.compile(r"Overlapping sections differ by 0\.\d+ m before and 0\.\d+ m after\.")
    )
    used = by_id(page, "ties").locator("circle.used")
    assert used.count() > 10
    card.scroll_into_view_if_needed()
    picture(page, "tracks-adjusted")
    used.first.click()
    by_id(page, "undo-adjustment").click()
    expect(told).to_contain_text("Positions are as the vehicles told them.")
    expect(by_id(page, "undo-adjustment")).to_have_count(0)
    page.set_viewport_size({"width": 390, "height": 844})
    by_id(page, "toggle-missions").click()
    card.scroll_into_view_if_needed()
    picture(page, "tracks-phone")
    assert violations(page) == []
    assert watched.complaints == []
