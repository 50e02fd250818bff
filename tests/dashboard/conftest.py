from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, ConsoleMessage, Page, Request, expect, sync_playwright

from app.dashboard.serve import STATIC

from .service import Service

CHROMIUM = Path("/usr/bin/chromium")
# WebGL by SwiftShader, the page itself put together by the processor: three times quicker than all by SwiftShader.
FLAGS = ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader", "--disable-background-networking"]
PATIENCE_MS = 90_000
"""Only how long a missing thing is waited for: the first map waits for numba to compile."""


@pytest.fixture(scope="session")
def built() -> None:
    """There is a dashboard to drive."""
    if not (STATIC / "index.html").is_file():
        pytest.skip("the dashboard is not built: 'pip install -e .' builds it")


# One service for all files that a process runs: its start and the compiling of its first map are most of their time.
@pytest.fixture(scope="session")
def service(built: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    running = Service(tmp_path_factory.mktemp("service"))
    running.start()
    yield running
    running.kill()


# One browser per module, not per session: Playwright's own event loop would be in the way of asynchronous tests.
@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    if not CHROMIUM.is_file():
        pytest.skip(f"{CHROMIUM} is missing: apt-get install chromium")
    expect.set_options(timeout=PATIENCE_MS)
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield chromium
        chromium.close()


@pytest.fixture(autouse=True)
def nothing_goes_on(request: pytest.FixtureRequest) -> Iterator[None]:
    """Vehicles are free for the next test, and nobody steers for nothing."""
    yield
    if "service" not in request.fixturenames:
        return
    service: Service = request.getfixturevalue("service")
    for mission in service.get("/missions"):
        if mission["state"] in ("running", "paused"):
            service.act(mission["id"], "abort")


class Watched:
    """A page together with what it complained about and whom it asked."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.complaints: list[str] = []
        self.addresses: list[str] = []
        page.on("console", self._note)
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("request", self._ask)

    def _note(self, message: ConsoleMessage) -> None:
        # What the driver says of software rendering is no fault of the page.
        if message.type in ("error", "warning") and "GL Driver Message" not in message.text:
            self.complaints.append(message.text)

    def _ask(self, request: Request) -> None:
        self.addresses.append(request.url)


@pytest.fixture
def watched(browser: Browser, service: Service) -> Iterator[Watched]:
    context = browser.new_context(viewport={"width": 1440, "height": 900}, base_url=service.url)
    page = context.new_page()
    page.set_default_timeout(PATIENCE_MS)
    yield Watched(page)
    context.close()


@pytest.fixture
def page(watched: Watched) -> Page:
    return watched.page
