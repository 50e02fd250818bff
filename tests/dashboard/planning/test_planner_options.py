"""A planner and its settings in the form, in Chromium against the real service."""

import json
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, show

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]


def described(page: Page, name: str) -> None:
    """Begin to describe a mission of this name, its expert settings open."""
    page.goto("/")
    by_id(page, "new-mission").click()
    by_id(page, "field-name").fill(name)
    page.get_by_text("Expert settings").click()


def created(page: Page, name: str) -> dict[str, Any]:
    """Create what is described and return what was sent of its planner."""
    with page.expect_request(lambda sent: sent.method == "POST" and sent.url.endswith("/api/v1/missions")) as sent:
        by_id(page, "create-mission").click()
    expect(by_id(page, "mission-name")).to_have_text(name)
    planner: dict[str, Any] = json.loads(sent.value.post_data or "")["planner"]
    return planner


@pytest.mark.parametrize("by", ["button", "template"])
def test_another_planner_goes_without_the_settings_that_it_does_not_read(page: Page, by: str) -> None:
    described(page, f"By {by}")
    page.locator("#option-candidates").fill("64")
    page.locator("#option-turn_radius_m").fill("5")
    if by == "button":
        by_id(page, "planner-lawnmower").click()
    else:
        by_id(page, "template").select_option("Multibeam, full coverage")
    expect(page.locator("#option-candidates")).to_have_count(0)
    name = "lawnmower" if by == "button" else "swath"
    assert created(page, f"By {by}") == {"name": name, "options": {"turn_radius_m": 5}}


def test_settings_of_a_mission_that_is_edited_are_shown(page: Page, service: Service) -> None:
    show(page, service.create(name="Edited", planner={"name": "cao", "options": {"alpha": 0.5}}))
    by_id(page, "edit-mission").click()
    page.get_by_text("Expert settings").click()
    expect(page.locator("#option-alpha")).to_have_value("0.5")
    expect(page.locator("#option-degree")).to_have_value("")
    by_id(page, "planner-lawnmower").click()
    by_id(page, "create-mission").click()
    expect(by_id(page, "mission-form")).to_have_count(0)


@pytest.mark.parametrize(("text", "words"), [("abc", "needs a number"), ("9", "between 1 and 3")])
def test_a_setting_that_cannot_be_taken_is_told_of_beside_it(page: Page, text: str, words: str) -> None:
    described(page, "Set wrongly")
    page.locator("#option-degree").fill(text)
    by_id(page, "create-mission").click()
    expect(by_id(page, "fault-options.degree")).to_contain_text(f"degree {words}".replace("between", "must be between"))
    expect(by_id(page, "fault-options.degree")).to_be_in_viewport()
    expect(page.locator("#option-degree")).to_be_focused()
    expect(page.locator("#option-degree")).to_have_attribute("aria-invalid", "true")


def test_a_refusal_of_a_setting_stands_beside_it(page: Page) -> None:
    described(page, "Refused")
    problem = {"field": "planner.options.degree", "message": "2 is too much here", "expected": ""}
    answer = {"title": "no", "status": 422, "detail": "1 value cannot be taken", "errors": [problem]}
    page.route(
        "**/api/v1/missions",
        lambda route: route.fulfill(status=422, json=answer) if route.request.method == "POST" else route.fallback(),
    )
    # Which settings there are is the service's to say.
    expect(page.locator("#option-degree")).to_be_visible()
    by_id(page, "create-mission").click()
    expect(by_id(page, "fault-options.degree")).to_contain_text("2 is too much here")
    expect(page.locator("#option-degree")).to_be_focused()
