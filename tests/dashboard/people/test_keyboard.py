"""The page without a mouse, and heard instead of seen: where the keyboard is after a command, what is told once."""

import re
from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, Request, Route, expect

from tests.support.dashboard.browser import PATIENCE_MS
from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, expect_state, picture, show

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]

NO_WEBGL = """() => {
    const context = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
        return kind.startsWith("webgl") ? null : context.call(this, kind, ...rest);
    };
}"""


@pytest.fixture
def portuguese(browser: Browser, service: Service) -> Iterator[Page]:
    context = browser.new_context(base_url=service.url, locale="pt-PT")
    page = context.new_page()
    page.set_default_timeout(PATIENCE_MS)
    yield page
    context.close()


@pytest.mark.parametrize("width", [1280, 390], ids=["wide", "phone"])
def test_that_the_map_cannot_be_drawn_is_told_where_nothing_covers_it(page: Page, service: Service, width: int) -> None:
    page.set_viewport_size({"width": width, "height": 844})
    page.add_init_script(f"({NO_WEBGL})()")
    page.goto(f"/#/missions/{service.create(name='No map')}")
    expect(by_id(page, "map-fault")).to_contain_text("The map cannot be drawn")
    picture(page, "map-fault")
    page.wait_for_function(
        """() => {
            const fault = document.querySelector("[data-testid=map-fault]");
            const { left, right, top, bottom } = fault.getBoundingClientRect();
            return [[left + 4, top + 4], [right - 4, top + 4], [left + 4, bottom - 4], [right - 4, bottom - 4]]
                .every(([x, y]) => fault.contains(document.elementFromPoint(x, y)));
        }"""
    )


def test_a_second_enter_discards_nothing_that_was_typed(page: Page) -> None:
    page.goto("/")
    by_id(page, "new-mission").click()
    by_id(page, "field-name").fill("Long thought about")
    by_id(page, "cancel-mission").focus()
    page.keyboard.press("Enter")
    expect(by_id(page, "discard-mission")).to_be_visible()
    expect(by_id(page, "keep-describing")).to_be_focused()
    page.keyboard.press("Enter")
    expect(by_id(page, "cancel-mission")).to_be_focused()
    expect(by_id(page, "field-name")).to_have_value("Long thought about")


def test_a_second_enter_deletes_no_mission(page: Page, service: Service) -> None:
    mission = service.create(name="Kept")
    show(page, mission)
    by_id(page, "delete-mission").focus()
    page.keyboard.press("Enter")
    expect(by_id(page, "confirm-delete")).to_be_visible()
    page.keyboard.press("Enter")
    expect(by_id(page, "delete-mission")).to_be_focused()
    assert mission in [one["id"] for one in service.get("/missions")]


def test_the_keyboard_stays_where_a_mission_was_paused(page: Page, service: Service) -> None:
    mission = service.create(name="By keyboard")
    service.act(mission, "start")
    show(page, mission)
    held: list[Route] = []
    page.route("**/pause", lambda route: held.append(route))
    by_id(page, "pause").focus()
    with page.expect_request("**/pause"):
        page.keyboard.press("Enter")
    # While it is on its way its button keeps the keyboard and sends nothing more.
    expect(by_id(page, "pause")).to_be_disabled()
    expect(by_id(page, "pause")).to_be_focused()
    page.keyboard.press("Enter")
    held[0].continue_()
    expect_state(page, "paused")
    expect(by_id(page, "commands")).to_be_focused()
    assert len(held) == 1
    # The new state is told before the answer to the command.
    expect(by_id(page, "resume")).to_be_enabled()
    asked: list[Request] = []
    page.on("request", lambda request: asked.append(request))
    # Pressed once more it does not undo what it did.
    page.keyboard.press("Enter")
    page.keyboard.press("Tab")
    expect(by_id(page, "resume")).to_be_focused()
    assert not [request for request in asked if request.url.endswith("/resume")]
    page.keyboard.press("Enter")
    expect_state(page, "running")
    expect(by_id(page, "commands")).to_be_focused()


def test_the_keyboard_stays_at_the_vehicle_that_was_ordered(page: Page, service: Service) -> None:
    mission = service.create(name="Held by keyboard")
    service.act(mission, "start")
    show(page, mission)
    by_id(page, "hold-sim-1").focus()
    page.keyboard.press("Enter")
    expect(by_id(page, "hold-sim-1")).to_be_hidden()
    expect(by_id(page, "card-sim-1")).to_be_focused()
    expect(by_id(page, "resume-sim-1")).to_be_visible()
    page.keyboard.press("Tab")
    expect(by_id(page, "resume-sim-1")).to_be_focused()
    page.keyboard.press("Enter")
    expect(by_id(page, "hold-sim-1")).to_be_visible()
    expect(by_id(page, "card-sim-1")).to_be_focused()


def test_escape_closes_the_field_for_a_position(page: Page) -> None:
    page.goto("/")
    expect(by_id(page, "map")).to_have_attribute("data-ready", "true")
    by_id(page, "go-to").focus()
    page.keyboard.press("Enter")
    expect(by_id(page, "go-to-position")).to_be_focused()
    page.keyboard.type("leix")
    expect(by_id(page, "harbour-0")).to_be_visible()
    # First what it offers, then the field itself.
    page.keyboard.press("Escape")
    expect(by_id(page, "harbour-0")).to_be_hidden()
    expect(by_id(page, "go-to-position")).to_have_value("leix")
    page.keyboard.press("Escape")
    expect(by_id(page, "go-to-position")).to_be_hidden()
    expect(by_id(page, "go-to")).to_be_focused()


def test_a_link_that_is_gone_is_told_once_and_not_each_second(page: Page, service: Service) -> None:
    mission = service.create(name="Told once")
    service.act(mission, "start")
    show(page, mission)
    expect(by_id(page, "heard-link")).to_have_text("Live")
    service.kill()
    try:
        expect(by_id(page, "link")).to_contain_text("trying again in")
        # What counts is seen, not heard.
        expect(by_id(page, "heard-link")).to_have_text("Service gone")
        told = "element => element.closest('[role=status], [role=alert], [aria-live]') === null"
        assert by_id(page, "link").evaluate(told)
    finally:
        service.start()
    expect(by_id(page, "heard-link")).to_have_text("Live")


def test_an_alarm_is_told_once(page: Page, service: Service) -> None:
    zone = [[-8.7047, 41.1852], [-8.7045, 41.1852], [-8.7045, 41.1853], [-8.7047, 41.1853], [-8.7047, 41.1852]]
    mission = service.create(
        name="Told zone",
        vehicles=[{"name": "rover", "kind": "rest"}],
        keep_out=[{"type": "Polygon", "coordinates": [zone]}],
    )

    def heard(time_s: float, lat_deg: float, lon_deg: float) -> None:
        place = {"lat_deg": lat_deg, "lon_deg": lon_deg, "depth_m": 2.0, "range_m": 5.0}
        item: dict[str, Any] = place | {"vehicle": "rover", "time_s": time_s}
        service.post(f"/missions/{mission}/measurements", {"items": [item]})

    heard(1_795_225_140.0, 41.1851, -8.7049)
    service.act(mission, "start")
    show(page, mission)
    expect(by_id(page, "step")).not_to_have_text("0")
    heard(1_795_225_150.0, 41.18525, -8.7046)
    expect(by_id(page, "alarms")).to_contain_text("rover is in keep-out zone 1")
    expect(by_id(page, "heard-alarms")).to_contain_text(re.compile("rover"))
    picture(page, "attention")
    # How long ago it was goes on counting there.
    expect(by_id(page, "attention")).not_to_have_attribute("role", "alert")


def test_the_checklist_is_told_in_the_pages_language(portuguese: Page, service: Service) -> None:
    page = portuguese
    show(page, service.create(name="Lista"))
    by_id(page, "start").click()
    expect(by_id(page, "preflight")).to_have_attribute("data-ready", "true")
    heard = by_id(page, "preflight").locator(".checklist .tone .visually-hidden")
    assert {"Em ordem:"} <= set(heard.all_text_contents()) <= {"Em ordem:", "Nota:", "Aviso:", "Problema:"}
