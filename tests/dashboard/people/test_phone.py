"""On a phone, in either language, nothing in dialogs, form and panes reaches beyond the window or is hard to press."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Locator, Page, expect

from tests.support.api.rest import mission_spec, soundings
from tests.support.dashboard.browser import PATIENCE_MS
from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, picture, show
from tests.support.missions.specs import rectangle

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]

PANES = ("charts", "soundings", "corrections", "imports", "files", "profile", "compare", "log")
LOW_PX = 39.5

FAULTS = """(root, low) => {
    const name = (part) => part.dataset.testid ?? `${part.localName}.${part.className}`;
    const faults = root.scrollWidth > root.clientWidth + 1 ? [`${name(root)} scrolls sideways`] : [];
    for (const part of root.querySelectorAll("*")) {
        const { width, height, right } = part.getBoundingClientRect();
        if (width < 2 || height < 2 || part.closest(".visually-hidden, .strip, canvas, svg")) continue;
        if (right > innerWidth + 1) faults.push(`${name(part)} ends at ${right}`);
        if (part.scrollWidth > part.clientWidth + 1 && getComputedStyle(part).overflowX === "auto")
            faults.push(`${name(part)} scrolls sideways`);
        const pressed = "button:not(.log-line), select, summary, .command.file, .check, .preset, .dialog a";
        const typed = "input:not([type=checkbox], [type=radio], [type=file], [type=range])";
        if (part.matches(`${pressed}, ${typed}`) && height < low) faults.push(`${name(part)} is ${height} px high`);
    }
    return faults;
}"""


LOW = """(parts, low) => parts
    .map((part) => [part.dataset.testid ?? part.textContent, part.getBoundingClientRect().height])
    .filter(([, height]) => height > 1 && height < low)"""
"""Cards lie in a row that scrolls sideways: how high what is pressed in them is, alone."""


@pytest.fixture(params=["en", "pt"])
def phone(request: pytest.FixtureRequest, browser: Browser, service: Service) -> Iterator[Page]:
    language = str(request.param)
    context = browser.new_context(
        viewport={"width": 390, "height": 844}, base_url=service.url, locale={"en": "en-GB", "pt": "pt-PT"}[language]
    )
    page = context.new_page()
    page.set_default_timeout(PATIENCE_MS)
    yield page
    context.close()


def expect_fits(page: Page, part: Locator, name: str) -> None:
    expect(part).to_be_visible()
    picture(page, f"phone-{page.evaluate('document.documentElement.lang')}-{name}")
    assert part.evaluate(FAULTS, LOW_PX) == [], name


def expect_dialog_fits(page: Page, opener: str, name: str) -> None:
    by_id(page, opener).dispatch_event("click")
    expect_fits(page, page.locator("dialog[open]"), name)
    page.keyboard.press("Escape")
    expect(page.locator("dialog[open]")).to_have_count(0)


def test_dialogs_before_the_start_fit(phone: Page, service: Service) -> None:
    area = rectangle(0, 0, 50, 50)
    site = service.post("/sites", {"name": "Outer basin behind the northern mole", "area": area, "cell_m": 2.0})["id"]
    for day in (1, 2):
        survey = mission_spec(name=f"Survey of the outer basin, day {day}", area=area, site=site)
        mission = service.post("/missions", survey)["id"]
        items = soundings(60, start_s=1.6e9 + 86_400 * day)
        service.post(f"/missions/{mission}/measurements", {"items": items})
        service.act(mission, "abort")
        assert service.get(f"/sites/{site}/surveys")[day - 1]["surveyed"]
    show(phone, service.create(name="A long name for a mission on a phone, with twins", vehicles=[]))
    for opener, name in (("open-settings", "settings"), ("account", "account"), ("open-links", "links")):
        expect_dialog_fits(phone, opener, name)
    phone.keyboard.press("?")
    expect_fits(phone, phone.locator("dialog[open]"), "keys")
    phone.keyboard.press("Escape")
    by_id(phone, "toggle-missions").click()
    expect_dialog_fits(phone, "open-fleet", "fleet")
    by_id(phone, "open-sites").click()
    if by_id(phone, "shown-site").count():
        by_id(phone, "shown-site").select_option(site)
    expect(by_id(phone, "changes-picture")).to_be_visible()
    by_id(phone, "sites-dialog").locator("summary").click()
    expect_fits(phone, phone.locator("dialog[open]"), "sites")
    phone.keyboard.press("Escape")


def test_the_form_fits(phone: Page, service: Service) -> None:
    show(phone, service.create(name="Described on a phone"))
    by_id(phone, "toggle-missions").click()
    by_id(phone, "copy-mission").click()
    form = by_id(phone, "mission-form")
    for kind in ("survey", "search"):
        by_id(phone, f"kind-{kind}").check()
        form.locator("details").evaluate_all("all => all.forEach(one => { one.open = true; })")
        expect_fits(phone, form, f"form-{kind}")


def test_dialogs_of_a_mission_under_way_and_panes_fit(phone: Page, service: Service) -> None:
    vehicles = [{"name": f"phone-{n}", "kind": "sim", "sensor": "dvl"} for n in (1, 2)]
    mission = service.create(name="Under way on a phone", vehicles=vehicles)
    show(phone, mission)
    by_id(phone, "start").click()
    expect(by_id(phone, "preflight")).to_have_attribute("data-ready", "true")
    expect_fits(phone, phone.locator("dialog[open]"), "checklist")
    by_id(phone, "confirm-start").click()
    expect(by_id(phone, "mission-state")).to_have_attribute("data-state", "running")
    for opener, name in (("change-length", "length"), ("finish", "finish"), ("abort", "abort")):
        expect_dialog_fits(phone, opener, name)
    for vehicle in vehicles:
        by_id(phone, f"hold-{vehicle['name']}").dispatch_event("click")
    by_id(phone, "attention-more").click()
    expect_fits(phone, by_id(phone, "attention"), "attention")
    casts = [{"name": f"cast at the pier {n}.asvp", "profile": [[0, 1500 + 60 * n]]} for n in (0, 1)]
    timed = [cast | {"time": f"2026-11-2{n}T01:00:00Z"} for n, cast in enumerate(casts)]
    service.post(f"/missions/{mission}/sound-speed/casts", {"casts": timed})
    for part, name in ((".legend", "legend"), (".map-tools", "map-tools")):
        expect_fits(phone, phone.locator(part), name)
    low = phone.locator(".cards-column :is(button, select, summary)").evaluate_all(LOW, LOW_PX)
    assert low == []
    for pane in PANES:
        by_id(phone, f"toggle-{pane}").dispatch_event("click")
        expect_fits(phone, phone.locator(".bottom .log"), pane)
        by_id(phone, f"toggle-{pane}").dispatch_event("click")
