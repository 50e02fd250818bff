"""What the form of a mission says of wrong values, in Chromium against the real service."""

import pytest
from playwright.sync_api import Page, expect

from tests.support.dashboard.steps import by_id

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]


def described(page: Page, name: str) -> None:
    """Begin to describe a mission of this name."""
    page.goto("/")
    by_id(page, "new-mission").click()
    by_id(page, "field-name").fill(name)


def posts(page: Page) -> list[str]:
    """What missions the page sends from now on."""
    sent: list[str] = []
    page.on(
        "request",
        lambda request: (
            sent.append(request.post_data or "")
            if request.method == "POST" and request.url.endswith("/api/v1/missions")
            else None
        ),
    )
    return sent


@pytest.mark.parametrize("width", [1400, 390])
@pytest.mark.parametrize(
    ("field", "text"), [("steps", "0"), ("accuracy_m", "0"), ("floor_depth_m", "-1"), ("east_m", "0")]
)
def test_the_first_fault_is_brought_into_sight_at_the_first_try(page: Page, field: str, text: str, width: int) -> None:
    page.set_viewport_size({"width": width, "height": 800})
    page.goto("/")
    if width < 400:
        by_id(page, "toggle-missions").click()
    by_id(page, "new-mission").click()
    by_id(page, "field-name").fill("Sought")
    by_id(page, f"field-{field}").fill(text)
    by_id(page, "create-mission").click()
    expect(by_id(page, f"fault-{field}")).to_be_in_viewport()
    expect(by_id(page, f"field-{field}")).to_be_focused()


def test_a_typed_area_that_is_too_large_is_told_of_beside_it(page: Page) -> None:
    sent = posts(page)
    described(page, "Vast")
    by_id(page, "field-east_m").fill("50000")
    by_id(page, "field-north_m").fill("50000")
    by_id(page, "create-mission").click()
    expect(by_id(page, "fault-ring")).to_contain_text("million cells")
    expect(by_id(page, "fault-ring")).to_be_in_viewport()
    assert sent == []


def test_what_the_service_refuses_is_brought_into_sight_until_it_is_corrected(page: Page) -> None:
    described(page, "Far from home")
    by_id(page, "field-recovery").fill("42.5 -8.7050")
    by_id(page, "create-mission").click()
    expect(by_id(page, "fault-recovery")).to_be_in_viewport()
    expect(by_id(page, "field-recovery")).to_be_focused()
    refusal = by_id(page, "mission-form").locator(".refusal")
    expect(refusal).to_contain_text("What is marked ▲ cannot be taken")
    by_id(page, "field-recovery").fill("")
    expect(refusal).to_be_empty()
    expect(by_id(page, "fault-recovery")).to_have_count(0)


def test_a_refusal_of_what_the_form_does_not_have_stands_by_the_button(page: Page) -> None:
    described(page, "Unknown")
    problem = {"field": "sounding_noise", "message": "0.9 is too much", "expected": "at most 0.5"}
    answer = {"title": "no", "status": 422, "detail": "1 value cannot be taken", "errors": [problem]}
    page.route(
        "**/api/v1/missions",
        lambda route: route.fulfill(status=422, json=answer) if route.request.method == "POST" else route.fallback(),
    )
    by_id(page, "create-mission").click()
    told = by_id(page, "unplaced-other.sounding_noise")
    expect(told).to_contain_text("sounding_noise: 0.9 is too much; expected at most 0.5")
    expect(told).to_be_in_viewport()


def test_a_vehicles_own_wrong_number_and_a_name_that_is_none_are_marked(page: Page) -> None:
    described(page, "Marked")
    singles = page.get_by_text("Single vehicles: speed, endurance")
    singles.click()
    by_id(page, "speed_mps-sim-2").fill("9")
    singles.click()
    by_id(page, "create-mission").click()
    expect(by_id(page, "speed_mps-sim-2")).to_have_attribute("aria-invalid", "true")
    expect(by_id(page, "speed_mps-sim-2")).to_be_focused()
    expect(by_id(page, "speed_mps-sim-1")).to_have_attribute("aria-invalid", "false")
    by_id(page, "speed_mps-sim-2").fill("")
    by_id(page, "sim-name-1").fill("port side")
    by_id(page, "sim-name-1").press("Tab")
    by_id(page, "create-mission").click()
    expect(by_id(page, "fault-names")).to_contain_text("port side is no vehicle's name")


def test_what_was_typed_before_another_choice_hid_it_stops_no_mission(page: Page) -> None:
    described(page, "Even lines")
    by_id(page, "field-sensor").select_option("multibeam")
    by_id(page, "planner-swath").click()
    by_id(page, "field-overlap_pct").fill("200")
    by_id(page, "create-mission").click()
    expect(by_id(page, "fault-overlap_pct")).to_be_visible()
    by_id(page, "planner-lawnmower").click()
    by_id(page, "create-mission").click()
    expect(by_id(page, "mission-name")).to_have_text("Even lines")
    # A length by lines that a vehicle cannot fly has its fault where the lines' distance is typed.
    by_id(page, "new-mission").click()
    by_id(page, "field-name").fill("Close lines")
    for side in ("east", "north"):
        by_id(page, f"field-{side}_m").fill("3000")
    by_id(page, "field-length").select_option("spacing_m")
    by_id(page, "field-spacing_m").fill("2")
    page.get_by_text("Expert settings").click()
    by_id(page, "field-cell_m").fill("5")
    by_id(page, "create-mission").click()
    expect(by_id(page, "fault-spacing_m")).to_be_in_viewport()
    expect(by_id(page, "field-spacing_m")).to_be_focused()
