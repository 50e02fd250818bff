"""What an operator does, in Chromium against the real service with simulated vehicles."""

import io
import json
import re
import time
from collections.abc import Iterator

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Locator, Page, expect

from .conftest import Watched
from .service import ROOT, Service

pytestmark = [pytest.mark.browser, pytest.mark.timeout(400)]


@pytest.fixture(autouse=True)
def nothing_goes_on(service: Service) -> Iterator[None]:
    """Vehicles are free for the next test, and nobody steers for nothing."""
    yield
    for mission in service.get("/missions"):
        if mission["state"] in ("running", "paused"):
            service.act(mission["id"], "abort")


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
    assert len(service.get("/missions")) == before


def test_what_only_the_service_can_refuse_is_shown_beside_its_field(page: Page) -> None:
    page.goto("/")
    by_id(page, "new-mission").click()
    by_id(page, "field-name").fill("One cell")
    page.get_by_text("Limits and grid").click()
    by_id(page, "field-cell_m").fill("90")
    by_id(page, "create-mission").click()
    expect(by_id(page, "mission-form").get_by_role("alert")).to_contain_text("cannot be taken")


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
    by_id(page, "planner-random").check()
    by_id(page, "create-mission").click()

    expect(by_id(page, "mission-name")).to_have_text("Quay <b>north</b>")
    expect_state(page, "ready")
    assert colours_in_the_middle(page) < 20
    start(page)

    for name in ("sim-1", "sim-2"):
        expect(by_id(page, f"card-{name}")).to_have_attribute("data-link", "engaged")
        expect(by_id(page, f"vehicle-mark-{name}")).to_be_visible()
        expect(by_id(page, f"depth-{name}")).to_have_text(re.compile(r"\d\.\d m"))
    marker = page.locator(".maplibregl-marker", has=by_id(page, "vehicle-mark-sim-1"))
    place = marker.get_attribute("style")
    assert place is not None
    expect(marker).not_to_have_attribute("style", place)
    expect(by_id(page, "waypoint-sim-1")).to_have_attribute("data-status", re.compile("acknowledged|reached"))

    expect(by_id(page, "range-low")).to_be_visible()
    expect(by_id(page, "step")).not_to_have_text("0")
    page.mouse.move(620, 430)
    expect(by_id(page, "readout")).to_contain_text(re.compile(r"\d+\.\d\d m ± \d+\.\d\d m"))
    assert colours_in_the_middle(page) > 20

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
    expect(link).to_contain_text(f"it takes part in mission {first}")
    expect(by_id(page, "check-tide")).to_contain_text("no tide is applied")
    expect(by_id(page, "confirm-start")).to_be_disabled()
    service.act(first, "abort")
    expect(by_id(page, "preflight")).to_have_attribute("data-ready", "true")
    by_id(page, "confirm-start").click()
    expect_state(page, "running")


def test_an_area_is_drawn_with_a_keep_out_zone_and_judged_at_once(page: Page, service: Service) -> None:
    page.goto("/")
    expect(by_id(page, "map")).to_have_attribute("data-ready", "true")
    by_id(page, "new-mission").click()
    by_id(page, "draw-polygon").click()
    expect(by_id(page, "drawing")).to_have_attribute("data-ready", "true")
    corners = [(520, 300), (900, 320), (880, 640), (540, 600)]
    for x, y in [*corners, corners[0]]:
        page.mouse.move(x, y)
        page.mouse.click(x, y)
    expect(by_id(page, "drawing")).to_be_hidden()
    expect(by_id(page, "area-size")).to_contain_text("4 corners")
    by_id(page, "draw-keep-out").click()
    expect(by_id(page, "drawing")).to_have_attribute("data-ready", "true")
    zone = [(640, 400), (700, 400), (690, 460)]
    for x, y in [*zone, zone[0]]:
        page.mouse.move(x, y)
        page.mouse.click(x, y)
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
    file = {"name": "crossed.geojson", "mimeType": "application/json", "buffer": json.dumps(crossed).encode()}
    by_id(page, "area-file").set_input_files(file)
    expect(by_id(page, "fault-ring")).to_contain_text("crosses itself")


KML = """<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Placemark><name>Basin</name><Polygon>
<outerBoundaryIs><LinearRing><coordinates>-8.705,41.185,0 -8.7043,41.185,0 -8.7043,41.1855,0 -8.705,41.185,0
</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark></kml>"""


def test_an_area_comes_from_a_kml_file(page: Page, service: Service) -> None:
    page.goto("/")
    by_id(page, "new-mission").click()
    file = {"name": "basin.kml", "mimeType": "application/vnd.google-earth.kml+xml", "buffer": KML.encode()}
    by_id(page, "area-file").set_input_files(file)
    expect(by_id(page, "area-note")).to_contain_text("basin.kml: area of 3 corners")
    expect(by_id(page, "estimate")).to_contain_text("At most")
    by_id(page, "field-name").fill("From a file")
    by_id(page, "create-mission").click()
    expect(by_id(page, "mission-name")).to_have_text("From a file")


def test_one_vehicle_is_aborted_the_others_go_on_and_it_is_noted(page: Page, service: Service) -> None:
    vehicles = [{"name": f"sim-{n}", "kind": "sim", "sensor": "dvl"} for n in (1, 2)]
    show(page, service.create(name="One of two", vehicles=vehicles))
    start(page)
    expect(by_id(page, "card-sim-2")).to_have_attribute("data-link", "engaged")
    by_id(page, "abort-sim-1").click()
    by_id(page, "abort-confirm").click()
    expect(by_id(page, "receipt-sim-1")).to_contain_text("acknowledged the stop")
    by_id(page, "abort-close").click()
    expect(by_id(page, "card-sim-1")).to_be_hidden()
    expect_state(page, "running")
    by_id(page, "toggle-log").click()
    by_id(page, "note").fill("sim-1 taken out, its battery")
    by_id(page, "note").press("Enter")
    by_id(page, "log-level").select_option("notes")
    expect(by_id(page, "log")).to_contain_text("sim-1 taken out, its battery")
    expect(by_id(page, "log").locator("li")).to_have_count(1)


@pytest.fixture(scope="module")
def flown(service: Service) -> str:
    """A mission of two vehicles that has finished after a few steps."""
    vehicles = [{"name": f"sim-{n}", "kind": "sim", "sensor": "dvl"} for n in (1, 2)]
    limits = {"max_step_m": 15}
    mission = service.create(name="Flown", vehicles=vehicles, steps=4, limits=limits, step_deadline_s=60)
    service.act(mission, "start")
    end = time.monotonic() + 120
    while service.get(f"/missions/{mission}")["state"] != "finished":
        assert time.monotonic() < end
        time.sleep(0.3)
    return mission


def test_a_finished_mission_is_replayed_step_by_step(page: Page, service: Service, flown: str) -> None:
    show(page, flown)
    expect(by_id(page, "step")).to_have_text("4")
    by_id(page, "slider").fill("2")
    expect(by_id(page, "replayed-at")).to_contain_text("UTC")
    expect(by_id(page, "step")).to_have_text("2")
    marker = page.locator(".maplibregl-marker", has=by_id(page, "vehicle-mark-sim-1"))
    expect(marker).to_be_visible()
    place = marker.get_attribute("style")
    assert place is not None
    by_id(page, "slider").fill("4")
    expect(marker).not_to_have_attribute("style", place)
    by_id(page, "to-present").click()
    expect(by_id(page, "replayed-at")).to_be_hidden()
    by_id(page, "play").click()
    expect(by_id(page, "replayed-at")).to_be_visible()
    expect(by_id(page, "step")).to_have_text("4")


def test_charts_layers_space_and_comparison_of_a_finished_mission(
    watched: Watched, service: Service, flown: str
) -> None:
    page = watched.page
    show(page, flown)
    by_id(page, "toggle-charts").click()
    expect(by_id(page, "charts").locator("canvas")).not_to_have_count(0)
    expect(by_id(page, "charts")).to_contain_text(re.compile(r"covered \d"))
    by_id(page, "toggle-charts").click()
    for name in ("uncertainty", "count", "slope", "tvu_fraction"):
        by_id(page, "layer").select_option(name)
        expect(by_id(page, "range-low")).to_be_visible()
    by_id(page, "layer").select_option("landmarks")
    expect(by_id(page, "landmarks")).to_contain_text(re.compile(r"accurate \d+ %"))
    by_id(page, "layer").select_option("difference")
    expect(page.get_by_text("There is no reference grid to differ from")).to_be_visible()
    by_id(page, "layer").select_option("depth")
    expect(by_id(page, "range-low")).to_be_visible()
    by_id(page, "measure").click()
    page.mouse.click(560, 350)
    page.mouse.click(700, 350)
    expect(by_id(page, "measured-all")).to_contain_text(re.compile(r"\d m"))
    by_id(page, "measure").click()
    by_id(page, "coordinates").click()
    page.mouse.move(620, 430)
    expect(by_id(page, "readout")).to_contain_text(re.compile(r"41°11\.\d{4}′ N 008°42\.\d{4}′ W"))
    by_id(page, "open-3d").click()
    expect(by_id(page, "space").locator("canvas")).to_be_visible()
    page.wait_for_load_state("networkidle")
    by_id(page, "exaggeration").fill("8")
    by_id(page, "close-3d").click()
    other = service.create(name="Never flown")
    page.reload()
    by_id(page, "toggle-compare").click()
    by_id(page, "compare-with").select_option(other)
    expect(by_id(page, "compare-table")).to_contain_text("Never flown")
    expect(by_id(page, "compare-maps")).to_contain_text("do not overlap")
    assert watched.complaints == []


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
    by_id(page, "theme").click()
    by_id(page, "theme").click()
    expect(page.locator("html")).to_have_attribute("data-theme", "dark")
    page.reload()
    expect(by_id(page, "range-high")).to_have_value("33")
    expect(page.locator("html")).to_have_attribute("data-theme", "dark")
    by_id(page, "layer").select_option("uncertainty")
    expect(by_id(page, "range-low")).to_have_value("0")
    by_id(page, "layer").select_option("depth")
    by_id(page, "range-fit").click()
    expect(by_id(page, "range-high")).not_to_have_value("33")


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


def test_everything_can_be_reached_with_the_keyboard(page: Page, service: Service) -> None:
    show(page, service.create(name="Keys"))
    reached: set[str] = set()
    for _ in range(60):
        page.keyboard.press("Tab")
        name = page.evaluate("document.activeElement?.dataset?.testid ?? ''")
        reached.add(str(name))
    assert {"toggle-missions", "theme", "start", "abort", "new-mission", "toggle-log"} <= reached


def test_the_page_has_no_unlabelled_controls(page: Page, service: Service) -> None:
    show(page, service.create(name="Labels"))
    by_id(page, "new-mission").click()
    unlabelled = page.evaluate(
        """() => [...document.querySelectorAll("button, input, select")]
            .filter(e => !e.ariaLabel && !e.textContent.trim() && !(e.labels?.length) && !e.title)
            .map(e => e.outerHTML)"""
    )
    assert unlabelled == []


def test_the_link_doctor_says_what_is_missing_and_what_to_do(page: Page) -> None:
    page.goto("/")
    by_id(page, "open-links").click()
    dialog = by_id(page, "links-dialog")
    expect(dialog).to_contain_text("does not listen for IMC vehicles")
    expect(dialog).to_contain_text("Set imc.enabled = true")
    by_id(page, "links-close").click()
    expect(dialog).not_to_be_visible()


def test_the_files_of_a_mission_are_downloaded_from_a_list(page: Page, service: Service) -> None:
    mission = service.create(vehicles=[{"name": "rover", "kind": "rest"}])
    items = [
        {"vehicle": "rover", "time_s": 1.79e9 + i, "lat_deg": 41.1851 + 1e-5 * i, "lon_deg": -8.7049 + 2e-5 * i}
        | {"depth_m": 2.0, "range_m": 8.0 + 0.1 * i}
        for i in range(12)
    ]
    show(page, mission)
    by_id(page, "toggle-files").click()
    expect(by_id(page, "file-tif")).to_be_disabled()
    service.post(f"/missions/{mission}/measurements", {"items": items})
    service.get(f"/missions/{mission}/map")
    expect(by_id(page, "file-tif")).to_be_enabled()
    expect(by_id(page, "quality")).to_contain_text("TVU estimate meets Order 1a in")
    for name, begin in (("tif", b"II*\0"), ("soundings.csv", b"#"), ("bag", b"\x89HDF")):
        with page.expect_download() as waited:
            by_id(page, f"file-{name}").click()
        assert waited.value.suggested_filename.endswith(name.rpartition(".")[2])
        assert waited.value.path().read_bytes().startswith(begin)
    by_id(page, "file-soundings.geojson").click()
    expect(by_id(page, "file-fault")).to_contain_text("set provider.organization and provider.email")


def test_a_rejected_sounding_is_found_on_the_map_restored_and_rejected_again(page: Page, service: Service) -> None:
    mission = service.create(vehicles=[{"name": "rover", "kind": "rest"}])
    items = [
        {"vehicle": "rover", "time_s": 1.79e9 + 30 * i, "lat_deg": 41.1851 + 4e-5 * (i // 8), "depth_m": 2.0}
        | {"lon_deg": -8.7049 + 6e-5 * (i % 8), "range_m": 8.0 + 0.1 * (i % 8) if i != 27 else 3.0}
        for i in range(64)
    ]
    service.post(f"/missions/{mission}/measurements", {"items": items})
    service.get(f"/missions/{mission}/map")
    show(page, mission)
    by_id(page, "toggle-soundings").click()
    row = by_id(page, "review").locator("li")
    expect(row).to_have_count(1)
    expect(row).to_have_attribute("data-state", "doubted")
    expect(row).to_contain_text("that its neighbours predict")
    by_id(page, "review-note").fill("seen by divers")
    row.get_by_role("button", name="Restore").click()
    expect(row).to_have_attribute("data-state", "restored")
    assert "seen by divers" in service.get(f"/missions/{mission}/soundings")["items"][0]["reason"]
    row.get_by_role("button", name="Reject").click()
    expect(row).to_have_attribute("data-state", "withdrawn")
    by_id(page, "toggle-log").click()
    expect(by_id(page, "log")).to_contain_text("restored by local operator: seen by divers")


def test_no_serious_fault_for_people_who_see_or_steer_otherwise(page: Page, service: Service, flown: str) -> None:
    axe = ROOT / "app" / "dashboard" / "web" / "node_modules" / "axe-core" / "axe.min.js"
    if not axe.is_file():
        pytest.skip("axe-core is missing: npm ci in app/dashboard/web")
    show(page, flown)
    expect(by_id(page, "range-low")).to_be_visible()
    for prepare in ("", "toggle-log", "toggle-charts", "toggle-soundings", "new-mission"):
        if prepare:
            by_id(page, prepare).click()
        page.evaluate(axe.read_text())
        found = page.evaluate("axe.run(document, {resultTypes: ['violations']})")
        serious = [
            (v["id"], [n["html"][:120] for n in v["nodes"]])
            for v in found["violations"]
            if v["impact"] in ("serious", "critical")
        ]
        assert serious == [], prepare
