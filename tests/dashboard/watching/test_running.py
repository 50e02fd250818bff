"""Missions that run: start, pause, abort, a service that dies, in Chromium with simulated vehicles."""

import re
import time

import pytest
from playwright.sync_api import Page, Route, expect

from tests.support.dashboard.browser import Watched
from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, colours_in_the_middle, expect_colours, expect_state, show, start

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]

PATIENCE_S = 90.0


def test_a_mission_from_the_form_to_its_abort(watched: Watched, service: Service) -> None:
    page = watched.page
    page.goto("/")
    by_id(page, "new-mission").click()
    for field, value in {
        "name": "Quay <b>north</b>",
        "latitude": "41.185",
        "longitude": "-8.705",
        "east_m": "60",
        "north_m": "60",
        "steps": "400",
        "simulated": "2",
    }.items():
        by_id(page, f"field-{field}").fill(value)
    page.get_by_text("Expert settings").click()
    by_id(page, "field-planner").select_option("random")
    by_id(page, "create-mission").click()

    expect(by_id(page, "mission-name")).to_have_text("Quay <b>north</b>")
    expect_state(page, "ready")
    assert colours_in_the_middle(page) < 20
    start(page)

    for name in ("sim-1", "sim-2"):
        expect(by_id(page, f"card-{name}")).to_have_attribute("data-link", "engaged")
        expect(by_id(page, f"vehicle-mark-{name}")).to_be_visible()
        expect(by_id(page, f"depth-{name}")).to_have_text(re.compile(r"\d\.\d m"))
        expect(by_id(page, f"card-{name}")).to_contain_text("Pos. age")
    marker = page.locator(".maplibregl-marker", has=by_id(page, "vehicle-mark-sim-1"))
    place = marker.get_attribute("style")
    assert place is not None
    expect(marker).not_to_have_attribute("style", place)
    expect(by_id(page, "waypoint-sim-1")).to_have_attribute("data-status", re.compile("acknowledged|reached"))

    expect(by_id(page, "range-low")).to_be_visible()
    expect(by_id(page, "step")).not_to_have_text("0")
    # Where a vehicle is now the map is known in a moment. It moves, and so does what is below the pointer.
    known, deadline_s = re.compile(r"\d+\.\d\d m ± \d+\.\d\d m"), time.monotonic() + PATIENCE_S
    readout, at = by_id(page, "readout"), (0.0, 0.0)
    while not known.search(" ".join(readout.all_text_contents())):
        assert time.monotonic() < deadline_s, "no depth is told where a vehicle is"
        box = by_id(page, "vehicle-mark-sim-1").bounding_box()
        assert box is not None
        at = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        page.mouse.move(*at)
        page.wait_for_timeout(250)
    # It goes on telling where the pointer rests, whatever comes and goes below it.
    page.wait_for_function("([x, y]) => !document.elementFromPoint(x, y).closest('.maplibregl-marker')", arg=list(at))
    page.wait_for_timeout(250)
    expect(readout).to_contain_text(known)
    expect_colours(page)

    by_id(page, "pause").click()
    expect_state(page, "paused")
    expect(by_id(page, "card-sim-1")).to_have_attribute("data-link", "ready")
    by_id(page, "resume").click()
    expect_state(page, "running")

    by_id(page, "abort").click()
    by_id(page, "abort-close").click()
    expect_state(page, "running")
    by_id(page, "abort").click()
    by_id(page, "abort-confirm").click()
    for name in ("sim-1", "sim-2"):
        expect(by_id(page, f"receipt-{name}")).to_contain_text("acknowledged the stop")
    expect_state(page, "aborted")
    by_id(page, "abort-close").click()
    expect(by_id(page, "abort")).to_be_disabled()

    by_id(page, "toggle-log").click()
    expect(by_id(page, "log")).to_contain_text("aborted by")
    assert watched.complaints == []


def test_the_checklist_names_what_stands_in_the_way_and_lets_go_once_it_is_gone(page: Page, service: Service) -> None:
    rover = [{"name": "rover", "kind": "rest"}]
    first = service.create(name="First come", vehicles=rover)
    service.act(first, "start")
    show(page, service.create(name="Second", vehicles=rover))
    by_id(page, "start").click()
    expect(by_id(page, "preflight")).to_have_attribute("data-ready", "false")
    link = by_id(page, "check-link.rover")
    expect(link).to_have_attribute("data-status", "problem")
    expect(link).to_contain_text(f"it takes part in mission 'First come' ({first})")
    expect(by_id(page, "check-tide")).to_contain_text("no tide is applied")
    expect(by_id(page, "confirm-start")).to_be_disabled()
    service.act(first, "abort")
    expect(by_id(page, "preflight")).to_have_attribute("data-ready", "true")
    by_id(page, "confirm-start").click()
    expect_state(page, "running")


def test_one_vehicle_is_aborted_the_others_go_on_and_it_is_noted(page: Page, service: Service) -> None:
    vehicles = [{"name": f"sim-{n}", "kind": "sim", "sensor": "dvl"} for n in (1, 2)]
    show(page, service.create(name="One of two", vehicles=vehicles))
    start(page)
    expect(by_id(page, "card-sim-2")).to_have_attribute("data-link", "engaged")
    by_id(page, "abort-sim-1").click()
    by_id(page, "abort-confirm").click()
    expect(by_id(page, "receipt-sim-1")).to_contain_text("acknowledged the stop")
    by_id(page, "abort-close").click()
    expect(by_id(page, "state-sim-1")).to_contain_text("Left the mission")
    expect_state(page, "running")
    by_id(page, "toggle-log").click()
    by_id(page, "note").fill("sim-1 taken out, its battery")
    by_id(page, "note").press("Enter")
    by_id(page, "log-level").select_option("notes")
    expect(by_id(page, "log")).to_contain_text("sim-1 taken out, its battery")
    expect(by_id(page, "log").locator("li")).to_have_count(1)


PLACES = """
    (name) => {
      window.places = [];
      const look = () => {
        const { top } = document.querySelector(`[data-testid="${name}"]`).getBoundingClientRect();
        if (window.places.at(-1) !== top) window.places.push(top);
        requestAnimationFrame(look);
      };
      look();
    }
"""
"""Notes where an element is, picture by picture, each time it has moved."""


HEIGHTS = """() => ["depth", "altitude", "water"].map((what) =>
  parseFloat(document.querySelector(`[data-testid="${what}-sim-1"]`).textContent))"""


def test_a_card_tells_how_deep_the_water_is_beside_the_vehicles_own_depth(page: Page, service: Service) -> None:
    show(page, service.create(name="Over the bottom"))
    start(page)
    expect(by_id(page, "card-sim-1")).to_contain_text("Veh. depth")
    expect(by_id(page, "water-sim-1")).to_have_text(re.compile(r"^\d+\.\d m$"))
    depth_m, altitude_m, water_m = page.evaluate(HEIGHTS)
    assert water_m == pytest.approx(depth_m + altitude_m, abs=0.11)


def test_a_vehicles_buttons_stay_where_they_are_while_it_tells_more(page: Page, service: Service) -> None:
    # A press met what had come to lie there: the words of a card come and go several times a second.
    vehicles = [{"name": f"sim-{n}", "kind": "sim", "sensor": "dvl"} for n in (1, 2)]
    show(page, service.create(name="Still", vehicles=vehicles))
    start(page)
    for name in ("sim-1", "sim-2"):
        expect(by_id(page, f"card-{name}")).to_have_attribute("data-link", "engaged")
        expect(by_id(page, f"card-{name}")).to_contain_text("Surveying")
    page.evaluate(PLACES, "abort-sim-2")
    expect(by_id(page, "step")).to_have_text(re.compile(r"^\d\d"))
    places = page.evaluate("window.places")
    # They give way to more words than there were so far, and never come back.
    assert places == sorted(places), places
    assert len(places) <= 3, places


def test_the_page_survives_a_killed_service(watched: Watched, service: Service) -> None:
    page = watched.page
    mission = service.create(name="Crossing")
    service.act(mission, "start")
    show(page, mission)
    expect(by_id(page, "step")).not_to_have_text("0")
    service.kill()
    try:
        expect(by_id(page, "link")).to_have_text(re.compile("Service gone, data .* old; trying again in"))
        expect(by_id(page, "service-fault")).to_contain_text("does not answer")
        expect(by_id(page, "card-sim-1")).to_have_class(re.compile("stale"))
        expect(by_id(page, "vehicle-mark-sim-1")).to_contain_text("old")
        expect(by_id(page, "mission-name")).to_have_text("Crossing")
    finally:
        service.start()
    expect(by_id(page, "link")).to_have_attribute("data-status", "open")
    expect(by_id(page, "service-fault")).to_be_hidden()
    expect_state(page, "running")
    before = int(by_id(page, "step").inner_text())
    expect(by_id(page, "step")).not_to_have_text(str(before))
    expect(by_id(page, "card-sim-1")).not_to_have_class(re.compile("stale"))


def test_a_fixed_range_and_the_colours_outlive_the_page(page: Page, service: Service) -> None:
    mission = service.create(name="Ranges")
    service.act(mission, "start")
    show(page, mission)
    by_id(page, "range-fix").click()
    by_id(page, "range-high").fill("33")
    by_id(page, "range-high").press("Enter")
    by_id(page, "open-settings").click()
    by_id(page, "theme").select_option("dark")
    by_id(page, "settings-close").click()
    expect(page.locator("html")).to_have_attribute("data-theme", "dark")
    page.reload()
    expect(by_id(page, "range-high")).to_have_value("33")
    expect(page.locator("html")).to_have_attribute("data-theme", "dark")
    by_id(page, "layer").select_option("uncertainty")
    expect(by_id(page, "range-low")).to_have_value("0")
    by_id(page, "layer").select_option("depth")
    by_id(page, "range-fit").click()
    expect(by_id(page, "range-high")).not_to_have_value("33")


def test_progress_is_told_in_the_unit_of_the_missions_length_and_of_each_vehicle(page: Page, service: Service) -> None:
    mission = service.create(name="By way", vehicles=[{"name": "sim-1", "kind": "sim"}], steps=40)

    def in_kilometres(route: Route) -> None:
        answer = route.fetch()
        missions = answer.json()
        for one in missions:
            one["progress"] |= {"budget": {"km_per_vehicle": 2.3}, "km_left_per_vehicle": 1.1}
        route.fulfill(response=answer, json=missions)

    show(page, mission)
    expect(by_id(page, f"mission-{mission}")).to_contain_text("Step 0 of 40")
    expect(by_id(page, "flown-sim-1")).to_be_hidden()
    start(page)
    expect(by_id(page, "flown-sim-1")).to_have_text(re.compile(r"^[A-Z][a-z ]+ · \d+ m flown · \d+ s idle$"))
    page.route("**/api/v1/missions", in_kilometres)
    page.reload()
    expect(by_id(page, f"mission-{mission}")).to_contain_text("1.2 of 2.3 km")


def test_a_running_mission_is_made_longer_and_what_is_refused_is_told_beside_it(page: Page, service: Service) -> None:
    mission = service.create(steps=None, budget={"minutes": 60})
    service.act(mission, "start")
    show(page, mission)
    expect_state(page, "running")
    by_id(page, "change-length").click()
    value, unit = by_id(page, "length-value"), by_id(page, "length-unit")
    expect(value).to_have_value("60")
    expect(unit).to_have_value("minutes")
    dialog = by_id(page, "length-dialog")
    value.fill("long")
    by_id(page, "set-length").click()
    expect(dialog.get_by_role("alert")).to_contain_text("Type a number")
    value.fill("0.01")
    by_id(page, "set-length").click()
    expect(dialog.get_by_role("alert")).to_contain_text("none would begin")
    value.fill("80")
    by_id(page, "set-length").click()
    expect(dialog).not_to_be_visible()
    expect(page.locator(".timeline .steps")).to_contain_text("of 80 min")
    expect_state(page, "running")
    assert service.get(f"/missions/{mission}")["progress"]["budget"] == {"minutes": 80}
    service.act(mission, "pause")
    expect_state(page, "paused")
    by_id(page, "change-length").click()
    expect(value).to_have_value("80")
    unit.select_option("km_per_vehicle")
    value.fill("1,5")
    value.press("Enter")
    expect(page.locator(".timeline .steps")).to_contain_text("of 1.5 km")
    service.act(mission, "abort")
    expect(by_id(page, "change-length")).to_have_count(0)
