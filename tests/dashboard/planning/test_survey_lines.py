"""A client's line plan is read from its file, drawn by name and flown as it is given, in Chromium."""

from pathlib import Path

import pytest
from playwright.sync_api import FilePayload, expect

from tests.support.dashboard.browser import Watched
from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, picture
from tests.support.mapping import line_files
from tests.support.mapping.line_files import UTM

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]

WEST, SOUTH = -8.705, 41.185
PLAN = {
    f"L{100 + k}": [(WEST + 2e-4 + 2e-4 * k, SOUTH + 2e-4), (WEST + 2e-4 + 2e-4 * k, SOUTH + 14e-4)] for k in range(8)
}
PLAN["X1"] = [(WEST + 1e-4, SOUTH + 7e-4), (WEST + 9e-4, SOUTH + 8e-4), (WEST + 17e-4, SOUTH + 7e-4)]
BASIN = [(WEST, SOUTH), (WEST + 18e-4, SOUTH), (WEST + 18e-4, SOUTH + 16e-4), (WEST, SOUTH + 16e-4)]


def payload(name: str, content: bytes) -> FilePayload:
    return FilePayload(name=name, mimeType="application/octet-stream", buffer=content)


def test_lines_of_a_plan_come_from_a_file_and_are_what_the_mission_flies(watched: Watched, service: Service) -> None:
    page = watched.page
    page.goto("/")
    expect(by_id(page, "map")).to_have_attribute("data-ready", "true")
    by_id(page, "new-mission").click()
    by_id(page, "planner-lawnmower").click()
    by_id(page, "lines-file").set_input_files(payload("plan.lnw", line_files.lnw(PLAN)))
    expect(page.get_by_role("alert").filter(has_text="does not say what its positions are in")).to_be_visible()
    by_id(page, "lines-crs").fill(UTM)
    by_id(page, "lines-read").click()
    expect(by_id(page, "lines-given")).to_contain_text("9 lines of a plan")
    # There was no area yet that they have to do with: it is around them.
    expect(by_id(page, "area-size")).to_contain_text("corners")
    expect(by_id(page, "field-length")).to_have_value("lines")
    expect(by_id(page, "option-line_heading_deg")).to_have_count(0)
    by_id(page, "lines-as-drawn").check()
    expect(by_id(page, "planned-whole")).to_be_visible()
    expect(by_id(page, "planned")).to_have_attribute("data-plan", "new")
    picture(page, "survey-lines")
    by_id(page, "field-name").fill("The client's lines")
    by_id(page, "create-mission").click()
    expect(by_id(page, "mission-form")).to_be_hidden()
    newest = service.get("/missions")[0]["id"]
    spec = service.get(f"/missions/{newest}")["spec"]
    assert [line["name"] for line in spec["survey_lines"]] == list(PLAN)
    assert all(line["keep_direction"] for line in spec["survey_lines"])
    assert spec["coverage"]["crosslines_pct"] == 0
    picture(page, "survey-lines-on-the-map")
    by_id(page, "edit-mission").click()
    expect(by_id(page, "lines-given")).to_contain_text("9 lines of a plan")
    by_id(page, "lines-remove").click()
    expect(by_id(page, "lines-given")).to_have_count(0)
    by_id(page, "create-mission").click()
    expect(by_id(page, "mission-form")).to_be_hidden()
    assert service.get(f"/missions/{newest}")["spec"]["survey_lines"] == []


def test_an_area_comes_from_a_drawing_of_cad_or_a_shapefile(watched: Watched, tmp_path: Path) -> None:
    page = watched.page
    page.goto("/")
    expect(by_id(page, "map")).to_have_attribute("data-ready", "true")
    by_id(page, "new-mission").click()
    closed = {"Basin": [*BASIN, BASIN[0]]}
    by_id(page, "area-file").set_input_files(payload("basin.zip", line_files.shapefile(closed, tmp_path)))
    expect(by_id(page, "area-note")).to_contain_text("basin.zip: area of 4 corners")
    by_id(page, "area-file").set_input_files(payload("basin.dxf", line_files.dxf(closed, closed=True)))
    by_id(page, "area-crs").fill(UTM)
    by_id(page, "area-read").click()
    expect(by_id(page, "area-note")).to_contain_text("basin.dxf: area of 4 corners")
    by_id(page, "area-file").set_input_files(payload("plan.dxf", b"no drawing"))
    expect(page.get_by_role("alert").filter(has_text="DXF")).to_be_visible()
