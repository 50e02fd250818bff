"""What an operator does, in Chromium against the real service with simulated vehicles."""

import io
import re
from collections.abc import Iterator

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Locator, Page, expect

from .conftest import Watched
from .service import Service

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
    by_id(page, "field-planner").select_option("random")
    by_id(page, "create-mission").click()

    expect(by_id(page, "mission-name")).to_have_text("Quay <b>north</b>")
    expect_state(page, "ready")
    assert colours_in_the_middle(page) < 20
    by_id(page, "start").click()
    expect_state(page, "running")

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


def test_a_refused_start_says_why_and_stays_until_taken(page: Page, service: Service) -> None:
    rover = [{"name": "rover", "kind": "rest"}]
    service.act(service.create(name="First come", vehicles=rover), "start")
    show(page, service.create(name="Second", vehicles=rover))
    by_id(page, "start").click()
    refusal = by_id(page, "refusal")
    expect(refusal).to_contain_text("start was refused")
    expect(refusal).to_contain_text("'rover' takes part in mission")
    expect(refusal).to_contain_text("finish or abort that mission")
    expect_state(page, "ready")
    refusal.get_by_role("button", name="Taken").click()
    expect(refusal).to_be_hidden()


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
    by_id(page, "layer-uncertainty").check(force=True)
    expect(by_id(page, "range-low")).to_have_value("0")
    by_id(page, "layer-depth").check(force=True)
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
