"""The current that vehicles estimate, beside the map's scale, in Chromium."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, picture, show

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]


@pytest.fixture(scope="module")
def service(built: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    running = Service(tmp_path_factory.mktemp("current"), simulation__current_mps="[0.3, 0.1]")
    running.start()
    yield running
    running.kill()


@pytest.fixture
def page(browser: Browser, service: Service) -> Iterator[Page]:
    context = browser.new_context(viewport={"width": 1440, "height": 900}, base_url=service.url)
    yield context.new_page()
    context.close()


def test_the_current_is_shown_beside_the_scale_while_vehicles_estimate_it(page: Page, service: Service) -> None:
    mission = service.create(name="In a current")
    show(page, mission)
    # On a phone it would lie over the whole map.
    by_id(page, "toggle-missions").click()
    current = by_id(page, "current")
    expect(current).to_have_count(0)
    service.act(mission, "start")
    expect(current).to_have_text("Current 0.3 m/s → 072°")
    assert service.get(f"/missions/{mission}")["current"] == {"speed_mps": 0.316, "toward_deg": 71.6}
    for width in (1440, 700, 390, 360):
        page.set_viewport_size({"width": width, "height": 900})
        picture(page, f"current-{width}")
        scale, box = page.locator(".maplibregl-ctrl-scale").bounding_box(), current.bounding_box()
        assert scale is not None
        assert box is not None
        assert box["x"] >= scale["x"] + scale["width"] or box["y"] + box["height"] <= scale["y"]
        assert box["x"] + box["width"] <= width
    service.act(mission, "abort")
    expect(current).to_have_count(0)
