"""The checklist asks on the page what no program sees, and the mission starts when all of it is confirmed."""

from collections.abc import Iterator

import httpx
import pytest
from playwright.sync_api import Browser, expect

from tests.support.dashboard.browser import PATIENCE_MS
from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, expect_state, show

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]


@pytest.fixture
def asking(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    running = Service(tmp_path_factory.mktemp("asking"), checklist='["Hatches closed", "Recovery boat ready"]')
    running.start()
    yield running
    running.kill()


def test_a_mission_starts_once_every_question_is_confirmed(browser: Browser, asking: Service) -> None:
    mission = asking.create(name="Quay")
    context = browser.new_context(base_url=asking.url)
    page = context.new_page()
    page.set_default_timeout(PATIENCE_MS)
    show(page, mission)
    by_id(page, "start").click()
    expect(by_id(page, "preflight")).to_have_attribute("data-ready", "true")
    expect(by_id(page, "confirm-start")).to_have_text("2 to confirm first")
    expect(by_id(page, "confirm-start")).to_be_disabled()
    page.get_by_label("Hatches closed").check()
    page.get_by_label("Recovery boat ready").check()
    expect(by_id(page, "confirm-start")).to_be_enabled()
    page.get_by_label("Hatches closed").uncheck()
    expect(by_id(page, "confirm-start")).to_have_text("1 to confirm first")
    by_id(page, "preflight-close").click()
    by_id(page, "start").click()
    expect(page.get_by_label("Recovery boat ready")).not_to_be_checked()
    page.get_by_label("Hatches closed").check()
    page.get_by_label("Recovery boat ready").check()
    by_id(page, "confirm-start").click()
    expect_state(page, "running")
    log = httpx.get(f"{asking.url}/api/v1/missions/{mission}/events", headers={"Accept": "application/json"})
    said = [one["message"] for one in log.json()]
    assert "local operator confirmed before the start: Hatches closed; Recovery boat ready" in said
    context.close()


def test_what_was_confirmed_for_one_mission_is_not_for_the_next(browser: Browser, asking: Service) -> None:
    first, second = asking.create(name="Quay"), asking.create(name="Pier")
    context = browser.new_context(base_url=asking.url)
    page = context.new_page()
    page.set_default_timeout(PATIENCE_MS)
    show(page, second)
    show(page, first)
    by_id(page, "start").click()
    page.get_by_label("Hatches closed").check()
    page.get_by_label("Recovery boat ready").check()
    expect(by_id(page, "confirm-start")).to_be_enabled()
    page.evaluate(f"location.hash = '#/missions/{second}'")
    expect(by_id(page, "preflight")).to_contain_text("Pier")
    expect(page.get_by_label("Hatches closed")).not_to_be_checked()
    expect(by_id(page, "confirm-start")).to_be_disabled()
    context.close()
