"""Describing missions again and otherwise: what is kept and what is lost, in Chromium against the real service."""

import pytest
from playwright.sync_api import Page, expect

from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, show

pytestmark = [pytest.mark.browser, pytest.mark.timeout(400)]


def test_vehicles_keep_what_is_theirs_when_one_is_called_otherwise(page: Page, service: Service) -> None:
    slow = {"name": "auv-1", "kind": "rest", "endurance_min": 50, "speed_mps": 1}
    fast = {"name": "auv-10", "kind": "rest", "endurance_min": 200, "speed_mps": 2}
    mission = service.create(name="Two", vehicles=[slow, fast])
    show(page, mission)
    by_id(page, "edit-mission").click()
    by_id(page, "vehicle-auv-10").press("End")
    by_id(page, "vehicle-auv-10").press("Backspace")
    by_id(page, "vehicle-auv-10").press("Tab")
    expect(by_id(page, "fault-names")).to_contain_text("Two vehicles are called auv-1")
    by_id(page, "vehicle-auv-10").press("End")
    by_id(page, "vehicle-auv-10").press("2")
    by_id(page, "vehicle-auv-10").press("Tab")
    expect(by_id(page, "fault-names")).to_be_hidden()
    by_id(page, "create-mission").click()
    expect(by_id(page, "mission-form")).to_be_hidden()
    vehicles = service.get(f"/missions/{mission}")["spec"]["vehicles"]
    told = [(vehicle["name"], vehicle["endurance_min"], vehicle["speed_mps"]) for vehicle in vehicles]
    assert told == [("auv-1", 50, 1), ("auv-12", 200, 2)]
