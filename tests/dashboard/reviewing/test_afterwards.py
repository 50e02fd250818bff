"""What came of a mission: replay, charts, layers, files, soundings in doubt, in Chromium against the real service."""

import re
import time

import pytest
from playwright.sync_api import Page, expect

from tests.support.dashboard.browser import Watched
from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, show, violations

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]


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
        time.sleep(0.1)
    return mission


def test_a_finished_mission_is_replayed_step_by_step(page: Page, service: Service, flown: str) -> None:
    show(page, flown)
    expect(by_id(page, "step")).to_have_text("4")
    by_id(page, "slider").fill("2")
    expect(by_id(page, "replayed-at")).to_have_text(re.compile(r"decided \d\d:\d\d:\d\d UTC"))
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


def test_files_tell_the_quality_of_the_mission_that_is_shown(page: Page, service: Service, flown: str) -> None:
    show(page, flown)
    by_id(page, "toggle-files").click()
    expect(by_id(page, "quality")).to_contain_text("Depths are below")
    nothing = service.create(name="Nothing yet")
    page.evaluate(f"location.hash = '#/missions/{nothing}'")
    expect(by_id(page, "mission-name")).to_have_text("Nothing yet")
    expect(by_id(page, "files")).to_contain_text("follow with the first accepted sounding")
    expect(by_id(page, "quality")).to_have_count(0)


def test_charts_layers_space_and_comparison_of_a_finished_mission(
    watched: Watched, service: Service, flown: str
) -> None:
    page = watched.page
    show(page, flown)
    by_id(page, "toggle-charts").click()
    expect(by_id(page, "charts").locator("canvas")).not_to_have_count(0)
    expect(by_id(page, "charts")).to_contain_text(re.compile(r"known \d"))
    # This page was opened after the end: what it shows of vehicles was kept.
    expect(by_id(page, "charts")).to_contain_text(re.compile(r"Depth of vehicles.*sim-1 \d"))
    by_id(page, "toggle-charts").click()
    for name in ("uncertainty", "count", "slope", "tvu_fraction"):
        by_id(page, "layer").select_option(name)
        expect(by_id(page, "range-low")).to_be_visible()
    by_id(page, "layer").select_option("flags")
    expect(by_id(page, "landmarks")).to_contain_text(re.compile(r"known as asked \d+ %"))
    by_id(page, "layer").select_option("difference")
    expect(page.get_by_text("The mission has no reference grid to differ from")).to_be_visible()
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
    for name, begin in (
        ("report.pdf", b"%PDF-"),
        ("report.html", b"<!doctype html>"),
        ("tif", b"II*\0"),
        ("soundings.csv", b"#"),
        ("bag", b"\x89HDF"),
    ):
        with page.expect_download() as waited:
            by_id(page, f"file-{name}").click()
        assert waited.value.suggested_filename.endswith(name.rpartition(".")[2])
        assert waited.value.path().read_bytes().startswith(begin)
    by_id(page, "file-soundings.geojson").click()
    expect(by_id(page, "file-fault")).to_contain_text("set provider.organization and provider.email")


def test_files_come_as_they_are_chosen(page: Page, service: Service) -> None:
    mission = service.create(vehicles=[{"name": name, "kind": "rest"} for name in ("rover", "diver")])
    items = [
        {"vehicle": vehicle, "time_s": 1.79e9 + i, "lat_deg": 41.1851 + 1e-5 * i, "lon_deg": -8.7049 + 2e-5 * i}
        | {"depth_m": 2.0, "range_m": 8.0 + 0.1 * i}
        for vehicle in ("rover", "diver")
        for i in range(12)
    ]
    service.post(f"/missions/{mission}/measurements", {"items": items})
    service.get(f"/missions/{mission}/map")
    show(page, mission)
    by_id(page, "toggle-files").click()
    expect(by_id(page, "files-order")).to_have_value("1a")
    expect(by_id(page, "files-lang")).to_have_value("en")
    by_id(page, "files-crs").select_option("utm")
    by_id(page, "files-interval_m").select_option("0.5")
    by_id(page, "files-order").select_option("special")
    for name, words in (
        ("xyz", b"WGS 84 / UTM zone 29N (EPSG:32629)"),
        ("contours.dxf", b"WGS 84 / UTM zone 29N (EPSG:32629)"),
        ("geojson", b'"depth_m":10.5'),
        ("tracks.gpx", b"<gpx"),
    ):
        with page.expect_download() as waited:
            by_id(page, f"file-{name}").click()
        assert ("epsg32629" in waited.value.suggested_filename) == (b"UTM" in words)
        assert words in waited.value.path().read_bytes().replace(b": ", b":")
    # A file of one vehicle asks for it, and no other does.
    expect(by_id(page, "files").locator("li select")).to_have_count(1)
    by_id(page, "file-soundings.geojson").click()
    expect(by_id(page, "file-fault")).to_contain_text("several vehicles have soundings")
    by_id(page, "vehicle-soundings.geojson").select_option("diver")
    by_id(page, "file-soundings.geojson").click()
    expect(by_id(page, "file-fault")).to_contain_text("set provider.organization and provider.email")
    page.reload()
    by_id(page, "toggle-files").click()
    expect(by_id(page, "files-crs")).to_have_value("utm")


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
    show(page, flown)
    expect(by_id(page, "range-low")).to_be_visible()
    states = (
        "",
        "toggle-legend",
        "go-to",
        "toggle-log",
        "toggle-charts",
        "toggle-soundings",
        "fold-cards",
        "new-mission",
    )
    for prepare in (*states, "expert"):
        if prepare == "expert":
            page.get_by_text("Expert settings").click()
        elif prepare:
            by_id(page, prepare).click()
        assert violations(page) == [], prepare


@pytest.fixture
def sixty_four(service: Service) -> str:
    """A mission with as many soundings in a square."""
    mission = service.create(vehicles=[{"name": "rover", "kind": "rest"}])
    items = [
        {"vehicle": "rover", "time_s": 1.79e9 + 30 * i, "lat_deg": 41.1851 + 4e-5 * (i // 8), "depth_m": 2.0}
        | {"lon_deg": -8.7049 + 6e-5 * (i % 8), "range_m": 8.0 + 0.1 * (i % 8)}
        for i in range(64)
    ]
    service.post(f"/missions/{mission}/measurements", {"items": items})
    return mission


def show_points(page: Page, mission: str) -> None:
    """Open a mission's soundings in space."""
    show(page, mission)
    by_id(page, "open-3d").click()
    by_id(page, "toggle-points").click()
    expect(by_id(page, "points-chosen")).to_contain_text("64 soundings")


def test_fewer_soundings_are_drawn_while_a_slow_machine_turns_them_and_all_when_they_are_still(
    page: Page, sixty_four: str
) -> None:
    show_points(page, sixty_four)
    canvas, lasso, chosen = page.locator(".space canvas"), by_id(page, "lasso"), by_id(page, "points-chosen")
    expect(canvas).to_have_attribute("data-points", "64")
    # Every picture comes late.
    page.evaluate(
        """() => { const late = () => { const until = performance.now() + 120; while (performance.now() < until);
        window.late = requestAnimationFrame(late); }; late(); }"""
    )
    box = lasso.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    drawn = set()
    for turn in range(40):
        page.mouse.wheel(0, 40 if turn % 2 else -40)
        drawn.add(int(canvas.get_attribute("data-points") or 0))
        if len(drawn) > 2:
            break
    assert min(drawn) < 64, "the first half of them at most"
    lasso.focus()
    page.keyboard.press("Enter")
    expect(chosen).to_contain_text("of 64 soundings chosen")
    while_turned = chosen.inner_text()
    page.evaluate("cancelAnimationFrame(window.late)")
    expect(canvas).to_have_attribute("data-points", "64")
    page.keyboard.press("Escape")
    expect(chosen).to_contain_text("Draw round")
    page.keyboard.press("Enter")
    expect(chosen).to_have_text(while_turned)


def test_soundings_are_chosen_in_space_with_a_lasso_rejected_and_taken_back(
    page: Page, service: Service, sixty_four: str
) -> None:
    mission = sixty_four
    show_points(page, mission)
    chosen = by_id(page, "points-chosen")
    expect(by_id(page, "points-reject")).to_be_disabled()

    def states() -> dict[str, int]:
        points = service.get(f"/missions/{mission}/soundings/points")
        names = [points["states"][k] for k in points["state"]]
        return {name: names.count(name) for name in set(names)}

    # The pointer draws round all of them, the keyboard's frame takes fewer.
    box = by_id(page, "lasso").bounding_box()
    assert box is not None
    left, top, right, bottom = box["x"] + 4, box["y"] + 4, box["x"] + box["width"] - 4, box["y"] + box["height"] - 4
    tools = page.locator(".points-tools").bounding_box()
    assert tools is not None
    assert tools["y"] > box["y"] + 0.5 * box["height"], "alarms stand in the upper part"
    page.mouse.move(box["x"] + box["width"] / 2, top)
    page.mouse.down()
    for x, y in [(right, top), (right, bottom), (left, bottom), (left, top)]:
        page.mouse.move(x, y)
    page.mouse.up()
    expect(chosen).to_contain_text("of 64 soundings chosen")
    some = int(chosen.inner_text().split()[0])
    assert some > 8
    page.keyboard.press("Escape")
    expect(chosen).to_contain_text("Draw round")
    by_id(page, "lasso").focus()
    for key in ("ArrowDown", "ArrowUp", "+", "Enter"):
        page.keyboard.press(key)
    expect(chosen).to_contain_text("of 64 soundings chosen")
    fewer = int(chosen.inner_text().split()[0])
    assert 0 < fewer < 64
    by_id(page, "points-note").fill("fish")
    by_id(page, "lasso").focus()
    page.keyboard.press("Delete")
    expect(by_id(page, "points-undo")).to_be_enabled()
    assert states() == {"withdrawn": fewer, "used": 64 - fewer}
    withdrawn = service.get(f"/missions/{mission}/soundings?state=withdrawn")["items"]
    assert {sounding["reason"] for sounding in withdrawn} == {"rejected by local operator: fish"}
    by_id(page, "lasso").focus()
    with page.expect_response("**/soundings/restore") as answered:
        page.keyboard.press("Control+z")
    assert answered.value.ok
    expect(by_id(page, "points-undo")).to_be_disabled()
    assert states() == {"restored": fewer, "used": 64 - fewer}
    by_id(page, "close-3d").click()
