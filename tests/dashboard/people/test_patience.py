"""What takes long says so, and keeps nothing else from being done."""

import re
from pathlib import Path

import pytest
from playwright.sync_api import Page, Route, expect

from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, show

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(600)]


ENDLESS_DECISIONS = """
import threading
from app.missions.flight.decisions import deciding

deciding.decide = lambda *_: threading.Event().wait()
"""
"""The wait ends with the mission and with nothing else."""


def test_the_page_says_that_vehicles_wait_for_a_decision(page: Page, built: None, tmp_path: Path) -> None:
    service = Service(tmp_path, before=ENDLESS_DECISIONS)
    service.start()
    try:
        mission = service.create(name="Thinking", steps=40)
        service.act(mission, "start")
        page.goto(f"{service.url}/#/missions/{mission}")
        expect(by_id(page, "deciding")).to_contain_text("vehicles wait at their waypoints")
        service.act(mission, "abort")
        expect(by_id(page, "deciding")).to_be_hidden()
    finally:
        service.kill()


def test_one_file_that_is_being_made_keeps_no_other_from_being_fetched(page: Page, service: Service) -> None:
    mission = service.create(name="Files", steps=3)
    service.act(mission, "start")
    show(page, mission)
    by_id(page, "toggle-files").click()
    expect(by_id(page, "file-tif")).to_be_enabled()
    held: list[Route] = []

    def hold(route: Route) -> None:
        held.append(route)

    page.route("**/soundings.csv", hold)
    by_id(page, "file-soundings.csv").click()
    expect(by_id(page, "making")).to_contain_text("being made")
    expect(by_id(page, "file-soundings.csv")).to_be_disabled()
    with page.expect_download() as download:
        by_id(page, "file-tif").click()
    assert download.value.suggested_filename.endswith(".tif")
    with page.expect_download() as late:
        held[0].continue_()
    assert late.value.suggested_filename.endswith(".csv")
    expect(by_id(page, "making")).to_be_hidden()
    expect(by_id(page, "file-soundings.csv")).to_be_enabled()


def test_a_note_is_sent_once_and_what_is_typed_meanwhile_stays(page: Page, service: Service) -> None:
    mission = service.create(name="Notes", steps=3)
    show(page, mission)
    by_id(page, "toggle-log").click()
    held: list[Route] = []
    page.route("**/notes", lambda route: held.append(route))
    write, note = by_id(page, "write-note"), by_id(page, "note")
    note.fill("battery changed")
    note.press("Enter")
    expect(write).to_have_attribute("aria-disabled", "true")
    expect(write).to_have_css("cursor", "progress")
    note.press("Enter")
    write.click(force=True)
    expect(write).to_be_focused()
    note.fill("and the other one, too")
    note.press("Enter")
    held[0].continue_()
    page.unroute("**/notes")
    expect(write).not_to_have_attribute("aria-disabled", "true")
    expect(note).to_have_value("and the other one, too")
    note.press("Enter")
    expect(note).to_have_value("")
    expect(write).to_be_disabled()
    by_id(page, "log-level").select_option("notes")
    expect(by_id(page, "log").locator("li .message")).to_have_text(
        [re.compile("and the other one, too"), re.compile("battery changed")]
    )
    assert len(held) == 1
