"""The page for whoever sits before it: language, looks, keys, the guided mission, profiles and pictures."""

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pypdfium2
import pytest
from PIL import Image
from playwright.sync_api import Browser, Page, expect

from tests.support.api.rest import soundings
from tests.support.dashboard.browser import PATIENCE_MS
from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, expect_state, need_axe, show, violations

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]

LINE = "41.18505, -8.70490; 41.18545, -8.70440"


@pytest.fixture(scope="module")
def surveyed(service: Service) -> str:
    """A mission with a map that nobody steers."""
    mission = service.create(name="Quay", vehicles=[{"name": "rover", "kind": "rest"}], cell_m=2)
    items = [
        {"vehicle": "rover", "time_s": 1.79e9 + i, "lat_deg": 41.18503 + 1e-5 * i, "lon_deg": -8.70495 + 1.4e-5 * i}
        | {"depth_m": 2.0, "range_m": 8.0 + 0.05 * i}
        for i in range(45)
    ]
    service.post(f"/missions/{mission}/measurements", {"items": items})
    service.get(f"/missions/{mission}/map")
    return mission


@pytest.fixture(scope="module")
def shared(browser: Browser, service: Service, surveyed: str) -> Iterator[Page]:
    """One page for several tests: to open one takes longer than most of what they do."""
    need_axe()
    # Colours that fade over would be judged half way.
    how: dict[str, Any] = {"locale": "pt-PT", "reduced_motion": "reduce", "viewport": {"width": 1280, "height": 800}}
    context = browser.new_context(base_url=service.url, **how)
    page = context.new_page()
    page.set_default_timeout(PATIENCE_MS)
    show(page, surveyed)
    yield page
    context.close()


def test_the_browsers_language_is_spoken_until_another_is_chosen(shared: Page) -> None:
    page = shared
    expect(page.locator("html")).to_have_attribute("lang", "pt")
    expect(by_id(page, "abort")).to_have_text("Abortar tudo")
    expect(by_id(page, "mission-state")).to_contain_text("Pronta a iniciar")
    expect(by_id(page, "depth-rover")).to_have_text("2,0 m")
    page.keyboard.press(",")
    expect(by_id(page, "settings-dialog")).to_contain_text("Definições")
    by_id(page, "language").select_option("en")
    expect(by_id(page, "abort")).to_have_text("Abort all")
    expect(by_id(page, "depth-rover")).to_have_text("2.0 m")
    by_id(page, "units").select_option("nautical")
    by_id(page, "theme").select_option("night")
    expect(page.locator("html")).to_have_attribute("data-theme", "night")
    assert violations(page) == []
    by_id(page, "settings-close").click()
    assert violations(page) == []
    page.reload()
    expect(by_id(page, "abort")).to_have_text("Abort all")
    expect(page.locator("html")).to_have_attribute("data-theme", "night")


def test_keys_do_what_their_sheet_says_and_nothing_while_one_types(shared: Page) -> None:
    page = shared
    page.keyboard.press("?")
    expect(by_id(page, "keys")).to_contain_text("Ask whether to abort all")
    assert violations(page) == []
    page.keyboard.press("Escape")
    expect(by_id(page, "keys-dialog")).not_to_be_visible()
    page.keyboard.press("l")
    by_id(page, "log-words").fill("")
    by_id(page, "log-words").press_sequentially("f?")
    expect(by_id(page, "log-words")).to_have_value("f?")
    expect(by_id(page, "keys-dialog")).not_to_be_visible()
    page.locator("body").press("Escape")
    by_id(page, "toggle-log").focus()
    page.keyboard.press("f")
    expect(by_id(page, "files")).to_be_visible()
    page.keyboard.press("f")
    expect(by_id(page, "files")).not_to_be_visible()
    page.keyboard.press("n")
    expect(by_id(page, "field-name")).to_be_visible()
    page.keyboard.press("?")
    by_id(page, "single-keys").uncheck()
    by_id(page, "keys-close").click()
    page.keyboard.press("l")
    expect(by_id(page, "log")).not_to_be_visible()
    by_id(page, "open-settings").click()
    by_id(page, "open-keys").click()
    by_id(page, "single-keys").check()
    by_id(page, "keys-close").click()


def test_a_survey_is_cut_along_a_line_and_given_as_a_table(shared: Page, service: Service, surveyed: str) -> None:
    page = shared
    again = service.create(name="Later", vehicles=[{"name": "rover-2", "kind": "rest"}], cell_m=2)
    item = {"vehicle": "rover-2", "time_s": 1.79e9, "lat_deg": 41.18525, "lon_deg": -8.70464, "depth_m": 2.0}
    items = [item | {"time_s": 1.79e9 + i, "lat_deg": 41.1852 + 1e-6 * i, "range_m": 12.0} for i in range(20)]
    service.post(f"/missions/{again}/measurements", {"items": items})
    show(page, surveyed)
    by_id(page, "toggle-profile").click()
    expect(by_id(page, "profile")).to_contain_text("Measure a line on the map")
    by_id(page, "profile-line").fill("nowhere")
    by_id(page, "profile-line").press("Enter")
    expect(by_id(page, "profile")).to_contain_text("Two or more places")
    by_id(page, "profile-line").fill(LINE)
    by_id(page, "profile-line").press("Enter")
    expect(by_id(page, "profile-chart")).to_be_visible()
    by_id(page, "profile-place").fill("20")
    expect(by_id(page, "profile-here")).to_contain_text("Quay: ")
    by_id(page, "profile-add").select_option(again)
    expect(by_id(page, "profile-difference")).to_contain_text("deeper than Quay on average")
    by_id(page, "profile-layer").select_option("slope")
    expect(by_id(page, "profile-layer-values")).to_contain_text("Quay: Slope")  # shown once it has come
    assert violations(page) == []
    with page.expect_download() as begun:
        by_id(page, "profile-csv").click()
    rows = Path(begun.value.path()).read_text(encoding="utf-8").splitlines()
    assert rows[0].startswith("mission,kind,along_m")
    assert rows[0].endswith(",slope")
    assert {row.split(",")[0] for row in rows[1:]} == {"Quay", "Later"}
    assert any(row.startswith("Quay,sounding,") for row in rows)
    page.keyboard.press("Escape")


def test_the_map_is_given_as_a_picture_and_a_page_like_the_screen(shared: Page, surveyed: str) -> None:
    page = shared
    show(page, surveyed)
    if not by_id(page, "files").is_visible():
        by_id(page, "toggle-files").click()
    with page.expect_download() as begun:
        by_id(page, "picture-png").click()
    assert begun.value.suggested_filename == "Quay-depth.png"
    picture = Image.open(Path(begun.value.path())).convert("RGB")
    assert picture.size in [(2246, 1588), (1588, 2246)]
    colours = picture.resize((400, round(400 * picture.height / picture.width))).getcolors(1 << 20)
    assert colours is not None
    assert len(colours) > 300
    with page.expect_download() as begun:
        by_id(page, "picture-pdf").click()
    document = pypdfium2.PdfDocument(Path(begun.value.path()))
    assert document.get_metadata_dict()["Title"] == "Quay"
    assert sorted(round(side) for side in document[0].get_size()) == [596, 842]
    drawn = document[0].render(scale=1).to_pil().convert("RGB")
    small = picture.resize(drawn.size)
    difference = sum(abs(a - b) for a, b in zip(drawn.tobytes(), small.tobytes(), strict=True)) / len(drawn.tobytes())
    assert difference < 6


def test_a_download_is_cancelled_without_a_complaint(shared: Page) -> None:
    page = shared
    page.route("**/map.xyz", lambda route: None)  # the service takes for ever
    by_id(page, "file-xyz").click()
    expect(by_id(page, "making")).to_be_visible()
    expect(by_id(page, "file-tif")).to_be_enabled()
    by_id(page, "stop-xyz").click()
    expect(by_id(page, "making")).not_to_be_visible()
    expect(by_id(page, "file-fault")).not_to_be_visible()
    page.unroute("**/map.xyz")


def test_a_printed_page_has_the_map_and_nothing_to_press(shared: Page) -> None:
    page = shared
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print")
    for shown in ("mission-name", "printed-map", "card-rover"):
        if page.get_by_test_id(shown).count():
            expect(by_id(page, shown).first).to_be_visible()
    for hidden in ("abort", "toggle-missions", "toggle-files", "measure", "map"):
        expect(by_id(page, hidden)).not_to_be_visible()
    page.emulate_media(media="screen")
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    expect(by_id(page, "printed-map")).to_have_count(0)
    expect(by_id(page, "map")).to_be_visible()
    sheets = pypdfium2.PdfDocument(io.BytesIO(page.pdf(print_background=True, prefer_css_page_size=True)))
    assert len(sheets) <= 2


@pytest.mark.parametrize("theme", ["dark", "night"])
def test_what_is_printed_is_on_white_paper_in_every_theme(page: Page, service: Service, theme: str) -> None:
    page.add_init_script(f"localStorage.setItem('bathyfleet.theme', '\"{theme}\"')")
    mission = service.create(name=f"Printed by {theme}", vehicles=[{"name": "rover", "kind": "rest"}])
    service.post(f"/missions/{mission}/measurements", {"items": soundings(20)})
    show(page, mission)
    by_id(page, "toggle-corrections").click()
    expect(by_id(page, "corrections-tide")).to_be_visible()
    sheets = pypdfium2.PdfDocument(io.BytesIO(page.pdf(prefer_css_page_size=True)))
    pictures = [np.asarray(sheets[i].render(scale=0.5).to_pil().convert("L")) for i in range(len(sheets))]
    assert all(np.median(picture) == 255 for picture in pictures)
    assert all((picture < 90).mean() < 0.1 for picture in pictures), "neither map nor text lies on dark ground"
    text = "".join(sheet.get_textpage().get_text_range() for sheet in sheets)
    assert "Water level" in text
    assert "Apply" not in text
    expect(page.locator("html")).to_have_attribute("data-theme", theme)
    expect(by_id(page, "printed-map")).to_have_count(0)


def test_the_first_mission_is_guided_by_what_is_really_done(page: Page, service: Service) -> None:
    page.goto("/#/")
    by_id(page, "begin-tour").click()
    tour = by_id(page, "tour")
    expect(tour).to_have_attribute("data-step", "checklist")
    expect(page.locator('[data-testid="start"].tour-mark')).to_be_visible()
    assert violations(page) == []
    by_id(page, "start").click()
    expect(tour).to_have_attribute("data-step", "start")
    expect(by_id(page, "preflight")).to_have_attribute("data-ready", "true")
    by_id(page, "confirm-start").click()
    expect_state(page, "running")
    expect(tour).to_have_attribute("data-step", "layer")
    by_id(page, "layer").select_option("uncertainty")
    expect(tour).to_have_attribute("data-step", "hold")
    by_id(page, "hold-sim-1").click()
    expect(tour).to_have_attribute("data-step", "resume")
    by_id(page, "resume-sim-1").click()
    expect(tour).to_have_attribute("data-step", "profile")
    by_id(page, "toggle-profile").click()
    by_id(page, "profile-line").fill(LINE)
    by_id(page, "profile-line").press("Enter")
    expect(tour).to_have_attribute("data-step", "finish")
    by_id(page, "end-tour").click()
    expect(tour).not_to_be_visible()
