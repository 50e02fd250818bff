"""Describing missions again and otherwise: what is kept and what is lost, in Chromium against the real service."""

import io
import json
import zipfile

import pytest
from playwright.sync_api import FilePayload, Page, Route, expect

from tests.support.dashboard.browser import Watched
from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, click_round, show

pytestmark = [pytest.mark.browser, pytest.mark.timeout(400)]


def test_vehicles_keep_what_is_theirs_when_one_is_called_otherwise(page: Page, service: Service) -> None:
    slow = {"name": "auv-1", "kind": "rest", "endurance_min": 50, "speed_mps": 1}
    fast = {"name": "auv-10", "kind": "rest", "endurance_min": 200, "speed_mps": 2}
    mission = service.create(name="Two", vehicles=[slow, fast])
    show(page, mission)
    by_id(page, "edit-mission").click()
    by_id(page, "vehicle-auv-10").press("End")
    by_id(page, "vehicle-auv-10").press("Backspace")
    by_id(page, "vehicle-auv-10").press("Tab")
    expect(by_id(page, "fault-names")).to_contain_text("Two vehicles are called auv-1")
    by_id(page, "vehicle-auv-10").press("End")
    by_id(page, "vehicle-auv-10").press("2")
    by_id(page, "vehicle-auv-10").press("Tab")
    expect(by_id(page, "fault-names")).to_be_hidden()
    by_id(page, "create-mission").click()
    expect(by_id(page, "mission-form")).to_be_hidden()
    vehicles = service.get(f"/missions/{mission}")["spec"]["vehicles"]
    told = [(vehicle["name"], vehicle["endurance_min"], vehicle["speed_mps"]) for vehicle in vehicles]
    assert told == [("auv-1", 50, 1), ("auv-12", 200, 2)]


RING = [[-8.705, 41.185], [-8.704, 41.185], [-8.704, 41.186], [-8.705, 41.186], [-8.705, 41.185]]
ZONE = [[-8.7048, 41.1852], [-8.7047, 41.1852], [-8.7047, 41.1853], [-8.7048, 41.1852]]


def area_file(*rings: list[list[float]], name: str = "quay.geojson") -> FilePayload:
    content = {"type": "MultiPolygon", "coordinates": [[ring] for ring in rings]}
    return FilePayload(name=name, mimeType="application/json", buffer=json.dumps(content).encode())


def kmz(ring: list[list[float]]) -> FilePayload:
    places = " ".join(f"{lon},{lat},0" for lon, lat in ring)
    polygon = (
        f"<Polygon><outerBoundaryIs><LinearRing><coordinates>{places}</coordinates></LinearRing></outerBoundaryIs>"
    )
    document = f"<kml xmlns='http://www.opengis.net/kml/2.2'><Placemark>{polygon}</Polygon></Placemark></kml>"
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("doc.kml", document)
    return FilePayload(name="quay.kmz", mimeType="application/vnd.google-earth.kmz", buffer=archive.getvalue())


def gpx(ring: list[list[float]], kind: str) -> FilePayload:
    """A route (``rte``) or a track (``trk``), as chart plotters write an outline."""
    point, begin, end = ("rtept", "", "") if kind == "rte" else ("trkpt", "<trkseg>", "</trkseg>")
    points = "".join(f"<{point} lat='{lat}' lon='{lon}'/>" for lon, lat in ring)
    document = f"<gpx xmlns='http://www.topografix.com/GPX/1/1'><{kind}>{begin}{points}{end}</{kind}></gpx>"
    return FilePayload(name="quay.gpx", mimeType="application/gpx+xml", buffer=document.encode())


def begin(page: Page) -> None:
    page.goto("/")
    expect(by_id(page, "map")).to_have_attribute("data-ready", "true")
    by_id(page, "new-mission").click()


def test_areas_come_as_google_earth_and_chart_plotters_write_them(page: Page, service: Service) -> None:
    begin(page)
    files = (kmz(RING), gpx(RING[:-1], "rte"), gpx(RING, "trk"))
    for number, file in enumerate(files):
        by_id(page, "area-file").set_input_files(file)
        expect(by_id(page, "area-note")).to_contain_text(f"{file['name']}: area of 4 corners")
        if number == 0:
            by_id(page, "area-file").set_input_files(area_file(ZONE, name="between.geojson"))
            expect(by_id(page, "area-note")).to_contain_text("between.geojson: area of 3 corners")
    by_id(page, "field-name").fill("Quay by plotter")
    by_id(page, "create-mission").click()
    expect(by_id(page, "mission-form")).to_be_hidden()
    (made,) = [one for one in service.get("/missions") if one["name"] == "Quay by plotter"]
    [ring] = service.get(f"/missions/{made['id']}")["spec"]["area"]["coordinates"]
    assert sorted(map(tuple, ring[:-1])) == sorted(map(tuple, RING[:-1]))


def test_a_zone_that_was_removed_stays_away_and_none_comes_twice(page: Page) -> None:
    begin(page)
    by_id(page, "area-file").set_input_files(area_file(RING, ZONE))
    expect(page.get_by_text("Zone 1")).to_be_visible()
    expect(by_id(page, "area-note")).not_to_contain_text("stay")
    by_id(page, "area-file").set_input_files(area_file(RING, ZONE))
    elsewhere = [[lng + 1, lat] for lng, lat in RING]
    by_id(page, "area-file").set_input_files(area_file(elsewhere, name="elsewhere.geojson"))
    expect(by_id(page, "area-note")).to_contain_text("elsewhere.geojson: area of 4 corners. 1 keep-out zone that was")
    expect(page.get_by_text("Zone 2")).to_have_count(0)
    by_id(page, "draw-keep-out").click()
    expect(by_id(page, "drawing")).to_have_attribute("data-ready", "true")
    page.get_by_label("Remove keep-out zone 1").click()
    expect(page.get_by_text("Zone 1")).to_have_count(0)
    click_round(page, [(640, 400), (700, 400), (690, 460)])
    expect(page.get_by_text("Zone 1")).to_be_visible()
    expect(page.get_by_text("Zone 2")).to_have_count(0)


def test_another_click_on_what_is_drawn_ends_drawing(page: Page) -> None:
    begin(page)
    by_id(page, "draw-polygon").click()
    expect(by_id(page, "draw-polygon")).to_have_attribute("aria-pressed", "true")
    by_id(page, "draw-polygon").click()
    expect(by_id(page, "draw-polygon")).to_have_attribute("aria-pressed", "false")
    expect(by_id(page, "drawing")).to_have_count(0)
    by_id(page, "draw-keep-out").click()
    expect(by_id(page, "draw-keep-out")).to_have_attribute("aria-pressed", "true")
    expect(by_id(page, "draw-polygon")).to_have_attribute("aria-pressed", "false")


def test_an_area_in_metres_is_refused_in_words(watched: Watched) -> None:
    page = watched.page
    begin(page)
    utm = [[524000.0, 4559000.0], [524100.0, 4559000.0], [524100.0, 4559100.0], [524000.0, 4559000.0]]
    by_id(page, "area-file").set_input_files(area_file(utm, name="utm.geojson"))
    expect(by_id(page, "area-note")).to_contain_text(
        "utm.geojson: a corner is at 524000, 4559000, which is no longitude"
    )
    expect(by_id(page, "field-latitude")).to_be_visible()
    assert watched.complaints == []


def test_what_was_typed_is_lost_only_after_a_question(page: Page) -> None:
    begin(page)
    by_id(page, "cancel-mission").click()
    expect(by_id(page, "mission-form")).to_be_hidden()
    by_id(page, "new-mission").click()
    by_id(page, "field-name").fill("Long thought about")
    by_id(page, "cancel-mission").click()
    by_id(page, "keep-describing").click()
    expect(by_id(page, "field-name")).to_have_value("Long thought about")
    with page.expect_event("dialog") as asked:
        page.evaluate("() => void setTimeout(() => location.reload())")
    assert asked.value.type == "beforeunload"
    asked.value.dismiss()
    expect(by_id(page, "field-name")).to_have_value("Long thought about")
    by_id(page, "cancel-mission").click()
    by_id(page, "discard-mission").click()
    expect(by_id(page, "mission-form")).to_be_hidden()


def test_a_mission_that_is_withdrawn_while_it_is_sent_is_not_there(page: Page, service: Service) -> None:
    begin(page)
    by_id(page, "field-name").fill("Withdrawn")
    held: list[Route] = []
    page.route("**/api/v1/missions", lambda route: held.append(route) if is_post(route) else route.continue_())
    with page.expect_request(lambda request: request.method == "POST" and request.url.endswith("/missions")):
        page.evaluate(
            """() => {
                const form = document.querySelector("[data-testid=mission-form]");
                form.requestSubmit();
                form.requestSubmit();
            }"""
        )
    # What is being sent cannot be changed.
    expect(by_id(page, "mission-form")).to_have_attribute("inert", "")
    by_id(page, "cancel-mission").click()
    by_id(page, "discard-mission").click()
    expect(by_id(page, "mission-form")).to_be_hidden()
    [sent] = held
    with page.expect_response(lambda answer: answer.request.method == "DELETE") as removed:
        sent.continue_()
    assert removed.value.ok
    assert "Withdrawn" not in [mission["name"] for mission in service.get("/missions")]
    expect(by_id(page, "mission-form")).to_be_hidden()


def is_post(route: Route) -> bool:
    return route.request.method == "POST"


def test_a_rectangle_is_typed_as_large_as_the_area_that_is_edited(page: Page, service: Service) -> None:
    begin(page)
    by_id(page, "field-name").fill("Rectangle")
    by_id(page, "field-east_m").fill("250")
    by_id(page, "field-north_m").fill("150")
    by_id(page, "create-mission").click()
    expect(by_id(page, "mission-name")).to_have_text("Rectangle")
    # Whoever uses the keyboard is at the list again, not at the page's beginning.
    expect(page.get_by_role("heading", name="Missions")).to_be_focused()
    by_id(page, "edit-mission").press("Enter")
    expect(page.get_by_role("heading", name="Edit a mission")).to_be_focused()
    page.get_by_text("Type a rectangle instead").click()
    expect(by_id(page, "field-east_m")).to_have_value("250")
    expect(by_id(page, "field-north_m")).to_have_value("150")


def test_a_search_says_that_blocks_are_left_out_and_a_survey_has_them_again(page: Page) -> None:
    begin(page)
    by_id(page, "another-block").click()
    expect(by_id(page, "block-2")).to_be_visible()
    by_id(page, "kind-search").check()
    expect(by_id(page, "blocks-left-out")).to_have_text("A search has one area: 1 more block is left out.")
    by_id(page, "kind-survey").check()
    expect(by_id(page, "block-2")).to_be_visible()


def test_a_search_that_is_copied_becomes_a_survey_like_any_other(page: Page, service: Service) -> None:
    begin(page)
    by_id(page, "field-name").fill("Search")
    by_id(page, "kind-search").check()
    by_id(page, "area-file").set_input_files(area_file(RING))
    by_id(page, "field-goal").fill("41.1855, -8.7042")
    by_id(page, "field-entry").fill("41.1851, -8.7049")
    by_id(page, "create-mission").click()
    expect(by_id(page, "mission-name")).to_have_text("Search")
    by_id(page, "copy-mission").click()
    by_id(page, "field-name").fill("Survey")
    by_id(page, "kind-survey").check()
    by_id(page, "create-mission").click()
    expect(by_id(page, "mission-name")).to_have_text("Survey")
    [made] = [one["id"] for one in service.get("/missions") if one["name"] == "Survey"]
    spec = service.get(f"/missions/{made}")["spec"]
    limits = spec["limits"]
    assert (spec["planner"]["name"], spec["budget"], spec["arrival_radius_m"]) == ("cao", {"steps": 100}, 3)
    assert (limits["min_depth_m"], limits["keep_out_margin_m"], limits["max_step_m"]) == (2, 10, 10)
    assert [vehicle["depth_m"] for vehicle in spec["vehicles"]] == [None, None]
