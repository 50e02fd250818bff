"""What the map shows as known, where on earth it is, and its room, in Chromium against the real service."""

import re

import pytest
from playwright.sync_api import Page, expect

from tests.support.dashboard.browser import Watched
from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, picture, show, violations

pytestmark = [pytest.mark.browser, pytest.mark.timeout(400)]


@pytest.fixture(scope="module")
def corner(service: Service) -> str:
    """A mission that was sounded in its south-western corner alone."""
    area = [[-8.705, 41.185], [-8.7026, 41.185], [-8.703, 41.1868], [-8.705, 41.1868], [-8.705, 41.185]]
    mission = service.create(
        name="Corner",
        area={"type": "Polygon", "coordinates": [area]},
        vehicles=[{"name": "rover", "kind": "rest"}],
        cell_m=2,
    )
    items = [
        {"vehicle": "rover", "time_s": 1.79e9 + 60 * i, "depth_m": 2.0, "range_m": 8.0 + (i % 8) + 3.0 * (i // 8 % 2)}
        | {"lat_deg": 41.18505 + 5e-5 * (i // 8), "lon_deg": -8.70495 + 6e-5 * (i % 8)}
        for i in range(64)
    ]
    service.post(f"/missions/{mission}/measurements", {"items": items})
    service.get(f"/missions/{mission}/map")
    return mission


def expect_drawn(page: Page, x: float, y: float, drawn: bool) -> None:
    """Wait until the map's still sheet has, or has not, a strong colour at a place of the window."""
    page.wait_for_function(
        """([x, y, drawn]) => {
            const sheet = document.querySelector(".sheet.still");
            const box = sheet.getBoundingClientRect();
            const ratio = sheet.width / box.width;
            const pixel = sheet.getContext("2d").getImageData((x - box.left) * ratio, (y - box.top) * ratio, 1, 1);
            return drawn ? pixel.data[3] > 150 : pixel.data[3] === 0;
        }""",
        arg=[x, y, drawn],
    )


def go_to(page: Page, position: str) -> tuple[float, float]:
    """Go to a position and return where it is in the window, a little beside its mark."""
    by_id(page, "go-to-position").fill(position)
    by_id(page, "go").click()
    pane, cards, strip = (page.locator(one).bounding_box() for one in (".missions", ".cards-column", ".bottom"))
    legend = page.locator(".legend").bounding_box()
    assert pane is not None
    assert cards is not None
    assert strip is not None
    assert legend is not None
    return (pane["width"] + cards["x"]) / 2 + 3, (legend["y"] + legend["height"] + strip["y"]) / 2 + 3


def test_the_map_tells_what_is_known_and_where_it_is(watched: Watched, service: Service, corner: str) -> None:
    page = watched.page
    show(page, corner)
    expect(by_id(page, "range-low")).to_be_visible()
    # Folded it is one line.
    legend = page.locator(".legend").bounding_box()
    assert legend is not None
    assert legend["height"] < 50
    by_id(page, "toggle-legend").click()
    expect(by_id(page, "certainty")).to_contain_text(re.compile(r"fades from ±[\d.]+ m, nothing from ±[\d.]+ m"))
    by_id(page, "light").select_option("none")
    by_id(page, "sharp-cells").check()
    by_id(page, "hatching").uncheck()
    page.reload()
    expect(by_id(page, "light")).to_have_value("none")
    expect(by_id(page, "sharp-cells")).to_be_checked()
    by_id(page, "toggle-legend").click()

    by_id(page, "go-to").click()
    by_id(page, "go-to-position").fill("the quay")
    by_id(page, "go").click()
    expect(by_id(page, "go-to-fault")).to_contain_text("A position is typed such as")
    x, y = go_to(page, "41.1852, -8.7048")
    page.mouse.move(x, y)
    expect(by_id(page, "readout")).to_contain_text(re.compile(r"\d m ± 0\.\d+ m · (\d+ sounding|guessed)"))
    expect_drawn(page, x, y, drawn=True)
    # Nobody was there: nothing is drawn, however smooth a plane would be.
    x, y = go_to(page, "41°11.190′ N 8°42.198′ W")
    page.mouse.move(x, y)
    expect(by_id(page, "readout")).to_contain_text("not known: a guess would be ±")
    expect_drawn(page, x, y, drawn=False)

    page.context.grant_permissions(["geolocation"])
    page.context.set_geolocation({"latitude": 60.1, "longitude": 25.2, "accuracy": 12})
    by_id(page, "own-position").click()
    expect(page.locator(".grid-labels")).to_contain_text("60.1")
    assert not [one for one in watched.addresses if "land-50m" in one]
    page.mouse.move(x, y)
    for _ in range(12):
        page.mouse.wheel(0, 700)
        page.wait_for_timeout(40)
    page.wait_for_function(
        "performance.getEntriesByType('resource').some(({ name }) => name.includes('land-50m'))",
    )
    assert [one for one in watched.addresses if not one.startswith((service.url, "data:", "blob:"))] == []
    # Reading the canvas back is the test's own.
    assert [words for words in watched.complaints if "getImageData" not in words] == []


def expect_name(page: Page, drawn: bool) -> None:
    """Wait until the map's lively sheet shows something, or nothing."""
    page.wait_for_function(
        """(drawn) => {
            const sheet = document.querySelector(".sheet.lively");
            const { data } = sheet.getContext("2d").getImageData(0, 0, sheet.width, sheet.height);
            return data.some((value, i) => i % 4 === 3 && value > 0) === drawn;
        }""",
        arg=drawn,
    )


def test_harbours_are_found_by_name_and_named_on_a_map_that_shows_their_coast(
    watched: Watched, service: Service
) -> None:
    page = watched.page
    page.goto("/")
    expect(by_id(page, "map")).to_have_attribute("data-ready", "true")
    assert not [one for one in watched.addresses if "harbours" in one]
    page.keyboard.press("g")
    field = by_id(page, "go-to-position")
    field.fill("lis")
    expect(by_id(page, "harbour-0")).to_have_text("LisboaPortugal")
    expect(page.get_by_role("option", selected=True)).to_have_count(1)
    field.press("ArrowDown")
    expect(page.get_by_role("option", selected=True)).to_have_id("harbour-1")
    expect(field).to_have_attribute("aria-activedescendant", "harbour-1")
    expect(page.locator(".go-to [role=status]")).to_have_text(re.compile(r"\d harbours: ↓ and ↑ choose"))
    assert violations(page) == []
    picture(page, "harbours-found")
    field.press("Escape")
    expect(by_id(page, "harbour-0")).to_have_count(0)
    expect(field).to_have_value("lis")
    # Typed with its accents, too; the field takes a position as before.
    field.fill("Leixões")
    field.press("Enter")
    expect(field).to_have_value("Porto De Leixoes")
    expect(page.locator(".grid-labels")).to_contain_text("41.2")
    picture(page, "harbours-leixoes")
    page.get_by_role("button", name="Unmark").click()
    expect_name(page, drawn=True)
    for theme in ("dark", "contrast", "night"):
        by_id(page, "open-settings").click()
        by_id(page, "theme").select_option(theme)
        by_id(page, "settings-close").click()
        picture(page, f"harbours-{theme}")
    field.fill("41.1852, -8.7048")
    expect(by_id(page, "harbour-0")).to_have_count(0)
    field.press("Enter")
    page.get_by_role("button", name="Unmark").click()
    expect_name(page, drawn=False)
    field.fill("no such harbour")
    field.press("Enter")
    expect(by_id(page, "go-to-fault")).to_contain_text("No harbour is called")
    assert [one for one in watched.addresses if not one.startswith((service.url, "data:", "blob:"))] == []
    assert [words for words in watched.complaints if "getImageData" not in words] == []


def test_panels_keep_the_size_that_they_were_given_and_the_map_keeps_clear_of_them(
    page: Page, service: Service, corner: str
) -> None:
    show(page, corner)
    expect(by_id(page, "range-low")).to_be_visible()
    before = page.locator(".missions").bounding_box()
    assert before is not None
    for _ in range(3):
        by_id(page, "grip-missions").press("ArrowRight")
    by_id(page, "fold-cards").click()
    by_id(page, "toggle-log").click()
    by_id(page, "grip-pane").press("ArrowUp")
    expect(by_id(page, "abort-rover")).to_be_visible()
    page.reload()
    expect(by_id(page, "fold-cards")).to_have_attribute("aria-pressed", "true")
    after = page.locator(".missions").bounding_box()
    assert after is not None
    assert after["width"] == pytest.approx(before["width"] + 72, abs=2)
    # The label of a vehicle is neither under a card nor under the legend.
    label = page.locator(".mark-label").bounding_box()
    assert label is not None
    assert after["width"] <= label["x"]
    for cover in (".legend", ".map-tools", ".cards .card"):
        box = page.locator(cover).first.bounding_box()
        assert box is not None
        apart = (
            label["x"] >= box["x"] + box["width"]
            or label["x"] + label["width"] <= box["x"]
            or label["y"] >= box["y"] + box["height"]
            or label["y"] + label["height"] <= box["y"]
        )
        assert apart, cover


COUNTED = """
    () => {
      window.drawn = 0;
      const clear = CanvasRenderingContext2D.prototype.clearRect;
      CanvasRenderingContext2D.prototype.clearRect = function (...where) {
        window.drawn += 1;
        return clear.apply(this, where);
      };
    }
"""
"""Counts how often a sheet of the map is drawn."""


def test_the_map_is_not_drawn_again_while_nothing_moves(page: Page, service: Service) -> None:
    messages: list[object] = []
    page.on("websocket", lambda socket: socket.on("framereceived", lambda frame: messages.append(frame)))
    show(page, service.create(name="At rest"))

    def until_more(count: int) -> None:
        wanted = len(messages) + count
        while len(messages) < wanted:
            page.wait_for_timeout(50)

    until_more(15)
    page.evaluate(COUNTED)
    until_more(15)
    assert page.evaluate("window.drawn") <= 2
