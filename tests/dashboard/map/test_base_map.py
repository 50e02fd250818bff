"""Charts under the map from a PMTiles file on the service's machine, in Chromium."""

import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Browser, FloatRect, Page

from tests.support.dashboard.pmtiles import plain_tile, tile_at, write_pmtiles
from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import show

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]

CHART = (214, 160, 40)
"""No colour of the page's own."""


@pytest.fixture
def charted(built: None, tmp_path: Path) -> Iterator[Service]:
    x_y = [tile_at(zoom, -8.7046, 41.1852) for zoom in (12, 13, 14)]
    file = tmp_path / "harbour.pmtiles"
    file.write_bytes(write_pmtiles(dict.fromkeys(x_y, plain_tile(CHART)), (-8.75, 41.15, -8.65, 41.22)))
    running = Service(tmp_path, charts=str(file))
    running.start()
    yield running
    running.kill()


def share_of_chart(page: Page) -> float:
    """How much of the window's middle has about the chart's colour."""
    box = FloatRect(x=420, y=150, width=600, height=500)
    pixels = np.asarray(Image.open(io.BytesIO(page.screenshot(clip=box))).convert("RGB"), dtype=np.int64)
    return float((np.abs(pixels - CHART).max(axis=2) < 30).mean())


def test_a_chart_from_a_file_lies_under_everything(browser: Browser, charted: Service) -> None:
    mission = charted.create()
    context = browser.new_context(viewport={"width": 1440, "height": 900}, base_url=charted.url)
    page = context.new_page()
    complaints: list[str] = []
    asked: list[tuple[str, int]] = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("response", lambda answer: asked.append((answer.url, answer.status)))
    show(page, mission)
    for _ in range(100):
        if share_of_chart(page) > 0.5:
            break
        page.wait_for_timeout(100)
    assert share_of_chart(page) > 0.5, [a for a in asked if "charts" in a[0]]
    assert complaints == []
    parts = [status for url, status in asked if url.endswith("/charts.pmtiles")]
    assert set(parts) == {206}  # in parts, from the service alone
    assert {url.split("/")[2] for url, _ in asked if url.startswith("http")} == {charted.url.split("/")[2]}
    page.emulate_media(color_scheme="dark")
    page.wait_for_timeout(300)
    assert share_of_chart(page) > 0.5  # a change of theme keeps it
    context.close()
