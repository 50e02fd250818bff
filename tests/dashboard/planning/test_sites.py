"""Sites on the page: a survey that belongs to one begins with what its earlier surveys found."""

import pytest
from playwright.sync_api import Page, expect

from tests.support.api.rest import mission_spec, soundings
from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id
from tests.support.missions.specs import rectangle

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]

AREA = rectangle(0, 0, 50, 50)
START_S, DAY_S = 1_600_000_000.0, 86_400.0


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
    by_id(page, "show-site-found").click()
    expect(by_id(page, "site-view").get_by_test_id("site-name")).to_have_value("Old quay")
    by_id(page, "sites-close").click()
    expect(by_id(page, "field-name")).to_have_value("Day 3")


def test_what_is_known_of_a_site_is_shown_and_saved(page: Page, service: Service) -> None:
    site = service.post("/sites", {"name": "Stone quay", "area": AREA, "cell_m": 2.0})["id"]
    service.post("/sites", {"name": "Wooden quay", "area": AREA, "cell_m": 2.0})
    missions = []
    for number, shoaler_m in ((1, 0.0), (2, 0.0), (3, 1.5)):
        mission = service.post("/missions", mission_spec(name=f"Day {number}", area=AREA, site=site))["id"]
        items = [
            item | {"range_m": item["range_m"] - shoaler_m} for item in soundings(60, start_s=START_S + number * DAY_S)
        ]
        service.post(f"/missions/{mission}/measurements", {"items": items})
        service.act(mission, "abort")
        missions.append(mission)
        assert service.get(f"/sites/{site}/surveys")[number - 1]["surveyed"]
    page.goto("/")
    by_id(page, "open-sites").click()
    by_id(page, "shown-site").select_option("Stone quay")
    rows = by_id(page, "site-surveys").locator("tbody tr")
    expect(rows).to_have_count(3)
    expect(rows.nth(2)).to_contain_text("Day 3")
    expect(by_id(page, "site-map")).to_be_visible()
    wide = "image => image.naturalWidth"
    assert by_id(page, "site-map").evaluate(wide) > 300

    found = service.get(f"/sites/{site}/changes")
    expect(by_id(page, "changes")).to_contain_text(f"{found['significant_pct']:.1f} % changed")
    assert found["largest_m"] < 0.0
    expect(by_id(page, "changes-picture")).to_be_visible()
    assert by_id(page, "changes-picture").evaluate(wide) == 25
    expect(by_id(page, "changes-from")).to_have_value(missions[1])
    by_id(page, "changes-to").select_option(missions[0])
    same = service.get(f"/sites/{site}/changes?from={missions[1]}&to={missions[0]}")
    expect(by_id(page, "changes")).to_contain_text(f"{same['significant_pct']:.1f} % changed")
    for button, name in (
        ("changes-file-csv", "stone-quay-changes.csv"),
        ("site-file-dxf", "stone-quay.dxf"),
    ):
        with page.expect_download() as download:
            by_id(page, button).click()
        assert download.value.suggested_filename == name
    by_id(page, "site-crs").select_option("utm")
    with page.expect_download() as download:
        by_id(page, "site-file-tif").click()
    assert download.value.suggested_filename == "stone-quay-epsg32629.tif"
    rows.first.get_by_role("link").click()
    expect(by_id(page, "sites-dialog")).to_be_hidden()
    expect(by_id(page, "mission-name")).to_have_text("Day 1")


def test_surveys_that_cannot_be_compared_are_told_of_in_words(page: Page, service: Service) -> None:
    site = service.post("/sites", {"name": "Tidal quay", "area": AREA, "cell_m": 2.0})["id"]
    missions = []
    for number in (1, 2):
        tide = {"level_m": 1.0, "source": "gauge"} if number == 2 else {}
        mission = service.post("/missions", mission_spec(name=f"Tide {number}", area=AREA, site=site, tide=tide))["id"]
        service.post(f"/missions/{mission}/measurements", {"items": soundings(60, start_s=START_S + number * DAY_S)})
        service.act(mission, "abort")
        missions.append(mission)
        assert service.get(f"/sites/{site}/surveys")[number - 1]["surveyed"]
    page.goto("/")
    by_id(page, "open-sites").click()
    shown = by_id(page, "site-view").get_by_role("region", name="Changes", exact=True)
    expect(shown.get_by_role("alert")).to_contain_text("no two of these surveys have depths below one datum")
    expect(shown.get_by_role("alert")).to_contain_text("Tide 1 below instantaneous water level")
    expect(by_id(page, "changes-from")).to_have_value("")
    third = service.post("/missions", mission_spec(name="Tide 3", area=AREA, site=site))["id"]
    service.post(f"/missions/{third}/measurements", {"items": soundings(60, start_s=START_S + 3 * DAY_S)})
    service.act(third, "abort")
    assert service.get(f"/sites/{site}/surveys")[2]["surveyed"]
    by_id(page, "sites-close").click()
    by_id(page, "open-sites").click()
    expect(by_id(page, "changes")).to_contain_text("Tide 3")
    expect(by_id(page, "changes-from")).to_have_value(missions[0])
    expect(shown).to_contain_text("Tide 2 is left out: its depths are below EPSG:5861")


def test_a_site_is_changed_and_an_empty_one_deleted(page: Page, service: Service) -> None:
    site = service.post("/sites", {"name": "Quay", "area": AREA, "cell_m": 2.0})["id"]
    page.goto("/")
    by_id(page, "open-sites").click()
    page.get_by_text("Change or delete this site").click()
    expect(by_id(page, "site-name")).to_have_value("Quay", timeout=90_000)
    expect(page.get_by_text("No survey of it has ended yet.")).to_be_visible()
    by_id(page, "site-yearly").fill("")
    by_id(page, "change-site").click()
    expect(by_id(page, "site-view").get_by_role("alert")).to_contain_text("Type a number into each field")
    by_id(page, "site-yearly").fill("0,2")
    by_id(page, "site-cell").fill("0.001")
    by_id(page, "change-site").click()
    expect(by_id(page, "site-view").get_by_role("alert")).to_contain_text("cell_m")
    assert service.get(f"/sites/{site}")["yearly_change_m"] == 0.0
    by_id(page, "site-cell").fill("2")
    by_id(page, "site-name").fill("Quay of 1890")
    with page.expect_response(lambda answer: answer.request.method == "PATCH"):
        by_id(page, "change-site").click()
    changed = service.get(f"/sites/{site}")
    assert (changed["name"], changed["yearly_change_m"]) == ("Quay of 1890", 0.2)
    by_id(page, "delete-site").click()
    with page.expect_response(lambda answer: answer.request.method == "DELETE"):
        by_id(page, "confirm-delete-site").click()
    expect(page.get_by_text("Quay of 1890")).to_have_count(0)
    assert site not in [one["id"] for one in service.get("/sites")]


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
