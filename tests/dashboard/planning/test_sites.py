"""Sites on the page: a survey that belongs to one begins with what its earlier surveys found."""

import pytest
from playwright.sync_api import Page, expect

from tests.support.api.rest import mission_spec, soundings
from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id
from tests.support.missions.specs import rectangle

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]

AREA = rectangle(0, 0, 50, 50)


def test_a_site_is_chosen_in_the_form_with_its_surveys_and_what_changed(page: Page, service: Service) -> None:
    site = service.post("/sites", {"name": "Old quay", "area": AREA, "cell_m": 2.0})["id"]
    for number in (1, 2):
        mission = service.post(
            "/missions",
            mission_spec(name=f"Day {number}", area=AREA, site=site),
        )["id"]
        service.post(f"/missions/{mission}/measurements", {"items": soundings(20)})
        service.act(mission, "abort")
        assert service.get(f"/sites/{site}/surveys")[number - 1]["surveyed"]
    page.goto("/")
    by_id(page, "new-mission").click()
    by_id(page, "field-name").fill("Day 3")
    page.get_by_text("Site that is surveyed again").click()
    by_id(page, "site").select_option("Old quay")
    expect(by_id(page, "surveys").get_by_role("listitem")).to_have_count(2)
    expect(by_id(page, "surveys")).to_contain_text("Day 1")
    expect(by_id(page, "changes")).to_contain_text("0.0 % changed (5 % is chance)")
    with page.expect_download() as download:
        by_id(page, "changes-file").click()
    assert download.value.suggested_filename == "old-quay-changes.tif"


def test_a_site_is_made_of_the_area_that_is_described(page: Page, service: Service) -> None:
    page.goto("/")
    by_id(page, "new-mission").click()
    by_id(page, "field-name").fill("Harbour mouth")
    page.get_by_text("Site that is surveyed again").click()
    room = "button => [button.scrollWidth - button.clientWidth, button.scrollHeight - button.clientHeight]"
    assert by_id(page, "make-site").evaluate(room) == [0, 0]
    by_id(page, "make-site").click()
    expect(by_id(page, "site")).not_to_have_value("")
    expect(page.get_by_text("No survey of it has ended yet.")).to_be_visible()
    site = service.get("/sites")[0]
    assert site["name"] == "Harbour mouth"
    by_id(page, "create-mission").click()
    expect(by_id(page, "mission-form")).to_be_hidden()
    (made,) = [one for one in service.get("/missions") if one["name"] == "Harbour mouth"]
    assert service.get(f"/missions/{made['id']}")["spec"]["site"] == site["id"]
