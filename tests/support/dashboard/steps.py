"""What tests of the page do again and again."""

import io
import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Locator, Page, expect

from tests.support.paths import PROJECT

AXE = PROJECT / "app" / "dashboard" / "web" / "node_modules" / "axe-core" / "axe.min.js"


def by_id(page: Page, name: str) -> Locator:
    return page.get_by_test_id(name)


def show(page: Page, mission: str) -> None:
    """Open a mission's address and wait until it is shown."""
    page.goto(f"/#/missions/{mission}")
    expect(by_id(page, "map")).to_have_attribute("data-ready", "true")
    expect(by_id(page, "link")).to_have_attribute("data-status", "open")
    expect(by_id(page, "mission-state")).to_be_visible()


def expect_state(page: Page, state: str) -> None:
    expect(by_id(page, "mission-state")).to_have_attribute("data-state", state)


def start(page: Page) -> None:
    """Start the shown mission through its checklist."""
    by_id(page, "start").click()
    expect(by_id(page, "preflight")).to_have_attribute("data-ready", "true")
    by_id(page, "confirm-start").click()
    expect_state(page, "running")


def colours_in_the_middle(page: Page) -> int:
    """How many colours the map's canvas shows around the middle of the window."""
    picture = page.screenshot(clip={"x": 560, "y": 350, "width": 200, "height": 200})
    pixels = np.asarray(Image.open(io.BytesIO(picture)).convert("RGB"))
    return len(np.unique(pixels.reshape(-1, 3), axis=0))


def expect_colours(page: Page) -> None:
    """Wait until the map shows depths around the middle of the window; it is drawn some pictures after its data."""
    assert any(colours_in_the_middle(page) > 20 for _ in range(100)), "the map stays of one colour"


def click_round(page: Page, corners: list[tuple[int, int]]) -> None:
    """Click corner after corner of an area on the map, the first one again at the end."""
    for x, y in [*corners, corners[0]]:
        page.mouse.move(x, y)
        page.mouse.click(x, y)


def drag(page: Page, start: tuple[int, int], end: tuple[int, int]) -> None:
    """Drag what lies at one place of the window to another."""
    page.mouse.move(*start)
    page.mouse.down()
    for share in (0.3, 0.7, 1.0):
        page.mouse.move(start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1]))
        # A browser joins moves that come between two pictures, and what begins too far from a handle drags nothing.
        page.evaluate("() => new Promise(requestAnimationFrame)")
    page.mouse.up()


def picture(page: Page, name: str) -> None:
    """Keep a picture to look at where ``DASHBOARD_LOOK`` names a folder."""
    if folder := os.environ.get("DASHBOARD_LOOK"):
        page.screenshot(path=Path(folder) / f"{name}.png")


def need_axe() -> None:
    """Skip where pages cannot be judged: tests that share a page do so before they leave anything open on it."""
    if not AXE.is_file():
        pytest.skip("axe-core is missing: npm ci in app/dashboard/web")


def violations(page: Page) -> list[str]:
    """What axe finds wrong with the page as it is."""
    need_axe()
    page.evaluate(AXE.read_text())
    found = page.evaluate("axe.run(document, {resultTypes: ['violations']})")
    return [f"{one['id']}: {[node['target'] for node in one['nodes']]}" for one in found["violations"]]
