"""Vehicles' logs, depths to begin with and a reference grid reach a mission from the page, in Chromium."""

import re
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import FilePayload, expect

from app.mapping.coordinates.georeference import LocalFrame
from tests.support.api.rest import soundings
from tests.support.dashboard.browser import Watched
from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, expect_colours, picture, show, violations
from tests.support.imc import log_writer as writer
from tests.support.mapping.multibeam import line, write_kmall
from tests.support.missions.specs import FRAME, rectangle

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]

PINGS = 150
"""45 m of track, all of it in the area."""


def mission_over(service: Service, area: dict[str, Any]) -> str:
    vehicles = [{"name": "rover", "kind": "rest"}]
    return service.create(name="After the dive", area=area, cell_m=2, vehicles=vehicles)


@pytest.fixture
def mission(service: Service) -> str:
    return mission_over(service, rectangle(0, 0, 60, 60))


def file(name: str, content: bytes) -> FilePayload:
    return {"name": name, "mimeType": "application/octet-stream", "buffer": content}


def depths(depth_m: float) -> bytes:
    """A regular grid over the area, as text."""
    spots = [FRAME.to_geographic(float(east), float(north)) for east in range(1, 60, 2) for north in range(1, 60, 2)]
    rows = [f"{float(lon):.7f},{float(lat):.7f},{depth_m}" for lat, lon in spots]
    return "\n".join(["lon,lat,depth", *rows]).encode()


def test_a_log_is_sent_its_counts_are_shown_and_its_soundings_are_on_the_map(
    watched: Watched, service: Service, tmp_path: Path
) -> None:
    page = watched.page
    # The track is in the middle of it.
    mission = mission_over(service, rectangle(-25, 0, 35, 60))
    content = writer.write(tmp_path / "Data.lsf.gz", writer.survey(PINGS + 250)).read_bytes()
    show(page, mission)
    by_id(page, "toggle-imports").click()
    expect(by_id(page, "imports")).to_contain_text("No log was imported yet.")
    expect(by_id(page, "soundings")).to_have_text("0")
    by_id(page, "log-file").set_input_files(files=[file("Data.lsf.gz", content)])
    logs = by_id(page, "logs")
    log = logs.locator("> li")
    expect(log).to_have_attribute("data-state", "done")
    expect(log).to_contain_text(f"Data.lsf.gz, {writer.NAME}")
    found = re.search(r"Soundings: (\d+) accepted, (\d+) rejected, 0 known", log.inner_text())
    assert found
    accepted, rejected = map(int, found.groups())
    assert accepted + rejected == PINGS + 250
    assert rejected > 0
    expect(log).to_contain_text(f"{rejected} × position: ")
    expect(by_id(page, "soundings")).to_have_text(str(accepted))
    picture(page, "imports")
    by_id(page, "log-file").set_input_files(files=[file("Data.lsf.gz", content)])
    expect(log).to_have_count(2)
    expect(log.first).to_contain_text("The whole file was imported before.")
    expect(by_id(page, "soundings")).to_have_text(str(accepted))
    # Figures that a vehicle has not renewed for a while are pale.
    assert [one for one in violations(page) if "depth-rover" not in one] == []
    by_id(page, "toggle-imports").click()
    expect_colours(page)
    assert watched.complaints == []


def test_a_log_is_taken_back_after_a_question_and_counts_again_when_it_is_sent_again(
    watched: Watched, service: Service, tmp_path: Path
) -> None:
    page = watched.page
    mission = mission_over(service, rectangle(-25, 0, 35, 60))
    content = writer.write(tmp_path / "Data.lsf.gz", writer.survey(PINGS)).read_bytes()
    service.post(f"/missions/{mission}/measurements", {"items": soundings(5)})
    show(page, mission)
    by_id(page, "toggle-imports").click()
    by_id(page, "log-vehicle").fill("wrong")
    by_id(page, "log-file").set_input_files(files=[file("Data.lsf.gz", content)])
    log = by_id(page, "logs").locator("> li")
    expect(log).to_have_attribute("data-state", "done")
    expect(by_id(page, "soundings")).to_have_text(str(PINGS + 5))
    by_id(page, "log-delete").click()
    expect(by_id(page, "log-delete-really")).to_have_text("Leave all that it brought out of the map")
    page.get_by_role("button", name="Keep it").click()
    expect(log).to_have_attribute("data-state", "done")
    by_id(page, "log-delete").click()
    by_id(page, "log-delete-really").click()
    expect(log).to_have_attribute("data-state", "taken-back")
    expect(by_id(page, "log-taken-back")).to_contain_text("Taken back by local operator")
    expect(by_id(page, "log-delete")).to_have_count(0)
    expect(by_id(page, "soundings")).to_have_text("5")
    by_id(page, "log-vehicle").fill("")
    by_id(page, "log-file").set_input_files(files=[file("Data.lsf.gz", content)])
    expect(log).to_have_count(2)
    expect(log.first).to_contain_text(f"Soundings: {PINGS} accepted")
    expect(log.first).to_contain_text(writer.NAME)
    expect(by_id(page, "soundings")).to_have_text(str(PINGS + 5))
    assert watched.complaints == []


def test_the_map_is_gone_with_the_last_sounding_that_is_taken_back(
    watched: Watched, service: Service, tmp_path: Path
) -> None:
    page = watched.page
    mission = mission_over(service, rectangle(-25, 0, 35, 60))
    show(page, mission)
    by_id(page, "toggle-imports").click()
    content = writer.write(tmp_path / "Data.lsf.gz", writer.survey(PINGS)).read_bytes()
    by_id(page, "log-file").set_input_files(files=[file("Data.lsf.gz", content)])
    nothing = page.get_by_text("The sea floor appears with the first soundings")
    expect(by_id(page, "soundings")).to_have_text(str(PINGS))
    expect(nothing).to_have_count(0)
    by_id(page, "log-delete").click()
    by_id(page, "log-delete-really").click()
    expect(by_id(page, "soundings")).to_have_text("0")
    expect(nothing).to_be_visible()


def test_whose_a_multibeams_file_is_has_to_be_said_and_what_is_refused_is_told(
    watched: Watched, mission: str, tmp_path: Path
) -> None:
    page = watched.page
    middle = LocalFrame(*(float(value) for value in FRAME.to_geographic(30.0, 30.0)))
    path = tmp_path / "0007.kmall"
    write_kmall(path, line(middle))
    files = [file("0007.kmall", path.read_bytes()), file("Data.lsf", b"nothing of the kind")]
    show(page, mission)
    by_id(page, "toggle-imports").click()
    by_id(page, "log-file").set_input_files(files=files)
    expect(by_id(page, "imports")).to_contain_text("0007.kmall does not tell its vehicle: name it first.")
    by_id(page, "log-vehicle").fill("wam-v")
    by_id(page, "log-file").set_input_files(files=files)
    log = by_id(page, "logs").locator("> li")
    expect(log).to_have_count(2)
    expect(log.first).to_have_attribute("data-state", "failed")
    expect(log.first).to_contain_text("Data.lsf holds no IMC packet. give a DUNE log")
    expect(log.last).to_contain_text("0007.kmall, wam-v")
    expect(log.last).to_contain_text("Pings: 12 accepted, 0 rejected, 0 known already")
    # What the service refuses at once is told beside what was tried.
    by_id(page, "log-vehicle").fill("two words")
    by_id(page, "log-file").set_input_files(files=files[1:])
    expect(by_id(page, "sending-log")).to_contain_text("Data.lsf: ")
    page.get_by_role("button", name="Dismiss").click()
    expect(by_id(page, "sending-log")).to_have_count(0)


def test_depths_to_begin_with_and_a_reference_come_and_go(watched: Watched, service: Service, mission: str) -> None:
    page, path = watched.page, f"/missions/{mission}"
    page.set_viewport_size({"width": 390, "height": 844})
    show(page, mission)
    by_id(page, "toggle-imports").click()
    pane = by_id(page, "imports")
    by_id(page, "prior-file").set_input_files(files=[file("old.csv", depths(9.0))])
    expect(by_id(page, "sending-import")).to_contain_text("state no uncertainty")
    pane.locator("summary").first.click()
    by_id(page, "prior-sd").fill("0,4")
    by_id(page, "prior-source").fill("survey of 2019")
    by_id(page, "prior-file").set_input_files(files=[file("old.csv", depths(9.0))])
    priors = by_id(page, "priors")
    expect(priors).to_contain_text("old.csv")
    expect(priors).to_contain_text("survey of 2019")
    expect(priors).to_contain_text("900 of 900 depths taken, 9.00 m to 9.00 m, ± 0.40 m")
    expect(by_id(page, "sending-import")).to_have_count(0)

    by_id(page, "reference-file").set_input_files(files=[file("truth.csv", depths(9.5))])
    expect(by_id(page, "reference")).to_contain_text("truth.csv")
    expect(by_id(page, "reference-difference")).to_contain_text("bias -0.50 m")
    by_id(page, "reference-difference").scroll_into_view_if_needed()
    picture(page, "imports-narrow")
    assert service.get(path)["has_reference"] is True
    by_id(page, "reference-delete").click()
    by_id(page, "reference-delete-really").click()
    expect(pane).to_contain_text("The map is compared with nothing.")
    assert service.get(path)["has_reference"] is False

    by_id(page, "prior-delete").click()
    by_id(page, "prior-delete-really").click()
    expect(pane).to_contain_text("The mission begins with nothing.")
    assert service.get(f"{path}/imports") == []
