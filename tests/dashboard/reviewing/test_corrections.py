"""Tide and sound speed are corrected when all was measured, in Chromium."""

import re

import pytest
from playwright.sync_api import FilePayload, expect

from tests.support.dashboard.browser import Watched
from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, picture, show
from tests.support.mapping.tracks import flown, lawnmower, measured
from tests.support.missions.specs import rectangle

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]

START_S = 1_795_225_140.0
"""2026-11-21 01:59 UTC."""


@pytest.fixture
def surveyed(service: Service) -> str:
    mission = service.create(
        name="Before the tide came",
        area=rectangle(0, 0, 60, 60),
        cell_m=4,
        vehicles=[{"name": "rover", "kind": "rest"}],
    )
    main = [(east + 4, north + 2) for east, north in lawnmower(52, 56, 13)]
    items = measured("rover", flown(main, spacing_m=2.0, start_s=START_S))
    service.post(f"/missions/{mission}/measurements", {"items": items})
    return mission


def text_file(name: str, text: str) -> FilePayload:
    return {"name": name, "mimeType": "text/plain", "buffer": text.encode()}


def test_levels_tables_and_profiles_correct_what_was_measured(
    watched: Watched, service: Service, surveyed: str
) -> None:
    page, corrections = watched.page, f"/missions/{surveyed}/corrections"
    show(page, surveyed)
    by_id(page, "toggle-corrections").click()
    tide, sound = by_id(page, "corrections-tide"), by_id(page, "corrections-sound-speed")
    expect(sound).to_contain_text("Not corrected")

    expect(by_id(page, "corrections-tide-source")).to_have_value("")
    by_id(page, "corrections-level").fill("0.5")
    by_id(page, "corrections-set-level").click()
    expect(tide).to_have_text("0.5 m (stated by the operator)")

    by_id(page, "corrections-level").fill("1,25")
    by_id(page, "corrections-tide-sd").fill("0.1")
    by_id(page, "corrections-tide-source").fill("harbour gauge")
    by_id(page, "corrections-set-level").click()
    expect(tide).to_have_text("1.25 m (harbour gauge)")
    told = service.get(corrections)["tide"]
    assert (told["level_m"], told["sd_m"], told["source"]) == (1.25, 0.1, "harbour gauge")

    table = "2026-11-21T00:00:00Z 0.4\n2026-11-21T06:10:00Z 3.1\n2026-11-21T12:20:00Z 0.5\n"
    by_id(page, "corrections-tide-file").set_input_files(files=[text_file("leixoes.tid", table)])
    expect(tide).to_contain_text("Tide table leixoes.tid: 3 entries")
    assert service.get(corrections)["tide"]["sd_m"] == 0.1, "the deviation stays"
    assert service.get(corrections)["rejected"] == 0

    by_id(page, "corrections-profile-file").set_input_files(
        files=[text_file("cast.asvp", "( SoundVelocity 1.0 )\n0 1530\n5 1528\n30 1526\n")]
    )
    expect(sound).to_contain_text(re.compile(r"Profile of 3 depths, 0 – 30 m: 1\s?526 – 1\s?530 m/s \(cast.asvp\)"))
    picture(page, "corrections")
    assert service.get(corrections)["sound_speed"]["profile"] == [[0.0, 1530.0], [5.0, 1528.0], [30.0, 1526.0]]
    by_id(page, "corrections-remove-speed").click()
    expect(sound).to_contain_text("Not corrected")
    assert service.get(corrections)["sound_speed"] is None


def test_what_cannot_be_taken_is_told_and_changes_nothing(watched: Watched, service: Service, surveyed: str) -> None:
    page, corrections = watched.page, f"/missions/{surveyed}/corrections"
    before = service.get(corrections)
    show(page, surveyed)
    by_id(page, "toggle-corrections").click()
    pane = by_id(page, "corrections")
    by_id(page, "corrections-level").fill("high")
    by_id(page, "corrections-set-level").click()
    expect(pane.get_by_role("alert")).to_have_text("Type a number into each field.")
    by_id(page, "corrections-profile-file").set_input_files(files=[text_file("notes.txt", "nothing here")])
    expect(pane.get_by_role("alert")).to_have_text("No line of the file begins with a depth and a speed.")
    by_id(page, "corrections-tide-file").set_input_files(files=[text_file("notes.txt", "nothing here")])
    expect(pane.get_by_role("alert")).to_contain_text("table")
    by_id(page, "corrections-speed").fill("20")
    by_id(page, "corrections-set-speed").click()
    expect(pane.get_by_role("alert")).to_contain_text("profile")
    assert service.get(corrections) == before
