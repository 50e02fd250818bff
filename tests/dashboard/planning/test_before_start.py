"""Before a start: the page itself, its dialogs, and describing a mission, in Chromium against the real service."""

import json
import re

import pytest
from playwright.sync_api import FilePayload, Page, Route, expect

from tests.support.dashboard.browser import Watched
from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, click_round, drag, show

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]


def test_the_page_loads_without_complaints_and_asks_nobody_else(watched: Watched, service: Service) -> None:
    mission = service.create()
    show(watched.page, mission)
    expect(watched.page).to_have_title("bathyfleet")
    assert watched.complaints == []
    assert [a for a in watched.addresses if not a.startswith((service.url, "data:", "blob:"))] == []


def test_without_a_mission_the_page_says_what_to_do_next(page: Page) -> None:
    page.goto("/")
    expect(by_id(page, "no-mission")).to_contain_text("No mission is shown")
    expect(by_id(page, "abort")).to_be_disabled()


def test_an_unknown_mission_is_named(page: Page, service: Service) -> None:
    service.create()
    page.goto("/#/missions/nonexistent")
    expect(by_id(page, "unknown-mission")).to_contain_text("There is no mission nonexistent")


def test_the_form_names_wrong_values_and_creates_nothing(page: Page, service: Service) -> None:
    before = len(service.get("/missions"))
    page.goto("/")
    by_id(page, "new-mission").click()
    by_id(page, "field-steps").fill("0")
    by_id(page, "create-mission").click()
    expect(page.get_by_text("Give the mission a name")).to_be_visible()
    expect(page.get_by_text("Steps must be between 1 and 100000")).to_be_visible()
    expect(by_id(page, "field-steps")).to_have_attribute("aria-invalid", "true")
    # The button is a window's height below.
    expect(by_id(page, "field-name")).to_be_in_viewport()
    expect(by_id(page, "field-name")).to_be_focused()
    by_id(page, "field-name").fill("Folded")
    by_id(page, "field-steps").fill("10")
    page.get_by_text("Expert settings").click()
    by_id(page, "field-max_depth_m").fill("-3")
    page.get_by_text("Expert settings").click()
    by_id(page, "create-mission").click()
    expect(by_id(page, "fault-max_depth_m")).to_be_in_viewport()
    assert len(service.get("/missions")) == before


def test_a_name_that_is_being_typed_stays_while_the_form_is_drawn_anew(page: Page) -> None:
    held: list[Route] = []
    page.route("**/api/v1/planners", lambda route: held.append(route))
    page.goto("/")
    by_id(page, "new-mission").click()
    name = by_id(page, "sim-name-1")
    name.select_text()
    name.press_sequentially("north")
    with page.expect_response("**/api/v1/planners"):
        held[0].continue_()
    page.evaluate("() => new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn)))")
    expect(name).to_have_value("north")
    name.blur()
    expect(name).to_have_value("north")


def test_an_area_is_drawn_with_a_keep_out_zone_and_judged_at_once(page: Page, service: Service) -> None:
    page.goto("/")
    expect(by_id(page, "map")).to_have_attribute("data-ready", "true")
    by_id(page, "new-mission").click()
    by_id(page, "draw-polygon").click()
    expect(by_id(page, "drawing")).to_have_attribute("data-ready", "true")
    corners = [(520, 300), (900, 320), (880, 640), (540, 600)]
    click_round(page, corners)
    expect(by_id(page, "drawing")).to_be_hidden()
    expect(by_id(page, "area-size")).to_contain_text("4 corners")
    by_id(page, "draw-keep-out").click()
    expect(by_id(page, "drawing")).to_have_attribute("data-ready", "true")
    zone = [(640, 400), (700, 400), (690, 460)]
    click_round(page, zone)
    expect(page.get_by_text("Zone 1")).to_be_visible()
    by_id(page, "field-name").fill("Drawn")
    by_id(page, "create-mission").click()
    expect(by_id(page, "mission-name")).to_have_text("Drawn")
    made = next(m for m in service.get("/missions") if m["name"] == "Drawn")
    spec = service.get(f"/missions/{made['id']}")["spec"]
    assert len(spec["area"]["coordinates"][0]) == 5
    assert len(spec["keep_out"]) == 1
    crossed = {"type": "Polygon", "coordinates": [[[0, 0], [1, 1], [1, 0], [0, 1], [0, 0]]]}
    by_id(page, "new-mission").click()
    file = FilePayload(name="crossed.geojson", mimeType="application/json", buffer=json.dumps(crossed).encode())
    by_id(page, "area-file").set_input_files(file)
    expect(by_id(page, "fault-ring")).to_contain_text("crosses itself")


FORECAST_MS = 240_000

KML = """<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Placemark><name>Basin</name><Polygon>
<outerBoundaryIs><LinearRing><coordinates>-8.705,41.185,0 -8.7043,41.185,0 -8.7043,41.1855,0 -8.705,41.185,0
</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark></kml>"""


def test_an_area_comes_from_a_kml_file(page: Page, service: Service) -> None:
    page.goto("/")
    by_id(page, "new-mission").click()
    file = FilePayload(name="basin.kml", mimeType="application/vnd.google-earth.kml+xml", buffer=KML.encode())
    by_id(page, "area-file").set_input_files(file)
    expect(by_id(page, "area-note")).to_contain_text("basin.kml: area of 3 corners")
    expect(by_id(page, "estimate")).to_contain_text("At most")
    by_id(page, "field-steps").fill("6")
    by_id(page, "ask-forecast").click()
    # It is flown over several floors.
    expect(by_id(page, "forecast-duration")).to_contain_text(re.compile(r"\d+ (s|min)"), timeout=FORECAST_MS)
    expect(by_id(page, "forecast-coverage")).to_contain_text("%")
    expect(by_id(page, "forecast")).to_contain_text("which is a guess")
    by_id(page, "field-name").fill("From a file")
    by_id(page, "create-mission").click()
    expect(by_id(page, "mission-name")).to_have_text("From a file")


def test_the_link_doctor_says_what_is_missing_and_what_to_do(page: Page) -> None:
    page.goto("/")
    by_id(page, "open-links").click()
    dialog = by_id(page, "links-dialog")
    expect(dialog).to_contain_text("does not listen for IMC vehicles")
    expect(dialog).to_contain_text("Set imc.enabled = true")
    by_id(page, "links-close").click()
    expect(dialog).not_to_be_visible()


def test_everything_can_be_reached_with_the_keyboard(page: Page, service: Service) -> None:
    show(page, service.create(name="Keys"))
    wanted = {"toggle-missions", "open-settings", "start", "abort", "new-mission", "toggle-log"}
    # Each mission of the list takes some of them.
    for _ in range(60 + 3 * len(service.get("/missions"))):
        page.keyboard.press("Tab")
        wanted.discard(str(page.evaluate("document.activeElement?.dataset?.testid ?? ''")))
    assert not wanted


def test_the_page_has_no_unlabelled_controls(page: Page, service: Service) -> None:
    show(page, service.create(name="Labels"))
    by_id(page, "new-mission").click()
    unlabelled = page.evaluate(
        """() => [...document.querySelectorAll("button, input, select")]
            .filter(e => !e.ariaLabel && !e.textContent.trim() && !(e.labels?.length) && !e.title)
            .map(e => e.outerHTML)"""
    )
    assert unlabelled == []


def test_narrow_windows_scroll_nothing_sideways_and_keep_abort_in_reach(page: Page, service: Service) -> None:
    page.set_viewport_size({"width": 420, "height": 900})
    vehicles = [{"name": f"sim-{n}", "kind": "sim"} for n in range(1, 5)]
    show(page, service.create(name="A rather long name for a mission in a narrow window", vehicles=vehicles))
    assert page.evaluate("document.documentElement.scrollWidth") <= 420
    expect(by_id(page, "abort")).to_be_in_viewport()
    box = by_id(page, "map").bounding_box()
    assert box is not None
    assert box["height"] > 250
    expect(by_id(page, "card-sim-4")).not_to_be_in_viewport()
    by_id(page, "card-sim-4").scroll_into_view_if_needed()
    expect(by_id(page, "card-sim-4")).to_be_in_viewport()


def test_the_stop_is_whole_and_the_area_above_the_lower_bar_in_every_width(page: Page, service: Service) -> None:
    mission = service.create(name="A rather long name for a mission in a window", vehicles=[])
    show(page, mission)
    for width, height in ((390, 844), (768, 1024), (820, 1180), (1024, 768), (1280, 800), (1600, 1000)):
        page.set_viewport_size({"width": width, "height": height})
        box = by_id(page, "abort").bounding_box()
        assert box is not None
        assert 0 <= box["x"] <= box["x"] + box["width"] <= width, width
        name = by_id(page, "mission-name").bounding_box()
        assert name is not None
        assert name["width"] > 90, width
        if width > 1000 or (width > 760 and width > height):
            covered = "parseFloat(getComputedStyle(document.querySelector('.app')).getPropertyValue('--over-bottom'))"
            strip = page.locator(".bottom").bounding_box()
            assert strip is not None
            page.wait_for_timeout(50)  # the strip is measured after it is laid out
            assert page.evaluate(covered) >= strip["height"] - 1, width
        else:
            chart, strip = by_id(page, "map").bounding_box(), page.locator(".bottom").bounding_box()
            assert chart is not None
            assert strip is not None
            assert chart["y"] + chart["height"] <= strip["y"] + 1, width


def test_the_corners_of_a_drawn_area_are_dragged_and_added(page: Page) -> None:
    page.goto("/")
    expect(by_id(page, "map")).to_have_attribute("data-ready", "true")
    by_id(page, "new-mission").click()
    by_id(page, "draw-polygon").click()
    expect(by_id(page, "drawing")).to_have_attribute("data-ready", "true")
    click_round(page, [(560, 300), (900, 300), (900, 600), (560, 600)])
    expect(by_id(page, "area-size")).to_contain_text("4 corners")
    before = by_id(page, "area-size").inner_text()
    expect(by_id(page, "editing")).to_have_attribute("data-ready", "true")
    drag(page, (900, 600), (960, 660))
    expect(by_id(page, "area-size")).not_to_have_text(before)
    expect(by_id(page, "area-size")).to_contain_text("4 corners")
    drag(page, (560, 450), (520, 470))
    expect(by_id(page, "area-size")).to_contain_text("5 corners")


def test_the_whole_fleet_is_one_table(page: Page, service: Service) -> None:
    mission = service.create(name="Of the fleet", vehicles=[{"name": "rover", "kind": "rest"}])
    place = {"vehicle": "rover", "time_s": 1.79e9, "lat_deg": 41.1852, "lon_deg": -8.7046, "depth_m": 1.5}
    service.post(f"/missions/{mission}/measurements", {"items": [place | {"battery_pct": 61}]})
    page.goto("/")
    by_id(page, "open-fleet").click()
    line = by_id(page, "fleet-rover")
    expect(line).to_contain_text("61 %")
    expect(line).to_contain_text("1.5 m")
    expect(line).to_contain_text("free")
    by_id(page, "fleet-close").click()
    expect(by_id(page, "fleet-dialog")).not_to_be_visible()


def test_who_knows_where_he_is_is_told_how_far_and_which_way_each_vehicle_is(page: Page, service: Service) -> None:
    mission = service.create(name="To be recovered", vehicles=[{"name": "lost", "kind": "rest"}])
    place = {"vehicle": "lost", "time_s": 1.79e9, "lat_deg": 41.1852, "lon_deg": -8.7046, "depth_m": 0.0}
    service.post(f"/missions/{mission}/measurements", {"items": [place]})
    page.context.grant_permissions(["geolocation"])
    page.context.set_geolocation({"latitude": 41.1852, "longitude": -8.7193})
    show(page, mission)
    expect(by_id(page, "depth-lost")).to_have_text("0.0 m")
    expect(by_id(page, "from-here-lost")).to_have_count(0)
    by_id(page, "own-position").click()
    expect(by_id(page, "from-here-lost")).to_have_text("1.23 km, 090°")
    page.context.set_geolocation({"latitude": 41.1816, "longitude": -8.7094})
    expect(by_id(page, "from-here-lost")).to_have_text("567 m, 045°")
    by_id(page, "open-fleet").click()
    expect(by_id(page, "fleet-lost")).to_contain_text("567 m, 045°")


@pytest.mark.parametrize("width", [390, 1200, 1600])
def test_nothing_hides_the_areas_lower_edge(page: Page, service: Service, width: int) -> None:
    page.set_viewport_size({"width": width, "height": 900})
    show(page, service.create(name="Edge"))
    strip = page.locator(".bottom").bounding_box()
    scale = page.locator(".maplibregl-ctrl-scale").bounding_box()
    assert strip is not None
    assert scale is not None
    assert scale["y"] + scale["height"] <= strip["y"] + 1


def test_a_length_in_minutes_and_a_vehicles_own_speed_are_described_in_the_form(page: Page, service: Service) -> None:
    page.goto("/")
    by_id(page, "new-mission").click()
    expect(by_id(page, "field-steps")).to_have_value("100")
    by_id(page, "field-name").fill("An hour")
    by_id(page, "field-length").select_option("minutes")
    expect(by_id(page, "field-steps")).to_be_hidden()
    by_id(page, "field-minutes").fill("10081")
    by_id(page, "create-mission").click()
    expect(by_id(page, "fault-minutes")).to_contain_text("Minutes must be more than 0 and at most 10080")
    by_id(page, "field-minutes").fill("60")
    page.get_by_text("Single vehicles: speed, endurance").click()
    by_id(page, "speed_mps-sim-2").fill("2")
    expect(by_id(page, "estimate")).to_contain_text("At most 1 h 00 min and 11.88 km of tracks")
    by_id(page, "create-mission").click()
    expect(by_id(page, "mission-name")).to_have_text("An hour")
    made = next(m for m in service.get("/missions") if m["name"] == "An hour")
    spec = service.get(f"/missions/{made['id']}")["spec"]
    assert spec["budget"] == {"minutes": 60}
    assert [vehicle["speed_mps"] for vehicle in spec["vehicles"]] == [None, 2.0]
