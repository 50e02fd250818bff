"""Describing missions in an operator's words, and keeping what was described, in Chromium against the real service."""

import json
import re

import pytest
from playwright.sync_api import Browser, Page, expect

from app.mapping.s44 import Order, strictest_sd_m
from tests.support.dashboard.browser import PATIENCE_MS, Watched
from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, click_round, expect_state, picture, show, start, violations

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]

FORECAST_MS = 240_000


def named(service: Service, name: str) -> list[str]:
    return [one["id"] for one in service.get("/missions") if one["name"] == name]


def test_a_mission_is_described_changed_exported_and_used_again(page: Page, service: Service) -> None:
    page.goto("/")
    expect(by_id(page, "map")).to_have_attribute("data-ready", "true")
    by_id(page, "new-mission").click()
    by_id(page, "field-name").fill("Asked")
    by_id(page, "field-order").select_option("Special Order")
    expect(by_id(page, "field-accuracy_m")).to_have_value(str(strictest_sd_m(Order.SPECIAL)))
    by_id(page, "field-length").select_option("spacing_m")
    by_id(page, "field-spacing_m").fill("10")
    by_id(page, "sim-name-2").fill("south")
    by_id(page, "sim-name-2").press("Tab")
    expect(by_id(page, "share-south")).to_contain_text("500 m")
    expect(by_id(page, "estimate")).to_contain_text("as much as lines 10.0 m apart")
    # The plan follows the area.
    by_id(page, "field-east_m").fill("200")
    expect(by_id(page, "share-south")).to_contain_text("1.00 km")
    page.get_by_text("Single vehicles: speed, endurance").click()
    by_id(page, "endurance_min-south").fill("5")
    expect(by_id(page, "share-south")).to_contain_text(re.compile(r"▲ \d{3} % of its endurance"))
    by_id(page, "endurance_min-south").fill("60")
    page.get_by_text("Expert settings").click()
    expect(by_id(page, "expert")).to_contain_text("Usual: 10 m")
    by_id(page, "create-mission").click()
    expect(by_id(page, "mission-name")).to_have_text("Asked")
    [first] = named(service, "Asked")
    spec = service.get(f"/missions/{first}")["spec"]
    assert spec["accuracy_m"] == strictest_sd_m(Order.SPECIAL)
    assert spec["budget"] == {"km_per_vehicle": 1.0}
    assert [vehicle["name"] for vehicle in spec["vehicles"]] == ["sim-1", "south"]

    by_id(page, "edit-mission").click()
    expect(by_id(page, "field-name")).to_have_value("Asked")
    by_id(page, "field-name").fill("Asked otherwise")
    by_id(page, "create-mission").click()
    expect(by_id(page, "mission-name")).to_have_text("Asked otherwise")
    expect(by_id(page, f"mission-{first}")).to_contain_text("Asked otherwise")
    assert named(service, "Asked") == []
    [second] = named(service, "Asked otherwise")
    assert second == first, "it keeps its id"

    with page.expect_download() as waited:
        by_id(page, "export-mission").click()
    assert waited.value.suggested_filename == "Asked-otherwise.mission.json"
    content = json.loads(waited.value.path().read_text())
    assert content["mission"]["area"] == service.get(f"/missions/{second}")["spec"]["area"]
    by_id(page, "new-mission").click()
    by_id(page, "mission-file").set_input_files(waited.value.path())
    expect(by_id(page, "field-name")).to_have_value("Asked otherwise")
    expect(by_id(page, "vehicle-south")).to_be_visible()
    by_id(page, "field-name").fill("Imported")
    by_id(page, "keep-template").click()
    by_id(page, "create-mission").click()
    expect(by_id(page, "mission-name")).to_have_text("Imported")
    [third] = named(service, "Imported")
    assert service.get(f"/missions/{third}")["spec"]["accuracy_m"] == strictest_sd_m(Order.SPECIAL)

    page.reload()
    by_id(page, "new-mission").click()
    by_id(page, "template").select_option("Imported")
    expect(by_id(page, "field-order")).to_have_value("Special Order")
    expect(by_id(page, "field-name")).to_have_value("")
    expect(by_id(page, "field-latitude")).to_be_visible()
    by_id(page, "template").select_option("Multibeam, full coverage")
    expect(by_id(page, "field-sensor")).to_have_value("multibeam")


def test_the_plan_is_drawn_before_the_start_and_follows_the_area_as_it_is_dragged(page: Page, service: Service) -> None:
    before = len(service.get("/missions"))
    page.goto("/")
    expect(by_id(page, "map")).to_have_attribute("data-ready", "true")
    by_id(page, "new-mission").click()
    by_id(page, "planner-lawnmower").click()
    by_id(page, "field-recovery").fill("41.1850 -8.7050")
    by_id(page, "draw-polygon").click()
    expect(by_id(page, "drawing")).to_have_attribute("data-ready", "true")
    click_round(page, [(520, 300), (900, 320), (880, 640), (540, 600)])
    plan, whole = by_id(page, "planned"), by_id(page, "planned-whole")
    expect(plan).to_have_attribute("data-plan", "new")
    expect(whole).to_contain_text(re.compile(r"Planned: \d.* of tracks in \d+.* to \d+"))
    # Its way home, and its way beside what it may fly at most.
    expect(by_id(page, "share-sim-1")).to_contain_text(re.compile(r"\d+ m of 1\.00 km\d+ m, \d+"))
    expect(by_id(page, "share-sim-1")).to_contain_text("not known")
    expect(by_id(page, "editing")).to_have_attribute("data-ready", "true")

    drawn, told = middle_of(page), whole.inner_text()
    page.mouse.move(880, 640)
    page.mouse.down()
    for k in range(1, 11):
        page.mouse.move(880 + 12 * k, 640 + 8 * k)
    # The button is still down, and the corner is where the pointer is: it was 89 m x 82 m.
    expect(page.get_by_text(re.compile(r"^10\d m x 9\d m, "))).to_be_visible()
    expect(whole).not_to_have_text(told)
    expect(plan).to_have_attribute("data-plan", "new")
    assert middle_of(page) != drawn
    page.mouse.up()

    expect(plan).to_have_attribute("data-plan", "new")
    lines = json.loads(saved(page, "save-plan-geojson", "mission.plan.geojson"))["features"]
    assert [line["properties"]["vehicle"] for line in lines] == ["sim-1", "sim-2"]
    assert all(line["geometry"]["type"] == "LineString" for line in lines)
    assert saved(page, "save-plan-gpx", "mission.plan.gpx").count("<rte>") == 2

    page.get_by_text("Single vehicles: speed, endurance").click()
    by_id(page, "endurance_min-sim-2").fill("6")
    expect(by_id(page, "share-sim-2")).to_contain_text(
        re.compile(r"turns back after \d+ m.*▲ \d{3} % of its endurance")
    )
    by_id(page, "field-recovery").fill("42.5 -8.7050")
    expect(by_id(page, "plan-fault")).to_contain_text("No plan: recovery.point lies")
    assert len(service.get("/missions")) == before


def saved(page: Page, button: str, name: str) -> str:
    """What a button gives as a file of this name."""
    with page.expect_download() as download:
        by_id(page, button).click()
    assert download.value.suggested_filename == name
    return download.value.path().read_text(encoding="utf-8")


def middle_of(page: Page) -> bytes:
    """What the map shows inside the area that is drawn."""
    return page.screenshot(clip={"x": 560, "y": 340, "width": 280, "height": 220})


def test_several_areas_are_blocks_that_are_flown_one_after_the_other(watched: Watched, service: Service) -> None:
    page = watched.page
    page.clock.install()
    page.goto("/")
    expect(by_id(page, "map")).to_have_attribute("data-ready", "true")
    by_id(page, "new-mission").click()
    by_id(page, "field-name").fill("Bay")
    by_id(page, "planner-lawnmower").click()
    by_id(page, "field-steps").fill("3")
    by_id(page, "another-block").click()
    for number, name in enumerate(("West", "East"), start=1):
        by_id(page, f"block-name-{number}").fill(name)
    # Typed, the second lies beside the first; a third one is drawn.
    expect(by_id(page, "block-2")).to_have_attribute("aria-pressed", "true")
    by_id(page, "another-block").click()
    by_id(page, "draw-polygon").click()
    expect(by_id(page, "drawing")).to_have_attribute("data-ready", "true")
    page.mouse.click(620, 560)
    # The map goes to areas that are typed, but not away from under one that is being drawn.
    page.clock.fast_forward(1000)
    for x, y in [(760, 570), (750, 680), (630, 670), (620, 560)]:
        page.mouse.move(x, y)
        page.mouse.click(x, y)
    expect(by_id(page, "drawing")).to_have_count(0)
    expect(by_id(page, "in-block-3")).to_contain_text(re.compile(r"Block 3\d"))
    expect(by_id(page, "in-blocks-all")).to_contain_text(re.compile(r"In all.*\d"))
    by_id(page, "block-earlier-3").click()
    expect(by_id(page, "in-block-2")).to_contain_text("Block 2")
    by_id(page, "block-3").click()
    expect(by_id(page, "block-3")).to_have_attribute("aria-pressed", "true")
    expect(by_id(page, "editing")).to_have_attribute("data-ready", "true")
    # Each block has its own vehicles' figures, the marked one unfolded; all of them are one way and one battery.
    expect(by_id(page, "of-block-3")).to_have_attribute("open", "")
    expect(by_id(page, "block-3-share-sim-1")).to_contain_text(re.compile(r"\d+ m"))
    expect(by_id(page, "block-1-share-sim-1")).to_be_hidden()
    expect(by_id(page, "share-sim-1")).to_contain_text(re.compile(r"\d+ m"))
    page.get_by_text("Single vehicles: speed, endurance").click()
    by_id(page, "endurance_min-sim-2").fill("1")
    expect(by_id(page, "share-sim-2")).to_contain_text(re.compile(r"turns back after .*▲ \d+ % of its endurance"))
    expect(by_id(page, "block-3-share-sim-2")).to_contain_text(re.compile(r"▲ .*left then"))
    picture(page, "blocks-wide")
    assert violations(page) == []
    by_id(page, "endurance_min-sim-2").fill("")
    page.set_viewport_size({"width": 390, "height": 844})
    by_id(page, "blocks").scroll_into_view_if_needed()
    picture(page, "blocks-phone")
    page.set_viewport_size({"width": 1440, "height": 900})
    by_id(page, "block-remove-2").click()
    by_id(page, "create-mission").click()
    expect(by_id(page, "mission-name")).to_have_text("Bay – West")
    [west], [east] = named(service, "Bay – West"), named(service, "Bay – East")
    assert service.get(f"/missions/{east}")["after"] == west
    expect(by_id(page, f"mission-{east}")).to_contain_text("Begins by itself after Bay – West")

    # Whoever watches the first goes on with the vehicles, and could stop them.
    start(page)
    expect(by_id(page, "mission-name")).to_have_text("Bay – East", timeout=120_000)
    expect(by_id(page, "abort")).to_be_visible()
    assert service.get(f"/missions/{west}")["state"] == "finished"
    assert watched.complaints == []


def test_every_block_is_forecast_over_a_bottom_as_deep_as_is_typed(page: Page) -> None:
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto("/")
    by_id(page, "new-mission").click()
    by_id(page, "field-steps").fill("2")
    expect(by_id(page, "field-floor_depth_m")).to_have_attribute("placeholder", "a guess")
    by_id(page, "another-block").click()
    by_id(page, "field-floor_depth_m").fill("-3")
    # What no depth can be is asked of nobody.
    expect(by_id(page, "ask-forecast")).to_have_count(0)
    by_id(page, "field-floor_depth_m").fill("12.5")
    expect(by_id(page, "planned")).to_have_attribute("data-plan", "new")
    by_id(page, "ask-forecast").click()
    expect(by_id(page, "forecast")).to_contain_text("1 of 2")
    expect(by_id(page, "forecast-block-1")).to_contain_text(re.compile(r"\d+ s"), timeout=FORECAST_MS)
    expect(by_id(page, "forecast-in-all")).to_contain_text("not computed yet")
    expect(by_id(page, "forecast-in-all")).to_contain_text(re.compile(r"\d+ s"), timeout=FORECAST_MS)
    forecasts = [url for url in asked if "/forecast" in url]
    assert [url.partition("?")[2] for url in forecasts] == ["floor_depth_m=12.5"] * 2
    picture(page, "blocks-forecast")
    assert violations(page) == []


def test_who_finishes_a_block_early_is_told_that_the_next_does_not_begin(page: Page, service: Service) -> None:
    sims = [{"name": "first", "kind": "sim"}]
    west = service.create(name="Early", vehicles=sims, steps=500)
    east = service.create(name="Late", vehicles=sims, after=west)
    show(page, west)
    start(page)
    by_id(page, "finish").click()
    expect(by_id(page, "does-not-follow")).to_contain_text("Late, which follows, does not begin by itself")
    by_id(page, "confirm-finish").click()
    expect_state(page, "finished")
    assert service.get(f"/missions/{east}")["state"] == "ready"
    expect(by_id(page, f"mission-{east}")).not_to_contain_text("Begins by itself")


def test_a_block_that_cannot_begin_by_itself_is_shown_with_its_alarm(page: Page, service: Service) -> None:
    sims = [{"name": name, "kind": "sim"} for name in ("kept", "lost")]
    west = service.create(name="Flown", vehicles=sims, steps=20)
    east = service.create(name="Waiting", vehicles=sims, after=west)
    show(page, west)
    start(page)
    service.post(f"/missions/{west}/vehicles/lost/abort", {})
    expect(by_id(page, "mission-name")).to_have_text("Waiting", timeout=120_000)
    expect(by_id(page, "alarms")).to_contain_text("does not begin by itself: lost left 'Flown'")
    expect_state(page, "ready")
    expect(by_id(page, "abort")).to_be_enabled()
    assert service.get(f"/missions/{east}")["state"] == "ready"


@pytest.mark.parametrize("size", [(820, 1180), (390, 844)], ids=["tablet", "phone"])
def test_an_area_is_drawn_where_the_form_lies_over_the_whole_map(
    browser: Browser, service: Service, size: tuple[int, int]
) -> None:
    context = browser.new_context(
        viewport={"width": size[0], "height": size[1]}, base_url=service.url, reduced_motion="reduce"
    )
    context.set_default_timeout(PATIENCE_MS)
    page = context.new_page()
    page.goto("/")
    expect(by_id(page, "map")).to_have_attribute("data-ready", "true")
    by_id(page, "toggle-missions").click()
    by_id(page, "new-mission").click()
    by_id(page, "field-name").fill("By hand")
    by_id(page, "draw-polygon").click()
    expect(by_id(page, "map-prompt")).to_contain_text("Tap corner after corner")
    by_id(page, "back-to-form").click()
    expect(by_id(page, "field-name")).to_have_value("By hand")

    by_id(page, "draw-polygon").click()
    expect(by_id(page, "field-name")).to_be_hidden()
    expect(by_id(page, "drawing")).to_have_attribute("data-ready", "true")
    picture(page, f"drawing-{size[0]}")
    click_round(page, [(80, 300), (300, 310), (290, 420), (90, 430)])
    expect(by_id(page, "field-name")).to_have_value("By hand")
    expect(by_id(page, "editing")).to_have_attribute("data-ready", "true")
    # Corners are dragged beside the closed form, which keeps what was typed.
    by_id(page, "toggle-missions").click()
    expect(by_id(page, "field-name")).to_be_hidden()
    by_id(page, "toggle-missions").click()
    expect(by_id(page, "field-name")).to_have_value("By hand")
    context.close()
