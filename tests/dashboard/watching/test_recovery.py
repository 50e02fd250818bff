"""Vehicles that go home, in Chromium with simulated vehicles."""

import re
from collections.abc import Sequence

import pytest
from playwright.sync_api import Page, expect

from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, expect_state, show
from tests.support.missions.specs import lon_lat, rectangle

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]

PAIR = [{"name": f"sim-{n}", "kind": "sim", "sensor": "dvl"} for n in (1, 2)]
NEAR, FAR = [-8.7046, 41.1849], [-8.7046, 41.1800]
"""Just outside the area, and so far from it that nobody gets there during a test."""


def under_way(page: Page, service: Service, name: str, point: list[float], **changes: object) -> str:
    """A mission with a recovery point, shown, in which somebody has begun a leg."""
    mission = service.create(name=name, recovery={"point": point}, **({"vehicles": PAIR} | changes))
    service.act(mission, "start")
    show(page, mission)
    expect(by_id(page, "step")).not_to_have_text("0")
    return mission


def expect_homecoming(page: Page, end: str, names: Sequence[str]) -> None:
    expect(by_id(page, "mission-state")).to_contain_text(f"Returning home; then {end}")
    expect_state(page, end)
    for name in names:
        expect(by_id(page, f"state-{name}")).to_contain_text("Home")
        expect(by_id(page, f"vehicle-mark-{name}")).to_have_attribute("data-stage", "home")


def test_a_mission_is_finished_once_everybody_is_home(page: Page, service: Service) -> None:
    under_way(page, service, "Finished at home", NEAR)
    by_id(page, "toggle-legend").click()
    expect(by_id(page, "stage-legend")).to_contain_text("returning")
    by_id(page, "finish").click()
    expect(by_id(page, "finish-return")).to_be_checked()
    by_id(page, "confirm-finish").click()
    expect(by_id(page, "finish-returning")).to_contain_text("on their way home")
    by_id(page, "finish-close").click()
    expect_homecoming(page, "finished", ["sim-1", "sim-2"])


def test_an_abort_may_bring_everybody_home(page: Page, service: Service) -> None:
    under_way(page, service, "Aborted at home", NEAR, vehicles=PAIR[:1])
    by_id(page, "abort").click()
    expect(by_id(page, "abort-confirm")).to_have_text("Stop now")
    by_id(page, "abort-return").click()
    by_id(page, "abort-close").click()
    expect_homecoming(page, "aborted", ["sim-1"])


@pytest.mark.parametrize(
    ("button", "confirm", "end"), [("finish", "confirm-finish", "finished"), ("abort", "abort-return", "aborted")]
)
def test_vehicles_on_their_way_home_are_stopped(
    page: Page, service: Service, button: str, confirm: str, end: str
) -> None:
    under_way(page, service, f"Stopped, {end}", FAR)
    by_id(page, button).click()
    by_id(page, confirm).click()
    by_id(page, f"{button}-close").click()
    expect(by_id(page, "state-sim-1")).to_contain_text("Returning home")
    by_id(page, "stop-now").click()
    by_id(page, {"finish": "confirm-finish", "abort": "abort-confirm"}[button]).click()
    expect(by_id(page, "receipt-sim-1")).to_contain_text("acknowledged the stop")
    expect_state(page, end)
    expect(by_id(page, "stop-now")).to_be_hidden()


def test_a_vehicle_is_held_and_resumed(page: Page, service: Service) -> None:
    # With room for a circle.
    starts = [lon_lat(35.0, 60.0), lon_lat(85.0, 60.0)]
    vehicles = [vehicle | {"start": start} for vehicle, start in zip(PAIR, starts, strict=True)]
    under_way(page, service, "One waits", NEAR, area=rectangle(0, 0, 120, 120), vehicles=vehicles)
    by_id(page, "hold-sim-1").click()
    expect(by_id(page, "withdrawn-sim-1")).to_contain_text("held by local operator")
    expect(by_id(page, "state-sim-1")).to_contain_text("Waits in circles")
    expect(by_id(page, "hold-sim-1")).to_have_count(0)
    # Holding everybody is a pause.
    expect(by_id(page, "hold-sim-2")).to_be_visible()
    by_id(page, "resume-sim-1").click()
    expect(by_id(page, "hold-sim-1")).to_be_visible()
    expect(by_id(page, "hold-sim-2")).to_be_visible()
    expect(by_id(page, "state-sim-1")).not_to_contain_text("Waits in circles")


def test_one_vehicle_goes_home_and_surveys_again(page: Page, service: Service) -> None:
    under_way(page, service, "One goes home", NEAR, vehicles=[PAIR[0], PAIR[1] | {"endurance_min": 90.0}])
    words = r"min.left · way.home.takes.+turn.back.at.\d\d:\d\d.UTC"
    expect(by_id(page, "range-sim-2")).to_have_text(re.compile(words))
    by_id(page, "return-sim-1").click()
    expect(by_id(page, "vehicle-mark-sim-1")).to_have_attribute("data-stage", "returning")
    expect(by_id(page, "withdrawn-sim-1")).to_contain_text("called home by")
    expect(by_id(page, "return-sim-1")).to_be_hidden()
    expect(by_id(page, "return-sim-2")).to_be_visible()
    by_id(page, "resume-sim-1").click()
    expect(by_id(page, "withdrawn-sim-1")).to_be_hidden()
    expect(by_id(page, "return-sim-1")).to_be_visible()
    expect_state(page, "running")


def test_a_recovery_point_is_picked_in_the_form(page: Page, service: Service) -> None:
    page.goto("/")
    expect(by_id(page, "map")).to_have_attribute("data-ready", "true")
    by_id(page, "new-mission").click()
    by_id(page, "field-name").fill("Comes home")
    expect(by_id(page, "field-on_finish")).to_be_hidden()
    by_id(page, "pick-recovery").click()
    page.mouse.click(720, 500)
    expect(by_id(page, "field-recovery")).to_have_value(re.compile(r"^41\.\d+, -8\.\d+$"))
    by_id(page, "field-on_lost_link").select_option("stop")
    page.get_by_text("Single vehicles: speed, endurance").click()
    by_id(page, "endurance_min-sim-2").fill("90")
    by_id(page, "pick-recovery_point-sim-2").click()
    page.mouse.click(740, 480)
    expect(by_id(page, "field-recovery_point-sim-2")).to_have_value(re.compile(r"^41\.\d+, -8\.\d+$"))
    by_id(page, "create-mission").click()
    expect(by_id(page, "mission-name")).to_have_text("Comes home")
    made = next(m for m in service.get("/missions") if m["name"] == "Comes home")
    spec = service.get(f"/missions/{made['id']}")["spec"]
    assert (spec["recovery"]["radius_m"], spec["recovery"]["on_lost_link"]) == (25.0, "stop")
    assert [vehicle["endurance_min"] for vehicle in spec["vehicles"]] == [None, 90.0]
    assert [vehicle["recovery_point"] is None for vehicle in spec["vehicles"]] == [True, False]
