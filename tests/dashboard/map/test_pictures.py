"""The main views beside pictures of them that were looked at. ``DASHBOARD_NEW_PICTURES=1`` renews those."""

import io
import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Page, expect

from tests.support.dashboard.browser import FONT
from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, show

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]

PICTURES = Path(__file__).with_name("pictures")
WIDTH = 360
MEAN_OF_255 = 5.0
STRONG, MOST_STRONG = 60, 0.03
"""Of all pixels of the small picture so many may differ by more than that: clocks, fonts, edges."""


@pytest.fixture(scope="module")
def surveyed(service: Service) -> str:
    """A mission whose soundings are always the same: lines over a slope with a hill."""
    mission = service.create(name="Basin", vehicles=[{"name": "rover", "kind": "rest"}], cell_m=2)
    items = []
    for i in range(160):
        line, along = divmod(i, 16)
        east, north = (along if line % 2 == 0 else 15 - along) / 15, line / 9
        hill = 3 * np.exp(-((east - 0.6) ** 2 + (north - 0.5) ** 2) / 0.03)
        items.append(
            {"vehicle": "rover", "time_s": 1.79e9 + 60 * i, "lat_deg": 41.18502 + 46e-5 * north, "depth_m": 2.0}
            | {"lon_deg": -8.70498 + 66e-5 * east, "range_m": float(6 + 4 * east + 2 * north - hill)}
        )
    service.post(f"/missions/{mission}/measurements", {"items": items})
    service.get(f"/missions/{mission}/map")
    return mission


def compare(page: Page, service: Service, mission: str, name: str) -> None:
    # It was heard just now, however long it took to get here.
    place = {"vehicle": "rover", "time_s": 1.7901e9, "lat_deg": 41.1853, "lon_deg": -8.7046, "depth_m": 2.0}
    service.post(f"/missions/{mission}/measurements", {"items": [place]})
    expect(by_id(page, "card-rover")).to_have_attribute("data-link", "ready")
    taken = Image.open(io.BytesIO(page.screenshot(animations="disabled"))).convert("RGB")
    small = taken.resize((WIDTH, round(taken.height * WIDTH / taken.width)), Image.Resampling.BOX)
    path = PICTURES / f"{name}.png"
    if os.environ.get("DASHBOARD_NEW_PICTURES"):
        PICTURES.mkdir(exist_ok=True)
        small.quantize(64).save(path, optimize=True)
        return
    known = np.asarray(Image.open(path).convert("RGB"), dtype=float)
    difference = np.abs(np.asarray(small, dtype=float) - known).mean(axis=2)
    assert difference.mean() < MEAN_OF_255, name
    assert (difference > STRONG).mean() < MOST_STRONG, name


def test_the_main_views_look_as_they_did(page: Page, service: Service, surveyed: str, one_font: Path | None) -> None:
    if one_font is None:
        pytest.skip(f"the pictures were taken with {FONT}, which is not installed here")
    page.emulate_media(color_scheme="light", reduced_motion="reduce")
    show(page, surveyed)
    expect(by_id(page, "range-low")).to_be_visible()
    by_id(page, "range-fix").click()
    page.wait_for_timeout(1500)
    compare(page, service, surveyed, "wide-light")
    by_id(page, "layer").select_option("flags")
    expect(by_id(page, "landmarks")).to_be_visible()
    page.emulate_media(color_scheme="dark", reduced_motion="reduce")
    page.wait_for_timeout(1500)
    compare(page, service, surveyed, "wide-dark-landmarks")
    by_id(page, "start").click()
    expect(by_id(page, "preflight")).to_have_attribute("data-ready", "true")
    compare(page, service, surveyed, "checklist-dark")
    by_id(page, "preflight-close").click()
    page.emulate_media(color_scheme="light", reduced_motion="reduce")
    by_id(page, "layer").select_option("depth")
    by_id(page, "toggle-missions").click()
    page.set_viewport_size({"width": 420, "height": 900})
    page.wait_for_timeout(1500)
    compare(page, service, surveyed, "narrow-light")
