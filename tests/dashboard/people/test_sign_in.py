import re
from collections.abc import Iterator

import httpx
import pytest
from playwright.sync_api import Page, Route, expect

from tests.support.dashboard.browser import Watched
from tests.support.dashboard.service import Service

pytestmark = [pytest.mark.browser, pytest.mark.timeout(400)]


@pytest.fixture(scope="module")
def service(built: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """A service of its own: once it has a token it asks everyone for one."""
    running = Service(tmp_path_factory.mktemp("guarded"))
    running.start()
    yield running
    running.kill()


@pytest.fixture(autouse=True)
def nothing_goes_on() -> None:
    """No vehicle is engaged here, and the service would ask for a token."""


@pytest.fixture(scope="module")
def tokens(service: Service) -> dict[str, str]:
    """A token of each role that matters here; the mission was there before, else nobody could make it."""
    mission = service.create(name="Guarded")
    return {"mission": mission} | {role: service.make_token(f"the {role}", role) for role in ("operator", "viewer")}


def sign_in(page: Page, token: str) -> None:
    page.get_by_test_id("token").fill(token)
    page.get_by_role("button", name="Sign in").click()


def kept_by_scripts(page: Page) -> str:
    """All that a script of the page can read at rest."""
    return str(
        page.evaluate("JSON.stringify([{ ...localStorage }, { ...sessionStorage }, document.cookie, location.href])")
    )


def test_a_wrong_token_is_tried_once_and_a_right_one_is_kept_out_of_reach(
    watched: Watched, service: Service, tokens: dict[str, str]
) -> None:
    page = watched.page
    page.clock.install()
    sockets: list[str] = []
    page.on("websocket", lambda socket: sockets.append(socket.url))
    page.goto(f"/#/missions/{tokens['mission']}")
    expect(page.get_by_test_id("sign-in")).to_be_visible()
    sign_in(page, "not-a-token")
    expect(page.get_by_test_id("sign-in-fault")).to_contain_text("unknown, revoked or has run out")
    asked = len(watched.addresses)
    page.clock.fast_forward(60_000)  # far longer than the page waits between two looks at its lists
    page.evaluate("new Promise(resolve => queueMicrotask(resolve))")
    assert watched.addresses[asked:] == []
    sign_in(page, tokens["operator"])
    expect(page.get_by_test_id("mission-name")).to_have_text("Guarded")
    expect(page.get_by_test_id("link")).to_have_attribute("data-status", "open")
    expect(page.get_by_test_id("start")).to_be_enabled()
    expect(page.get_by_test_id("account")).to_contain_text("the operator")
    page.reload()
    expect(page.get_by_test_id("link")).to_have_attribute("data-status", "open")
    assert sockets
    assert tokens["operator"] not in kept_by_scripts(page)
    assert not any(tokens["operator"] in address for address in [*watched.addresses, *sockets])


def test_a_token_that_an_earlier_page_kept_is_used_once_and_removed(page: Page, tokens: dict[str, str]) -> None:
    page.goto("/charts.json")
    page.evaluate("token => localStorage.setItem('bathyfleet.token', JSON.stringify(token))", tokens["viewer"])
    page.goto(f"/#/missions/{tokens['mission']}")
    expect(page.get_by_test_id("account")).to_contain_text("the viewer")
    assert tokens["viewer"] not in kept_by_scripts(page)
    page.reload()
    expect(page.get_by_test_id("account")).to_contain_text("the viewer")


def test_signing_in_is_asked_for_once_and_says_that_it_is_on_its_way(page: Page, tokens: dict[str, str]) -> None:
    page.goto(f"/#/missions/{tokens['mission']}")
    held: list[Route] = []
    token, send = page.get_by_test_id("token"), page.get_by_test_id("send-token")
    expect(send).to_be_disabled()
    token.fill(tokens["viewer"])
    page.route("**/session", lambda route: held.append(route) if route.request.method == "POST" else route.continue_())
    token.press("Enter")
    expect(send).to_have_text("Signing in…")
    expect(send).to_have_attribute("aria-disabled", "true")
    token.press("Enter")
    send.click(force=True)
    held[0].continue_()
    expect(page.get_by_test_id("account")).to_contain_text("viewer")
    assert len(held) == 1


def test_a_viewer_sees_what_he_may_not_do_and_signs_out(page: Page, tokens: dict[str, str]) -> None:
    page.goto(f"/#/missions/{tokens['mission']}")
    sign_in(page, tokens["viewer"])
    expect(page.get_by_test_id("account")).to_contain_text("viewer: looks only")
    for command in ("start", "abort", "new-mission", "copy-mission", "delete-mission"):
        expect(page.get_by_test_id(command)).to_be_disabled()
        expect(page.get_by_test_id(command)).to_have_attribute("title", re.compile("role viewer, which may look only"))
    page.get_by_test_id("account").click()
    page.get_by_test_id("sign-out").click()
    expect(page.get_by_test_id("sign-in")).to_be_visible()
    page.reload()
    expect(page.get_by_test_id("sign-in")).to_be_visible()


def test_enter_sends_no_length_where_its_button_may_not_be_pressed(
    watched: Watched, service: Service, tokens: dict[str, str]
) -> None:
    operator = {"Authorization": f"Bearer {tokens['operator']}"}
    spec = httpx.get(f"{service.url}/api/v1/missions/{tokens['mission']}", headers=operator, timeout=60).json()["spec"]
    made = httpx.post(f"{service.url}/api/v1/missions", headers=operator, json=spec, timeout=60).raise_for_status()
    path = f"{service.url}/api/v1/missions/{made.json()['id']}"
    httpx.post(f"{path}/start", headers=operator, timeout=60).raise_for_status()
    page = watched.page
    page.goto(f"/#/missions/{made.json()['id']}")
    sign_in(page, tokens["viewer"])
    # The dialog as it stays open for somebody whose role was taken away.
    expect(page.get_by_test_id("change-length")).to_be_disabled()
    page.get_by_test_id("change-length").evaluate("button => { button.disabled = false; button.click(); }")
    expect(page.get_by_test_id("set-length")).to_be_disabled()
    page.get_by_test_id("length-value").fill("7")
    page.get_by_test_id("length-value").press("Enter")
    expect(page.get_by_test_id("length-dialog")).to_be_visible()
    expect(page.get_by_test_id("length-dialog").get_by_role("alert")).to_have_count(0)
    assert not any(address.endswith("/budget") for address in watched.addresses)
    httpx.post(f"{path}/abort", headers=operator, timeout=60).raise_for_status()


def test_a_watch_keeper_sees_what_another_commands(page: Page, service: Service, tokens: dict[str, str]) -> None:
    page.goto(f"/#/missions/{tokens['mission']}")
    sign_in(page, tokens["viewer"])
    expect(page.get_by_test_id("link")).to_have_attribute("data-status", "open")
    path = f"{service.url}/api/v1/missions/{tokens['mission']}"
    operator = {"Authorization": f"Bearer {tokens['operator']}"}
    for action, words in (
        ("start", "the operator set the mission running"),
        ("abort", "the operator aborted the mission"),
    ):
        httpx.post(f"{path}/{action}", headers=operator, timeout=60).raise_for_status()
        expect(page.get_by_test_id("others")).to_have_text(words)
        expect(page.get_by_test_id("heard")).to_have_text(words)


def test_who_may_only_look_sees_what_was_imported_and_nothing_that_imports(
    watched: Watched, tokens: dict[str, str]
) -> None:
    page = watched.page
    page.goto(f"/#/missions/{tokens['mission']}")
    sign_in(page, tokens["viewer"])
    page.get_by_test_id("toggle-imports").click()
    pane = page.get_by_test_id("imports")
    for words in ("No log was imported yet.", "The mission begins with nothing.", "The map is compared with nothing."):
        expect(pane).to_contain_text(words)
    expect(pane.locator("input, button")).to_have_count(0)
