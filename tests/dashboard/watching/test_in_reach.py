"""What has to be in sight and in reach whatever is open: the stop, and every vehicle; on every screen."""

import itertools
import os
import re
import signal
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.support.dashboard.browser import PATIENCE_MS
from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, expect_state, show, start
from tests.support.missions.specs import AREA

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(600)]

SCREENS = {"wide": (1600, 1000), "tablet": (1024, 768), "upright": (768, 1024), "phone": (390, 844)}
PAIR = [{"name": f"sim-{n}", "kind": "sim", "sensor": "dvl"} for n in (1, 2)]


@pytest.fixture(params=SCREENS)
def screen(request: pytest.FixtureRequest, browser: Browser, service: Service) -> Iterator[Page]:
    width, height = SCREENS[request.param]
    context = browser.new_context(viewport={"width": width, "height": height}, base_url=service.url)
    page = context.new_page()
    page.set_default_timeout(PATIENCE_MS)
    yield page
    context.close()


def size_of(screen: str) -> dict[str, int]:
    width, height = SCREENS[screen]
    return {"width": width, "height": height}


def expect_on_top(page: Page, name: str, *, moved: bool = False) -> None:
    """A click in the middle of an element meets it, and all of it is on the screen, once what opens has opened.

    ``moved``: once its row of cards is moved to where it is. The row goes back to a whole card as cards grow.
    """
    page.wait_for_function(
        """([name, moved]) => {
            const element = document.querySelector(`[data-testid="${name}"]`);
            if (element === null) return false;
            if (moved) element.scrollIntoView({ block: "nearest", inline: "nearest" });
            const { left, right, top, bottom } = element.getBoundingClientRect();
            const hit = document.elementFromPoint((left + right) / 2, (top + bottom) / 2);
            return element.contains(hit) && left >= 0 && top >= 0 && right <= innerWidth && bottom <= innerHeight;
        }""",
        arg=[name, moved],
    )


def expect_menu_at_its_button(page: Page, name: str) -> None:
    """Also after the row of cards was moved below it."""
    page.wait_for_function(
        """name => {
            const of = part => document.querySelector(`[data-testid="${part}-${name}"]`).getBoundingClientRect();
            const [button, menu] = [of("more"), of("more-orders")];
            const left = Math.max(0, Math.min(button.left, innerWidth - 230));
            return Math.abs(menu.left - left) < 2 && menu.bottom <= button.top && menu.bottom > button.top - 10;
        }""",
        arg=name,
    )


def expect_orders_in_one_row(page: Page, name: str) -> None:
    """On narrow screens: what is seldom needed is in a menu, which covers no stop. Elsewhere it is beside them."""
    if page.viewport_size in (size_of("wide"), size_of("tablet")):
        expect(by_id(page, f"more-{name}")).to_be_hidden()
        expect(by_id(page, f"hold-{name}")).to_be_visible()
        return
    row = by_id(page, f"card-{name}").locator(".orders > button")
    tops = row.evaluate_all("buttons => [...new Set(buttons.map(b => b.getBoundingClientRect().top))]")
    assert len(tops) == 1
    expect(by_id(page, f"hold-{name}")).to_be_hidden()
    by_id(page, f"more-{name}").click()
    for order in ("hold", "go", "skip", "repeat"):
        expect_on_top(page, f"{order}-{name}")
    expect_on_top(page, f"abort-{name}", moved=True)
    expect_menu_at_its_button(page, name)
    by_id(page, f"card-{name}").evaluate("card => { card.parentElement.scrollLeft -= 40; }")
    expect_menu_at_its_button(page, name)
    expect_on_top(page, "abort")
    by_id(page, f"go-{name}").click()
    expect(by_id(page, f"hold-{name}")).to_be_hidden()
    expect(by_id(page, f"go-place-{name}")).to_be_visible()
    expect_on_top(page, f"abort-{name}", moved=True)
    by_id(page, f"more-{name}").click()
    by_id(page, f"go-{name}").click()
    expect(by_id(page, f"go-place-{name}")).to_be_hidden()


def test_nothing_covers_the_stop_and_a_single_vehicle_can_be_stopped_from_there(screen: Page, service: Service) -> None:
    page = screen
    mission = service.create(name="Always in reach", vehicles=PAIR)
    service.act(mission, "start")
    show(page, mission)
    expect_on_top(page, "abort")
    for pane in ("charts", "files", "soundings", "compare", "log"):
        by_id(page, f"toggle-{pane}").click()
        expect_on_top(page, "abort")
    by_id(page, "toggle-log").click()
    by_id(page, "toggle-legend").click()
    expect_on_top(page, "abort")
    by_id(page, "open-links").click()
    expect(by_id(page, "links-dialog")).to_be_visible()
    expect_on_top(page, "abort")
    page.keyboard.press("Escape")
    # Each vehicle's own stop: in sight, or a movement of its row away.
    for name in ("sim-1", "sim-2"):
        expect_on_top(page, f"abort-{name}", moved=True)
    expect_orders_in_one_row(page, "sim-2")
    by_id(page, "finish").click()
    expect(by_id(page, "finish-dialog")).to_be_visible()
    expect_on_top(page, "abort")
    page.keyboard.press("Escape")
    expect(by_id(page, "finish-dialog")).to_be_hidden()
    if not by_id(page, "new-mission").is_visible():
        by_id(page, "toggle-missions").click()
    expect_on_top(page, "abort")
    by_id(page, "new-mission").click()
    expect(by_id(page, "mission-form")).to_be_visible()
    expect_on_top(page, "abort")
    page.get_by_role("button", name="Cancel").click()
    by_id(page, "open-fleet").click()
    expect(by_id(page, "fleet-dialog")).to_be_visible()
    expect_on_top(page, "abort")

    by_id(page, "abort").click()
    expect_on_top(page, "abort-confirm")
    by_id(page, "abort-only-sim-2").click()
    by_id(page, "abort-confirm").click()
    expect(by_id(page, "receipt-sim-2")).to_contain_text("acknowledged the stop")
    page.keyboard.press("Escape")
    expect(by_id(page, "abort-dialog")).to_be_hidden()
    expect(by_id(page, "fleet-dialog")).to_be_visible()
    expect_state(page, "running")


def test_the_stop_of_twenty_vehicles_is_in_sight_and_at_hand(screen: Page, service: Service) -> None:
    page = screen
    team = [{"name": f"sim-{n}", "kind": "sim", "sensor": "dvl"} for n in range(1, 21)]
    show(page, service.create(name="Twenty", vehicles=team))
    by_id(page, "abort").click()
    expect_on_top(page, "abort-confirm")
    expect(by_id(page, "abort-close")).to_be_focused()
    page.keyboard.press("Tab")
    expect(by_id(page, "abort-confirm")).to_be_focused()


@pytest.mark.parametrize("size", [(390, 844), (844, 390)], ids=["upright", "lying"])
def test_what_needs_attention_leaves_the_maps_tools_in_reach_on_a_phone(
    page: Page, service: Service, size: tuple[int, int]
) -> None:
    page.set_viewport_size({"width": size[0], "height": size[1]})
    mission = service.create(name="Two wait", vehicles=[*PAIR, PAIR[0] | {"name": "sim-3"}])
    service.act(mission, "start")
    show(page, mission)
    for name in ("sim-1", "sim-2"):
        by_id(page, f"hold-{name}").dispatch_event("click")
    by_id(page, "attention-more").click()
    expect(by_id(page, "attention").locator("li")).to_have_count(2)
    for tool in ("measure", "go-to", "coordinates", "attention-more", "abort"):
        expect_on_top(page, tool)
    by_id(page, "go-to").click()
    # Who types at once types into the field.
    page.keyboard.type("leix")
    for part in ("go-to-position", "harbour-0", "go", "attention-more"):
        expect_on_top(page, part)
    by_id(page, "harbour-0").click()
    expect(by_id(page, "go-to-position")).to_have_value("Porto De Leixoes")


def test_a_vehicle_that_was_aborted_stays_in_sight_and_can_be_added_again(page: Page, service: Service) -> None:
    mission = service.create(name="Nobody disappears", vehicles=PAIR)
    service.act(mission, "start")
    show(page, mission)
    expect(by_id(page, "card-sim-1")).to_have_attribute("data-link", "engaged")
    by_id(page, "abort-sim-1").click()
    by_id(page, "abort-confirm").click()
    by_id(page, "abort-close").click()
    expect(by_id(page, "state-sim-1")).to_contain_text("Left the mission")
    expect(by_id(page, "left-sim-1")).to_contain_text(re.compile(r"Left at \d\d:\d\d:\d\d UTC"))
    expect(by_id(page, "vehicle-mark-sim-1")).to_contain_text("left")
    expect(by_id(page, "link")).to_contain_text("1 of 1 vehicles")
    page.reload()
    expect(by_id(page, "vehicle-mark-sim-1")).to_contain_text("left")
    by_id(page, "rejoin-sim-1").click()
    expect(by_id(page, "link")).to_contain_text("of 2 vehicles")
    expect(by_id(page, "card-sim-1")).to_have_attribute("data-link", "engaged")
    service.act(mission, "abort")
    expect_state(page, "aborted")
    for name in ("sim-1", "sim-2"):
        expect(by_id(page, f"vehicle-mark-{name}")).to_be_visible()


def test_finishing_early_asks_first(page: Page, service: Service) -> None:
    show(page, service.create(name="Asked first"))
    start(page)
    by_id(page, "finish").click()
    by_id(page, "finish-close").click()
    expect_state(page, "running")
    by_id(page, "finish").click()
    by_id(page, "confirm-finish").click()
    expect(by_id(page, "receipt-sim-1")).to_contain_text("acknowledged the stop")
    expect_state(page, "finished")


def test_with_the_service_gone_the_mission_is_not_green(page: Page, service: Service) -> None:
    mission = service.create(name="Not green")
    service.act(mission, "start")
    show(page, mission)
    expect(by_id(page, "mission-state")).to_have_attribute("data-live", "true")
    service.kill()
    try:
        expect(by_id(page, "mission-state")).to_have_attribute("data-live", "false")
        expect(by_id(page, "mission-state")).to_contain_text("Running when last heard")
        expect(by_id(page, "mission-state")).to_have_class(re.compile("unknown"))
        expect(by_id(page, "state-sim-1")).to_contain_text("when last heard")
        expect(by_id(page, "state-sim-1")).not_to_have_class(re.compile("good"))
        expect(by_id(page, f"listed-{mission}")).to_contain_text("Running when last heard")
    finally:
        service.start()
    expect(by_id(page, "mission-state")).to_have_attribute("data-live", "true")


def test_a_stop_of_a_service_that_hangs_can_be_given_again(page: Page, service: Service) -> None:
    mission = service.create(name="Hangs")
    service.act(mission, "start")
    show(page, mission)
    expect(by_id(page, "mission-state")).to_have_attribute("data-live", "true")
    os.kill(service.pid, signal.SIGSTOP)
    try:
        by_id(page, "abort").click()
        by_id(page, "abort-confirm").click()
        expect(by_id(page, "abort-dialog")).to_contain_text("may or may not have reached it")
        expect(by_id(page, "abort-confirm")).to_be_enabled()
        by_id(page, "abort-confirm").click()
    finally:
        os.kill(service.pid, signal.SIGCONT)
    expect(by_id(page, "mission-state")).to_contain_text("Aborted")


def test_an_entry_into_a_zone_is_told_over_the_map_and_on_the_card(page: Page, service: Service) -> None:
    zone = [[-8.7047, 41.1852], [-8.7045, 41.1852], [-8.7045, 41.1853], [-8.7047, 41.1853], [-8.7047, 41.1852]]
    mission = service.create(
        name="Zone",
        vehicles=[{"name": "rover", "kind": "rest"}],
        keep_out=[{"type": "Polygon", "coordinates": [zone]}],
    )
    time_s = itertools.count(1_795_225_140.0, 10.0)

    def heard(lat_deg: float, lon_deg: float) -> None:
        place = {"lat_deg": lat_deg, "lon_deg": lon_deg, "depth_m": 2.0, "range_m": 5.0}
        item = place | {"vehicle": "rover", "time_s": next(time_s)}
        service.post(f"/missions/{mission}/measurements", {"items": [item]})

    inside = 41.18525, -8.7046
    heard(41.1851, -8.7049)
    service.act(mission, "start")
    show(page, mission)
    expect(by_id(page, "step")).not_to_have_text("0")
    heard(*inside)
    expect(by_id(page, "alarms")).to_contain_text("rover is in keep-out zone 1")
    expect(by_id(page, "state-rover")).to_contain_text("In keep-out zone 1")
    expect(by_id(page, "vehicle-mark-rover")).to_contain_text("in keep-out zone 1")
    # A vehicle that is silent for half a minute counts as lost, which is another alarm.
    heard(*inside)
    other = page.context.new_page()
    other.goto(page.url)
    expect(by_id(other, "alarms")).to_contain_text("rover is in keep-out zone 1")
    heard(*inside)
    # Who looks at the past is told of the present's alarms, too.
    by_id(other, "slider").fill("1")
    expect(by_id(other, "replayed-at")).to_contain_text("UTC")
    expect(by_id(other, "alarms")).to_contain_text("rover is in keep-out zone 1")
    heard(*inside)
    # One that stays in a zone is another alarm after a while, and who took this one is told beside it.
    entry = re.compile("rover is in keep-out zone 1, at 2.0 m depth")
    by_id(page, "alarms").locator("li", has_text=entry).get_by_role("button", name="Take it").click()
    for either in (page, other):
        expect(by_id(either, "alarms").locator("li", has_text=entry)).to_have_count(0)
        expect(by_id(either, "taken-alarm")).to_contain_text("took “rover is in keep-out zone 1, at 2.0 m")
    other.close()


def test_a_mission_is_copied_with_other_names_and_deleted_while_it_is_empty(page: Page, service: Service) -> None:
    mission = service.create(name="Original", vehicles=PAIR, seed=7)
    show(page, mission)
    by_id(page, "copy-mission").click()
    by_id(page, "vehicle-sim-1").fill("north")
    by_id(page, "field-name").fill("Another")
    by_id(page, "create-mission").click()
    expect(by_id(page, "mission-name")).to_have_text("Another")
    expect(by_id(page, "card-north")).to_be_visible()
    [copy] = [one for one in service.get("/missions") if one["name"] == "Another"]
    spec = service.get(f"/missions/{copy['id']}")["spec"]
    assert [vehicle["name"] for vehicle in spec["vehicles"]] == ["north", "sim-2"]
    assert spec["seed"] == 7
    by_id(page, "delete-mission").click()
    by_id(page, "confirm-delete").click()
    expect(by_id(page, f"mission-{copy['id']}")).to_be_hidden()
    assert copy["id"] not in [one["id"] for one in service.get("/missions")]


def test_the_map_goes_to_an_area_that_is_typed_or_read_from_a_file(page: Page, service: Service) -> None:
    page.goto("/")
    expect(by_id(page, "map")).to_have_attribute("data-ready", "true")
    by_id(page, "new-mission").click()
    by_id(page, "field-latitude").fill("60.1")
    by_id(page, "field-longitude").fill("25.2")
    expect(page.locator(".grid-labels")).to_contain_text("60.1")
    far = [[[lon, lat] for lon, lat in AREA["coordinates"][0]]]
    apart = [[[lon + 0.01, lat] for lon, lat in AREA["coordinates"][0]]]
    text = {"type": "MultiPolygon", "coordinates": [far, apart]}
    import json

    by_id(page, "area-file").set_input_files(
        {"name": "two.geojson", "mimeType": "application/geo+json", "buffer": json.dumps(text).encode()}
    )
    expect(by_id(page, "area-note")).to_contain_text("1 more area lies apart and is left out")
    expect(page.locator(".grid-labels")).to_contain_text("41.18")
    by_id(page, "other-area-1").click()
    expect(page.locator(".grid-labels")).to_contain_text("8.69")


def test_both_ends_of_the_colour_range_are_kept_and_a_wrong_one_is_explained(page: Page, service: Service) -> None:
    mission = service.create(name="Both ends")
    service.act(mission, "start")
    show(page, mission)
    low, high = by_id(page, "range-low"), by_id(page, "range-high")
    low.fill("8")
    # What appears beside them meanwhile may move them from under a click.
    low.press("Tab")
    expect(high).to_be_focused()
    high.fill("4")
    expect(by_id(page, "range-fault")).to_contain_text("The lower end, 8, must be below the upper one, 4")
    high.fill("12")
    high.press("Enter")
    expect(by_id(page, "range-fault")).to_be_hidden()
    page.reload()
    expect(low).to_have_value("8")
    expect(high).to_have_value("12")
    by_id(page, "range-fit").click()


LEAVES_THE_FIELD_AS_NEW_DATA_COME = """([low, high]) => {
    const scale = document.querySelector(".range .scale");
    low.focus();
    low.value = "-8";
    low.dispatchEvent(new InputEvent("input", { bubbles: true }));
    return new Promise((done) => {
        // Told as soon as the new range stands in the page, before anything is painted.
        const watch = new MutationObserver(() => {
            watch.disconnect();
            low.blur();
            Promise.resolve().then(() => { high.focus(); done(); });
        });
        watch.observe(scale, { attributeFilter: ["aria-label"] });
    });
}"""


def test_what_is_typed_of_the_colour_range_outlasts_data_that_come_as_its_field_is_left(
    page: Page, service: Service
) -> None:
    mission = service.create(name="Typed")
    service.act(mission, "start")
    show(page, mission)
    low, high = by_id(page, "range-low"), by_id(page, "range-high")
    expect(low).to_be_visible()
    page.evaluate(LEAVES_THE_FIELD_AS_NEW_DATA_COME, [low.element_handle(), high.element_handle()])
    expect(by_id(page, "range-fit")).to_be_visible()
    high.fill("-9")
    expect(by_id(page, "range-fault")).to_contain_text("The lower end, -8, must be below the upper one, -9")
    by_id(page, "range-fit").click()
    expect(by_id(page, "range-fault")).to_be_hidden()
    expect(low).not_to_have_value("-8")
    expect(high).not_to_have_value("-9")


def test_a_replay_shows_the_figures_of_its_step(page: Page, service: Service) -> None:
    mission = service.create(name="Then", steps=6)
    service.act(mission, "start")
    show(page, mission)
    expect_state(page, "finished")
    now = by_id(page, "distance").inner_text()
    by_id(page, "slider").fill("1")
    expect(by_id(page, "replayed-at")).to_contain_text("Replay")
    expect(by_id(page, "distance")).not_to_have_text(now)
    first = next(step for step in service.get(f"/missions/{mission}/steps") if step["number"] == 1)
    expect(by_id(page, "soundings")).to_have_text(str(first["soundings"]))
    by_id(page, "to-present").click()
    expect(by_id(page, "distance")).to_have_text(now)
