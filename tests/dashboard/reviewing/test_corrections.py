"""Tide and sound speed are corrected when all was measured, in Chromium."""

import re
from pathlib import Path

import pytest
from playwright.sync_api import FilePayload, Route, expect

from tests.support.dashboard.browser import Watched
from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, picture, show, violations
from tests.support.imc import log_writer
from tests.support.mapping.calibration import REAL, calibration
from tests.support.mapping.tracks import flown, lawnmower, measured
from tests.support.missions.specs import LAT, LON, rectangle

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


def test_a_mounting_is_corrected_after_the_patch_test_and_taken_back(
    watched: Watched, service: Service, surveyed: str
) -> None:
    page, corrections = watched.page, f"/missions/{surveyed}/corrections"
    show(page, surveyed)
    by_id(page, "toggle-corrections").click()
    one = by_id(page, "mounting-rover")
    expect(one).to_contain_text("along the vehicle")
    one.locator("summary").click()
    by_id(page, "mounting-roll_deg").fill("-1,5")
    by_id(page, "mounting-down").fill("0.25")
    by_id(page, "mounting-source").fill("patch test")
    picture(page, "mounting")
    by_id(page, "mounting-set").click()
    expect(one).to_contain_text("roll -1.5°, 0 m forward, 0 m to starboard, 0.25 m down (patch test)")
    (told,) = service.get(corrections)["mountings"]
    assert (told["corrected"]["roll_deg"], told["corrected"]["offset_m"]) == (-1.5, [0.0, 0.0, 0.25])
    # Figures that a vehicle has not renewed for a while are pale.
    assert [one for one in violations(page) if "depth-rover" not in one] == []
    one.locator("summary").click()
    by_id(page, "mounting-remove").click()
    expect(one).not_to_contain_text("patch test")
    expect(one).to_contain_text("along the vehicle")
    assert service.get(corrections)["mountings"][0]["corrected"] is None


def test_a_mounting_is_estimated_from_lines_that_overlap_taken_over_and_applied(
    watched: Watched, service: Service
) -> None:
    page = watched.page
    vehicle = {"name": "rover", "kind": "rest", "sensor": "multibeam", "mounting": {"offset_m": REAL["offset_m"]}}
    mission = service.create(name="Patch test", area=rectangle(0, 0, 60, 60), cell_m=2, vehicles=[vehicle])
    items = calibration("rover", START_S)
    for start in range(0, len(items), 200):
        service.post(f"/missions/{mission}/measurements", {"items": items[start : start + 200]})
    show(page, mission)
    by_id(page, "toggle-corrections").click()
    by_id(page, "mounting-rover").locator("summary").click()
    by_id(page, "mounting-estimate").click()
    told = by_id(page, "mounting-estimated")
    expect(told).to_contain_text("6 lines", timeout=60_000)
    expect(by_id(page, "estimated-roll_deg")).to_have_text(re.compile(r"estimated 1\.\d\d ± 0\.\d\d"))
    expect(by_id(page, "estimated-latency_s")).to_have_count(0)
    expect(by_id(page, "unknown-latency_s")).to_contain_text("slowly and fast")
    expect(by_id(page, "mounting-roll_deg")).to_have_value("0")
    picture(page, "patch-test")
    by_id(page, "mounting-take").click()
    expect(by_id(page, "mounting-roll_deg")).to_have_value(re.compile(r"1\.[12]\d*"))
    expect(by_id(page, "mounting-forward")).to_have_value("1.5")
    expect(by_id(page, "mounting-source")).to_have_value("patch test of 6 lines")
    assert service.get(f"/missions/{mission}/corrections")["mountings"][0]["corrected"] is None, "it is not applied yet"
    assert [one for one in violations(page) if "-rover" not in one] == []
    page.set_viewport_size({"width": 390, "height": 844})
    by_id(page, "toggle-missions").click()
    by_id(page, "mounting-estimated").scroll_into_view_if_needed()
    picture(page, "patch-test-narrow")
    by_id(page, "mounting-set").click()
    expect(by_id(page, "mounting-rover")).to_contain_text("(patch test of 6 lines)")
    assert abs(service.get(f"/missions/{mission}/corrections")["mountings"][0]["corrected"]["pitch_deg"] + 2.5) < 0.5


def test_what_an_estimate_cannot_be_made_of_is_told(watched: Watched, service: Service, surveyed: str) -> None:
    page = watched.page
    show(page, surveyed)
    by_id(page, "toggle-corrections").click()
    by_id(page, "mounting-rover").locator("summary").click()
    by_id(page, "mounting-estimate").click()
    expect(by_id(page, "corrections").get_by_role("alert")).to_contain_text("has no pings of a swath sonar")


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


def test_a_cast_that_a_vehicle_measured_is_filled_in_and_added(
    watched: Watched, service: Service, surveyed: str, tmp_path: Path
) -> None:
    page = watched.page
    show(page, surveyed)
    by_id(page, "toggle-corrections").click()
    expect(by_id(page, "casts")).to_be_visible()
    expect(by_id(page, "measured-cast")).to_have_count(0)
    log = log_writer.write(tmp_path / "Dive.lsf", [*log_writer.survey(5), *log_writer.dive(START_S + 600, 12.0, 400)])
    service.send_log(surveyed, log, "rover")
    measured_ = by_id(page, "measured-cast")
    expect(measured_).to_have_count(1)
    expect(measured_).to_contain_text("rover")
    expect(measured_).to_contain_text("down to 1")
    expect(measured_).to_contain_text("speeds, ± 0.")
    measured_.get_by_role("button", name="Fill in").click()
    expect(by_id(page, "cast-text")).to_have_value(re.compile(r"^0\.\d+ 1511\.\d+\n"))
    by_id(page, "cast-add").click()
    expect(by_id(page, "cast")).to_have_count(1)
    expect(by_id(page, "cast")).to_contain_text("rover 20")
    picture(page, "casts-of-vehicles")
    told = service.get(f"/missions/{surveyed}/corrections")["sound_speed"]
    assert (told["source"], len(told["profile"]) > 15) == ("Dive.lsf", True)
    assert [one for one in violations(page) if "-rover" not in one] == []


def test_a_cast_that_a_vehicle_sent_is_shown_as_a_profile_and_added(
    watched: Watched, service: Service, surveyed: str
) -> None:
    page = watched.page
    dive = [
        {
            "vehicle": "rover",
            "time_s": START_S + 900.0 + second,
            "lat_deg": LAT,
            "lon_deg": LON,
            "depth_m": 15.0 * (1.0 - abs(2.0 * second / 400 - 1.0)),
        }
        for second in range(400)
    ]
    for item in dive:
        depth_m = float(str(item["depth_m"]))
        item["sound_speed_mps"] = 1520.0 - 0.3 * depth_m - (15.0 if depth_m > 6.0 else 0.0)
    service.post(f"/missions/{surveyed}/measurements", {"items": dive})
    show(page, surveyed)
    by_id(page, "toggle-corrections").click()
    sent = by_id(page, "measured-cast")
    expect(sent).to_contain_text("sent by the vehicle")
    sent.locator("summary").click()
    expect(by_id(page, "cast-chart")).to_be_visible()
    by_id(page, "cast-chart").scroll_into_view_if_needed()
    picture(page, "cast-sent")
    assert [one for one in violations(page) if "-rover" not in one] == []
    page.set_viewport_size({"width": 390, "height": 844})
    by_id(page, "toggle-missions").click()
    by_id(page, "cast-chart").scroll_into_view_if_needed()
    picture(page, "cast-sent-narrow")
    sent.get_by_role("button", name="Fill in").click()
    assert service.get(f"/missions/{surveyed}/corrections")["sound_speed"] is None, "it is not applied yet"
    expect(by_id(page, "cast-time")).to_have_value(re.compile(r"^2026-11-21 0\d:\d\d"))
    sent.get_by_role("button", name="Add").click()
    expect(by_id(page, "cast")).to_have_count(1)
    expect(sent.get_by_role("button", name="Add")).to_have_count(0)
    told = service.get(f"/missions/{surveyed}/corrections")["sound_speed"]
    assert (told["source"], told["assumed_mps"]) == ("rover rest", 1500.0)


def test_casts_are_added_from_files_changed_and_removed(watched: Watched, service: Service, surveyed: str) -> None:
    page, corrections = watched.page, f"/missions/{surveyed}/corrections"
    show(page, surveyed)
    by_id(page, "toggle-corrections").click()
    sound, listed, pane = by_id(page, "corrections-sound-speed"), by_id(page, "cast"), by_id(page, "corrections")
    by_id(page, "corrections-assumed").fill("1490")
    morning = "( SoundVelocity 1.0 0 20261120210030 41.1853 -8.7042 -1 0 0 SVP P 0002 )\n0 1510\n30 1506\n"
    by_id(page, "cast-file").set_input_files(files=[text_file("morning.asvp", morning)])
    for field, value in (
        ("name", "morning.asvp"),
        ("time", "2026-11-20 21:00:30"),
        ("lat", "41.1853"),
        ("lon", "-8.7042"),
    ):
        expect(by_id(page, f"cast-{field}")).to_have_value(value)
    by_id(page, "cast-add").click()
    expect(listed).to_have_count(1)
    expect(listed).to_contain_text(
        "morning.asvp 20 Nov 2026, 21:00 UTC · 41.1853° N 8.7042° W · down to 30.0 m · corrects"
    )
    expect(by_id(page, "casts-far")).to_contain_text("are more than 4 h from their cast")
    told = service.get(corrections)["sound_speed"]
    assert (told["assumed_mps"], told["time"], told["position"]) == (1490.0, "2026-11-20T21:00:30Z", [-8.7042, 41.1853])
    assert told["source"] == "morning.asvp"
    listed.nth(0).get_by_role("button", name="Change…").click()
    expect(by_id(page, "cast-time")).to_have_value("2026-11-20 21:00:30")
    by_id(page, "cast-file").set_input_files(files=[text_file("again.asvp", morning)])
    by_id(page, "cast-name").fill("morning.asvp")
    with page.expect_response(lambda answer: answer.request.method == "POST"):
        by_id(page, "cast-add").click()
    assert service.get(corrections)["sound_speed"]["source"] == "again.asvp", "the file that it was read from last"

    by_id(page, "cast-name").fill("noon")
    by_id(page, "cast-time").fill("soon")
    by_id(page, "cast-text").fill("0 1512\n30 1507")
    by_id(page, "cast-add").click()
    expect(pane.get_by_role("alert")).to_have_text("Type the time as 2026-11-30 11:00, UTC.")
    by_id(page, "cast-time").fill("2026-11-21 02:00")
    by_id(page, "cast-add").click()
    expect(listed).to_have_count(2)
    expect(sound).to_have_text("2 casts, nearest in time; 1490 m/s is set in the sonars")
    count = service.get(corrections)["accepted"]
    expect(listed.nth(0)).to_contain_text("corrects 0 soundings, 0 pings")
    expect(listed.nth(1)).to_contain_text(f"corrects {count} soundings, 0 pings · at most 0.")
    expect(by_id(page, "casts-far")).to_have_count(0)
    picture(page, "casts")

    by_id(page, "casts-rule").select_option("nearest_in_distance_within_time")
    by_id(page, "casts-hours").fill("2,5")
    by_id(page, "casts-set-rule").click()
    expect(sound).to_contain_text("2 casts, nearest in distance within a time")
    told = service.get(corrections)["sound_speed"]
    assert (told["rule"], told["within_h"]) == ("nearest_in_distance_within_time", 2.5)

    listed.nth(1).get_by_role("button", name="Change…").click()
    expect(by_id(page, "cast-text")).to_have_value("0 1512\n30 1507")
    by_id(page, "cast-text").fill("0 1600\n30 1598")
    by_id(page, "cast-add").click()
    expect(by_id(page, "casts-differ")).to_have_count(1)
    expect(by_id(page, "casts-differ")).to_contain_text("From morning.asvp to noon")
    assert [one["profile"][0][1] for one in service.get(corrections)["sound_speed"]["further"]] == [1600.0]

    picture(page, "casts-that-differ")
    # Figures that a vehicle has not renewed for a while are pale.
    assert [one for one in violations(page) if "-rover" not in one] == []
    listed.nth(0).get_by_role("button", name="Remove").click()
    expect(listed).to_have_count(1)
    assert service.get(corrections)["sound_speed"]["name"] == "noon"


def test_casts_of_a_file_leave_those_that_another_operator_adds_in_that_second(
    watched: Watched, service: Service, surveyed: str
) -> None:
    page, casts = watched.page, f"/missions/{surveyed}/sound-speed/casts"
    show(page, surveyed)
    by_id(page, "toggle-corrections").click()
    listed, pane = by_id(page, "cast"), by_id(page, "corrections")

    def other(name: str, hour: int) -> None:
        one = {"name": name, "profile": [[0, 1500 + hour]], "time": f"2026-11-21T{hour:02d}:30:00Z"}
        service.post(casts, {"casts": [one]})

    # What others add is shown without being asked for.
    other("theirs before", 0)
    expect(listed).to_have_count(1)
    expect(listed).to_contain_text("theirs before")

    def late(route: Route) -> None:
        if route.request.method == "POST":
            other("theirs meanwhile", 1)
        route.continue_()

    page.route("**/sound-speed/**", late)
    sections = "".join(
        f"Section 2026-325 {hour:02d}:00:00 41:11:06N -8:42:15\n0 15{hour}0\n30 1506\n" for hour in (2, 3)
    )
    by_id(page, "cast-file").set_input_files(files=[text_file("day.svp", f"[SVP_VERSION_2]\nday.svp\n{sections}")])
    expect(by_id(page, "cast-name")).to_have_value("day.svp")
    with page.expect_response(lambda answer: answer.request.method == "POST") as sent:
        by_id(page, "cast-add").click()
    assert sent.value.ok, sent.value.text()
    expect(listed).to_have_count(4)
    names = ["theirs before", "theirs meanwhile", "day.svp 1", "day.svp 2"]
    for item, name in zip(listed.all(), names, strict=True):
        expect(item).to_contain_text(name)
    expect(pane.get_by_role("alert")).to_have_count(0)
    assert [one["name"] for one in service.get(casts)["casts"]] == names
