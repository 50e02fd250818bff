"""How well a survey agrees with itself, in Chromium."""

import re

import pytest
from playwright.sync_api import expect

from tests.support.dashboard.browser import Watched
from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, colours_in_the_middle, picture, show
from tests.support.mapping.tracks import DEPTH_M, flown, lawnmower, measured, pinged
from tests.support.missions.specs import rectangle

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]

START_S = 1_795_225_140.0


@pytest.fixture
def surveyed(service: Service) -> str:
    """Lines of a swath sonar, one across them with a wrong roll, and another vehicle that measures 0.6 m too deep."""
    kinds = [{"name": "rover", "kind": "rest", "sensor": "multibeam"}, {"name": "scout", "kind": "rest"}]
    mission = service.create(name="Crossed", area=rectangle(0, 0, 60, 60), cell_m=2, vehicles=kinds)
    main = [(east + 4, north + 2) for east, north in lawnmower(52, 56, 6.5)]
    across = flown([(-2, 30.3), (62, 30.7)], spacing_m=0.5, start_s=START_S + 50_000.0)
    deep = flown([(-2, 12.3), (62, 14.7)], spacing_m=1.0, start_s=START_S)
    for items in (
        pinged("rover", flown(main, spacing_m=0.5, start_s=START_S)),
        pinged("rover", across, wrong_roll_deg=1.0),
        measured("scout", deep, DEPTH_M + 0.6),
    ):
        service.post(f"/missions/{mission}/measurements", {"items": items})
    return mission


def test_crossings_are_summed_up_drawn_and_gone_to(watched: Watched, surveyed: str) -> None:
    page = watched.page
    show(page, surveyed)
    expect(by_id(page, "crossings")).to_have_text("18")
    expect(by_id(page, "crossings-within")).to_have_text("50.0 %")
    card = by_id(page, "crosslines-card")
    expect(card).to_contain_text("rover – scout")
    expect(by_id(page, "crosslines-length")).to_have_text(re.compile(r"2 crosslines, 12\d m: \d+\.\d % of the way"))
    expect(by_id(page, "at-crosslines")).to_contain_text("18 crossings, mean -0.30 m")
    expect(by_id(page, "crossings-histogram")).to_be_attached()
    expect(by_id(page, "crossings-by-angle").locator("circle")).to_have_count(11)
    card.get_by_text("By line, worst first").click()
    expect(card).to_contain_text("scout 1 (crossline)")
    card.scroll_into_view_if_needed()
    picture(page, "crosslines")
    expect(by_id(page, "crossing-1")).to_have_text(re.compile(r"^rover \d+ × scout 1 -0\.60 m$"))
    by_id(page, "crossing-1").click()
    assert any(colours_in_the_middle(page) > 2 for _ in range(50)), "its sign is in the middle"
    picture(page, "crossing-shown")
    by_id(page, "show-crossings").click()
    expect(by_id(page, "show-crossings")).to_have_attribute("aria-pressed", "false")
    by_id(page, "show-crossings").click()
    by_id(page, "toggle-files").click()
    with page.expect_download() as download:
        by_id(page, "file-crossovers.csv").click()
    assert len(download.value.path().read_text().splitlines()) == 20
    page.set_viewport_size({"width": 390, "height": 844})
    by_id(page, "toggle-missions").click()
    by_id(page, "toggle-files").click()
    card.scroll_into_view_if_needed()
    picture(page, "crosslines-phone")
    assert watched.complaints == []


def test_what_is_always_wrong_is_taken_out_by_a_click_and_put_back_by_another(
    watched: Watched, surveyed: str, service: Service
) -> None:
    for number, north in enumerate((22.3, 44.3)):
        way = flown([(-2, north), (62, north + 0.4)], spacing_m=1.0, start_s=START_S + 1000.0 * (1 + number))
        service.post(f"/missions/{surveyed}/measurements", {"items": measured("scout", way, DEPTH_M + 0.6)})
    page = watched.page
    show(page, surveyed)
    expect(by_id(page, "crossings")).to_have_text("36")
    by_id(page, "look-for-errors").click()
    errors = by_id(page, "systematic-errors")
    expect(errors).to_contain_text(re.compile(r"scout: depths too large by \+0\.\d+ m"))
    expect(errors).to_contain_text("Not known: water level")
    by_id(page, "look-for-errors").scroll_into_view_if_needed()
    picture(page, "systematic-errors")
    before = by_id(page, "crossings-within").inner_text()
    by_id(page, "take-out-errors").click()
    expect(by_id(page, "undo-errors")).to_be_visible()
    expect(by_id(page, "crossings-within")).to_have_text("100.0 %")
    by_id(page, "undo-errors").click()
    expect(by_id(page, "undo-errors")).to_have_count(0)
    expect(by_id(page, "crossings-within")).to_have_text(before)
