from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from .service import Service

pytestmark = [pytest.mark.browser, pytest.mark.timeout(400)]


@pytest.fixture(scope="module")
def service(built: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """A service of its own: once it has a token it asks everyone for one."""
    running = Service(tmp_path_factory.mktemp("guarded"))
    running.start()
    yield running
    running.kill()


@pytest.fixture(autouse=True)
def nothing_goes_on() -> None:
    """No vehicle is engaged here, and the service would ask for a token."""


def test_a_service_with_tokens_asks_for_one_and_takes_it(page: Page, service: Service) -> None:
    mission = service.create(name="Guarded")
    token = service.make_token("quay", "operator")
    page.goto(f"/#/missions/{mission}")
    page.get_by_test_id("token").fill("not-a-token")
    page.get_by_role("button", name="Sign in").click()
    expect(page.get_by_text("unknown, revoked or has run out")).to_be_visible()
    page.get_by_test_id("token").fill(token)
    page.get_by_role("button", name="Sign in").click()
    expect(page.get_by_test_id("mission-name")).to_have_text("Guarded")
    expect(page.get_by_test_id("link")).to_have_attribute("data-status", "open")
    expect(page.get_by_test_id("start")).to_be_visible()
