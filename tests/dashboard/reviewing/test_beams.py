"""Beams of a multibeam rejected and restored, in space and by what they have in common, in Chromium."""

import pytest
from playwright.sync_api import expect

from tests.support.dashboard.browser import Watched
from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, picture, show, violations
from tests.support.mapping.school import ANGLES, PINGS, surveyed
from tests.support.missions.specs import rectangle

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]

ALL = PINGS * len(ANGLES)


@pytest.fixture
def school(service: Service) -> str:
    """A mission whose multibeam met a school of fish."""
    vehicles = [{"name": "rover", "kind": "rest", "sensor": "multibeam"}]
    mission = service.create(name="Fish", vehicles=vehicles, area=rectangle(0, 0, 60, 60), cell_m=2.0)
    service.post(f"/missions/{mission}/measurements", {"items": surveyed("rover", 1.79e9)})
    service.get(f"/missions/{mission}/map")
    return mission


def test_beams_are_chosen_in_space_rejected_and_taken_back(watched: Watched, service: Service, school: str) -> None:
    page = watched.page
    show(page, school)
    by_id(page, "open-3d").click()
    by_id(page, "toggle-points").click()
    chosen = by_id(page, "points-chosen")
    expect(chosen).to_contain_text(f"{ALL} beams")
    expect(by_id(page, "beams-everywhere")).to_be_disabled()
    lasso = by_id(page, "lasso")
    lasso.focus()
    page.keyboard.press("Enter")
    expect(chosen).to_contain_text(f"of {ALL} beams chosen")
    some = int(chosen.inner_text().split()[0])
    assert 0 < some < ALL
    picture(page, "beams-chosen")
    by_id(page, "points-note").fill("fish")
    lasso.focus()
    page.keyboard.press("Delete")
    expect(by_id(page, "points-undo")).to_be_enabled()
    edits = service.get(f"/missions/{school}/beams/edits")
    assert (edits["rejected"], [(one["beams"], one["note"]) for one in edits["edits"]]) == (some, [(some, "fish")])
    lasso.focus()
    page.keyboard.press("Enter")
    expect(chosen).to_contain_text(f"{some} of {ALL} beams chosen")
    by_id(page, "beams-here").click()
    expect(chosen).to_contain_text("Draw round")
    fewer = int(chosen.inner_text().split()[0])
    assert some <= fewer < ALL
    picture(page, "beams-here")
    with page.expect_response("**/beams/edits/*") as answered:
        by_id(page, "points-undo").click()
    assert answered.value.ok
    expect(by_id(page, "points-undo")).to_be_disabled()
    assert service.get(f"/missions/{school}/beams/edits")["edits"] == []
    by_id(page, "beams-everywhere").click()
    expect(chosen).to_contain_text(f"{ALL} beams")
    assert violations(page) == []
    assert watched.complaints == []


def test_outer_and_shoal_beams_are_rejected_together_and_listed(
    watched: Watched, service: Service, school: str
) -> None:
    page = watched.page
    show(page, school)
    by_id(page, "toggle-soundings").click()
    edits = by_id(page, "beam-edits")
    expect(edits).to_contain_text("0 rejected, 0 restored")
    expect(by_id(page, "range-low")).to_have_value("7")
    by_id(page, "beams-in-common").locator("summary").click()
    by_id(page, "beams-reject").click()
    expect(edits).to_contain_text("it would be all beams")
    by_id(page, "beams-angle").fill("steep")
    by_id(page, "beams-reject").click()
    expect(edits).to_contain_text("number")
    by_id(page, "beams-angle").fill("49,9")
    by_id(page, "beams-vehicle").select_option("rover")
    by_id(page, "beams-note").fill("outer beams")
    by_id(page, "beams-reject").click()
    row = edits.locator("li")
    expect(row).to_have_count(1)
    expect(row).to_contain_text("80")
    expect(row).to_contain_text("rejected · rover · at 49.9° and more")
    expect(row).to_contain_text("local operator · outer beams")
    expect(edits).to_contain_text("80 rejected, 0 restored")
    by_id(page, "beams-angle").fill("")
    by_id(page, "beams-shoaler").fill("9")
    by_id(page, "beams-reject").click()
    expect(row).to_have_count(2)
    expect(row.nth(1)).to_contain_text("shoaler than 9.00 m")
    expect(by_id(page, "range-low")).to_have_value("12")
    picture(page, "beam-edits")
    row.first.get_by_role("button", name="Take back").click()
    expect(row).to_have_count(1)
    expect(row).to_contain_text("shoaler than 9.00 m")
    assert [one["selection"] for one in service.get(f"/missions/{school}/beams/edits")["edits"]] == [
        {"vehicle": "rover", "most_depth_m": 9.0}
        | dict.fromkeys(("area", "from_s", "until_s", "least_depth_m", "least_angle_deg"))
    ]
    assert violations(page) == []
    # The browser's own line for the answer that was refused is no fault of the page.
    assert [line for line in watched.complaints if "422" not in line] == []
