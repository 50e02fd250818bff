"""Watching a mission: orders from the map and the cards, what needs a person, log and charts, in Chromium."""

import math
import re
import time
from collections.abc import Callable
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.support.dashboard.browser import PATIENCE_MS
from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, click_round, show

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]

PAIR = [{"name": name, "kind": "sim", "sensor": "dvl"} for name in ("north", "south")]
AREA = {
    "type": "Polygon",
    "coordinates": [[[-8.705, 41.185], [-8.7026, 41.185], [-8.7026, 41.1868], [-8.705, 41.1868], [-8.705, 41.185]]],
}


def under_way(page: Page, service: Service, **changes: Any) -> str:
    """A mission of two vehicles on lines, shown."""
    mission = service.create(
        **{
            "name": "Watched",
            "area": AREA,
            "vehicles": PAIR,
            "steps": 2000,
            "planner": {"name": "lawnmower"},
            "recovery": {"point": [-8.7049, 41.1851]},
        }
        | changes
    )
    service.act(mission, "start")
    show(page, mission)
    expect(by_id(page, "step")).not_to_have_text("0")
    return mission


def orders(service: Service, mission: str) -> list[tuple[str, str, str]]:
    found = service.get(f"/missions/{mission}/orders")
    return [(order["vehicle"], order["kind"], order["state"]) for order in found[::-1]]


def test_vehicles_are_ordered_from_the_map_and_from_their_cards(page: Page, service: Service) -> None:
    mission = under_way(page, service)
    page.mouse.click(640, 420, button="right")
    expect(by_id(page, "map-menu")).to_contain_text(re.compile(r"Send (north|south) here \(\d+ m\)"))
    page.keyboard.press("Escape")
    expect(by_id(page, "map-menu")).to_have_count(0)
    page.mouse.click(640, 420, button="right")
    by_id(page, "menu-go-north").click()
    expect(by_id(page, "order-north")).to_contain_text("Goes where it was sent: ordered by local operator")
    by_id(page, "end-order-north").click()
    expect(by_id(page, "order-north")).to_have_count(0)

    by_id(page, "go-south").click()
    by_id(page, "go-place-south").fill("41.1999 N 8.7040 W")
    by_id(page, "go-send-south").click()
    expect(by_id(page, "refusal")).to_contain_text("outside the area")
    page.get_by_role("button", name="Taken").click()
    page.mouse.click(640, 420)
    expect(by_id(page, "order-south")).to_contain_text("Goes where it was sent")

    page.mouse.click(600, 380, button="right")
    by_id(page, "menu-denser").click()
    expect(by_id(page, "draws-denser")).to_be_visible()
    click_round(page, [(600, 380), (680, 380), (680, 450), (600, 450)])
    by_id(page, "denser-spacing").fill("6")
    by_id(page, "denser-vehicle").select_option("north")
    by_id(page, "denser-send").click()
    expect(by_id(page, "order-north")).to_contain_text(re.compile(r"Surveys a part denser(, next)?, \d+ lines"))
    expect(by_id(page, "denser")).to_have_count(0)
    by_id(page, "skip-south").click()
    expect(by_id(page, "refusal")).to_contain_text("not its own lines")
    kinds = [(vehicle, kind) for vehicle, kind, _ in orders(service, mission)]
    assert kinds == [("north", "go"), ("south", "go"), ("north", "denser")]


def test_one_glance_tells_what_needs_a_person(page: Page, service: Service) -> None:
    mission = under_way(page, service, name="Glance")
    by_id(page, "hold-north").click()
    by_id(page, "hold-south").click()
    expect(by_id(page, "attention")).to_contain_text("waits: held by local operator")
    by_id(page, "attention-more").click()
    for name in ("north", "south"):
        expect(by_id(page, f"matter-vehicle-{name}")).to_contain_text("What to do: resume its survey, or bring it home")
    by_id(page, "resume-north").click()
    by_id(page, "resume-south").click()
    expect(by_id(page, "attention")).to_have_count(0)

    # The card of one that left stays, with the ways back.
    service.post(f"/missions/{mission}/vehicles/south/abort", {})
    expect(by_id(page, "matter-vehicle-south")).to_contain_text("left the mission and nobody leads it")
    by_id(page, "bring-home-south").click()
    expect(by_id(page, "withdrawn-south")).to_contain_text("called home by")

    by_id(page, "toggle-log").click()
    by_id(page, "log-vehicle").select_option("north")
    lines = by_id(page, "log").locator("li")
    expect(lines.first).to_contain_text("north")
    # Lines of south are gone; one of north may name it.
    expect(by_id(page, "log").locator("li", has_text=re.compile("south (holds|goes|left)|called home"))).to_have_count(
        0
    )
    lines.get_by_role("button", name=re.compile("north holds")).click()
    by_id(page, "go-to").click()
    expect(page.get_by_role("button", name="Unmark")).to_be_visible()

    by_id(page, "toggle-charts").click()
    plot = by_id(page, "charts").locator("figure", has_text="Depth of vehicles")
    expect(plot).to_contain_text(re.compile(r"north \d(\.\d+)? m now"))
    plot.get_by_role("button", name="Larger").click()
    expect(plot.locator("canvas")).to_be_visible()
    with page.expect_download() as waited:
        plot.get_by_role("button", name="CSV").click()
    assert waited.value.suggested_filename == "depth-of-vehicles.csv"
    assert waited.value.path().read_text().startswith("time_utc,north (m),south (m)")
    with page.expect_download() as waited:
        plot.get_by_role("button", name="PNG").click()
    assert waited.value.path().read_bytes().startswith(b"\x89PNG")


def test_a_killed_service_carries_an_accepted_order_out_once(service: Service) -> None:
    mission = service.create(name="Killed", area=AREA, vehicles=PAIR[:1], steps=2000, planner={"name": "lawnmower"})
    service.act(mission, "start")
    wait_until(lambda: service.get(f"/missions/{mission}")["progress"]["step"] > 2)
    place = [-8.7046, 41.1853]
    answer = service.post(f"/missions/{mission}/vehicles/north/go", {"position": place})
    service.kill()
    service.start()

    def ends() -> list[dict[str, Any]]:
        steps = service.get(f"/missions/{mission}/steps?limit=1000")
        legs = [leg for step in steps for leg in step["waypoints"]]
        return [leg for leg in legs if math.dist((leg["lon_deg"], leg["lat_deg"]), place) < 1e-7]

    wait_until(lambda: service.get(f"/missions/{mission}/orders")[0]["state"] == "done")
    step = service.get(f"/missions/{mission}")["progress"]["step"]
    wait_until(lambda: service.get(f"/missions/{mission}")["progress"]["step"] > step + 1)
    assert [(order["id"], order["state"]) for order in service.get(f"/missions/{mission}/orders")] == [
        (answer["id"], "done")
    ]
    assert [leg["status"] for leg in ends()].count("reached") == 1


def wait_until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE_MS / 1000
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.1)
