"""What a survey is asked for, as the form and the checklist have it, in Chromium against the real service."""

import re

import pytest
from playwright.sync_api import Page, expect

from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, show
from tests.support.paths import PROJECT

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]

TABLE = PROJECT / "app" / "dashboard" / "web" / "src" / "state" / "form" / "missionFields.ts"


def declared(kind: str) -> set[str]:
    """Names of the fields that the form's table has for missions of a kind, the choice of a length aside."""
    table = TABLE.read_text().partition("VEHICLE_FIELDS")[0]
    entries = re.findall(r"^  (\w+): \{\n(.*?)^  \},\n", table, re.DOTALL | re.MULTILINE)
    lengths = {"minutes", "km_per_vehicle"}
    return {name for name, entry in entries if f'kind: "{kind}"' in entry or "kind:" not in entry} - lengths


@pytest.mark.parametrize("kind", ["survey", "search"])
def test_every_field_of_the_table_is_in_the_form(page: Page, kind: str) -> None:
    names = declared(kind)
    assert {"cell_m", "shoal_depth_m" if kind == "survey" else "reach_m"} <= names
    page.goto("/")
    by_id(page, "new-mission").click()
    by_id(page, f"kind-{kind}").click()
    by_id(page, "field-recovery").fill("41.1850 -8.7050")
    if kind == "survey":
        by_id(page, "template").select_option("Multibeam, full coverage")
    for name in names:
        expect(by_id(page, f"field-{name}")).to_have_count(1)


def test_orders_that_ask_for_the_same_are_one_choice(page: Page) -> None:
    page.goto("/")
    by_id(page, "new-mission").click()
    by_id(page, "field-order").select_option("S-44 Order 1a, Order 1b")
    expect(by_id(page, "field-accuracy_m")).to_have_value("0.255")
    by_id(page, "field-accuracy_m").fill("0.3")
    expect(by_id(page, "field-order")).to_have_value("")


def test_the_checklist_has_the_depth_of_the_bottom_that_the_form_had(page: Page) -> None:
    page.goto("/")
    by_id(page, "new-mission").click()
    by_id(page, "field-name").fill("Twelve metres")
    by_id(page, "field-floor_depth_m").fill("12")
    by_id(page, "create-mission").click()
    expect(by_id(page, "mission-name")).to_have_text("Twelve metres")
    by_id(page, "start").click()
    depth = by_id(page, "preflight-floor_depth_m")
    expect(depth).to_have_value("12")
    expect(by_id(page, "ask-forecast")).to_be_visible()
    depth.fill("abc")
    expect(by_id(page, "preflight")).to_contain_text("Depth of the bottom needs a number")
    expect(depth).to_have_attribute("aria-invalid", "true")
    expect(by_id(page, "ask-forecast")).to_have_count(0)
    depth.fill("")
    expect(by_id(page, "ask-forecast")).to_be_visible()


def test_the_template_for_multibeams_suits_the_simulated_vehicles_of_a_copy(page: Page, service: Service) -> None:
    show(page, service.create(name="By DVL"))
    by_id(page, "copy-mission").click()
    by_id(page, "template").select_option("Multibeam, full coverage")
    by_id(page, "field-name").fill("By multibeam")
    by_id(page, "create-mission").click()
    expect(by_id(page, "mission-name")).to_have_text("By multibeam")
    [made] = [one["id"] for one in service.get("/missions") if one["name"] == "By multibeam"]
    spec = service.get(f"/missions/{made}")["spec"]
    assert spec["planner"]["name"] == "swath"
    assert [vehicle["sensor"] for vehicle in spec["vehicles"]] == ["multibeam"]
