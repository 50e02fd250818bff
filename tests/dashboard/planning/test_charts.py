"""What a chart shows to keep out of is chosen in the form, in Chromium."""

import json
from pathlib import Path

import pytest
from playwright.sync_api import FilePayload, expect

from tests.support.dashboard.browser import Watched
from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, picture
from tests.support.mapping.enc import Cell

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]

WEST, SOUTH, EAST, NORTH = -8.705, 41.185, -8.703, 41.187
RING = [[WEST, SOUTH], [EAST, SOUTH], [EAST, NORTH], [WEST, NORTH], [WEST, SOUTH]]


@pytest.fixture
def cell(tmp_path: Path) -> bytes:
    made = Cell()
    made.area(
        "M_QUAL", [(WEST - 1, SOUTH - 1), (EAST + 1, SOUTH - 1), (EAST + 1, NORTH + 1), (WEST - 1, NORTH + 1)], CATZOC=1
    )
    made.point("UWTROC", (WEST + 1e-3, SOUTH + 1e-3), VALSOU=1.5, OBJNAM="<b>Rock</b>")
    made.area("PONTON", [(WEST, SOUTH), (WEST + 2e-4, SOUTH), (WEST + 2e-4, SOUTH + 2e-4), (WEST, SOUTH + 2e-4)])
    return made.write(tmp_path / "cell.000")


def test_zones_of_a_chart_are_proposed_and_those_that_are_ticked_are_kept_out_of(
    watched: Watched, service: Service, cell: bytes
) -> None:
    page = watched.page
    page.goto("/")
    expect(by_id(page, "map")).to_have_attribute("data-ready", "true")
    by_id(page, "new-mission").click()
    area = json.dumps({"type": "Polygon", "coordinates": [RING]}).encode()
    by_id(page, "area-file").set_input_files(FilePayload(name="a.geojson", mimeType="application/json", buffer=area))
    wrong = FilePayload(name="b.000", mimeType="application/octet-stream", buffer=b"no chart" * 10)
    by_id(page, "chart-file").set_input_files(wrong)
    expect(page.get_by_role("alert").filter(has_text="ENC cell")).to_be_visible()
    chart = FilePayload(name="PT426101.000", mimeType="application/octet-stream", buffer=cell)
    by_id(page, "chart-file").set_input_files(chart)
    zones = by_id(page, "chart-zones")
    expect(zones).to_contain_text("2 zones on the chart")
    rock = zones.get_by_label("rock <b>Rock</b>, 1.5 m (± 5 m)")
    pontoon = zones.get_by_label("pontoon")
    expect(rock).not_to_be_checked()
    rock.check()
    pontoon.check()
    pontoon.uncheck()
    picture(page, "chart-zones")
    expect(page.get_by_text("Zone 1")).to_be_visible()
    expect(page.get_by_text("Zone 2")).to_have_count(0)
    # Removed below the map it is not ticked any more.
    page.get_by_label("Remove keep-out zone 1").click()
    expect(rock).not_to_be_checked()
    rock.check()
    by_id(page, "field-name").fill("Off the pontoon")
    by_id(page, "create-mission").click()
    expect(by_id(page, "mission-form")).to_be_hidden()
    newest = service.get("/missions")[0]["id"]
    (zone,) = service.get(f"/missions/{newest}")["spec"]["keep_out"]
    (ring,) = zone["coordinates"]
    assert min(lon for lon, _ in ring) < WEST + 1e-3 < max(lon for lon, _ in ring)


def test_reading_a_chart_is_cancelled(watched: Watched, cell: bytes) -> None:
    page = watched.page
    # It never arrives: what the page does while it waits is what is looked at.
    page.route("**/chart-zones?*", lambda _route: None)
    page.goto("/")
    expect(by_id(page, "map")).to_have_attribute("data-ready", "true")
    by_id(page, "new-mission").click()
    area = json.dumps({"type": "Polygon", "coordinates": [RING]}).encode()
    by_id(page, "area-file").set_input_files(FilePayload(name="a.geojson", mimeType="application/json", buffer=area))
    chart = FilePayload(name="PT426101.000", mimeType="application/octet-stream", buffer=cell)
    expect(by_id(page, "chart-cancel")).to_have_count(0)
    by_id(page, "chart-file").set_input_files(chart)
    expect(page.get_by_text("The chart is being read…")).to_be_visible()
    by_id(page, "chart-cancel").click()
    expect(page.get_by_text("Zones from a chart (ENC)…")).to_be_visible()
    expect(by_id(page, "chart-cancel")).to_have_count(0)
    expect(page.locator(".chart-zones").get_by_role("alert")).to_have_count(0)
    page.unroute_all(behavior="ignoreErrors")
    by_id(page, "chart-file").set_input_files(chart)
    expect(by_id(page, "chart-zones")).to_contain_text("2 zones on the chart")
